//! The host's end of the link to a board, whatever carries its bytes.
//!
//! - [`Wire`]: what carries bytes: a [`SerialLine`] to a board, or the emulator's pipes.
//! - [`Peer`]: the board at the other end: commands, answers, telemetry, recordings.
//! - [`Recorded`]: a recording out of the board's memory.

mod access;
mod peer;
mod recorded;
mod serial;

pub use access::denied;
pub use peer::{Peer, Telemetry};
pub use recorded::Recorded;
pub use serial::{BAUD, SerialLine};

use std::time::Duration;

use crate::error::Result;

/// What is read at once.
pub const BLOCK: usize = 4096;

/// Of a line's bytes, for telemetry; the rest is for answers.
const SHARE: f64 = 0.75;
/// What a telemetry frame has beside its words: kind, number, period, checksum and framing.
const FRAMING: f64 = 16.0;
/// The most bytes of a word.
const WORD: f64 = 5.0;

/// Telemetry frames of so many words that a line of `capacity` bytes a second carries, a second.
pub fn frames_carried(capacity: f64, words: usize) -> f64 {
    SHARE * capacity / (FRAMING + WORD * words as f64)
}

/// What carries bytes to a board and back.
pub trait Wire {
    /// Whether bytes may be lost or changed under way; where they cannot, a damaged frame is a defect.
    fn is_noisy(&self) -> bool;
    /// How long to wait for bytes from now on.
    fn set_patience(&mut self, patience: Duration) -> Result<()>;
    /// Sends bytes.
    fn write(&mut self, bytes: &[u8]) -> Result<()>;
    /// Waits for bytes; how many came, and none if its patience has ended. Fails if the other end is gone.
    fn read(&mut self, buffer: &mut [u8; BLOCK]) -> Result<usize>;
    /// What a person calls it.
    fn name(&self) -> &str;
}

impl<W: Wire + ?Sized> Wire for Box<W> {
    fn is_noisy(&self) -> bool {
        (**self).is_noisy()
    }
    fn set_patience(&mut self, patience: Duration) -> Result<()> {
        (**self).set_patience(patience)
    }
    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        (**self).write(bytes)
    }
    fn read(&mut self, buffer: &mut [u8; BLOCK]) -> Result<usize> {
        (**self).read(buffer)
    }
    fn name(&self) -> &str {
        (**self).name()
    }
}
