//! The current loop within a control period, and what it remembers from one to the next.

use super::{Number, Parameters, Reading, legs};
use crate::control::{Electrical, Output};

/// A motor's winding, as the loop knows it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Winding<T> {
    /// Integral part of the loop, V.
    sum: T,
    /// Current asked for and measured in the last period, A.
    wanted: T,
    current: T,
    /// What the limits took off the voltage then, V.
    excess: T,
}

impl<T: Number> Winding<T> {
    /// Without current.
    pub const fn new() -> Self {
        Self {
            sum: T::ZERO,
            wanted: T::ZERO,
            current: T::ZERO,
            excess: T::ZERO,
        }
    }

    /// By how much the current was beyond what had been asked for since the last period, in the mean of its ends, A; and of
    /// which sign the voltage was that could not be applied.
    #[inline]
    pub fn off(&self, current: T) -> (T, T) {
        ((self.current + current).half() - self.wanted, self.excess)
    }

    /// What drives the axis: the voltage of the loop, or without one what the control law asks for.
    #[inline]
    pub fn input(&mut self, set: &Parameters<T>, reading: &Reading<T>, output: &Output<T>) -> T {
        let Some(current) = &set.current else {
            return output.command;
        };
        let at = Electrical {
            wanted: output.command,
            current: reading.current,
            velocity: output.velocity,
            available: legs::most(reading.bus),
        };
        let (voltage, excess) = current.step(&mut self.sum, at);
        (self.wanted, self.current, self.excess) = (at.wanted, at.current, excess);
        voltage
    }
}
