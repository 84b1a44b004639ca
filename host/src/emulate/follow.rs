//! From a test signal to set points.

use bristle_core::control::SetPoint;
use bristle_core::drive::Number;
use bristle_core::friction::Units;

use super::run::{position, velocity};

/// What follows a test signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Follow {
    /// `u` itself, with the controllers off.
    Input,
    /// Velocity, under control.
    Velocity,
    /// Position, under control.
    Position,
}

impl Follow {
    /// The set points along a signal of `rate` samples a second, in the unit of `u`, in rad/s or m/s, or in rad or m, for an
    /// encoder whose count is `count` rad or m. Only of a `smooth` one are the rates fed forward: corners have none.
    pub fn set_points<T: Number>(
        self,
        signal: &[f64],
        (rate, smooth): (f64, bool),
        count: f64,
        units: &Units,
    ) -> Vec<SetPoint<T>> {
        let rates = |k: usize| {
            let at = |k: usize| signal[k.min(signal.len() - 1)];
            if smooth && k > 0 {
                let (before, now, after) = (at(k - 1), at(k), at(k + 1));
                let first = 0.5 * (after - before) * rate;
                (first, (after - 2.0 * now + before) * rate * rate)
            } else {
                (0.0, 0.0)
            }
        };
        let set_point = |k: usize| match self {
            Self::Input => SetPoint::Command(T::from_f64(signal[k])),
            Self::Velocity => velocity(signal[k], rates(k).0, units),
            Self::Position => position(signal[k], rates(k), count, units),
        };
        (0..signal.len()).map(set_point).collect()
    }
}
