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
    /// The nearest representable value; what is out of range saturates.
    fn from_i32(value: i32) -> Self;
    /// The largest integer that is not above the value; what is out of range saturates, and NaN becomes zero.
    fn floor(self) -> i32;
    /// The value as [`Scalar::floor`] and what is left of it, from 0 to 1.
    #[must_use]
    #[inline]
    fn split(self) -> (i32, Self) {
        let whole = self.floor();
        (whole, self - Self::from_i32(whole))
    }
    /// Half of the value, rounded down in fixed point.
    #[must_use]
    fn half(self) -> Self;
    /// The share of a whole that a value from 0 to 1 says, cut to an integer.
    #[must_use]
    fn share_of(self, whole: u32) -> u32;
    /// Sine and cosine of `phase`·2π/2³²: a whole turn is the range of the number, so that a phase may wrap.
    #[must_use]
    fn wave(phase: u32) -> (Self, Self);
    /// Whether the value is a number, and not infinite.
    #[must_use]
    fn is_finite(self) -> bool {
        // Infinity and NaN are what zero does not annul.
        self * Self::ZERO == Self::ZERO
    }
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

    /// `self + a·b`. Fixed point rounds the sum alone. Floating point rounds the product as well: a host may not have what
    /// a target fuses.
    #[must_use]
    #[inline]
    fn plus_product(self, a: Self, b: Self) -> Self {
        self + a * b
    }

    /// The product with a whole number, which need not be in range itself.
    #[must_use]
    #[inline]
    fn times(self, count: i32) -> Self {
        self * Self::from_i32(count)
    }

    /// One over the value.
    #[must_use]
    #[inline]
    fn reciprocal(self) -> Self {
        Self::ONE / self
    }

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

    /// The value limited to `[-bound, bound]`, for a bound that is not negative.
    #[must_use]
    #[inline]
    fn clamp_symmetric(self, bound: Self) -> Self {
        // The usual case by one comparison: each takes four instructions where there is no minimum and maximum.
        if self.abs() > bound {
            if self > Self::ZERO { bound } else { -bound }
        } else {
            self
        }
    }

    /// How far the value lies outside of `[-bound, bound]`, with its sign: what [`Scalar::clamp_symmetric`] takes off.
    #[must_use]
    #[inline]
    fn beyond(self, bound: Self) -> Self {
        if self.abs() <= bound {
            Self::ZERO
        } else if self > Self::ZERO {
            self - bound
        } else {
            self + bound
        }
    }
}

/// The nearest quarter of a turn, from 0 to 3, and the rest of a phase as at most 2²⁹ to either side.
#[inline]
fn quarter(phase: u32) -> (u32, i32) {
    let quarter = phase.wrapping_add(1 << 29) >> 30;
    (quarter, phase.wrapping_sub(quarter << 30) as i32)
}

/// Sine and cosine of a rest, turned by quarters.
#[inline]
fn turned<T: Scalar>(quarter: u32, (sine, cosine): (T, T)) -> (T, T) {
    match quarter {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

#[cfg(test)]
mod tests {
    use super::Scalar;

    /// The largest error of sine and cosine over phases of no special form.
    fn wave_error<T: Scalar>() -> f64 {
        let phases = (0..200_000_u32).map(|k| k.wrapping_mul(2_654_435_761));
        let errors = phases.map(|phase| {
            let exact = f64::from(phase) / 2f64.powi(32) * core::f64::consts::TAU;
            let (sine, cosine) = T::wave(phase);
            let off = (sine.to_f64() - libm::sin(exact)).abs();
            off.max((cosine.to_f64() - libm::cos(exact)).abs())
        });
        errors.fold(0.0, f64::max)
    }

    #[test]
    fn waves_err_by_their_rounding_alone() {
        assert!(wave_error::<f64>() < 4.0 * f64::EPSILON);
        // Four roundings of a value below one, and the remainder 2·10⁻⁸ of the cosine.
        assert!(wave_error::<f32>() < 4.0 * 2f64.powi(-24) + 3e-8);
        // Half a unit in the last place, and 2⁻²¹ of remainder.
        assert!(wave_error::<super::Q16>() < 2f64.powi(-17) + 2f64.powi(-21));
        assert_eq!(f32::wave(1 << 30), (1.0, 0.0));
        assert_eq!(f32::wave(1 << 31), (0.0, -1.0));
    }

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

    /// Floor and back for one type, at integers, halves and their neighbours.
    fn floors<S: Scalar>() {
        for whole in [-30_000, -2, -1, 0, 1, 2, 29_999] {
            let x = S::from_i32(whole);
            let half = S::from_f64(0.5);
            assert_eq!(x.to_f64(), f64::from(whole));
            assert_eq!((x.floor(), (x + half).floor()), (whole, whole));
            assert_eq!((x - S::from_f64(0.01)).floor(), whole - 1);
            assert!(Scalar::is_finite(x));
        }
    }

    #[test]
    fn floor_goes_down_on_both_sides_of_zero() {
        floors::<f64>();
        floors::<f32>();
        floors::<super::Q16>();
        assert_eq!(Scalar::floor(f32::NAN), 0);
        assert_eq!(Scalar::floor(1e20_f64), i32::MAX);
        assert_eq!(Scalar::floor(-1e20_f32), i32::MIN);
        assert_eq!(super::Q16::from_i32(i32::MIN), super::Q16::MIN);
        assert!(!Scalar::is_finite(f32::NAN) && !Scalar::is_finite(f64::NEG_INFINITY));
    }

    /// Parts of one type on both sides of zero, against `floor` and whole numbers.
    fn parts<S: Scalar>(resolution: f64) {
        for k in -2000..2000 {
            let x = S::from_f64(f64::from(k) * 0.0137);
            let (whole, part) = x.split();
            let rest = x.to_f64() - f64::from(whole);
            assert_eq!(whole, x.floor());
            assert!((part.to_f64() - rest).abs() <= resolution && part <= S::ONE);
            let share = f64::from(part.share_of(3 << 20));
            assert!((share - part.to_f64() * f64::from(3 << 20)).abs() < 1.5);
            let (bound, x) = (S::from_f64(10.0), x.to_f64());
            let beyond = S::from_f64(x).beyond(bound).to_f64();
            assert!((beyond - (x - x.clamp(-10.0, 10.0))).abs() <= resolution);
        }
        assert_eq!(S::ONE.share_of(1 << 31), 1 << 31);
    }

    #[test]
    fn numbers_are_split_into_whole_and_part() {
        parts::<f64>(f64::EPSILON);
        parts::<f32>(2f64.powi(-24));
        parts::<super::Q16>(0.0);
        assert!(f32::NAN.split().1.is_nan() && f64::NAN.beyond(1.0).is_nan());
    }

    #[test]
    fn square_root_of_a_rounding_error_is_zero() {
        assert!(Scalar::sqrt(-1e-18_f64) == 0.0);
    }
}
