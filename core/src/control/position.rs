//! Where an axis stands.

use serde::{Deserialize, Serialize};

use crate::Scalar;

/// A position in encoder counts: whole ones and a part of one.
///
/// A single number would lose its resolution far from zero in `f32` and its range in fixed point; the whole counts
/// do not. They wrap, as the counter of an encoder does, and only differences of positions reach the arithmetic.
///
/// ```
/// use bristle_core::control::Position;
/// let far = Position::<f32>::at(i32::MAX);
/// let further = far.moved(1.25);
/// assert_eq!(further.minus(far), 1.25);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Position<T> {
    /// Whole counts.
    pub counts: i32,
    /// What is to be added to them, from 0 to 1.
    pub fraction: T,
}

impl<T: Scalar> Position<T> {
    /// A whole number of counts.
    pub fn at(counts: i32) -> Self {
        Self {
            counts,
            fraction: T::ZERO,
        }
    }

    /// A number of counts, for configuration on a host.
    pub fn from_f64(counts: f64) -> Self {
        let whole = Scalar::floor(counts);
        Self {
            counts: whole,
            fraction: T::from_f64(counts - f64::from(whole)),
        }
    }

    /// The position `by` counts further.
    #[must_use]
    #[inline]
    pub fn moved(self, by: T) -> Self {
        let (carry, fraction) = (self.fraction + by).split();
        Self {
            counts: self.counts.wrapping_add(carry),
            fraction,
        }
    }

    /// Counts from `other` to here.
    #[must_use]
    #[inline]
    pub fn minus(self, other: Self) -> T {
        T::from_i32(self.counts.wrapping_sub(other.counts)) + (self.fraction - other.fraction)
    }

    /// Counts from here to a whole number of counts.
    #[must_use]
    #[inline]
    pub fn short_of(self, counts: i32) -> T {
        T::from_i32(counts.wrapping_sub(self.counts)) - self.fraction
    }
}

#[cfg(test)]
mod tests {
    use super::Position;
    use crate::scalar::{Q16, Scalar};

    fn walk<T: Scalar>(tolerance: f64) {
        // 30 000 steps of −0.37 counts from where the counter wraps.
        let start = Position::<T>::at(i32::MIN + 5);
        let mut at = start;
        for _ in 0..30_000 {
            at = at.moved(T::from_f64(-0.37));
            assert!(at.fraction >= T::ZERO && at.fraction <= T::ONE);
        }
        let gone = at.minus(start).to_f64();
        assert!((gone + 11_100.0).abs() < tolerance, "{gone}");
    }

    #[test]
    fn a_position_keeps_its_resolution_wherever_it_is() {
        // A step errs by half a unit in the last place of a number below 1.37, the difference by one of its own.
        walk::<f64>(30_000.0 * 2f64.powi(-52) + 1e-11);
        walk::<f32>(30_000.0 * 2f64.powi(-23) + 2f64.powi(-10));
        walk::<Q16>(30_000.0 * 2f64.powi(-17));
    }

    #[test]
    fn numbers_of_either_sign_are_split_downwards() {
        let position = Position::<f64>::from_f64(-2.25);
        assert_eq!((position.counts, position.fraction), (-3, 0.75));
    }
}
