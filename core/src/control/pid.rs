//! Proportional, integral and derivative action.

use serde::{Deserialize, Serialize};

use crate::Scalar;

/// `y = Kp·e + Ki·∫e dt + Kd·ė`, limited, with an integral that never winds up.
///
/// The error `e` and its rate come from the caller, who knows whether the set point belongs into the rate. With
/// `derivative = 0` it is a PI controller.
///
/// # Anti-windup
/// The integral only takes in what does not push the output further beyond a limit that it is at already (conditional
/// integration), and never exceeds that limit itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pid<T> {
    /// `Kp`, output per error.
    pub proportional: T,
    /// `Ki`, output per error and second.
    pub integral: T,
    /// `Kd`, output per rate of the error.
    pub derivative: T,
}

impl<T: Scalar> Pid<T> {
    /// Whether the gains are finite and not negative.
    pub fn is_valid(&self) -> bool {
        let gains = [self.proportional, self.integral, self.derivative];
        gains.into_iter().all(|k| k.is_finite() && k >= T::ZERO)
    }

    /// The output, without a limit, at the integral part `sum`.
    #[inline]
    pub fn output(&self, sum: T, error: T, rate: T) -> T {
        (self.proportional * error + sum).plus_product(self.derivative, rate)
    }

    /// The integral part after `period` seconds of `error`, where `excess` is what the limits took off the output and
    /// `bound` the largest integral part that makes sense.
    #[must_use]
    #[inline]
    pub fn integrated(&self, sum: T, error: T, period: T, excess: T, bound: T) -> T {
        let step = self.integral * error * period;
        let further = if excess > T::ZERO {
            step > T::ZERO
        } else {
            excess < T::ZERO && step < T::ZERO
        };
        if further {
            return sum.clamp_symmetric(bound);
        }
        (sum + step).clamp_symmetric(bound)
    }

    /// One sample: the output within ±`limit`, at the integral part `sum`, which is brought forward.
    #[must_use]
    pub fn step(&self, sum: &mut T, error: T, rate: T, limit: T, period: T) -> T {
        let wanted = self.output(*sum, error, rate);
        let output = wanted.clamp_symmetric(limit);
        *sum = self.integrated(*sum, error, period, wanted - output, limit);
        output
    }
}

#[cfg(test)]
mod tests {
    use super::Pid;
    use crate::scalar::{Q16, Scalar};

    const PI: Pid<f64> = Pid {
        proportional: 2.0,
        integral: 10.0,
        derivative: 0.0,
    };

    #[test]
    fn each_part_acts_as_its_equation_says() {
        let pid = Pid {
            derivative: 0.5,
            ..PI
        };
        let mut sum = 0.0;
        assert_eq!(pid.step(&mut sum, 1.0, -2.0, 100.0, 0.01), 1.0);
        assert_eq!(pid.step(&mut sum, 1.0, -2.0, 100.0, 0.01), 1.1);
        assert!((sum - 0.2).abs() < 1e-15);
    }

    /// Samples after the error has changed its sign until the output has left the limit.
    fn samples_at_the_limit<T: Scalar>() -> usize {
        let number = T::from_f64;
        let pid = Pid {
            proportional: number(2.0),
            integral: number(10.0),
            derivative: T::ZERO,
        };
        let mut sum = T::ZERO;
        for _ in 0..100_000 {
            let output = pid.step(&mut sum, number(3.0), T::ZERO, number(5.0), number(0.01));
            assert!(output <= number(5.0) && sum <= number(5.0));
        }
        let leaves = |_: &usize| {
            pid.step(&mut sum, number(-0.5), T::ZERO, number(5.0), number(0.01)) < number(5.0)
        };
        (0..1000).find(leaves).unwrap_or(1000)
    }

    #[test]
    fn a_long_saturation_is_left_at_once() {
        assert_eq!(samples_at_the_limit::<f64>(), 0);
        assert_eq!(samples_at_the_limit::<f32>(), 0);
        assert_eq!(samples_at_the_limit::<Q16>(), 0);
    }

    #[test]
    fn negative_and_infinite_gains_are_refused() {
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(
                !Pid {
                    integral: bad,
                    ..PI
                }
                .is_valid()
            );
        }
        assert!(PI.is_valid());
    }
}
