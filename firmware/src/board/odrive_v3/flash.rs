//! The flash's last two sectors, which hold the parameters.

use bristle_core::drive::store::Places;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use super::watchdog::{self, Patience};
use crate::board::device::FLASH;

/// 3.3, table 5: sectors 10 and 11 of 128 KB end the megabyte; the image lies far below.
pub const PLACES: Places = Places {
    offsets: [0xC_0000, 0xE_0000],
    size: 0x2_0000,
};

const BASE: usize = 0x0800_0000;
const CAPACITY: usize = 0x10_0000;
const FIRST_SECTOR: u8 = 10;

/// 3.9.3.
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// The flash controller. Writing stalls the processor, as code runs from the same flash (3.5.2), so it is only done with
/// the bridge off; the watchdog is told to wait for an erase, which takes a second or two.
pub struct Flash {
    registers: FLASH,
}

/// What the controller refused.
#[derive(Debug)]
pub struct Failed(NorFlashErrorKind);

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl ErrorType for Flash {
    type Error = Failed;
}

impl Flash {
    /// Takes the controller.
    pub fn new(registers: FLASH) -> Self {
        Self { registers }
    }

    /// Does something with the controller unlocked (3.6.1), then waits and checks (3.6.5).
    fn unlocked(&mut self, act: impl FnOnce(&FLASH)) -> Result<(), Failed> {
        for key in KEYS {
            self.registers.keyr().write(|w| w.key().set(key));
        }
        // 3.8.4: error flags are cleared by writing one.
        self.registers.sr().write(|w| {
            w.pgserr().clear_bit_by_one();
            w.pgperr().clear_bit_by_one();
            w.pgaerr().clear_bit_by_one();
            w.wrperr().clear_bit_by_one()
        });
        act(&self.registers);
        while self.registers.sr().read().bsy().bit_is_set() {}
        let status = self.registers.sr().read();
        self.registers.cr().write(|w| w.lock().set_bit());
        let failed = status.pgserr().bit_is_set()
            || status.pgperr().bit_is_set()
            || status.pgaerr().bit_is_set()
            || status.wrperr().bit_is_set();
        if failed {
            return Err(Failed(NorFlashErrorKind::Other));
        }
        Ok(())
    }
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    #[allow(unsafe_code)]
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        let offset = offset as usize;
        if offset.saturating_add(bytes.len()) > CAPACITY {
            return Err(Failed(NorFlashErrorKind::OutOfBounds));
        }
        for (k, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: the address lies in flash, as was just checked, and flash can be read at any time. Volatile, as
            // the controller changes it behind the compiler's back.
            *byte = unsafe { ((BASE + offset + k) as *const u8).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = PLACES.size as usize;

    /// Erases one of the two sectors (3.6.3: SER, its number, STRT).
    #[allow(unsafe_code)]
    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        let index = PLACES.offsets.iter().position(|o| *o == from);
        let (Some(index), true) = (index, to == from.saturating_add(PLACES.size)) else {
            return Err(Failed(NorFlashErrorKind::NotAligned));
        };
        watchdog::set(Patience::Erasing);
        let outcome = self.unlocked(|flash| {
            flash.cr().write(|w| {
                w.ser().set_bit();
                w.psize().psize32();
                w.strt().set_bit();
                // SAFETY: the chip has twelve sectors, of which this is the eleventh or the twelfth.
                unsafe { w.snb().bits(FIRST_SECTOR + index as u8) }
            });
        });
        watchdog::set(Patience::Running);
        outcome
    }

    /// 3.6.4: words, with PG set.
    #[allow(unsafe_code)]
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        let inside = PLACES.offsets[0]..CAPACITY as u32;
        for (k, word) in bytes.chunks(4).enumerate() {
            let place = offset.saturating_add(4 * k as u32);
            let Ok(word) = <[u8; 4]>::try_from(word) else {
                return Err(Failed(NorFlashErrorKind::NotAligned));
            };
            if !inside.contains(&place) || !place.is_multiple_of(4) {
                return Err(Failed(NorFlashErrorKind::OutOfBounds));
            }
            self.unlocked(|flash| {
                flash.cr().write(|w| w.pg().set_bit().psize().psize32());
                // SAFETY: the address lies in the parameters' sectors, as was just checked, which hold nothing that the
                // program refers to.
                unsafe {
                    ((BASE + place as usize) as *mut u32).write_volatile(u32::from_le_bytes(word));
                }
            })?;
        }
        Ok(())
    }
}
