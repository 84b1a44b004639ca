//! The test function of every window.

use crate::Scalar;

/// `φ(τ) = c·(1 − (τ/T)²)⁶` on `|τ| ≤ T`, zero outside, with `∫φ dτ = 1`.
///
/// The sixth power makes φ and its first five derivatives vanish at both ends, so integration by parts leaves
/// no boundary terms. Unit area makes a functional a weighted mean: `∫F φ` is the mean of `F` in the window, in the
/// unit of `F`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestFunction<S> {
    half_width: S,
    scale: S,
}

/// `∫₀¹ (1 − x²)⁶ dx = ∏ 2k/(2k + 1), k = 1…6` (half a Beta function).
const AREA: f64 = 1024.0 / 3003.0;

impl<S: Scalar> TestFunction<S> {
    /// The test function of half-width `half_width` > 0, in seconds.
    pub fn new(half_width: S) -> Self {
        Self {
            half_width,
            scale: S::ONE / (S::from_f64(2.0 * AREA) * half_width),
        }
    }

    /// Half-width `T`, in seconds.
    pub fn half_width(&self) -> S {
        self.half_width
    }

    /// `φ(τ)`, in 1/s.
    pub fn value(&self, tau: S) -> S {
        let (_, p) = self.base(tau);
        let p2 = p * p;
        self.scale * p2 * p2 * p2
    }

    /// `φ̇(τ) = −12·c·x·(1 − x²)⁵/T` with `x = τ/T`, in 1/s².
    pub fn first_derivative(&self, tau: S) -> S {
        let (x, p) = self.base(tau);
        let p2 = p * p;
        S::from_f64(-12.0) * self.scale * x * p2 * p2 * p / self.half_width
    }

    /// `φ̈(τ) = 12·c·(1 − x²)⁴·(11·x² − 1)/T²`, in 1/s³.
    pub fn second_derivative(&self, tau: S) -> S {
        let (x, p) = self.base(tau);
        let p2 = p * p;
        let factor = S::from_f64(11.0) * x * x - S::ONE;
        S::from_f64(12.0) * self.scale * p2 * p2 * factor / (self.half_width * self.half_width)
    }

    fn base(&self, tau: S) -> (S, S) {
        let x = tau / self.half_width;
        let p = S::ONE - x * x;
        (x, if p > S::ZERO { p } else { S::ZERO })
    }
}

#[cfg(test)]
mod tests {
    use super::{AREA, TestFunction};

    #[test]
    fn area_constant_matches_the_beta_function() {
        // B(1/2, 7) = 2·∏ 2k/(2k+1), k = 1..6
        let product: f64 = (1..=6)
            .map(|k| f64::from(2 * k) / f64::from(2 * k + 1))
            .product();
        assert!((2.0 * AREA - 2.0 * product).abs() < 1e-14);
    }

    #[test]
    fn its_area_is_one_and_its_derivatives_are_slopes() {
        let phi = TestFunction::new(0.08_f64);
        // Smooth at both ends, so that the trapezoidal sum converges fast.
        let area: f64 = (-80..80)
            .map(|k| 1e-3 * phi.value(1e-3 * f64::from(k)))
            .sum();
        assert!((area - 1.0).abs() < 1e-10);
        let h = 1e-5;
        for k in -7..=7 {
            let tau = f64::from(k) * 0.01;
            // Central differences err by h²/6·f''' ≤ h²/6·1e6 here, far below the tolerance.
            let slope = (phi.value(tau + h) - phi.value(tau - h)) / (2.0 * h);
            assert!((slope - phi.first_derivative(tau)).abs() < 1e-4 * phi.value(0.0) / 0.08);
            let slope = (phi.first_derivative(tau + h) - phi.first_derivative(tau - h)) / (2.0 * h);
            assert!((slope - phi.second_derivative(tau)).abs() < 1e-3 * phi.value(0.0) / 0.0064);
        }
    }

    #[test]
    fn vanishes_outside_its_window() {
        let phi = TestFunction::new(0.1_f32);
        for tau in [-0.1, 0.1, 0.2] {
            assert!(phi.value(tau) == 0.0 && phi.first_derivative(tau) == 0.0);
            assert!(phi.second_derivative(tau) == 0.0);
        }
    }
}
