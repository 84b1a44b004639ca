//! The innermost loop: voltage from current.

use serde::{Deserialize, Serialize};

use super::Pid;
use crate::Scalar;

/// A PI controller of motor current, for drives whose `u` is a current: the third loop of a cascade.
///
/// `V = Kp·(i_ref − i) + Ki·∫(i_ref − i) dt + ke·v` within ±`limit`, where the last part takes the back-EMF away.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurrentLoop<T> {
    /// V/A and V/(A·s).
    pub gains: Pid<T>,
    /// `ke`, V·s/rad or V·s/m.
    pub back_emf: T,
    /// Largest voltage, V.
    pub limit: T,
    /// Sampling period, s.
    pub period: T,
}

impl<T: Scalar> CurrentLoop<T> {
    /// Gains for a winding of `resistance` Ω and `inductance` H and a bandwidth in rad/s: `Kp = L·ω` and `Ki = R·ω` cancel
    /// the pole of the winding, and what is left of the loop is `ω/s`.
    pub fn tuned(resistance: T, inductance: T, bandwidth: T) -> Pid<T> {
        Pid {
            proportional: inductance * bandwidth,
            integral: resistance * bandwidth,
            derivative: T::ZERO,
        }
    }

    /// Whether the numbers are finite and in range.
    pub fn is_valid(&self) -> bool {
        let positive = |x: T| x.is_finite() && x > T::ZERO;
        self.gains.is_valid()
            && self.back_emf.is_finite()
            && positive(self.limit)
            && positive(self.period)
    }

    /// One sample: the voltage from now on, V; `sum` is the integral part, which starts at zero.
    #[must_use]
    pub fn step(&self, sum: &mut T, wanted: T, current: T, velocity: T) -> T {
        let counter = (self.back_emf * velocity).clamp_symmetric(self.limit);
        let error = wanted - current;
        let voltage = self.gains.output(*sum, error, T::ZERO) + counter;
        let limited = voltage.clamp_symmetric(self.limit);
        *sum = self
            .gains
            .integrated(*sum, error, self.period, voltage - limited, self.limit);
        limited
    }
}

#[cfg(test)]
mod tests {
    use super::CurrentLoop;
    use crate::scalar::{Q16, Scalar};

    /// Current after `n` samples of a winding that turns at `velocity`, and the largest current on the way.
    fn run<T: Scalar>(n: usize, velocity: f64) -> (f64, f64) {
        let number = T::from_f64;
        // Time in ms: 2.6 Ω, 1.8 mH, 0.4 1/ms.
        let drive = CurrentLoop {
            gains: CurrentLoop::tuned(number(2.6), number(1.8), number(0.4)),
            back_emf: number(0.5),
            limit: number(12.0),
            period: number(0.1),
        };
        assert!(drive.is_valid());
        let (mut sum, mut current, mut most) = (T::ZERO, 0.0_f64, 0.0_f64);
        for _ in 0..n {
            let voltage = drive
                .step(&mut sum, number(2.0), number(current), number(velocity))
                .to_f64();
            assert!(voltage.abs() <= 12.0);
            let (relaxed, _) = (0.1 * 2.6 / 1.8).relax();
            current += ((voltage - 0.5 * velocity) / 2.6 - current) * relaxed;
            most = most.max(current);
        }
        (current, most)
    }

    #[test]
    fn the_current_rises_as_a_first_order_lag_whatever_the_speed() {
        for velocity in [0.0, 8.0] {
            // After one time constant, 2.5 ms, 1 − 1/e of 2 A; sampling advances the loop by a few percent.
            let (current, _) = run::<f64>(25, velocity);
            assert!((current / 2.0 - 0.632).abs() < 0.03, "{current}");
            let (end, most) = run::<f64>(400, velocity);
            assert!((end - 2.0).abs() < 1e-3 && most < 2.06);
            assert!((run::<Q16>(400, velocity).0 - 2.0).abs() < 0.01);
        }
    }
}
