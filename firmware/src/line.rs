//! What waits to be sent where memory is scarce: one report of any size, and one actuation, which never waits for it.

use bristle_core::link::{ACTUATION_CAPACITY, Frame, Report, encode_short};
use bristle_core::scalar::Q16;
use heapless::Vec;

/// Takes frames from the tasks and gives bytes to the line.
#[derive(Default)]
pub struct Line {
    actuation: Vec<u8, ACTUATION_CAPACITY>,
    frame: Frame,
    /// How much of which of them the line has had.
    sent: usize,
    sending_actuation: bool,
}

impl Line {
    /// Nothing to send.
    pub const fn new() -> Self {
        Self {
            actuation: Vec::new(),
            frame: Vec::new(),
            sent: 0,
            sending_actuation: false,
        }
    }

    /// Whether there is room for a report.
    pub fn has_room(&self) -> bool {
        self.frame.is_empty()
    }

    /// Leaves a report to be sent, where there is room.
    pub fn put(&mut self, frame: Frame) {
        self.frame = frame;
    }

    /// Leaves an actuation to be sent. The host sends no sample before it has the actuation of the one before, so there is
    /// room.
    pub fn actuate(&mut self, report: &Report<Q16>) {
        // A frame that is too long would be lost here, which a test of `link` rules out.
        if let Ok(frame) = encode_short(report) {
            self.actuation = frame;
        }
    }

    /// Whether nothing is left to send.
    pub fn is_empty(&self) -> bool {
        self.actuation.is_empty() && self.frame.is_empty()
    }

    /// The rest of a frame, for a line that takes it at once; to be followed by [`Line::sent`].
    pub fn rest(&mut self) -> &[u8] {
        if self.sent == 0 {
            self.sending_actuation = !self.actuation.is_empty();
        }
        let bytes: &[u8] = if self.sending_actuation {
            &self.actuation
        } else {
            &self.frame
        };
        bytes.get(self.sent..).unwrap_or_default()
    }

    /// So many bytes of the rest have gone.
    pub fn sent(&mut self, bytes: usize) {
        self.sent += bytes;
        if self.sending_actuation && self.sent >= self.actuation.len() {
            self.actuation.clear();
            self.sent = 0;
        } else if !self.sending_actuation && self.sent >= self.frame.len() {
            self.frame.clear();
            self.sent = 0;
        }
    }
}
