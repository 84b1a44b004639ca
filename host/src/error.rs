//! What can go wrong, in the words that the user reads.

use std::path::{Path, PathBuf};

/// A failure with one clear message: what is wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file cannot be opened or read.
    #[error("{path}: cannot be read: {reason}; check the name, and that it is a file you may read")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        reason: std::io::Error,
    },
    /// A file cannot be written; a file of that name, if any, is as it was.
    #[error("{path}: cannot be written: {reason}; choose another place with the same option")]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        reason: std::io::Error,
    },
    /// A recording is unusable at one place.
    #[error("{path}, line {line}, column {column}: {what}")]
    Cell {
        /// The recording.
        path: PathBuf,
        /// Line in the file, the header being line 1.
        line: usize,
        /// Name of the column as the file has it.
        column: String,
        /// What is wrong there and what to do.
        what: String,
    },
    /// A recording is unusable as a whole.
    #[error("{path}: {what}")]
    Recording {
        /// The recording.
        path: PathBuf,
        /// What is wrong and what to do.
        what: String,
    },
    /// A model file is unusable.
    #[error("{path}: {what}")]
    Model {
        /// The model file.
        path: PathBuf,
        /// What is wrong, under which key, and what to do.
        what: String,
    },
    /// The command line asks for something impossible.
    #[error("{0}")]
    Usage(String),
    /// The recording and the model are each in order, but the fit cannot be made.
    #[error("{0}")]
    NotIdentifiable(String),
    /// The emulator or the firmware in it failed.
    #[error("the emulated board failed: {0}; please report this with the command")]
    Emulator(String),
    /// A board at the other end of the link did not do what it should.
    #[error("the board: {0}")]
    Board(String),
    /// A defect of Bristle itself.
    #[error("internal failure: {0}; please report this with the recording and the model file")]
    Internal(String),
}

impl Error {
    /// What does not suit a model, with the name of its file in front; what is wrong with an option names the option.
    #[must_use]
    pub fn in_model(self, path: &Path) -> Self {
        match self {
            Self::Usage(what) if !what.starts_with("--") => Self::Model {
                path: path.to_owned(),
                what,
            },
            other => other,
        }
    }

    /// The process exit status: 2 for unusable input or arguments, 1 for an internal failure.
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Internal(_) | Self::Emulator(_) | Self::Board(_) => 1,
            _ => 2,
        }
    }
}

/// Result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Refuses options that are given and are not positive numbers.
pub fn positive(options: &[(&str, Option<f64>)]) -> Result<()> {
    let bad = |(name, value): &(&str, Option<f64>)| {
        let value = value.filter(|x| !(*x > 0.0 && x.is_finite()))?;
        Some(Error::Usage(format!(
            "{name} {value} must be a positive, finite number"
        )))
    };
    options.iter().find_map(bad).map_or(Ok(()), Err)
}
