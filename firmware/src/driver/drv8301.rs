//! Texas Instruments DRV8301: gate driver and current amplifiers. Section numbers refer to its datasheet, SLOS719F.

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;

/// Gain of the current amplifiers, V/V.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Gain {
    /// 10
    Ten = 0,
    /// 20
    Twenty = 1,
    /// 40
    Forty = 2,
    /// 80
    Eighty = 3,
}

/// How the driver is to be set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setup {
    /// Gain of both current amplifiers.
    pub gain: Gain,
    /// `OC_ADJ_SET`, table 13: the voltage over a transistor at which it is turned off; 21 is 0.730 V.
    pub overcurrent: u16,
}

/// Why the driver is not ready.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotReady {
    /// The bus or a pin failed.
    Bus,
    /// A register reads back something else than was written: no driver answers, or its supply is low.
    Mismatch,
    /// The status registers report a fault.
    Fault,
}

/// A register, by its address (7.6.1).
#[derive(Clone, Copy)]
#[repr(u16)]
enum Register {
    Status1 = 0,
    Control1 = 2,
    Control2 = 3,
}

/// Bit 15 of a frame: read.
const READ: u16 = 1 << 15;
/// The lower 11 bits are data.
const DATA: u16 = 0x7FF;
/// Bit 10 of status register 1 is FAULT (table 10).
const FAULT: u16 = 1 << 10;

/// The driver behind its bus and its enable pin.
pub struct Drv8301<S, P> {
    spi: S,
    enable: P,
}

impl<S: SpiDevice<u16>, P: OutputPin> Drv8301<S, P> {
    /// A driver that is off.
    pub fn new(spi: S, enable: P) -> Self {
        Self { spi, enable }
    }

    /// Turns the driver on and sets it up; it is off again unless everything reads back as written.
    pub fn enable(&mut self, setup: Setup, delay: &mut impl DelayNs) -> Result<(), NotReady> {
        let outcome = self.bring_up(setup, delay);
        if outcome.is_err() {
            self.disable()?;
        }
        outcome
    }

    /// Turns the driver and with it all transistors off.
    pub fn disable(&mut self) -> Result<(), NotReady> {
        self.enable.set_low().map_err(|_| NotReady::Bus)
    }

    fn bring_up(&mut self, setup: Setup, delay: &mut impl DelayNs) -> Result<(), NotReady> {
        // 7.3.5: low for at least 20 µs resets latched faults.
        self.disable()?;
        delay.delay_us(100);
        self.enable.set_high().map_err(|_| NotReady::Bus)?;
        // 6.6: the bus answers 5 to 10 ms after that.
        delay.delay_ms(20);
        // Table 13: gates by 1.7 A (0), six inputs (bit 3 is 0), latched shutdown at overcurrent (bits 5:4 are 1).
        let control1 = (1 << 4) | (setup.overcurrent & 0x1F) << 6;
        // Table 14: OCTW reports both (0), the gain in bits 3:2.
        let control2 = (setup.gain as u16) << 2;
        for (register, value) in [
            (Register::Control1, control1),
            (Register::Control2, control2),
        ] {
            self.exchange(register as u16, value)?;
            if self.read(register)? != value {
                return Err(NotReady::Mismatch);
            }
        }
        if self.read(Register::Status1)? & FAULT != 0 {
            return Err(NotReady::Fault);
        }
        Ok(())
    }

    /// 7.5.1: the answer to a frame comes with the next one.
    fn read(&mut self, register: Register) -> Result<u16, NotReady> {
        self.exchange(READ >> 11 | register as u16, 0)?;
        let answer = self.exchange(READ >> 11 | register as u16, 0)?;
        Ok(answer & DATA)
    }

    /// One frame of 16 bits: the address and the read bit in the upper five, data in the rest.
    fn exchange(&mut self, address: u16, data: u16) -> Result<u16, NotReady> {
        let mut frame = [address << 11 | data & DATA];
        let done = self.spi.transfer_in_place(&mut frame);
        done.map_err(|_| NotReady::Bus)?;
        Ok(frame[0])
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::convert::Infallible;
    use std::rc::Rc;

    use embedded_hal::delay::DelayNs;
    use embedded_hal::digital::{self, OutputPin};
    use embedded_hal::spi::{self, Operation, SpiDevice};

    use super::{Drv8301, Gain, NotReady, Setup};

    /// The driver as the datasheet describes it: registers, an answer that comes one frame late, and an enable pin.
    #[derive(Default)]
    struct Chip {
        enabled: bool,
        waited: u64,
        registers: [u16; 4],
        answer: u16,
        /// Bits of control register 1 that do not hold.
        stuck: u16,
    }

    struct Wire(Rc<RefCell<Chip>>);

    impl spi::ErrorType for Wire {
        type Error = Infallible;
    }

    impl SpiDevice<u16> for Wire {
        fn transaction(&mut self, operations: &mut [Operation<'_, u16>]) -> Result<(), Infallible> {
            for operation in operations {
                let Operation::TransferInPlace([frame]) = operation else {
                    panic!("a transaction is one frame of 16 bits")
                };
                let mut chip = self.0.borrow_mut();
                assert!(chip.enabled && chip.waited >= 10_000_000, "not ready yet");
                let (address, data) = (usize::from(*frame >> 11 & 0xF), *frame & 0x7FF);
                let next = if *frame >> 15 == 1 {
                    (address as u16) << 11 | chip.registers[address]
                } else {
                    assert!(address >= 2, "a status register is read-only");
                    let stuck = if address == 2 { chip.stuck } else { 0 };
                    chip.registers[address] = data & !stuck;
                    0
                };
                *frame = std::mem::replace(&mut chip.answer, next);
            }
            Ok(())
        }
    }

    struct Pin(Rc<RefCell<Chip>>);

    impl digital::ErrorType for Pin {
        type Error = Infallible;
    }

    impl OutputPin for Pin {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.borrow_mut().enabled = false;
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            let mut chip = self.0.borrow_mut();
            (chip.enabled, chip.waited) = (true, 0);
            Ok(())
        }
    }

    struct Clock(Rc<RefCell<Chip>>);

    impl DelayNs for Clock {
        fn delay_ns(&mut self, ns: u32) {
            self.0.borrow_mut().waited += u64::from(ns);
        }
    }

    fn enable(chip: Chip) -> (Result<(), NotReady>, Rc<RefCell<Chip>>) {
        let chip = Rc::new(RefCell::new(chip));
        let mut driver = Drv8301::new(Wire(chip.clone()), Pin(chip.clone()));
        let setup = Setup {
            gain: Gain::Forty,
            overcurrent: 21,
        };
        let outcome = driver.enable(setup, &mut Clock(chip.clone()));
        (outcome, chip)
    }

    #[test]
    fn a_healthy_chip_is_set_up_and_on() {
        let (outcome, chip) = enable(Chip::default());
        assert_eq!(outcome, Ok(()));
        let chip = chip.borrow();
        assert!(chip.enabled);
        assert_eq!(chip.registers[2..], [21 << 6 | 1 << 4, 2 << 2]);
    }

    #[test]
    fn a_chip_that_does_not_take_its_setup_or_reports_a_fault_is_turned_off() {
        let stuck = Chip {
            stuck: 1 << 4,
            ..Chip::default()
        };
        let faulty = Chip {
            registers: [1 << 10, 0, 0, 0],
            ..Chip::default()
        };
        for (chip, expected) in [(stuck, NotReady::Mismatch), (faulty, NotReady::Fault)] {
            let (outcome, chip) = enable(chip);
            assert_eq!(outcome, Err(expected));
            assert!(!chip.borrow().enabled);
        }
    }
}
