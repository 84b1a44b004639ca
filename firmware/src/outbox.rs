//! The frames that wait to be sent, as a stream of bytes for the transmit interrupt.

use bristle_core::link::Frame;
use rtic_sync::channel::Receiver;

/// The most frames that wait behind the one being sent; a task that wants to send more is suspended.
pub const WAITING: usize = 2;

/// Takes frames from the tasks and gives bytes to the interrupt.
pub struct Outbox {
    frames: Receiver<'static, Frame, WAITING>,
    sending: Frame,
    sent: usize,
}

impl Outbox {
    /// An outbox that sends what arrives at `frames`.
    pub fn new(frames: Receiver<'static, Frame, WAITING>) -> Self {
        Self {
            frames,
            sending: Frame::new(),
            sent: 0,
        }
    }

    /// Whether nothing is left to send.
    pub fn is_empty(&self) -> bool {
        self.sent == self.sending.len() && self.frames.is_empty()
    }

    /// The next byte to send.
    pub fn take_byte(&mut self) -> Option<u8> {
        if self.sent == self.sending.len() {
            self.sending = self.frames.try_recv().ok()?;
            self.sent = 0;
        }
        let byte = *self.sending.get(self.sent)?;
        self.sent += 1;
        Some(byte)
    }
}
