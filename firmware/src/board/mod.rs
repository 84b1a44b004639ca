//! The boards, and which of them this is.
//!
//! Both are the same chip, an STM32F405, so one image serves both, and what the tests run is what is flashed:
//!
//! - [`emulated`]: QEMU's model of the chip (`netduinoplus2`), which has neither clock tree, converters nor bridge. The
//!   host plays them: a sensor frame takes the place of the converter's interrupt, and a report that of the bridge.
//! - [`odrive_v3`]: the motor driver.
//!
//! Register names and section numbers refer to ST's reference manual RM0090.

pub mod emulated;
pub mod odrive_v3;
mod serial;

pub use serial::Serial;
pub use stm32f4::stm32f405 as device;

use core::mem::MaybeUninit;

use bristle_core::drive::store::{self, Places, Stored};
use bristle_core::drive::{
    Actuation, Drive, Fault, Faults, Mailbox, News, Parameters, Refusal, Sample,
};
use bristle_core::link::{
    Answer, Board as Kind, Hello, Injection, Numbers, PROTOCOL_VERSION, Report,
};
use embedded_storage::nor_flash::NorFlash;

use crate::outbox::Postbox;
use emulated::Persistent;

/// Turns the bridge off, from any context and whatever state the program is in.
pub fn enter_safe_state() {
    odrive_v3::bridge_off();
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
            port: Serial::new(device.UART4, &device.GPIOA, &device.RCC, clock),
            hardware: None,
            storage: Storage::Emulated(flash),
            faults,
            fast: emulated::is_fast(),
        }
    }

    /// The greeting of this board, whose recordings hold `ring` words.
    pub fn hello(&self, ring: usize) -> Hello {
        let part = |text: &str| text.parse().unwrap_or(0);
        Hello {
            protocol: PROTOCOL_VERSION,
            version: [
                part(env!("CARGO_PKG_VERSION_MAJOR")),
                part(env!("CARGO_PKG_VERSION_MINOR")),
                part(env!("CARGO_PKG_VERSION_PATCH")),
            ],
            build: build(),
            board: match self.hardware {
                None => Kind::Emulated,
                Some(_) => Kind::OdriveV3,
            },
            numbers: Numbers::F32,
            ring: ring as u32,
        }
    }
}

/// The CRC-32 of the image, from the vector table to the initial values of variables.
#[allow(unsafe_code)]
fn build() -> u32 {
    unsafe extern "C" {
        static __vector_table: u8;
        static __sidata: u8;
        static __sdata: u8;
        static __edata: u8;
    }
    let start = &raw const __vector_table;
    let data = (&raw const __edata as usize).wrapping_sub(&raw const __sdata as usize);
    let end = (&raw const __sidata as usize).wrapping_add(data);
    let length = end.wrapping_sub(start as usize);
    // SAFETY: the linker script puts all of this into flash, one section behind the other, and nothing writes there
    // while the image runs.
    let image = unsafe { core::slice::from_raw_parts(start, length) };
    store::checksum(image)
}

/// What the control task works on.
pub enum Hardware {
    /// The host has sensors and bridge.
    Emulated(Postbox),
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
            Self::Emulated(postbox) => {
                // The host sends no sample before it has this, so there is room.
                postbox.try_send(&Report::Actuation {
                    period: drive.snapshot().period,
                    input: actuation.input,
                    bridge: actuation.bridge,
                    faults: drive.faults(),
                });
            }
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
    pub fn load(&mut self, mut faults: Faults) -> (Parameters<f32>, Faults) {
        let stored = match self {
            Self::Emulated(flash) => store::load(flash, emulated::PLACES),
            Self::OdriveV3(flash) => store::load(flash, odrive_v3::PLACES),
        };
        faults.raise_if(Fault::CorruptParameters, stored == Stored::Corrupt);
        match stored {
            Stored::Parameters(parameters) => (parameters, faults),
            Stored::Nothing | Stored::Corrupt => (Parameters::harmless(), faults),
        }
    }

    /// Writes parameters and reads them back.
    pub fn save(&mut self, parameters: &Parameters<f32>) -> Answer<f32> {
        fn answer(
            flash: &mut impl NorFlash,
            places: Places,
            parameters: &Parameters<f32>,
        ) -> Answer<f32> {
            match store::save(flash, places, parameters) {
                Ok(()) => Answer::Done,
                Err(store::WriteFailed) => Answer::Refused(Refusal::WriteFailed),
            }
        }
        match self {
            Self::Emulated(flash) => answer(flash, emulated::PLACES, parameters),
            Self::OdriveV3(flash) => answer(flash, odrive_v3::PLACES, parameters),
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
