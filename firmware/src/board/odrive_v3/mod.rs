//! `ODrive` v3.5 and v3.6, motor M0: a brushed motor across phases B and C.
//!
//! **Never run on silicon yet.** It compiles, its drivers are tested against mocks, and it was written along the
//! reference manual; that is all.
//!
//! | pin | function | peripheral |
//! | --- | --- | --- |
//! | PA0, PA1 | link: `GPIO 1` is TX, `GPIO 2` RX | UART4, AF8 |
//! | PA9, PB14 | phase B, high and low side | TIM1 CH2, CH2N, AF1 |
//! | PA10, PB15 | phase C, high and low side | TIM1 CH3, CH3N, AF1 |
//! | PA8, PB13 | phase A: kept low, for a three-phase motor later | |
//! | PB12 | `EN_GATE` of the gate driver DRV8301 | output |
//! | PD2 | `nFAULT` of it, open drain | input, pull-up |
//! | PC13 | its chip select | output |
//! | PC10, PC11, PC12 | its SPI: SCK, MISO, MOSI | SPI3, AF6 |
//! | PB4, PB5 | encoder A and B | TIM3, AF2 |
//! | PC0 | current of phase B, by its low-side shunt | ADC1 IN10 |
//! | PA6 | bus voltage over a divider (19 to 1 on 56 V boards) | ADC1 IN6 |
//!
//! The board's DIP switch `DFU` pulls BOOT0 up: a reset then starts the chip's loader, which `dfu-util` talks to.
//!
//! # What turns the bridge off
//! The timer's main output bit is off from reset on, and on only while the drive says so. The gate driver turns its
//! transistors off by itself on a fault, and tells by `nFAULT`, which each period reads. Neither of the timer's break
//! pins is wired on this board; its break is fed by the clock security system alone (17.4.18, BKE): when the crystal
//! stops, the outputs go off in hardware. The independent watchdog resets the chip when the control task stops.
//!
//! # Order of the start
//! Gate driver off, clock, timer with its outputs off, encoder, gate driver on and set up over SPI and read
//! back, converter, watchdog. The first control period comes after all of it.

mod clock;
mod converter;
mod encoder;
mod flash;
mod gate;
mod pwm;
mod watchdog;

pub use clock::acknowledge_clock_failure;
pub use flash::{Flash, PLACES};
pub use pwm::{TOP, bridge_off};

use bristle_core::drive::{Fault, Faults, Sample};

use super::device::{GPIOB, GPIOC, GPIOD, Peripherals, RCC};
use super::{Board, Storage, serial_port};
use clock::Clock;
use converter::{Channels, Converter};
use encoder::Encoder;
use gate::Gate;
use pwm::{Bridge, Timer};

/// Everything that a control period touches.
pub struct Power {
    bridge: Bridge,
    converter: Converter,
    encoder: Encoder,
    clock: Clock,
    fault_pin: GPIOD,
    /// Whether the gate driver could be set up.
    gate_ready: bool,
    missed: bool,
}

/// Starts the board, with the bridge off.
pub fn start(device: Peripherals, mut core: cortex_m::Peripherals) -> Board {
    let mut faults = Faults::NONE;
    // 7.3.21: the cause of the reset is kept until it is cleared.
    let was_watchdog = device.RCC.csr().read().wdgrstf().bit_is_set();
    device.RCC.csr().modify(|_, w| w.rmvf().set_bit());
    faults.raise_if(Fault::Watchdog, was_watchdog);
    let Peripherals {
        RCC: rcc,
        GPIOA: gpioa,
        GPIOB: gpiob,
        GPIOC: gpioc,
        GPIOD: gpiod,
        ..
    } = device;
    start_ports(&rcc, &gpiob, &gpioc);
    let clock = Clock::start(rcc, &device.FLASH, &device.PWR);
    faults.raise_if(Fault::Clock, clock.has_failed());
    let rcc = clock.rcc();
    let port = serial_port(device.UART4, &gpioa, rcc, clock.apb1_hz());
    let bridge = Bridge::new(Timer::off(device.TIM1, rcc, &gpioa, &gpiob));
    let encoder = Encoder::start(device.TIM3, rcc, &gpiob);
    let converter = Converter::new(Channels::start(device.ADC1, rcc, &gpioa, &gpioc));
    // 8.4.4: nFAULT is open drain.
    gpiod.pupdr().modify(|_, w| w.pupdr2().pull_up());
    let mut delay = gate::Delay::new(&mut core.SYST, clock.cpu_hz());
    let mut gate = Gate::off(device.SPI3, rcc, gpiob, gpioc);
    let gate_ready = gate.enable(&mut delay).is_ok();
    faults.raise_if(Fault::GateDriver, !gate_ready);
    let power = Power {
        bridge,
        converter,
        encoder,
        clock,
        fault_pin: gpiod,
        gate_ready,
        missed: false,
    };
    watchdog::set(watchdog::Patience::Running);
    Board {
        port,
        hardware: Some(power),
        storage: Storage::OdriveV3(flash::start(device.FLASH)),
        faults,
        fast: false,
    }
}

/// Clocks of all ports (7.3.10), and the gate driver off before anything else: the level first (8.4.7), then the
/// direction.
fn start_ports(rcc: &RCC, gpiob: &GPIOB, gpioc: &GPIOC) {
    rcc.ahb1enr().modify(|_, w| {
        w.gpioaen().enabled();
        w.gpioben().enabled();
        w.gpiocen().enabled();
        w.gpioden().enabled()
    });
    // ES0182: two cycles until the ports answer.
    rcc.ahb1enr().read();
    gpiob.bsrr().write(|w| w.br12().reset());
    gpiob.moder().modify(|_, w| w.moder12().output());
    gpioc.bsrr().write(|w| w.bs13().set_bit());
    gpioc.moder().modify(|_, w| w.moder13().output());
}

impl Power {
    /// The readings of this period.
    pub fn sample(&mut self) -> Sample {
        watchdog::feed();
        let (current, bus) = self.converter.read();
        Sample {
            count: self.encoder.count(),
            current,
            bus,
            gate_fault: !self.gate_ready || self.fault_pin.idr().read().idr2().is_low(),
        }
    }

    /// Sets the compare values of phases B and C and turns the bridge on, or off without them.
    pub fn drive(&mut self, legs: Option<[u16; 2]>) {
        match legs {
            Some(legs) => self.bridge.drive(legs),
            None => self.bridge.off(),
        }
        // A conversion that is done before this one's step was is a missed period.
        self.missed = self.converter.is_done();
    }

    /// Whether the period before this one was missed.
    pub fn take_missed(&mut self) -> bool {
        core::mem::take(&mut self.missed)
    }

    /// Whether the crystal has stopped.
    pub fn clock_failed(&self) -> bool {
        self.clock.has_failed()
    }
}
