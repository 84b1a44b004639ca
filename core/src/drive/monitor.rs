//! Finds faults in the samples of a period and in what did not come.

use super::fault::{Fault, Faults};
use super::parameters::Limits;
use super::{News, Number};

/// The sample of a period in its units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<T> {
    /// Counts that the encoder moved since the last period.
    pub moved: i16,
    /// Motor current, A.
    pub current: T,
    /// Bus voltage, V.
    pub bus: T,
    /// Whether the gate driver pulls its fault line.
    pub gate_fault: bool,
}

/// Counts the periods of what is overdue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Monitor {
    command: u16,
    link: u16,
    stalled: u16,
}

impl Monitor {
    /// Nothing is overdue.
    pub const fn new() -> Self {
        Self {
            command: 0,
            link: 0,
            stalled: 0,
        }
    }

    /// What is wrong in this period. `input` is what drove the axis since the last one, if it was running.
    #[inline]
    pub fn check<T: Number>(
        &mut self,
        limits: &Limits<T>,
        reading: &Reading<T>,
        news: &News<T>,
        input: Option<T>,
    ) -> Faults {
        let mut faults = Faults::NONE;
        let jumped = reading.moved.unsigned_abs() > limits.jump;
        faults.raise_if(Fault::EncoderJump, jumped);
        faults.raise_if(Fault::Overcurrent, reading.current.abs() > limits.current);
        faults.raise_if(Fault::Overvoltage, reading.bus > limits.bus_max);
        faults.raise_if(Fault::GateDriver, reading.gate_fault);
        match input {
            Some(input) => faults.and(self.powered(limits, reading, news, input)),
            None => {
                *self = Self::new();
                faults
            }
        }
    }

    /// What only matters to an axis under power. With the bridge off a period may be missed, as while the flash is
    /// written, and nobody need speak.
    #[inline]
    fn powered<T: Number>(
        &mut self,
        limits: &Limits<T>,
        reading: &Reading<T>,
        news: &News<T>,
        input: T,
    ) -> Faults {
        age(&mut self.command, news.set_point.is_none());
        age(&mut self.link, !news.heard && news.set_point.is_none());
        let stalled = reading.moved == 0 && input.abs() > limits.stall;
        age(&mut self.stalled, stalled);
        let overdue = |waited: u16, limit: u16| limit > 0 && waited > limit;
        let mut faults = Faults::NONE;
        faults.raise_if(
            Fault::StaleCommand,
            overdue(self.command, limits.command_timeout),
        );
        faults.raise_if(Fault::LinkLoss, overdue(self.link, limits.link_timeout));
        faults.raise_if(Fault::EncoderLoss, self.stalled >= limits.stall_periods);
        faults.raise_if(Fault::Undervoltage, reading.bus < limits.bus_min);
        faults.raise_if(Fault::Overrun, news.missed);
        faults
    }
}

/// Counts on while something lasts.
#[inline]
fn age(counter: &mut u16, lasts: bool) {
    *counter = if lasts { counter.saturating_add(1) } else { 0 };
}
