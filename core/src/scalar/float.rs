//! Floating point.
//!
//! `relax` is the inner loop of every law with bristles, so it does not go through `libm`, which spends its time on
//! ranges that cannot occur here. With `n = round(32·x/ln 2) = 32·m + j` and `r = x − n·ln 2/32`,
//! `1 − e^(−x) = (1 − 2⁻ᵐ) + 2⁻ᵐ·(D − (1 − D)·(e^(−r) − 1))`, where `D = 1 − 2^(−j/32)` comes from a table. The first
//! bracket is exact, and where `x` is small `m`, `j` and `D` are 0 and the Taylor polynomial of `e^(−r) − 1`, which
//! begins with `−r`, is the result: no precision is lost. `ln 2/32` is subtracted in two parts, of which the
//! first ends in enough zeros for its product with `n` to be exact.
//!
//! With unit roundoff `u` and `|r| ≤ ln 2/64`, the product of `1 − D` and the polynomial errs by `8u` of its value: `u` from
//! `r`, `3u` from cutting off, `2u` from rounding the polynomial and `2u` from the product. `D` errs by `3u`. The result is
//! smallest against both at `n = 1` and `r = −ln 2/64`, where the product is about as large as the result and `D`
//! twice as large, and the two sums add `u` each: altogether below `16u`. The mean divides by `x`: below `17u`.

use super::{Scalar, quarter, turned};

/// `floor` and `split`, which read alike for either width.
macro_rules! whole_and_part {
    () => {
        #[inline]
        fn floor(self) -> i32 {
            // The cast cuts off towards zero, saturates and makes zero of NaN.
            let cut = self as i32;
            cut.saturating_sub(i32::from(Self::from_i32(cut) > self))
        }
        #[inline]
        fn split(self) -> (i32, Self) {
            let cut = self as i32;
            // Exact, so that the one rounding is that of the sum below.
            let rest = self - Self::from_i32(cut);
            if rest < 0.0 {
                (cut.saturating_sub(1), rest + 1.0)
            } else {
                (cut, rest)
            }
        }
    };
}

impl Scalar for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const EPSILON: Self = f64::EPSILON;

    fn from_f64(value: f64) -> Self {
        value
    }
    #[inline]
    fn to_f64(self) -> f64 {
        self
    }
    #[inline]
    fn from_i32(value: i32) -> Self {
        Self::from(value)
    }
    whole_and_part!();
    #[inline]
    fn share_of(self, whole: u32) -> u32 {
        (self * Self::from(whole)) as u32
    }
    #[inline]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline]
    fn half(self) -> Self {
        0.5 * self
    }
    fn wave(phase: u32) -> (Self, Self) {
        let (quarter, rest) = quarter(phase);
        let x = Self::from(rest) * (core::f64::consts::TAU / 4_294_967_296.0);
        turned(quarter, (libm::sin(x), libm::cos(x)))
    }
    #[inline]
    fn sqrt(self) -> Self {
        if self > 0.0 { libm::sqrt(self) } else { 0.0 }
    }
    #[inline]
    fn exp(self) -> Self {
        libm::exp(self)
    }
    #[inline]
    fn relax(self) -> (Self, Self) {
        let relaxed = relaxed(self);
        (relaxed, if self > 0.0 { relaxed / self } else { 1.0 })
    }
}

impl Scalar for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const EPSILON: Self = f32::EPSILON;

    fn from_f64(value: f64) -> Self {
        value as f32
    }
    #[inline]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[inline]
    fn from_i32(value: i32) -> Self {
        value as Self
    }
    whole_and_part!();
    #[inline]
    fn share_of(self, whole: u32) -> u32 {
        (self * whole as Self) as u32
    }
    #[inline]
    fn abs(self) -> Self {
        f32::abs(self)
    }
    #[inline]
    fn half(self) -> Self {
        0.5 * self
    }
    /// By Taylor polynomials on an eighth of a turn to either side, whose remainders are below `x¹¹/11! < 2·10⁻⁹`
    /// and `x¹⁰/10! < 3·10⁻⁸`.
    #[inline]
    fn wave(phase: u32) -> (Self, Self) {
        let (quarter, rest) = quarter(phase);
        let x = rest as f32 * (core::f32::consts::TAU / 4_294_967_296.0);
        let x2 = x * x;
        let high = 1.0 / 120.0 - x2 * (1.0 / 5040.0 - x2 * (1.0 / 362_880.0));
        let sine = x - x * x2 * (1.0 / 6.0 - x2 * high);
        let high = 1.0 / 24.0 - x2 * (1.0 / 720.0 - x2 * (1.0 / 40_320.0));
        let cosine = 1.0 - x2 * (0.5 - x2 * high);
        turned(quarter, (sine, cosine))
    }
    #[inline]
    fn sqrt(self) -> Self {
        if self > 0.0 { libm::sqrtf(self) } else { 0.0 }
    }
    #[inline]
    fn exp(self) -> Self {
        libm::expf(self)
    }
    #[inline]
    fn relax(self) -> (Self, Self) {
        let relaxed = relaxed_single(self);
        (relaxed, if self > 0.0 { relaxed / self } else { 1.0 })
    }
}

/// Entries of `STEPS`.
const ENTRIES: usize = 32;

/// `1 − 2^(−j/32)`, by the Taylor series of `−(e^(−x) − 1)`.
const STEPS: [f64; ENTRIES] = {
    let mut steps = [0.0; ENTRIES];
    let mut j = 0;
    while j < ENTRIES {
        let x = j as f64 * (core::f64::consts::LN_2 / ENTRIES as f64);
        let mut sum = 1.0;
        let mut k = 20.0;
        while k > 1.0 {
            sum = 1.0 - sum * x / k;
            k -= 1.0;
        }
        steps[j] = x * sum;
        j += 1;
    }
    steps
};

/// `STEPS` rounded.
const STEPS_SINGLE: [f32; ENTRIES] = {
    let mut steps = [0.0; ENTRIES];
    let mut j = 0;
    while j < ENTRIES {
        steps[j] = STEPS[j] as f32;
        j += 1;
    }
    steps
};

/// `1 − e^(−x)` for `x ≥ 0`.
#[inline]
fn relaxed(x: f64) -> f64 {
    /// The leading bits of ln 2/32 and the rest.
    const LN_2: [f64; 2] = [
        6.931_471_803_691_238e-1 / 32.0,
        1.908_214_929_270_587_7e-10 / 32.0,
    ];
    /// Added to a number below 2⁵¹, leaves its nearest integer in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    // Beyond, nothing is left of the exponential; and NaN must pass.
    let x = if x > 64.0 { 64.0 } else { x };
    let rounded = x * (32.0 * core::f64::consts::LOG2_E) + ROUND;
    let n = rounded - ROUND;
    let r = x - n * LN_2[0] - n * LN_2[1];
    let bits = rounded.to_bits();
    let step = STEPS[(bits % ENTRIES as u64) as usize];
    let scale = f64::from_bits(1023_u64.wrapping_sub(bits / ENTRIES as u64) << 52);
    let r2 = r * r;
    let high = (1.0 / 24.0 - r * (1.0 / 120.0)) + r2 * (1.0 / 720.0);
    let bracket = ((0.5 - r * (1.0 / 6.0)) + high * r2) * r2 - r;
    (1.0 - scale) + scale * (step - (1.0 - step) * bracket)
}

/// `relaxed` in single precision.
#[inline]
fn relaxed_single(x: f32) -> f32 {
    const LN_2: [f32; 2] = [0.693_359_4 / 32.0, -2.121_944_4e-4 / 32.0];
    const ROUND: f32 = 12_582_912.0;
    let x = if x > 32.0 { 32.0 } else { x };
    let rounded = x * (32.0 * core::f32::consts::LOG2_E) + ROUND;
    let n = rounded - ROUND;
    let r = x - n * LN_2[0] - n * LN_2[1];
    let bits = rounded.to_bits();
    let step = STEPS_SINGLE[(bits % ENTRIES as u32) as usize];
    let scale = f32::from_bits(127_u32.wrapping_sub(bits / ENTRIES as u32) << 23);
    let bracket = (0.5 - r * (1.0 / 6.0)) * (r * r) - r;
    (1.0 - scale) + scale * (step - (1.0 - step) * bracket)
}

#[cfg(test)]
mod tests {
    use super::Scalar;

    /// Arguments over the whole range, at steps of no special form.
    fn arguments() -> impl Iterator<Item = f64> {
        core::iter::successors(Some(1e-300), |x| Some(x * 1.003_7)).take_while(|x| *x < 1e300)
    }

    #[test]
    fn relaxation_keeps_its_relative_bound() {
        for x in arguments() {
            let exact = -(-x).exp_m1();
            let (relaxed, mean) = Scalar::relax(x);
            assert!(
                (relaxed - exact).abs() <= 8.0 * f64::EPSILON * exact,
                "{x:e}"
            );
            assert!(
                (mean - exact / x).abs() <= 8.5 * f64::EPSILON * exact / x,
                "{x:e}"
            );
        }
    }

    #[test]
    fn relaxation_in_single_precision_keeps_its_relative_bound() {
        let epsilon = f64::from(f32::EPSILON);
        for x in arguments().filter(|x| (1e-30..1e30).contains(x)) {
            let single = x as f32;
            let x = f64::from(single);
            let exact = -(-x).exp_m1();
            let (relaxed, mean) = single.relax();
            assert!(
                (f64::from(relaxed) - exact).abs() <= 8.0 * epsilon * exact,
                "{x:e}"
            );
            assert!(
                (f64::from(mean) - exact / x).abs() <= 8.5 * epsilon * exact / x,
                "{x:e}"
            );
        }
    }

    #[test]
    fn relaxation_at_the_ends() {
        assert_eq!(Scalar::relax(0.0_f64), (0.0, 1.0));
        assert_eq!(Scalar::relax(f64::INFINITY), (1.0, 0.0));
        assert_eq!(Scalar::relax(f32::INFINITY), (1.0, 0.0));
        assert!(Scalar::relax(f64::NAN).0.is_nan() && Scalar::relax(f32::NAN).0.is_nan());
    }
}
