//! The frames that wait to be sent, as a stream of bytes for the transmit interrupt.

use bristle_core::link::{Frame, Report, encode};
use rtic_sync::channel::{Receiver, Sender};

/// The most frames that wait behind the one being sent; a task that wants to send more is suspended.
pub const WAITING: usize = 4;

/// Where tasks leave their reports.
pub struct Postbox {
    frames: Sender<'static, Frame, WAITING>,
    notify: fn(),
}

impl Postbox {
    /// A postbox that calls `notify` after each frame, which must see to it that it is sent.
    pub fn new(frames: Sender<'static, Frame, WAITING>, notify: fn()) -> Self {
        Self { frames, notify }
    }

    /// Another entrance to the same outbox.
    #[must_use]
    pub fn another(&self) -> Self {
        Self {
            frames: self.frames.clone(),
            notify: self.notify,
        }
    }

    /// Sends a report as soon as there is room.
    pub async fn send(&mut self, report: &Report<f32>) {
        // Every report fits a frame, which a test of `link` holds; and the outbox is never dropped. Were either to
        // change, the host would miss one report and the board would go on listening.
        if let Ok(frame) = encode(report) {
            let _ = self.frames.send(frame).await;
            (self.notify)();
        }
    }

    /// Sends a report if there is room now, and says whether there was.
    pub fn try_send(&mut self, report: &Report<f32>) -> bool {
        let sent = encode(report).is_ok_and(|frame| self.frames.try_send(frame).is_ok());
        (self.notify)();
        sent
    }
}

/// Takes frames from the tasks and gives bytes to the line.
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

    /// The next frame, whole; not to be mixed with [`Outbox::take_byte`].
    pub fn take_frame(&mut self) -> Option<Frame> {
        self.frames.try_recv().ok()
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
