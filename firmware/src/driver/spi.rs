//! A bus of an STM32 with one device on it, in frames of 16 bits. Section numbers refer to RM0090.

use embedded_hal::spi::{self, Operation, SpiDevice};

/// The registers of the bus, and the pin that selects the device.
pub trait Registers {
    /// Pulls the device's select line, or lets it go.
    fn select(&mut self, selected: bool);
    /// Sends a frame.
    fn put(&mut self, word: u16);
    /// 28.3.5: whether the frame that came back is there.
    fn is_received(&self) -> bool;
    /// Takes it.
    fn take(&mut self) -> u16;
    /// Lets pass what the device wants between two selections.
    fn rest(&mut self);
}

/// Attempts to see a frame done: a thousand times as long as it takes.
const PATIENCE: u32 = 1_000_000;

/// A frame that does not end.
#[derive(Debug)]
pub struct Timeout;

impl spi::Error for Timeout {
    fn kind(&self) -> spi::ErrorKind {
        spi::ErrorKind::Other
    }
}

/// The bus.
pub struct Bus<R> {
    registers: R,
}

impl<R> spi::ErrorType for Bus<R> {
    type Error = Timeout;
}

impl<R: Registers> Bus<R> {
    /// A bus that is set up.
    pub const fn new(registers: R) -> Self {
        Self { registers }
    }

    /// A frame out and one in.
    fn exchange(&mut self, word: u16) -> Result<u16, Timeout> {
        self.registers.put(word);
        for _ in 0..PATIENCE {
            if self.registers.is_received() {
                return Ok(self.registers.take());
            }
        }
        Err(Timeout)
    }

    fn operate(&mut self, operation: &mut Operation<'_, u16>) -> Result<(), Timeout> {
        match operation {
            Operation::Read(words) => {
                for word in words.iter_mut() {
                    *word = self.exchange(0)?;
                }
            }
            Operation::Write(words) => {
                for word in *words {
                    self.exchange(*word)?;
                }
            }
            Operation::Transfer(read, write) => {
                let longest = read.len().max(write.len());
                for k in 0..longest {
                    let word = self.exchange(write.get(k).copied().unwrap_or(0))?;
                    if let Some(slot) = read.get_mut(k) {
                        *slot = word;
                    }
                }
            }
            Operation::TransferInPlace(words) => {
                for word in words.iter_mut() {
                    *word = self.exchange(*word)?;
                }
            }
            // A device asks for less between two frames than the code around them takes.
            Operation::DelayNs(_) => self.registers.rest(),
        }
        Ok(())
    }
}

impl<R: Registers> SpiDevice<u16> for Bus<R> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u16>]) -> Result<(), Timeout> {
        self.registers.select(true);
        let outcome = operations.iter_mut().try_for_each(|o| self.operate(o));
        self.registers.select(false);
        self.registers.rest();
        outcome
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use embedded_hal::spi::{Operation, SpiDevice};

    use super::{Bus, Registers};

    /// A device that sends back each frame with its bits turned over, while it is selected.
    #[derive(Default)]
    struct Echo {
        selected: bool,
        selections: u32,
        seen: Vec<u16>,
        answer: Option<u16>,
        /// Looks until a frame is there.
        slow: Cell<u32>,
        dead: bool,
    }

    impl Registers for Echo {
        fn select(&mut self, selected: bool) {
            assert_ne!(self.selected, selected);
            self.selected = selected;
            self.selections += u32::from(selected);
        }
        fn put(&mut self, word: u16) {
            assert!(
                self.selected && self.answer.is_none(),
                "a frame would be lost"
            );
            self.seen.push(word);
            self.slow.set(3);
            self.answer = (!self.dead).then_some(!word);
        }
        fn is_received(&self) -> bool {
            self.slow.set(self.slow.get().saturating_sub(1));
            self.slow.get() == 0 && self.answer.is_some()
        }
        fn take(&mut self) -> u16 {
            self.answer.take().expect("a frame")
        }
        fn rest(&mut self) {}
    }

    #[test]
    fn every_operation_sends_and_takes_its_frames_under_one_selection() {
        let mut bus = Bus::new(Echo::default());
        let (mut read, mut both, mut place) = ([9; 2], [9; 1], [5, 6]);
        let mut operations = [
            Operation::Read(&mut read),
            Operation::Write(&[1, 2]),
            Operation::Transfer(&mut both, &[3, 4]),
            Operation::TransferInPlace(&mut place),
        ];
        bus.transaction(&mut operations).unwrap();
        assert_eq!((read, both, place), ([!0; 2], [!3], [!5, !6]));
        let echo = &bus.registers;
        assert_eq!(echo.seen, [0, 0, 1, 2, 3, 4, 5, 6]);
        assert_eq!((echo.selected, echo.selections), (false, 1));
    }

    #[test]
    fn a_device_that_does_not_answer_is_let_go_of() {
        let mut bus = Bus::new(Echo {
            dead: true,
            ..Echo::default()
        });
        assert!(bus.transaction(&mut [Operation::Write(&[7, 8])]).is_err());
        assert_eq!(bus.registers.seen, [7]);
        assert!(!bus.registers.selected);
    }
}
