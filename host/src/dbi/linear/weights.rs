//! Functionals of products of signals, which the default equation of motion does not need.

use bristle_core::weak::TestFunction;

use crate::weak::{Track, Windows};

/// Weights of one track's windows, for signals at the nodes and for signals held over the cells.
pub(super) struct Weights {
    /// `∫x φ`, nodes.
    pub value: Vec<f64>,
    /// `∫x φ̇`, nodes.
    pub slope: Vec<f64>,
    /// `∫x φ⃛`, nodes.
    pub third: Vec<f64>,
    /// `∫x φ̇`, cells: exact for a held signal.
    pub held_slope: Vec<f64>,
}

impl Weights {
    pub fn new(track: &Track, windows: &Windows) -> Self {
        let (reach, period) = (windows.reach, track.period);
        let phi = TestFunction::new(reach as f64 * period);
        let tau = |k: usize| (k as f64 - reach as f64) * period;
        let nodes = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (0..=2 * reach).map(|k| period * f(tau(k))).collect()
        };
        Self {
            value: nodes(&|tau| phi.value(tau)),
            slope: nodes(&|tau| phi.first_derivative(tau)),
            third: nodes(&|tau| third_derivative(&phi, tau)),
            held_slope: (0..2 * reach)
                .map(|k| phi.value(tau(k + 1)) - phi.value(tau(k)))
                .collect(),
        }
    }
}

/// `φ⃛(τ) = 120·c·x·(1 − x²)³·(3 − 11·x²)/T³` with `x = τ/T` and `c = φ(0)`, in 1/s⁴: the derivative of
/// [`TestFunction::second_derivative`]. It still vanishes at both ends, so positions can be integrated against it.
fn third_derivative(phi: &TestFunction<f64>, tau: f64) -> f64 {
    let half_width = phi.half_width();
    let x = tau / half_width;
    let p = (1.0 - x * x).max(0.0);
    120.0 * phi.value(0.0) * x * p.powi(3) * (3.0 - 11.0 * x * x) / half_width.powi(3)
}

/// Mean over a cell of a function of the velocity that runs linearly between its nodes, by Simpson's rule.
pub(super) fn cell_means(v: &[f64], f: impl Fn(f64) -> f64) -> Vec<f64> {
    let mean = |w: &[f64]| (f(w[0]) + 4.0 * f(0.5 * (w[0] + w[1])) + f(w[1])) / 6.0;
    v.windows(2).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::third_derivative;
    use bristle_core::weak::TestFunction;

    #[test]
    fn the_third_derivative_is_that_of_the_second() {
        let phi = TestFunction::new(0.1);
        let h = 1e-5;
        for k in -9..=9 {
            let tau = f64::from(k) * 0.01;
            let slope =
                (phi.second_derivative(tau + h) - phi.second_derivative(tau - h)) / (2.0 * h);
            let scale = phi.value(0.0) / 0.1_f64.powi(3);
            // Central differences err by h²/6 times the fifth derivative, below 10⁵·c/T⁵.
            assert!(
                (third_derivative(&phi, tau) - slope).abs() < 2e-3 * scale,
                "{tau}"
            );
        }
    }
}
