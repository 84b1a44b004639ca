//! QEMU's `stm32vldiscovery`: an STM32F100, without a floating-point unit and with 8 KB of RAM.
//!
//! The board itself carries no bridge: the image serves the emulator only, and elsewhere stops before it does anything.
//! Section numbers refer to ST's reference manual RM0041.

use core::mem::MaybeUninit;

use bristle_core::drive::{Fault, Faults};
use bristle_core::link::{Board as Kind, Hello, Numbers};

use super::emulated::{self, Flash, Persistent};
use super::{Serial, device, greeting};
use crate::fault;

/// Bytes that the fast transport takes at once.
pub const BLOCK: usize = 64;

/// The bridge is on the host, which sees that the board has stopped.
pub const fn enter_safe_state() {}

/// Nothing raises it.
pub fn non_maskable() {
    fault::stop(fault::UNHANDLED_STATUS);
}

/// What is there after the start.
pub struct Board {
    /// The port of the link.
    pub port: Serial,
    /// What takes the place of the flash.
    pub flash: Flash,
    /// What is wrong already.
    pub faults: Faults,
    /// Whether the host asked for the fast transport.
    pub fast: bool,
}

impl Board {
    /// Starts in the emulator.
    pub fn start(
        device: device::Peripherals,
        persistent: &'static mut MaybeUninit<Persistent>,
    ) -> Self {
        if !emulated::is_emulated() {
            fault::stop(fault::UNHANDLED_STATUS);
        }
        let mut flash = Persistent::recover(persistent);
        let mut faults = Faults::NONE;
        faults.raise_if(Fault::Watchdog, flash.take_watchdog());
        // 6.3.7: port A and the serial port.
        device
            .RCC
            .apb2enr()
            .modify(|_, w| w.iopaen().enabled().usart1en().enabled());
        // 7.1.11: TX is a push-pull output of the port, RX an input that floats.
        device.GPIOA.crh().modify(|_, w| {
            w.mode9().output50();
            w.cnf9().alt_push_pull();
            w.mode10().input();
            w.cnf10().open_drain()
        });
        Self {
            port: Serial::new(device.USART1, emulated::CLOCK_HZ),
            flash,
            faults,
            fast: emulated::is_fast(),
        }
    }
}

/// The greeting of this board, which has no room for a recording.
pub fn hello() -> Hello {
    greeting(Kind::Emulated, Numbers::Q16, 0)
}
