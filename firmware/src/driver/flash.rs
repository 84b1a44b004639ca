//! The flash of an STM32F4 as storage for two records, one in each of two neighbouring sectors. Section numbers refer to RM0090.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// 3.9.3: what opens the control register, in this order.
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// The flash controller and the memory behind it.
pub trait Controller {
    /// Writes a word to the key register.
    fn give_key(&mut self, key: u32);
    /// 3.8.4: clears the error flags.
    fn clear_errors(&mut self);
    /// Whether it is busy.
    fn is_busy(&self) -> bool;
    /// Whether an error flag is set.
    fn has_failed(&self) -> bool;
    /// 3.6.3: begins to erase a sector of 128 KB.
    fn erase(&mut self, sector: u8);
    /// 3.6.4: makes the next write to the memory program a word.
    fn program(&mut self);
    /// Closes the control register.
    fn lock(&mut self);
    /// A byte of the memory; the caller has checked that it is there.
    fn read(&self, offset: u32) -> u8;
    /// Writes a word to the memory; the caller has checked that it belongs to the two sectors.
    fn write(&mut self, offset: u32, word: u32);
    /// An erase takes a second or two, in which nothing else runs: for the watchdog to know.
    fn announce_erase(&mut self, erasing: bool);
}

/// Where the two sectors lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sectors {
    /// The number of the first.
    pub first: u8,
    /// The offset of each.
    pub offsets: [u32; 2],
    /// The size of each.
    pub size: u32,
}

impl Sectors {
    /// The end of the second, which is that of the memory.
    const fn end(&self) -> u32 {
        self.offsets[1] + self.size
    }
}

/// The flash. Writing stalls the processor, as code runs from the same flash (3.5.2), so it is only done with the bridge off.
pub struct Flash<C> {
    controller: C,
    sectors: Sectors,
}

/// What the controller refused.
#[derive(Debug)]
pub struct Failed(NorFlashErrorKind);

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl<C> ErrorType for Flash<C> {
    type Error = Failed;
}

impl<C: Controller> Flash<C> {
    /// Takes the controller.
    pub const fn new(controller: C, sectors: Sectors) -> Self {
        Self {
            controller,
            sectors,
        }
    }

    /// Does something with the controller unlocked (3.6.1), then waits and checks (3.6.5).
    fn unlocked(&mut self, act: impl FnOnce(&mut C)) -> Result<(), Failed> {
        let controller = &mut self.controller;
        KEYS.into_iter().for_each(|key| controller.give_key(key));
        controller.clear_errors();
        act(controller);
        while controller.is_busy() {}
        let failed = controller.has_failed();
        controller.lock();
        if failed {
            return Err(Failed(NorFlashErrorKind::Other));
        }
        Ok(())
    }
}

impl<C: Controller> ReadNorFlash for Flash<C> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        let end = (offset as usize).saturating_add(bytes.len());
        if end > self.capacity() {
            return Err(Failed(NorFlashErrorKind::OutOfBounds));
        }
        for (place, byte) in (offset..).zip(bytes) {
            *byte = self.controller.read(place);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.sectors.end() as usize
    }
}

impl<C: Controller> NorFlash for Flash<C> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 0x2_0000;

    /// Erases one of the two sectors.
    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        let Sectors {
            first,
            offsets,
            size,
        } = self.sectors;
        let index = offsets.iter().position(|o| *o == from);
        let (Some(index), true) = (index, to == from.saturating_add(size)) else {
            return Err(Failed(NorFlashErrorKind::NotAligned));
        };
        self.controller.announce_erase(true);
        let outcome = self.unlocked(|controller| controller.erase(first + index as u8));
        self.controller.announce_erase(false);
        outcome
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        let inside = self.sectors.offsets[0]..self.sectors.end();
        for (k, word) in bytes.chunks(4).enumerate() {
            let place = offset.saturating_add(4 * k as u32);
            let Ok(word) = <[u8; 4]>::try_from(word) else {
                return Err(Failed(NorFlashErrorKind::NotAligned));
            };
            if !inside.contains(&place) || !place.is_multiple_of(4) {
                return Err(Failed(NorFlashErrorKind::OutOfBounds));
            }
            self.unlocked(|controller| {
                controller.program();
                controller.write(place, u32::from_le_bytes(word));
            })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use bristle_core::drive::Parameters;
    use bristle_core::drive::store::{self, Places, Stored};
    use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};

    use super::{Controller, Flash, Sectors};

    const SECTORS: Sectors = Sectors {
        first: 10,
        offsets: [0x1000, 0x1200],
        size: 0x200,
    };
    const PLACES: Places = Places {
        offsets: SECTORS.offsets,
        size: SECTORS.size,
    };

    /// The controller as the manual describes it.
    struct Chip {
        memory: Vec<u8>,
        keys: Vec<u32>,
        programming: bool,
        error: bool,
        /// What is still to be done, and for how many looks it is.
        busy: Cell<u32>,
        announced: bool,
        /// Erases and writes that the supply bears before it fails.
        strength: usize,
    }

    fn chip() -> Flash<Chip> {
        let chip = Chip {
            memory: vec![0xFF; 0x1400],
            keys: Vec::new(),
            programming: false,
            // Flags of an earlier failure stay until they are cleared.
            error: true,
            busy: Cell::new(0),
            announced: false,
            strength: usize::MAX,
        };
        Flash::new(chip, SECTORS)
    }

    impl Chip {
        fn is_open(&self) -> bool {
            self.keys == super::KEYS
        }

        /// Begins something, if the supply holds.
        fn begin(&mut self) -> bool {
            assert!(self.is_open() && self.busy.get() == 0 && !self.error);
            self.busy.set(3);
            self.error = self.strength == 0;
            self.strength = self.strength.saturating_sub(1);
            !self.error
        }
    }

    impl Controller for Chip {
        fn give_key(&mut self, key: u32) {
            assert!(!self.is_open(), "a key to an open register is a bus error");
            self.keys.push(key);
            assert_eq!(
                self.keys,
                super::KEYS[..self.keys.len()],
                "locked until reset"
            );
        }
        fn clear_errors(&mut self) {
            self.error = false;
        }
        fn is_busy(&self) -> bool {
            let left = self.busy.get();
            self.busy.set(left.saturating_sub(1));
            left > 0
        }
        fn has_failed(&self) -> bool {
            assert_eq!(self.busy.get(), 0, "flags are valid when it is done");
            self.error
        }
        fn erase(&mut self, sector: u8) {
            assert!(self.announced, "the watchdog would bite");
            if self.begin() {
                let start = SECTORS.offsets[usize::from(sector - SECTORS.first)] as usize;
                self.memory[start..start + SECTORS.size as usize].fill(0xFF);
            }
        }
        fn program(&mut self) {
            assert!(self.is_open());
            self.programming = true;
        }
        fn lock(&mut self) {
            self.keys.clear();
            self.programming = false;
        }
        fn read(&self, offset: u32) -> u8 {
            self.memory[offset as usize]
        }
        fn write(&mut self, offset: u32, word: u32) {
            assert!(self.programming && offset >= SECTORS.offsets[0]);
            if self.begin() {
                let bytes = word.to_le_bytes();
                for (k, byte) in bytes.into_iter().enumerate() {
                    self.memory[offset as usize + k] &= byte;
                }
            }
        }
        fn announce_erase(&mut self, erasing: bool) {
            self.announced = erasing;
        }
    }

    fn set(timeout: u16) -> Parameters<f32> {
        let mut parameters = Parameters::harmless();
        parameters.limits.command_timeout = timeout;
        parameters
    }

    #[test]
    fn parameters_go_through_the_controller_and_come_back() {
        let mut flash = chip();
        assert_eq!(store::load::<f32>(&mut flash, PLACES), Stored::Nothing);
        for timeout in [1, 2, 3] {
            store::save(&mut flash, PLACES, &set(timeout)).unwrap();
            assert_eq!(
                store::load(&mut flash, PLACES),
                Stored::Parameters(set(timeout))
            );
        }
        let chip = &flash.controller;
        assert!(
            !chip.is_open() && !chip.announced && chip.memory[..0x1000].iter().all(|b| *b == 0xFF)
        );
    }

    #[test]
    fn a_failure_is_told_and_leaves_the_controller_locked_and_the_old_record_whole() {
        for strength in 0..97 {
            let mut flash = chip();
            store::save(&mut flash, PLACES, &set(1)).unwrap();
            flash.controller.strength = strength;
            // One erase, and 96 words.
            assert!(store::save(&mut flash, PLACES, &set(2)).is_err());
            assert!(!flash.controller.is_open() && !flash.controller.announced);
            assert_eq!(store::load(&mut flash, PLACES), Stored::Parameters(set(1)));
        }
    }

    #[test]
    fn nothing_outside_the_two_sectors_is_touched() {
        let mut flash = chip();
        let word = [0; 4];
        for place in [0, 0xFFC, 0x1400, 0x1002, u32::MAX - 3] {
            assert!(flash.write(place, &word).is_err());
        }
        assert!(flash.write(0x1000, &word[..3]).is_err());
        for (from, to) in [
            (0x1000, 0x1400),
            (0x1000, 0x1100),
            (0, 0x200),
            (0x1100, 0x1300),
        ] {
            assert!(flash.erase(from, to).is_err());
        }
        assert!(flash.controller.memory.iter().all(|b| *b == 0xFF));
        let mut byte = [0; 2];
        assert!(flash.read(0x13FF, &mut byte).is_err() && flash.read(0x13FE, &mut byte).is_ok());
        assert!(flash.read(u32::MAX, &mut byte).is_err());
    }
}
