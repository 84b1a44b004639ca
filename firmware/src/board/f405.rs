//! The STM32F405: `odrive_v3` and QEMU's model of the chip, in one image.
//!
//! Register names and section numbers refer to ST's reference manual RM0090.

use core::mem::MaybeUninit;

use bristle_core::drive::store;
use bristle_core::drive::{
    Actuation, Drive, Fault, Faults, Mailbox, News, Parameters, Refusal, Sample,
};
use bristle_core::link::{self, Answer, Board as Kind, Hello, Injection, Numbers};

use super::emulated::{self, Persistent};
use super::{Serial, device, greeting, odrive_v3};
use crate::outbox::Actuations;

/// Bytes that the fast transport takes at once.
pub const BLOCK: usize = 512;

/// Turns the bridge off, from any context and whatever state the program is in.
pub fn enter_safe_state() {
    odrive_v3::bridge_off();
}

/// Notes that the clock security system has stopped the crystal (7.2.7). The timer's break has turned the outputs off in
/// hardware, and the control task finds the clock on the internal oscillator and raises the fault.
pub fn non_maskable() {
    enter_safe_state();
    odrive_v3::acknowledge_clock_failure();
}

/// What is there after the start.
pub struct Board {
    /// The port of the link.
    pub port: Serial,
    /// Sensors and bridge; none in the emulator, where they are the link's.
    pub hardware: Option<odrive_v3::Power>,
    /// Where parameters are kept.
    pub storage: Storage,
    /// What is wrong already.
    pub faults: Faults,
    /// Whether the host asked for the fast transport.
    pub fast: bool,
}

impl Board {
    /// Starts whatever this is, with the bridge off.
    pub fn start(
        device: device::Peripherals,
        core: cortex_m::Peripherals,
        persistent: &'static mut MaybeUninit<Persistent>,
    ) -> Self {
        if !emulated::is_emulated() {
            return odrive_v3::start(device, core);
        }
        let mut flash = Persistent::recover(persistent);
        let mut faults = Faults::NONE;
        faults.raise_if(Fault::Watchdog, flash.take_watchdog());
        let clock = emulated::CLOCK_HZ;
        Self {
            port: serial_port(device.UART4, &device.GPIOA, &device.RCC, clock),
            hardware: None,
            storage: Storage::Emulated(flash),
            faults,
            fast: emulated::is_fast(),
        }
    }

    /// The greeting of this board, whose recordings hold `ring` words.
    pub fn hello(&self, ring: usize) -> Hello {
        let kind = match self.hardware {
            None => Kind::Emulated,
            Some(_) => Kind::OdriveV3,
        };
        greeting(kind, Numbers::F32, ring)
    }
}

/// The link's port: UART4 on PA0 (TX) and PA1 (RX). `clock` is the frequency of APB1, Hz.
pub fn serial_port(
    port: device::UART4,
    gpio: &device::GPIOA,
    rcc: &device::RCC,
    clock: u32,
) -> Serial {
    // A peripheral answers only two cycles after its clock is enabled (errata sheet ES0182): the read of the
    // second enable register covers the port, and the pin setup covers the UART.
    rcc.ahb1enr().modify(|_, w| w.gpioaen().enabled());
    rcc.apb1enr().modify(|_, w| w.uart4en().enabled());
    // The alternate function first (8.4.9; datasheet DS8626, table 9: AF8 is UART4): the pins must not switch to
    // one that is not yet chosen.
    gpio.afrl().modify(|_, w| w.afrl0().af8().afrl1().af8());
    // An open RX line must read idle and not noise.
    gpio.pupdr().modify(|_, w| w.pupdr1().pull_up());
    gpio.moder()
        .modify(|_, w| w.moder0().alternate().moder1().alternate());
    Serial::new(port, clock)
}

/// What the control task works on.
pub enum Hardware {
    /// The host has sensors and bridge.
    Emulated(Actuations),
    /// The board has.
    OdriveV3(odrive_v3::Power),
}

impl Hardware {
    /// What this period brings, if it brings a sample.
    pub fn sample(&mut self, mailbox: &mut Mailbox<f32>) -> (Option<Sample>, News<f32>) {
        match self {
            Self::Emulated(_) => (mailbox.take_sample(), mailbox.take_news()),
            Self::OdriveV3(power) => {
                let news = mailbox.take_news();
                let missed = power.take_missed();
                (Some(power.sample()), News { missed, ..news })
            }
        }
    }

    /// Drives the bridge. Faults that only the hardware knows are raised for the next period.
    pub fn actuate(&mut self, drive: &mut Drive<f32>, actuation: &Actuation<f32>) {
        match self {
            Self::Emulated(actuations) => actuations.send(&link::actuation(drive, actuation)),
            Self::OdriveV3(power) => {
                if power.clock_failed() {
                    drive.raise(Fault::Clock);
                }
                let legs = drive.legs(actuation, odrive_v3::TOP);
                power.drive(legs.filter(|_| drive.faults().is_empty()));
            }
        }
    }
}

/// Where parameters are kept.
pub enum Storage {
    /// In memory that survives a restart.
    Emulated(emulated::Flash),
    /// In the last two sectors of the flash.
    OdriveV3(odrive_v3::Flash),
}

impl Storage {
    /// The parameters to begin with, and the faults with those found now.
    pub fn load(&mut self, faults: Faults) -> (Parameters<f32>, Faults) {
        match self {
            Self::Emulated(flash) => store::boot(flash, emulated::PLACES, faults),
            Self::OdriveV3(flash) => store::boot(flash, odrive_v3::PLACES, faults),
        }
    }

    /// Writes parameters and reads them back.
    pub fn save(&mut self, parameters: &Parameters<f32>) -> Answer<f32> {
        match self {
            Self::Emulated(flash) => link::store(flash, emulated::PLACES, parameters),
            Self::OdriveV3(flash) => link::store(flash, odrive_v3::PLACES, parameters),
        }
    }

    /// Lets the hardware fail, if it is not real.
    pub fn inject(&mut self, injection: Injection) -> Answer<f32> {
        match self {
            Self::Emulated(flash) => {
                flash.inject(injection);
                Answer::Done
            }
            Self::OdriveV3(_) => Answer::Refused(Refusal::NotEmulated),
        }
    }
}
