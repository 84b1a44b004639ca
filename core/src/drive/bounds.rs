//! What an axis must not leave while it is excited: checked on the board, as a host may hang.

use serde::{Deserialize, Serialize};

use super::fault::{Fault, Faults};
use super::{Number, Reading};

/// Bounds of one run, from the command that turns the axis on until it is off again.
///
/// Travel is that of the encoder and speed that of the controller's observer. Beyond either, and beyond the current, the
/// bridge goes off in the same period, and the axis coasts from there: leave room for that. `u` is cut, and the axis runs on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds<T> {
    /// Most encoder counts either way from where the axis was turned on.
    pub travel: u32,
    /// Largest velocity either way, rad/s or m/s.
    pub speed: T,
    /// Largest `|u|`, in the unit of `u`; `control.command_limit` holds as well.
    pub input: T,
    /// Largest motor current either way, A; `limits.current` holds as well.
    pub current: T,
}

impl<T: Number> Bounds<T> {
    /// Whether every number is finite and positive, so that each bound can be left.
    pub fn is_valid(&self) -> bool {
        let positive = [self.speed, self.input, self.current];
        self.travel > 0 && positive.into_iter().all(|x| x.is_sound() && x > T::ZERO)
    }
}

/// Bounds, and where the axis was turned on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Confines<T> {
    pub bounds: Bounds<T>,
    /// What the encoder had counted.
    pub origin: i32,
}

impl<T: Number> Confines<T> {
    /// What a sample is beyond. The counter may wrap on the way.
    #[inline]
    pub fn check(&self, total: i32, reading: &Reading<T>) -> Faults {
        let way = total.wrapping_sub(self.origin).unsigned_abs();
        let mut faults = Faults::NONE;
        faults.raise_if(Fault::Travel, way > self.bounds.travel);
        let current = reading.current.abs();
        faults.raise_if(Fault::Overcurrent, current > self.bounds.current);
        faults
    }

    /// Whether an axis is too fast.
    #[inline]
    pub fn is_passed_by(&self, velocity: T) -> bool {
        velocity.abs() > self.bounds.speed
    }
}
