//! Fixed point, for targets without a floating-point unit.

use core::fmt;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use serde::{Deserialize, Serialize};

use super::{Scalar, quarter, turned};

/// A multiple of 2⁻¹⁶ from −2¹⁵ up to 2¹⁵ − 2⁻¹⁶.
///
/// Arithmetic saturates and never wraps or panics: what is too large becomes the largest value of its sign, and
/// so does a quotient by zero (0/0 is 0). Products and quotients are rounded to nearest, sums are exact, so
/// every operation errs by at most 2⁻¹⁷ until it saturates, as does the sum of a number and a product. A law in this type wants units in which its numbers
/// lie around 1: see [`Units`](crate::friction::Units).
///
/// # Why not the crate `fixed`
/// One step of [`ModifiedLuGre`](crate::friction::ModifiedLuGre), measured with rustc 1.95 and QEMU 7.2 as
/// `core/benches/footprint/src/main.rs` says; both share the exponential, which `fixed` does not have:
///
/// | | this type | `I16F16` of `fixed` 1.31, saturating |
/// | --- | --- | --- |
/// | flash on Cortex-M4, with library calls | 1704 bytes | 2362 bytes |
/// | instructions a step on Cortex-M4 | 379 | 795 |
/// | million steps a second on a host | 16 | 24 |
/// | clean build on two shared cores | 19 s | 45 s |
/// | product and quotient | to nearest | rounded down |
///
/// The target decides, and there the division makes the difference: it takes two hardware divisions here and a
/// library call there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[repr(transparent)]
pub struct Q16(i32);

/// Fractional bits.
const FRACTION: u32 = 16;

impl Q16 {
    /// The largest value, 2¹⁵ − 2⁻¹⁶.
    pub const MAX: Self = Self(i32::MAX);
    /// The smallest value, −2¹⁵.
    pub const MIN: Self = Self(i32::MIN);

    /// The value `bits`·2⁻¹⁶.
    #[inline]
    pub const fn from_bits(bits: i32) -> Self {
        Self(bits)
    }

    /// The value in units of 2⁻¹⁶.
    #[inline]
    pub const fn to_bits(self) -> i32 {
        self.0
    }

    #[inline]
    fn saturate(bits: i64) -> Self {
        // Whether it fits is one comparison of halves, where a clamp takes two of whole numbers.
        let narrow = bits as i32;
        if i64::from(narrow) == bits {
            Self(narrow)
        } else {
            Self::end(bits < 0)
        }
    }

    /// The end of the range on a side. Out of the way, as numbers hardly ever come here.
    #[cold]
    const fn end(negative: bool) -> Self {
        if negative { Self::MIN } else { Self::MAX }
    }

    /// A sum with twice the fractional bits, to nearest.
    #[inline]
    fn rounded(wide: i64) -> Self {
        let wide = wide + (1 << (FRACTION - 1));
        // It fits if the upper half is one of 16 bits.
        let upper = (wide >> 32) as i32;
        if i32::from(upper as i16) == upper {
            Self((wide >> FRACTION) as i32)
        } else {
            Self::end(upper < 0)
        }
    }

    /// Whether the value lies in `[-bound, bound]`, by one comparison; a bound below zero counts as zero.
    #[inline]
    const fn is_within(self, bound: Self) -> bool {
        let bound = if bound.0 < 0 { 0 } else { bound.0 as u32 };
        (self.0 as u32).wrapping_add(bound) <= bound << 1
    }
}

impl fmt::Debug for Q16 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_f64().fmt(f)
    }
}

impl Add for Q16 {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for Q16 {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl Neg for Q16 {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(self.0.saturating_neg())
    }
}

impl Mul for Q16 {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self::rounded(i64::from(self.0) * i64::from(other.0))
    }
}

impl Div for Q16 {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let negative = (self.0 ^ other.0) < 0;
        let magnitude = match (self.0.unsigned_abs(), other.0.unsigned_abs()) {
            (0, _) => 0,
            (_, 0) => 1 << 31,
            (dividend, divisor) => divide(dividend, divisor),
        };
        Self(if negative {
            // 2³¹ is its own negative here, which is the smallest value.
            (magnitude as i32).wrapping_neg()
        } else {
            magnitude.min(i32::MAX as u32) as i32
        })
    }
}

/// `dividend·2¹⁶/divisor` to nearest, at most 2³¹; the divisor is not zero.
///
/// Schoolbook division in base 2¹⁶ (Knuth, algorithm D): the fractional digit is first guessed from the leading half of
/// the divisor and then too large by 2 at most. Two short divisions, which Cortex-M has in hardware, take the place
/// of a long one, which is a library call there.
#[inline]
fn divide(dividend: u32, divisor: u32) -> u32 {
    let whole = dividend / divisor;
    if whole >= 1 << 15 {
        return 1 << 31;
    }
    let shift = divisor.leading_zeros();
    let rest = (dividend % divisor) << shift;
    let divisor = divisor << shift;
    // The leading bit is set already; saying so spares the check for zero.
    let (high, low) = ((divisor >> 16) | 1 << 15, divisor & 0xFFFF);
    let (mut digit, mut left) = (rest / high, rest % high);
    while left >> 16 == 0 && (digit >> 16 != 0 || digit * low > left << 16) {
        digit -= 1;
        left += high;
    }
    let remainder = (rest << 16).wrapping_sub(digit.wrapping_mul(divisor));
    (whole << 16) + digit + u32::from(remainder >= divisor - remainder)
}

impl AddAssign for Q16 {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Q16 {
    #[inline]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Scalar for Q16 {
    const ZERO: Self = Self(0);
    const ONE: Self = Self(1 << FRACTION);
    const EPSILON: Self = Self(1);

    /// To nearest; what is out of range saturates, and NaN becomes zero.
    fn from_f64(value: f64) -> Self {
        Self(libm::round(value * f64::from(1_u32 << FRACTION)) as i32)
    }

    #[inline]
    fn to_f64(self) -> f64 {
        f64::from(self.0) / f64::from(1_u32 << FRACTION)
    }

    #[inline]
    fn from_i32(value: i32) -> Self {
        if i32::from(value as i16) == value {
            Self(value << FRACTION)
        } else {
            Self::end(value < 0)
        }
    }

    #[inline]
    fn times(self, count: i32) -> Self {
        Self::saturate(i64::from(self.0) * i64::from(count))
    }

    #[inline]
    fn floor(self) -> i32 {
        self.0 >> FRACTION
    }

    #[inline]
    fn split(self) -> (i32, Self) {
        (self.floor(), Self(self.0 & ((1 << FRACTION) - 1)))
    }

    #[inline]
    fn half(self) -> Self {
        Self(self.0 >> 1)
    }

    #[inline]
    fn share_of(self, whole: u32) -> u32 {
        ((u64::from(self.0.unsigned_abs()) * u64::from(whole)) >> FRACTION) as u32
    }

    /// Sums with 32 fractional bits cannot overflow: the product is at most 2⁶², and the number adds 2⁴⁷.
    #[inline]
    fn plus_product(self, a: Self, b: Self) -> Self {
        Self::rounded((i64::from(self.0) << FRACTION) + i64::from(a.0) * i64::from(b.0))
    }

    /// From 1 on by one short division.
    #[inline]
    fn reciprocal(self) -> Self {
        if self < Self::ONE {
            return Self::ONE / self;
        }
        let divisor = self.0.unsigned_abs();
        // 2³² itself does not fit, and only a power of two makes a difference: the remainder is then the divisor.
        let whole = u32::MAX / divisor;
        let remainder = whole.wrapping_mul(divisor).wrapping_neg();
        Self((whole + u32::from(remainder >= divisor - remainder)) as i32)
    }

    #[inline]
    fn abs(self) -> Self {
        Self(self.0.saturating_abs())
    }

    #[inline]
    fn clamp_symmetric(self, bound: Self) -> Self {
        if self.is_within(bound) {
            self
        } else if self.0 < 0 {
            -bound
        } else {
            bound
        }
    }

    #[inline]
    fn beyond(self, bound: Self) -> Self {
        if self.is_within(bound) {
            Self::ZERO
        } else if self.0 < 0 {
            self + bound
        } else {
            self - bound
        }
    }

    /// Within 2⁻¹⁷ + 2⁻²¹, each: by Taylor polynomials on an eighth of a turn to either side, whose remainders are below
    /// `x⁹/9! < 2⁻²¹` and `x¹⁰/10! < 2⁻²⁵`.
    #[inline]
    fn wave(phase: u32) -> (Self, Self) {
        /// π with 30 fractional bits.
        const PI: u32 = 3_373_259_426;
        /// One over a factorial.
        const fn over(factorial: u32) -> u32 {
            u32::MAX / factorial
        }
        let (quarter, rest) = quarter(phase);
        // The size of the angle with 31 fractional bits, and its square with 32: it is below 0.62.
        let x = high(rest.unsigned_abs() << 2, PI);
        let x2 = high(x, x) << 2;
        let lost = high(x2, over(6) - high(x2, over(120) - high(x2, over(5040))));
        let sine = x - high(x, lost);
        let sine = Self(((sine + (1 << 14)) >> 15) as i32);
        let high_orders = high(x2, over(720) - high(x2, over(40_320)));
        let lost = high(x2, over(2) - high(x2, over(24) - high_orders));
        let cosine = Self::ONE - round_to_fraction(lost);
        let sine = if rest < 0 { -sine } else { sine };
        turned(quarter, (sine, cosine))
    }

    /// Rounded down.
    #[inline]
    fn sqrt(self) -> Self {
        let radicand = u64::from(self.0.max(0).unsigned_abs()) << FRACTION;
        Self(radicand.isqrt() as i32)
    }

    /// Within 2⁻¹⁷ + 2⁻²⁵·eˣ: see `exp2`, and `LOG2_E` whose rounding the argument, at most 11, multiplies.
    #[inline]
    fn exp(self) -> Self {
        let (exponent, fraction) = exp2(i64::from(self.0) * LOG2_E);
        if exponent >= 15 {
            return Self::MAX;
        }
        // 1.fraction with 32 fractional bits, shifted to 16 with rounding; below 2⁻¹⁷ nothing is left.
        let shift = (16 - exponent).min(40) as u32;
        let mantissa = (1 << 32) | u64::from(fraction);
        Self::saturate(((mantissa + (1 << (shift - 1))) >> shift) as i64)
    }

    /// Within 2⁻¹⁷ + 2⁻²¹, each. For `x < 2⁻⁵` by the Taylor polynomial of `1 − m = x/2 − x²/6 + x³/24`, whose
    /// remainder is below `x⁴/120 < 2⁻²⁶`. Above, `e^(−x)` errs by less than 2⁻²⁶ (`exp2` and `x·e^(−x)`
    /// times that of `LOG2_E`), which the division by `x` makes 2⁻²¹ at most.
    #[inline]
    fn relax(self) -> (Self, Self) {
        let x = self.0.max(0).unsigned_abs();
        if x < 1 << 11 {
            let wide = x << 16;
            let square = high(wide, wide);
            let deficit = wide / 2 - square / 6 + high(square, wide) / 24;
            let relaxed = round_to_fraction(wide - high(wide, deficit));
            return (relaxed, Self::ONE - round_to_fraction(deficit));
        }
        let (exponent, fraction) = exp2(-(i64::from(x) * LOG2_E));
        let mantissa = (1 << 32) | u64::from(fraction);
        let left = mantissa.checked_shr(-exponent as u32).unwrap_or(0) as u32;
        // 1 − e^(−x) with 32 fractional bits, where 1 itself does not fit.
        let relaxed = left.max(1).wrapping_neg();
        let mean = relaxed / x + u32::from(relaxed % x > x / 2);
        (round_to_fraction(relaxed), Self(mean as i32))
    }
}

/// log₂ e with 30 fractional bits; errs by less than 2⁻³¹.
const LOG2_E: i64 = 1_549_082_005;

/// `2^t` for `t` with 46 fractional bits, as `(n, p)` meaning `2ⁿ·(1 + p·2⁻³²)`.
///
/// `2^f = 1 + f·(c₁ + … + c₆·f⁵)` on `[0, 1)` with the coefficients that interpolate at the Chebyshev nodes, which
/// errs by 2⁻²⁷·⁴ relative; the six products cut off less than 2⁻²⁹ more.
#[inline]
fn exp2(t: i64) -> (i32, u32) {
    const COEFFICIENTS: [u32; 5] = [
        5_451_244,
        41_455_862,
        238_353_606,
        1_031_767_986,
        2_977_044_430,
    ];
    let fraction = (t >> 14) as u32;
    let mut sum = 894_123;
    for c in COEFFICIENTS {
        sum = high(sum, fraction) + c;
    }
    ((t >> 46) as i32, high(sum, fraction))
}

/// The product of two fractions of 2³².
#[inline]
fn high(a: u32, b: u32) -> u32 {
    ((u64::from(a) * u64::from(b)) >> 32) as u32
}

/// A fraction of 2³² to nearest.
#[inline]
fn round_to_fraction(wide: u32) -> Q16 {
    Q16(((wide >> (FRACTION - 1)).div_ceil(2)) as i32)
}

#[cfg(test)]
mod tests {
    use super::{Q16, Scalar};

    const HALF: f64 = 1.0 / 131_072.0;

    /// Every magnitude of the format, at steps of no special form.
    fn samples() -> impl Iterator<Item = Q16> {
        let magnitudes =
            core::iter::successors(Some(1_i32), |bits| bits.checked_add(bits / 97 + 1));
        magnitudes.flat_map(|bits| [Q16(bits), Q16(-bits)])
    }

    #[test]
    fn no_operation_wraps_or_panics_at_the_extremes() {
        let extremes = [
            Q16::MIN,
            Q16(i32::MIN + 1),
            Q16(-1),
            Q16(0),
            Q16(1),
            Q16::ONE,
            Q16::MAX,
        ];
        let (low, high) = (Q16::MIN.to_f64(), Q16::MAX.to_f64());
        for a in extremes {
            let x = a.to_f64();
            assert!(((-a).to_f64() - (-x).clamp(low, high)).abs() <= HALF);
            assert!((a.sqrt().to_f64() - x.max(0.0).sqrt()).abs() < 2.0 * HALF);
            assert!((a.exp().to_f64() - x.exp().min(high)).abs() <= HALF);
            let (relaxed, mean) = a.relax();
            assert!(relaxed >= Q16::ZERO && relaxed <= Q16::ONE);
            assert!(mean >= Q16::ZERO && mean <= Q16::ONE);
            for b in extremes {
                let y = b.to_f64();
                assert!(((a + b).to_f64() - (x + y).clamp(low, high)).abs() == 0.0);
                assert!(((a - b).to_f64() - (x - y).clamp(low, high)).abs() == 0.0);
                assert!(((a * b).to_f64() - (x * y).clamp(low, high)).abs() <= HALF);
                let quotient = if x == 0.0 { 0.0 } else { x / y };
                assert!(((a / b).to_f64() - quotient.clamp(low, high)).abs() <= HALF);
            }
        }
    }

    #[test]
    fn values_out_of_range_saturate_and_nan_is_zero() {
        for (value, expected) in [(1e9, Q16::MAX), (-1e9, Q16::MIN), (f64::NAN, Q16::ZERO)] {
            assert_eq!(Q16::from_f64(value), expected);
        }
        assert_eq!(Q16::from_f64(f64::NEG_INFINITY), Q16::MIN);
    }

    #[test]
    fn products_and_quotients_are_rounded_to_nearest() {
        for a in samples() {
            for b in [Q16(3), Q16(-70_001), Q16(1_234_567), Q16(-1_987_654_321)] {
                for (found, exact) in [
                    (a * b, a.to_f64() * b.to_f64()),
                    (a / b, a.to_f64() / b.to_f64()),
                ] {
                    let exact = exact.clamp(Q16::MIN.to_f64(), Q16::MAX.to_f64());
                    assert!((found.to_f64() - exact).abs() <= HALF, "{a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn a_number_and_a_product_are_rounded_once_and_saturate_as_a_sum() {
        let (low, high) = (Q16::MIN.to_f64(), Q16::MAX.to_f64());
        let far = [Q16::MIN, Q16(-70_001), Q16(3), Q16::MAX];
        for a in samples() {
            for (b, c) in far.iter().flat_map(|b| far.map(|c| (*b, c))) {
                // All three have 31 bits: a double holds the product of two with 9 bits missing at most, which is far
                // below half a unit wherever the sum does not saturate.
                let exact = c.to_f64() + a.to_f64() * b.to_f64();
                let found = c.plus_product(a, b).to_f64();
                assert!(
                    (found - exact.clamp(low, high)).abs() <= HALF,
                    "{a:?} {b:?} {c:?}"
                );
            }
        }
    }

    #[test]
    fn reciprocals_are_rounded_to_nearest() {
        let powers = (0..31).flat_map(|k| [Q16(1 << k), Q16((1 << k) + 1)]);
        for x in samples().chain(powers) {
            let exact = (1.0 / x.to_f64()).clamp(Q16::MIN.to_f64(), Q16::MAX.to_f64());
            assert!((x.reciprocal().to_f64() - exact).abs() <= HALF, "{x:?}");
        }
        assert_eq!(Q16::ZERO.reciprocal(), Q16::MAX);
    }

    #[test]
    fn limits_are_met_exactly_by_every_value_and_bound() {
        for bound in samples()
            .chain([Q16::ZERO, Q16::MAX])
            .filter(|b| *b >= Q16::ZERO)
        {
            let beside = [Q16(bound.0 - 1), bound, Q16(bound.0.saturating_add(1))];
            let values = beside
                .into_iter()
                .chain([Q16::MIN, Q16(-1), Q16::ZERO, Q16::MAX]);
            for x in values.flat_map(|x| [x, -x]) {
                let inside = x.0.clamp(-bound.0, bound.0);
                assert_eq!(x.clamp_symmetric(bound), Q16(inside), "{x:?} {bound:?}");
                assert_eq!(x.beyond(bound), Q16(x.0 - inside), "{x:?} {bound:?}");
            }
        }
    }

    #[test]
    fn exponentials_keep_the_bounds_that_their_docs_derive() {
        for x in samples() {
            let exact = x.to_f64().exp().min(Q16::MAX.to_f64());
            let bound = HALF + exact / f64::from(1 << 25);
            assert!((x.exp().to_f64() - exact).abs() <= bound, "{x:?}");
            let (relaxed, mean) = x.relax();
            let x = x.to_f64().max(0.0);
            let exact = -(-x).exp_m1();
            let bound = HALF + 1.0 / f64::from(1 << 21);
            assert!((relaxed.to_f64() - exact).abs() <= bound, "{x}");
            let exact = if x > 0.0 { exact / x } else { 1.0 };
            assert!((mean.to_f64() - exact).abs() <= bound, "{x}");
        }
    }
}
