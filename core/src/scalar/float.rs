//! Floating point.
//!
//! `relax` is the inner loop of every law with bristles, so it does not go through `libm`, which spends its time on
//! ranges that cannot occur here. With `n = round(x/ln 2)` and `r = x − n·ln 2`, `|r| ≤ ln 2/2`,
//! `1 − e^(−x) = (1 − 2⁻ⁿ) − 2⁻ⁿ·(e^(−r) − 1)`: the first bracket is exact, and for small `x`, where `n = 0`, the
//! second alone is the result, so no precision is lost. The Taylor polynomial of the second bracket stops where its
//! remainder is below a tenth of a rounding error. `ln 2` is subtracted in two parts, of which the first has
//! enough zeros at its end for `n·ln 2` to be exact.
//!
//! With unit roundoff `u`, `r` errs by `u·|r|` relative to the polynomial's slope and the polynomial, its terms
//! falling by half or more, by `2u` of its value; scaling by `2⁻ⁿ` is exact and the difference adds `u`. The
//! second bracket is at most `√2 − 1` where `n = 0` and at most 1.5 times the result elsewhere; altogether the
//! relative error stays below `6u`, and below `8u` for the mean, which one more division gives.

use super::Scalar;

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

/// `1 − e^(−x)` for `x ≥ 0`.
#[inline]
fn relaxed(x: f64) -> f64 {
    /// `1/k!` from `k = 2` to 13, with alternating signs.
    const C: [f64; 12] = [
        1.0 / 2.0,
        -1.0 / 6.0,
        1.0 / 24.0,
        -1.0 / 120.0,
        1.0 / 720.0,
        -1.0 / 5_040.0,
        1.0 / 40_320.0,
        -1.0 / 362_880.0,
        1.0 / 3_628_800.0,
        -1.0 / 39_916_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 6_227_020_800.0,
    ];
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    /// Added to a number below 2⁵¹, leaves its nearest integer in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    // Beyond, nothing is left of the exponential; and NaN must pass.
    let x = if x > 64.0 { 64.0 } else { x };
    let rounded = x * core::f64::consts::LOG2_E + ROUND;
    let n = rounded - ROUND;
    let r = x - n * LN_2_HIGH - n * LN_2_LOW;
    let scale = f64::from_bits((1023_u64.wrapping_sub(rounded.to_bits())) << 52);
    // Estrin's scheme: pairs, then fours, so that the processor has independent work.
    let (r2, r4) = (r * r, (r * r) * (r * r));
    let pair = |k: usize| C[k] + C[k + 1] * r;
    let low = pair(0) + pair(2) * r2;
    let middle = pair(4) + pair(6) * r2;
    let high = pair(8) + pair(10) * r2;
    let bracket = (low + (middle + high * r4) * r4) * r2 - r;
    (1.0 - scale) - scale * bracket
}

/// [`relaxed`] in single precision.
#[inline]
fn relaxed_single(x: f32) -> f32 {
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    const ROUND: f32 = 12_582_912.0;
    let x = if x > 32.0 { 32.0 } else { x };
    let rounded = x * core::f32::consts::LOG2_E + ROUND;
    let n = rounded - ROUND;
    let r = x - n * LN_2_HIGH - n * LN_2_LOW;
    let scale = f32::from_bits((127_u32.wrapping_sub(rounded.to_bits())) << 23);
    let mut sum = 1.0 / 40_320.0;
    for c in [
        -1.0 / 5_040.0,
        1.0 / 720.0,
        -1.0 / 120.0,
        1.0 / 24.0,
        -1.0 / 6.0,
        1.0 / 2.0,
    ] {
        sum = sum * r + c;
    }
    (1.0 - scale) - scale * (sum * (r * r) - r)
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
                (relaxed - exact).abs() <= 3.0 * f64::EPSILON * exact,
                "{x:e}"
            );
            assert!(
                (mean - exact / x).abs() <= 4.0 * f64::EPSILON * exact / x,
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
                (f64::from(relaxed) - exact).abs() <= 3.0 * epsilon * exact,
                "{x:e}"
            );
            assert!(
                (f64::from(mean) - exact / x).abs() <= 4.0 * epsilon * exact / x,
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
