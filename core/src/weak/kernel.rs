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
/// Their φ is the polygon through the samples of a [`TestFunction`]. Its second derivative is an impulse at each sample, so
/// that `F2` takes a position at the samples alone and no rule of quadrature errs: where the acceleration is held from a
/// sample to the next, `F2[q] = F0[q̈]` to the last digit, however few samples lie under the window.
///
/// The weights are written into slices that the caller lends, so nothing is allocated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel<S> {
    phi: TestFunction<S>,
    reach: usize,
    period: S,
    /// What gives the polygon unit area.
    scale: S,
}

impl<S: Scalar> Kernel<S> {
    /// A window that reaches `reach` ≥ 1 samples to either side of its centre.
    pub fn new(reach: usize, period: S) -> Self {
        let mut kernel = Self {
            phi: TestFunction::new(S::from_f64(reach as f64) * period),
            reach,
            period,
            scale: S::ONE,
        };
        let beside = (1..reach as i32).fold(S::ZERO, |sum, k| sum + kernel.phi(k));
        kernel.scale = S::ONE / ((kernel.phi(0) + beside + beside) * period);
        kernel
    }

    /// Samples on either side of the centre.
    pub fn reach(&self) -> usize {
        self.reach
    }

    /// Half-width in seconds.
    pub fn half_width(&self) -> S {
        self.phi.half_width()
    }

    /// Fills `weights` (length `2·reach + 1`, 1/s²) with those of `∫q φ̈`.
    pub fn acceleration(&self, weights: &mut [S]) {
        let rate = S::ONE / self.period;
        self.fill(weights, |kernel, k| {
            let (before, after) = (
                kernel.phi(k) - kernel.phi(k - 1),
                kernel.phi(k + 1) - kernel.phi(k),
            );
            (after - before) * rate
        });
    }

    /// Fills `weights` (length `2·reach + 1`, 1/s) with those of `−∫q φ̇`, of positions that run straight between samples.
    pub fn velocity(&self, weights: &mut [S]) {
        let half = S::from_f64(0.5);
        self.fill(weights, |kernel, k| {
            (kernel.phi(k - 1) - kernel.phi(k + 1)) * half
        });
    }

    /// Fills `weights` (length `2·reach`) with `∫φ` over each sampling interval.
    pub fn hold(&self, weights: &mut [S]) {
        let half = S::from_f64(0.5) * self.period;
        self.fill(weights, |kernel, k| {
            (kernel.phi(k) + kernel.phi(k + 1)) * half
        });
    }

    /// `φ` at sample `k` from the centre; zero outside of the window.
    fn phi(&self, k: i32) -> S {
        self.scale * self.phi.value(S::from_i32(k) * self.period)
    }

    fn fill(&self, weights: &mut [S], weight: impl Fn(&Self, i32) -> S) {
        for (k, w) in (-(self.reach as i32)..).zip(weights) {
            *w = weight(self, k);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Kernel;
    use std::vec;
    use std::vec::Vec;

    fn dot(w: &[f64], f: impl Fn(f64) -> f64, first: f64, period: f64) -> f64 {
        w.iter()
            .enumerate()
            .map(|(k, w)| w * f((first + k as f64) * period))
            .sum()
    }

    #[test]
    fn few_samples_are_exact_for_a_held_acceleration() {
        let (reach, h) = (3, 0.01_f64);
        let kernel = Kernel::new(reach, h);
        let (mut wa, mut wv, mut wh) = ([0.0; 7], [0.0; 7], [0.0; 6]);
        kernel.acceleration(&mut wa);
        kernel.velocity(&mut wv);
        kernel.hold(&mut wh);
        let held = [3.0, -1.0, 0.5, 8.0, -6.0, 2.0];
        // From afar, where a sum of weights that is not zero would show.
        let (mut q, mut v) = (vec![900.0], 0.7);
        for a in held {
            q.push(q[q.len() - 1] + h * (v + 0.5 * h * a));
            v += h * a;
        }
        let mean = |w: &[f64], x: &[f64]| w.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
        // Rounding alone: ε·q times the weights.
        assert!((mean(&wa, &q) - mean(&wh, &held)).abs() < 1e-8);
        let travel: Vec<f64> = q.windows(2).map(|q| (q[1] - q[0]) / h).collect();
        assert!((mean(&wv, &q) - mean(&wh, &travel)).abs() < 1e-10);
    }

    #[test]
    fn the_held_weights_are_those_of_a_mean() {
        for reach in [1, 2, 7, 40] {
            let mut w = vec![0.0; 2 * reach];
            Kernel::new(reach, 0.01_f64).hold(&mut w);
            assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{reach}");
            // φ is even, so the weights mirror about the centre.
            assert!((0..reach).all(|k| (w[k] - w[2 * reach - 1 - k]).abs() < 1e-12));
        }
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
