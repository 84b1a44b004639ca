//! The log of an emulated board, as text.

use std::path::Path;

use crate::error::{Error, Result};

/// Decodes the frames that an image has logged, with the texts that its ELF file holds: a line for each, which begins with the
/// control period in which it was logged.
///
/// Fails if the image was built without a log, or this program without the decoder.
#[cfg(feature = "log")]
pub fn decode(image: &Path, frames: &[u8]) -> Result<String> {
    use defmt_decoder::{DecodeError, Table};
    use std::fmt::Write;

    let bytes = std::fs::read(image).map_err(|reason| Error::Unreadable {
        path: image.to_owned(),
        reason,
    })?;
    let unusable = |what: String| {
        Error::Usage(format!(
            "{}: {what}; build it with --features log, or leave --image out",
            image.display()
        ))
    };
    let table = Table::parse(&bytes).map_err(|e| unusable(e.to_string()))?;
    let table = table.ok_or_else(|| unusable("has no log".to_owned()))?;
    let mut decoder = table.new_stream_decoder();
    decoder.received(frames);
    let mut text = String::new();
    loop {
        match decoder.decode() {
            Ok(frame) => {
                let period = frame.display_timestamp().map(|t| t.to_string());
                let level = frame.level().map_or("", |level| level.as_str());
                // Writing to a string does not fail.
                let _ = writeln!(
                    text,
                    "{} {level} {}",
                    period.unwrap_or_default(),
                    frame.display_message()
                );
            }
            Err(DecodeError::UnexpectedEof) => return Ok(text),
            // The emulator itself may have written there.
            Err(DecodeError::Malformed) => text.push_str("(not a line of the log)\n"),
        }
    }
}

/// Says that this program cannot.
#[cfg(not(feature = "log"))]
pub fn decode(_: &Path, _: &[u8]) -> Result<String> {
    Err(Error::Usage(
        "this program was built without the decoder that --log needs; build it with `cargo build --release --features log`, or leave --log out"
            .to_owned(),
    ))
}
