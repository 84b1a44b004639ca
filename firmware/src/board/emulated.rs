//! QEMU's models of the chips: what takes the place of hardware that they lack.

use core::mem::MaybeUninit;

use bristle_core::drive::store::{self, Places};
use bristle_core::link::Injection;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use semihosting::io::{Read, Write, stdin, stdout};

use super::device::{DBGMCU, RCC};

/// The frequency that the serial port is set up for; its model ignores it.
pub const CLOCK_HZ: u32 = 16_000_000;

/// The argument that chooses the fast transport: frames over the emulator's standard input and output.
const FAST: &str = "fast";

/// Whether this is QEMU's model of the chip.
///
/// The model has neither clock nor debug unit and reads both as zero. A chip never does: its reset value of
/// `RCC_CR` has the oscillator on (RM0090 7.3.1, RM0041 6.3.1), and `DBGMCU_IDCODE` names the device (38.6.1, 25.6.1).
#[allow(unsafe_code)]
pub fn is_emulated() -> bool {
    // SAFETY: both pointers are valid for the whole run, as they are fixed addresses of the chip. The reads have no
    // side effect and the registers are not written here, so no owner of the peripherals can notice.
    let (clock, id) = unsafe { ((*RCC::ptr()).cr().read(), (*DBGMCU::ptr()).idcode().read()) };
    clock.bits() == 0 && id.bits() == 0
}

/// Whether the host asked for the fast transport. Only in the emulator.
pub fn is_fast() -> bool {
    semihosting::experimental::env::args::<64>()
        .is_ok_and(|arguments| (&arguments).any(|argument| argument == Ok(FAST)))
}

/// Reads what the host has sent, waiting for some; ends the emulation when the host has closed its end.
pub fn read(buffer: &mut [u8]) -> &[u8] {
    let length = stdin().and_then(|mut input| input.read(buffer));
    match length {
        Ok(1..) => length.ok().and_then(|n| buffer.get(..n)).unwrap_or(&[]),
        _ => semihosting::process::exit(0),
    }
}

/// Sends to the host.
pub fn write(bytes: &[u8]) {
    if stdout().and_then(|mut out| out.write_all(bytes)).is_err() {
        semihosting::process::exit(0);
    }
}

/// What survives a restart: the emulator keeps the memory that the image does not initialise.
pub struct Persistent {
    /// Tells a restart from a first start, in which memory is zero.
    magic: u32,
    /// Whether the watchdog caused the restart.
    watchdog: u32,
    flash: [u8; 2 * SECTOR],
}

const MAGIC: u32 = 0x4252_4953;
/// A sector holds one record and nothing else: memory is scarcer than flash.
const SECTOR: usize = store::BYTES;

/// Where the two records lie.
pub const PLACES: Places = Places {
    offsets: [0, SECTOR as u32],
    size: SECTOR as u32,
};

impl Persistent {
    /// Takes the memory over from the run before, if there was one.
    #[allow(unsafe_code)]
    pub fn recover(memory: &'static mut MaybeUninit<Self>) -> Flash {
        // SAFETY: integers have no invalid values, and memory always holds some; what it holds is checked below.
        let memory = unsafe { memory.assume_init_mut() };
        if memory.magic != MAGIC {
            *memory = Self {
                magic: MAGIC,
                watchdog: 0,
                flash: [0xFF; 2 * SECTOR],
            };
        }
        Flash { memory }
    }
}

/// The flash that the model lacks, in memory that survives a restart.
pub struct Flash {
    memory: &'static mut Persistent,
}

impl Flash {
    /// Whether the watchdog caused the restart; asked once.
    pub fn take_watchdog(&mut self) -> bool {
        core::mem::take(&mut self.memory.watchdog) != 0
    }

    /// Lets hardware fail. A crystal that stops is the drive's to notice.
    pub fn inject(&mut self, injection: Injection) {
        match injection {
            Injection::CorruptFlash { record } => {
                let place = usize::from(record) * SECTOR + 20;
                if let Some(byte) = self.memory.flash.get_mut(place) {
                    *byte ^= 1;
                }
            }
            // The model has no watchdog: this is what it would do.
            Injection::Hang => {
                self.memory.watchdog = 1;
                cortex_m::peripheral::SCB::sys_reset();
            }
            Injection::Restart => cortex_m::peripheral::SCB::sys_reset(),
            Injection::CorruptParameter | Injection::Clock => {}
        }
    }
}

/// Nothing lies outside of the memory that stands for the flash.
#[derive(Debug)]
pub struct OutOfBounds;

impl NorFlashError for OutOfBounds {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::OutOfBounds
    }
}

impl ErrorType for Flash {
    type Error = OutOfBounds;
}

impl Flash {
    fn range(&mut self, from: u32, length: usize) -> Result<&mut [u8], OutOfBounds> {
        let from = from as usize;
        let range = from..from.saturating_add(length);
        self.memory.flash.get_mut(range).ok_or(OutOfBounds)
    }
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), OutOfBounds> {
        let length = bytes.len();
        let source = self.range(offset, length)?.iter();
        bytes
            .iter_mut()
            .zip(source)
            .for_each(|(to, from)| *to = *from);
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * SECTOR
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), OutOfBounds> {
        let length = to.saturating_sub(from) as usize;
        self.range(from, length)?.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), OutOfBounds> {
        let target = self.range(offset, bytes.len())?.iter_mut();
        // NOR flash clears bits and never sets them.
        target.zip(bytes).for_each(|(to, from)| *to &= from);
        Ok(())
    }
}
