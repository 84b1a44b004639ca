//! The log: what a person wants to know of a run, with the control period in which it happened.
//!
//! With the feature `log`, each line is a frame of [defmt](https://defmt.ferrous-systems.com), whose text stays in the ELF
//! file. On a chip the frames go to the RTT channel that probe-rs reads, in the emulator to its error stream, which
//! `bristle emulate --log` decodes. Without the feature nothing is left of any of it.

use bristle_core::drive::{Drive, Faults, Number, Refusal, State};

#[cfg(feature = "log")]
mod sink;

#[cfg(feature = "log")]
pub use sink::start;

/// There is no log.
#[cfg(not(feature = "log"))]
pub const fn start() {}

/// Watches a drive, and logs what changes.
pub struct Watch {
    state: State,
    faults: Faults,
}

impl Watch {
    /// Nothing has been logged of a drive that begins with these faults.
    pub const fn new() -> Self {
        Self {
            state: State::Off,
            faults: Faults::NONE,
        }
    }

    /// Logs what has changed, after a period.
    #[inline]
    pub fn look<T: Number>(&mut self, drive: &Drive<T>) {
        if cfg!(feature = "log") {
            set_period(drive.snapshot().period);
            self.compare(drive.state(), drive.faults());
        }
    }

    fn compare(&mut self, state: State, faults: Faults) {
        for fault in faults.iter().filter(|f| !self.faults.contains(*f)) {
            failed(fault.number(), fault.page().id);
        }
        if state != self.state {
            changed(match state {
                State::Off => "off",
                State::Running => "running",
                State::Faulted => "faulted",
            });
        }
        (self.state, self.faults) = (state, faults);
    }
}

impl Default for Watch {
    fn default() -> Self {
        Self::new()
    }
}

/// Hands a line to defmt, if there is a log.
macro_rules! line {
    ($level:ident, $text:literal $(, $value:expr)*) => {{
        #[cfg(feature = "log")]
        defmt::$level!($text $(, $value)*);
        #[cfg(not(feature = "log"))]
        { $(let _ = $value;)* }
    }};
}

fn set_period(period: u32) {
    #[cfg(feature = "log")]
    sink::set_period(period);
    #[cfg(not(feature = "log"))]
    let _ = period;
}

fn failed(number: u8, id: &'static str) {
    line!(error, "fault {=u8}: {=str}", number, id);
}

fn changed(state: &'static str) {
    line!(info, "the drive is {=str}", state);
}

/// The board has started.
pub fn started(emulated: bool) {
    let place = if emulated {
        "in the emulator"
    } else {
        "on the board"
    };
    line!(info, "started {=str}", place);
}

/// Parameters were written to the flash.
pub fn stored() {
    line!(info, "parameters stored");
}

/// A command was refused.
pub fn refused(packet: u16, refusal: Refusal) {
    let why = match refusal {
        Refusal::Running => "the axis runs",
        Refusal::Faulted => "faults are latched",
        Refusal::Invalid => "a parameter is out of range",
        Refusal::NothingSelected => "no signal is selected",
        Refusal::WriteFailed => "the flash cannot be written",
        Refusal::NotEmulated => "only an emulated board does this",
        Refusal::Fixed => "something would change that must stay while the axis runs",
    };
    line!(warn, "packet {=u16} refused: {=str}", packet, why);
}
