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
}

/// Where the control task leaves what an emulated bridge does. It has a place of its own and goes first, as the host waits for
/// it: behind frames that wait it would be lost when there is no room.
pub struct Actuations {
    place: Sender<'static, Frame, 1>,
    notify: fn(),
}

impl Actuations {
    /// A place that calls `notify` after each report, which must see to it that it is sent.
    pub fn new(place: Sender<'static, Frame, 1>, notify: fn()) -> Self {
        Self { place, notify }
    }

    /// Sends what the bridge does. The host sends no sample before it has this, so the place is empty.
    pub fn send(&mut self, report: &Report<f32>) {
        // Every report fits a frame.
        if let Ok(frame) = encode(report) {
            let _ = self.place.try_send(frame);
            (self.notify)();
        }
    }
}

/// Takes frames from the tasks and gives bytes to the line.
pub struct Outbox {
    actuated: Receiver<'static, Frame, 1>,
    frames: Receiver<'static, Frame, WAITING>,
    sending: Frame,
    sent: usize,
}

impl Outbox {
    /// An outbox that sends what arrives at `actuated` and, behind it, at `frames`.
    pub fn new(
        actuated: Receiver<'static, Frame, 1>,
        frames: Receiver<'static, Frame, WAITING>,
    ) -> Self {
        Self {
            actuated,
            frames,
            sending: Frame::new(),
            sent: 0,
        }
    }

    /// Whether nothing is left to send.
    pub fn is_empty(&self) -> bool {
        self.sent == self.sending.len() && self.actuated.is_empty() && self.frames.is_empty()
    }

    /// The next frame, whole; not to be mixed with [`Outbox::take_byte`].
    pub fn take_frame(&mut self) -> Option<Frame> {
        let actuated = self.actuated.try_recv();
        actuated.or_else(|_| self.frames.try_recv()).ok()
    }

    /// The next byte to send.
    pub fn take_byte(&mut self) -> Option<u8> {
        if self.sent == self.sending.len() {
            self.sending = self.take_frame()?;
            self.sent = 0;
        }
        let byte = *self.sending.get(self.sent)?;
        self.sent += 1;
        Some(byte)
    }
}
