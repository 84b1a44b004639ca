//! The flash's last two sectors, which hold the parameters.

use bristle_core::drive::store::Places;

use super::watchdog::{self, Patience};
use crate::board::device::FLASH;
use crate::driver::flash::{Controller, Sectors};

/// The flash, of which the parameters have the end.
pub type Flash = crate::driver::flash::Flash<Registers>;

/// 3.3, table 5: sectors 10 and 11 of 128 KB end the megabyte; the image lies far below.
const SECTORS: Sectors = Sectors {
    first: 10,
    offsets: [0xC_0000, 0xE_0000],
    size: 0x2_0000,
};

/// Where the records are.
pub const PLACES: Places = Places {
    offsets: SECTORS.offsets,
    size: SECTORS.size,
};

const BASE: usize = 0x0800_0000;

/// The controller's registers, and the memory that they guard.
pub struct Registers {
    registers: FLASH,
}

/// Takes the controller.
pub const fn start(registers: FLASH) -> Flash {
    Flash::new(Registers { registers }, SECTORS)
}

#[allow(unsafe_code)]
impl Controller for Registers {
    fn give_key(&mut self, key: u32) {
        self.registers.keyr().write(|w| w.key().set(key));
    }

    fn clear_errors(&mut self) {
        // By writing one.
        self.registers.sr().write(|w| {
            w.pgserr().clear_bit_by_one();
            w.pgperr().clear_bit_by_one();
            w.pgaerr().clear_bit_by_one();
            w.wrperr().clear_bit_by_one()
        });
    }

    fn is_busy(&self) -> bool {
        self.registers.sr().read().bsy().bit_is_set()
    }

    fn has_failed(&self) -> bool {
        let status = self.registers.sr().read();
        status.pgserr().bit_is_set()
            || status.pgperr().bit_is_set()
            || status.pgaerr().bit_is_set()
            || status.wrperr().bit_is_set()
    }

    fn erase(&mut self, sector: u8) {
        self.registers.cr().write(|w| {
            w.ser().set_bit();
            w.psize().psize32();
            w.strt().set_bit();
            // SAFETY: the chip has twelve sectors, of which the driver knows the eleventh and the twelfth.
            unsafe { w.snb().bits(sector) }
        });
    }

    fn program(&mut self) {
        self.registers
            .cr()
            .write(|w| w.pg().set_bit().psize().psize32());
    }

    fn lock(&mut self) {
        self.registers.cr().write(|w| w.lock().set_bit());
    }

    fn read(&self, offset: u32) -> u8 {
        // SAFETY: the address lies in flash, as the driver has checked, and flash can be read at any time. Volatile, as the
        // controller changes it behind the compiler's back.
        unsafe { ((BASE + offset as usize) as *const u8).read_volatile() }
    }

    fn write(&mut self, offset: u32, word: u32) {
        // SAFETY: the address lies in the parameters' sectors, as the driver has checked, which hold nothing that the program
        // refers to.
        unsafe { ((BASE + offset as usize) as *mut u32).write_volatile(word) };
    }

    fn announce_erase(&mut self, erasing: bool) {
        watchdog::set(if erasing {
            Patience::Erasing
        } else {
            Patience::Running
        });
    }
}
