//! From bytes to where they belong: the same for both transports.

use bristle_core::drive::Mailbox;
use bristle_core::link::{Packet, Received, Receiver};
use rtic::Mutex;
use rtic_sync::channel::Sender;

use crate::board::device::Interrupt;

/// Commands that wait to be served.
pub const BACKLOG: usize = 3;

/// Where a transport leaves what it has received.
pub struct Inlet {
    packets: Sender<'static, Packet<f32>, BACKLOG>,
    /// Whether samples come over the link, and not from the converter.
    emulated: bool,
}

impl Inlet {
    /// An inlet that leaves commands at `packets`.
    pub fn new(packets: Sender<'static, Packet<f32>, BACKLOG>, emulated: bool) -> Self {
        Self { packets, emulated }
    }

    /// Takes bytes. A sample among them starts the control task when all have been taken.
    pub fn take(
        &mut self,
        bytes: impl Iterator<Item = u8>,
        receiver: &mut impl Mutex<T = Receiver>,
        mailbox: &mut impl Mutex<T = Mailbox<f32>>,
    ) {
        let mut sampled = false;
        for byte in bytes {
            let dropped = match receiver.lock(|receiver| receiver.push(byte)) {
                None => false,
                Some(Received::SetPoint(set_point)) => {
                    mailbox.lock(|mailbox| mailbox.put_set_point(set_point));
                    false
                }
                Some(Received::Sample(sample)) if self.emulated => {
                    mailbox.lock(|mailbox| mailbox.put_sample(sample));
                    sampled = true;
                    false
                }
                Some(Received::Sample(_)) => true,
                Some(Received::Packet(packet)) => {
                    mailbox.lock(Mailbox::hear);
                    self.packets.try_send(packet).is_err()
                }
            };
            if dropped {
                receiver.lock(Receiver::dropped);
            }
        }
        if sampled {
            rtic::pend(Interrupt::ADC);
        }
    }
}
