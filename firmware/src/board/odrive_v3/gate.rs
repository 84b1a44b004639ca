//! The gate driver's pins and bus.

use core::convert::Infallible;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{self, OutputPin};

use crate::board::device::{GPIOB, GPIOC, RCC, SPI3};
use crate::driver::drv8301::{Drv8301, Gain, NotReady, Setup};
use crate::driver::spi::Registers;

/// 40 V/V over 0.5 mΩ: 20 mV/A, ±80 A in the range of the converter. 0.730 V over transistors of some 7 mΩ is far beyond
/// that: the driver's own threshold is for short circuits.
const SETUP: Setup = Setup {
    gain: Gain::Forty,
    overcurrent: 21,
};

/// The gate driver.
pub struct Gate {
    driver: Drv8301<Bus, Enable>,
}

impl Gate {
    /// Sets the bus up for a driver that is off, with its pins being outputs already.
    pub fn off(spi: SPI3, rcc: &RCC, gpiob: GPIOB, gpioc: GPIOC) -> Self {
        // DS8626, table 9: AF6 is SPI3.
        gpioc
            .afrh()
            .modify(|_, w| w.afrh10().af6().afrh11().af6().afrh12().af6());
        gpioc.moder().modify(|_, w| {
            w.moder10().alternate();
            w.moder11().alternate();
            w.moder12().alternate()
        });
        rcc.apb1enr().modify(|_, w| w.spi3en().enabled());
        rcc.apb1enr().read();
        // 28.3.3: master, 16 bits, chip select by software, data taken at the second edge of a clock that idles low; 42 MHz
        // by 16 is 2.6 MHz, of the 10 that the driver stands.
        spi.cr1().write(|w| {
            w.mstr().master();
            w.dff().sixteen_bit();
            w.ssm().enabled();
            w.ssi().slave_not_selected();
            w.cpol().idle_low();
            w.cpha().second_edge();
            w.br().div16();
            w.spe().enabled()
        });
        let driver = Drv8301::new(Bus::new(Port { spi, gpioc }), Enable { gpiob });
        Self { driver }
    }

    /// Turns the driver on and sets it up.
    pub fn enable(&mut self, delay: &mut Delay) -> Result<(), NotReady> {
        self.driver.enable(SETUP, delay)
    }
}

/// `EN_GATE`.
struct Enable {
    gpiob: GPIOB,
}

impl digital::ErrorType for Enable {
    type Error = Infallible;
}

impl OutputPin for Enable {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.gpiob.bsrr().write(|w| w.br12().reset());
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.gpiob.bsrr().write(|w| w.bs12().set_bit());
        Ok(())
    }
}

/// The bus with the driver's chip select.
type Bus = crate::driver::spi::Bus<Port>;

/// The bus's registers.
struct Port {
    spi: SPI3,
    gpioc: GPIOC,
}

impl Registers for Port {
    fn select(&mut self, selected: bool) {
        self.gpioc.bsrr().write(|w| {
            if selected {
                w.br13().reset()
            } else {
                w.bs13().set_bit()
            }
        });
    }

    fn put(&mut self, word: u16) {
        self.spi.dr().write(|w| w.dr().set(word));
    }

    fn is_received(&self) -> bool {
        self.spi.sr().read().rxne().bit_is_set()
    }

    fn take(&mut self) -> u16 {
        self.spi.dr().read().dr().bits()
    }

    fn rest(&mut self) {
        cortex_m::asm::delay(200);
    }
}

/// Waits by the system timer.
pub struct Delay<'a> {
    timer: &'a mut SYST,
    /// Ticks a microsecond.
    megahertz: u32,
}

impl<'a> Delay<'a> {
    /// Waits by a timer that runs at the processor's frequency.
    pub fn new(timer: &'a mut SYST, frequency: u32) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        Self {
            timer,
            megahertz: frequency / 1_000_000,
        }
    }
}

impl DelayNs for Delay<'_> {
    fn delay_ns(&mut self, ns: u32) {
        // Whole microseconds, rounded up; one at a time never overflows the 24 bits of the timer.
        for _ in 0..ns.div_ceil(1000) {
            self.timer.set_reload(self.megahertz);
            self.timer.clear_current();
            self.timer.enable_counter();
            while !self.timer.has_wrapped() {}
            self.timer.disable_counter();
        }
    }
}
