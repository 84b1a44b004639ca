//! From bytes to where they belong: the same for both transports.

use bristle_core::drive::{Mailbox, Number};
use bristle_core::link::{Packet, Received, Receiver};
use rtic::Mutex;

use crate::board::device::Interrupt;

/// Takes bytes. A sample among them starts the control task when all have been taken; any other packet but a set point is
/// handed to `serve`, which says whether it has room.
///
/// Samples count only if they come over the link (`emulated`), and not from the converter.
pub fn take<T: Number>(
    bytes: impl Iterator<Item = u8>,
    receiver: &mut impl Mutex<T = Receiver>,
    mailbox: &mut impl Mutex<T = Mailbox<T>>,
    emulated: bool,
    mut serve: impl FnMut(Packet<T>) -> bool,
) {
    let mut sampled = false;
    for byte in bytes {
        let taken = match receiver.lock(|receiver| receiver.push(byte)) {
            None => true,
            Some(Received::SetPoint(set_point)) => {
                mailbox.lock(|mailbox| mailbox.put_set_point(set_point));
                true
            }
            Some(Received::Sample(sample)) if emulated => {
                mailbox.lock(|mailbox| mailbox.put_sample(sample));
                sampled = true;
                true
            }
            Some(Received::Sample(_)) => false,
            Some(Received::Packet(packet)) => {
                mailbox.lock(Mailbox::hear);
                serve(packet)
            }
        };
        if !taken {
            receiver.lock(Receiver::dropped);
        }
    }
    if sampled {
        rtic::pend(Interrupt::ADC);
    }
}
