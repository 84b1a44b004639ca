//! Test functions sampled into weights.

use super::TestFunction;
use crate::Scalar;

/// The weights of one window on samples `period` seconds apart, `2·reach + 1` samples wide.
///
/// A functional is then a dot product with the samples under the window, the middle weight at its centre:
///
/// | weights | functional | applied to |
/// | --- | --- | --- |
/// | [`Kernel::acceleration`] | `F2[q] = ∫q φ̈`, the mean of `q̈` | positions, `2·reach + 1` of them |
/// | [`Kernel::velocity`] | `F1[q] = −∫q φ̇`, the mean of `q̇` | positions, `2·reach + 1` of them |
/// | [`Kernel::hold`] | `F0[u] = ∫u φ`, the mean of `u` | values held from a sample to the next, `2·reach` of them |
///
/// The weights are written into slices that the caller lends, so nothing is allocated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel<S> {
    phi: TestFunction<S>,
    reach: usize,
    period: S,
}

impl<S: Scalar> Kernel<S> {
    /// A window that reaches `reach` ≥ 1 samples to either side of its centre.
    pub fn new(reach: usize, period: S) -> Self {
        Self {
            phi: TestFunction::new(S::from_f64(reach as f64) * period),
            reach,
            period,
        }
    }

    /// Samples on either side of the centre.
    pub fn reach(&self) -> usize {
        self.reach
    }

    /// Half-width in seconds.
    pub fn half_width(&self) -> S {
        self.phi.half_width()
    }

    /// Fills `weights` (length `2·reach + 1`, 1/s²) with the trapezoidal weights of `∫q φ̈`.
    pub fn acceleration(&self, weights: &mut [S]) {
        self.fill(weights, |kernel, tau| {
            kernel.period * kernel.phi.second_derivative(tau)
        });
    }

    /// Fills `weights` (length `2·reach + 1`, 1/s) with the trapezoidal weights of `−∫q φ̇`.
    pub fn velocity(&self, weights: &mut [S]) {
        self.fill(weights, |kernel, tau| {
            -(kernel.period * kernel.phi.first_derivative(tau))
        });
    }

    /// Fills `weights` (length `2·reach`) with `∫φ` over each sampling interval, exact for a held signal.
    pub fn hold(&self, weights: &mut [S]) {
        self.fill(weights, |kernel, tau| {
            kernel.phi.integral(tau + kernel.period) - kernel.phi.integral(tau)
        });
    }

    fn fill(&self, weights: &mut [S], weight: impl Fn(&Self, S) -> S) {
        let first = -S::from_f64(self.reach as f64);
        for (k, w) in weights.iter_mut().enumerate() {
            *w = weight(self, (first + S::from_f64(k as f64)) * self.period);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Kernel;
    use std::vec;

    fn dot(w: &[f64], f: impl Fn(f64) -> f64, first: f64, period: f64) -> f64 {
        w.iter()
            .enumerate()
            .map(|(k, w)| w * f((first + k as f64) * period))
            .sum()
    }

    #[test]
    fn functionals_reproduce_polynomials_to_the_aliasing_error() {
        // φ̈·q has 4 vanishing derivatives at the ends, so by Euler-Maclaurin the trapezoidal error is of order
        // (1/reach)^5 relative to the peak weight; for reach = 40 that is below 1e-7.
        let (reach, h) = (40, 1e-3);
        let kernel = Kernel::new(reach, h);
        let mut w = vec![0.0; 2 * reach + 1];
        let first = -(reach as f64);
        kernel.acceleration(&mut w);
        let peak: f64 = w.iter().copied().map(f64::abs).sum();
        assert!(dot(&w, |_| 1.0, first, h).abs() < 1e-7 * peak);
        assert!((dot(&w, |t| 0.5 * t * t, first, h) - 1.0).abs() < 1e-6);
        kernel.velocity(&mut w);
        assert!((dot(&w, |t| t, first, h) - 1.0).abs() < 1e-7);
        assert!(dot(&w, |t| t * t, first, h).abs() < 1e-9);
    }

    #[test]
    fn the_held_input_is_integrated_exactly() {
        let kernel = Kernel::new(7, 0.01_f64);
        let mut w = vec![0.0; 14];
        kernel.hold(&mut w);
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        // φ is even, so the weights mirror about the centre.
        assert!((0..7).all(|k| (w[k] - w[13 - k]).abs() < 1e-12));
    }

    #[test]
    fn weak_form_of_a_known_motion_balances() {
        // J·q̈ = u with q = sin 9t: F2[q] must equal F0[u]/J. u is held at its value in the middle of each
        // interval, which leaves the hold error (ωh)²/24 relative.
        let (reach, h, omega, inertia) = (50, 1e-3, 9.0_f64, 0.02);
        let kernel = Kernel::new(reach, h);
        let (mut wa, mut wh) = (vec![0.0; 101], vec![0.0; 100]);
        kernel.acceleration(&mut wa);
        kernel.hold(&mut wh);
        let start = 0.3 / h;
        let acceleration = dot(&wa, |t| (omega * t).sin(), start, h);
        let torque = dot(
            &wh,
            |t| -inertia * omega * omega * (omega * t).sin(),
            start + 0.5,
            h,
        );
        let bound = torque.abs() * ((omega * h).powi(2) / 24.0 + 1e-6);
        assert!((inertia * acceleration - torque).abs() < bound);
    }
}
