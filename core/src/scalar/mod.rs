//! The arithmetic that the laws and estimators are written in.
//!
//! `f64` is the reference, `f32` is what a controller with a floating-point unit runs, and [`Q16`] is for one without.
//! The trait asks for nothing that a saturating fixed-point type could not give: no NaN, no infinity, no
//! conversion back and forth inside a law. Transcendental functions are pure Rust, from `libm` or here, and give
//! the same bits on the host and on the target. All rounding is in this folder; every function states its bound.

mod fixed;
mod float;

pub use fixed::Q16;

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A real number, rounded as the implementing type rounds.
pub trait Scalar:
    Copy
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// The additive identity.
    const ZERO: Self;
    /// The multiplicative identity.
    const ONE: Self;

    /// The distance from one to the next larger value.
    const EPSILON: Self;

    /// The nearest representable value. Meant for constants and configuration, not for the control path.
    fn from_f64(value: f64) -> Self;
    /// The value as the reference type.
    fn to_f64(self) -> f64;
    /// The non-negative square root; zero for negative arguments that stem from rounding.
    #[must_use]
    fn sqrt(self) -> Self;
    /// The natural exponential.
    #[must_use]
    fn exp(self) -> Self;

    /// `(1 − e^(−x), (1 − e^(−x))/x)` for `x ≥ 0`: how far a first-order lag gets in `x` time constants, and the
    /// mean of what is left to go meanwhile. Both keep their precision at `x → 0`, where they are `(x, 1)`.
    #[must_use]
    fn relax(self) -> (Self, Self);

    /// `√(a² + b²)` without overflow of the squares.
    #[must_use]
    fn hypot(self, other: Self) -> Self {
        let (a, b) = (self.abs(), other.abs());
        let (large, small) = if a > b { (a, b) } else { (b, a) };
        if large == Self::ZERO {
            return Self::ZERO;
        }
        let ratio = small / large;
        large * (Self::ONE + ratio * ratio).sqrt()
    }

    /// The absolute value.
    #[must_use]
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }

    /// −1, 0 or +1. Unlike the sign *bit*, the sign of zero is zero: an axis at rest has no direction.
    #[must_use]
    fn sign(self) -> Self {
        if self > Self::ZERO {
            Self::ONE
        } else if self < Self::ZERO {
            -Self::ONE
        } else {
            Self::ZERO
        }
    }

    /// The value limited to `[-bound, bound]`.
    #[must_use]
    fn clamp_symmetric(self, bound: Self) -> Self {
        if self > bound {
            bound
        } else if self < -bound {
            -bound
        } else {
            self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Scalar;

    #[test]
    fn sign_of_zero_is_zero_for_both_zeros() {
        assert!(Scalar::sign(0.0_f64) == 0.0 && Scalar::sign(-0.0_f32) == 0.0);
        assert!(Scalar::sign(-3.0_f64) == -1.0 && Scalar::sign(2.0_f32) == 1.0);
    }

    #[test]
    fn clamp_keeps_the_inside_and_limits_both_sides() {
        assert!(Scalar::clamp_symmetric(0.5_f64, 1.0) == 0.5);
        assert!(Scalar::clamp_symmetric(-7.0_f64, 1.0) == -1.0);
        assert!(Scalar::clamp_symmetric(7.0_f32, 1.0) == 1.0);
    }

    #[test]
    fn square_root_of_a_rounding_error_is_zero() {
        assert!(Scalar::sqrt(-1e-18_f64) == 0.0);
    }
}
