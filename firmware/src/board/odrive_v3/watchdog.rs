//! The independent watchdog (21): resets the chip when nobody feeds it.

use crate::board::device::IWDG;

/// How long it waits.
#[derive(Clone, Copy)]
pub enum Patience {
    /// 32 kHz by 4, 160 counts: 20 ms, which the tolerance of its oscillator makes 14 to 38 ms.
    Running,
    /// By 256, 4095 counts: 33 s, 22 at the least. For an erase of the flash, which stalls the processor.
    Erasing,
}

/// Starts the watchdog, or changes how long it waits.
#[allow(unsafe_code)]
pub fn set(patience: Patience) {
    // SAFETY: the pointer is valid for the whole run. Both who call this, the start and the flash driver, do so with the
    // bridge off, and an interrupt in between can only feed the watchdog, which does no harm.
    let registers = unsafe { &*IWDG::ptr() };
    // 21.4.1: the key that starts it, then the one that opens the other registers.
    registers.kr().write(|w| w.key().start());
    registers.kr().write(|w| w.key().unlock());
    match patience {
        Patience::Running => {
            registers.pr().write(|w| w.pr().divide_by4());
            registers.rlr().write(|w| w.rl().set(160));
        }
        Patience::Erasing => {
            registers.pr().write(|w| w.pr().divide_by256());
            registers.rlr().write(|w| w.rl().set(0xFFF));
        }
    }
    // 21.4.4: the registers take a few of its slow cycles.
    while registers.sr().read().bits() != 0 {}
    feed();
}

/// Feeds it.
#[allow(unsafe_code)]
pub fn feed() {
    // SAFETY: the pointer is valid for the whole run, and a single write with the key has no other effect.
    unsafe { (*IWDG::ptr()).kr().write(|w| w.key().feed()) };
}
