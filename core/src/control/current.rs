//! The innermost loop: voltage from current.

use serde::{Deserialize, Serialize};

use crate::Scalar;
use crate::friction::{OutOfRange, Units};

/// A PI controller of motor current, below a control law whose `u` is a current: the third loop of a cascade.
///
/// `V = Kp·(i_ref − i) + s + ke·v` within the limit and what the bus gives, where the last part takes the back-EMF away. The
/// integral part is a lag of the voltage that was applied, `s′ = s + ρ·(V − ke·v − s)`. While nothing is cut that is
/// `s′ = s + ρ·Kp·(i_ref − i)`, an integral with `Ki = ρ·Kp/T`. Where something is, the integral takes in the error from a set
/// point that could have been reached (Hanus, Kinnaert and Henrotte 1987, the conditioning technique): it cannot wind up, and
/// at the end of a saturation it is what it would be if the current had been asked for that there is.
///
/// The loop runs once a control period, on the current that is measured in it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurrentLoop<T> {
    /// `Kp`, V/A.
    pub proportional: T,
    /// `ρ`, the share of the way that the integral part goes in a sample, above 0 and at most 1.
    pub reset: T,
    /// `ke`, V·s/rad or V·s/m.
    pub back_emf: T,
    /// Largest voltage, V.
    pub limit: T,
}

/// What a sample of the loop goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Electrical<T> {
    /// Current asked for, A.
    pub wanted: T,
    /// Current measured, A.
    pub current: T,
    /// Velocity, rad/s or m/s.
    pub velocity: T,
    /// The most that the bridge can make of its bus now, V; not negative.
    pub available: T,
}

impl<T: Scalar> CurrentLoop<T> {
    /// `Kp` and `ρ` for a winding of `resistance` Ω and `inductance` H that is sampled every `period` s, and a bandwidth `ω`
    /// in rad/s.
    ///
    /// Under a held voltage the sampled winding is `(1 − a)/R/(z − a)` with `a = e^(−x)`, `x = R·T/L`, and the controller
    /// `Kp·(z − 1 + ρ)/(z − 1)`. `ρ = 1 − a` puts its zero on that pole, and `Kp = R·ω·T/(1 − a)`, which is `L·ω` where the
    /// sampling is fast, leaves `ω·T/(z − 1)` of the loop: the error of the current falls by `1 − ω·T` from sample to
    /// sample, whatever the winding.
    pub fn tuned(resistance: T, inductance: T, bandwidth: T, period: T) -> [T; 2] {
        let (gone, mean) = (resistance * period / inductance).relax();
        [inductance * bandwidth / mean, gone]
    }

    /// Whether the numbers are finite and in range.
    pub fn is_valid(&self) -> bool {
        let positive = |x: T| x.is_finite() && x > T::ZERO;
        positive(self.proportional)
            && positive(self.reset)
            && self.reset <= T::ONE
            && self.back_emf.is_finite()
            && positive(self.limit)
    }

    /// One sample: the voltage from now on and what the limits took off it, V; `sum` is the integral part, which starts at
    /// zero.
    #[must_use]
    pub fn step(&self, sum: &mut T, at: Electrical<T>) -> (T, T) {
        let most = if at.available < self.limit {
            at.available
        } else {
            self.limit
        };
        let push = self.proportional * (at.wanted - at.current);
        let counter = (self.back_emf * at.velocity).clamp_symmetric(most);
        let wanted = push + *sum + counter;
        let voltage = wanted.clamp_symmetric(most);
        let excess = wanted - voltage;
        *sum = sum.plus_product(self.reset, push - excess);
        (voltage, excess)
    }
}

impl CurrentLoop<f64> {
    /// The loop in `units`; voltage and current keep their own.
    pub fn scaled<T: Scalar>(&self, units: &Units) -> Result<CurrentLoop<T>, OutOfRange> {
        let scale = Units::scale::<T>;
        Ok(CurrentLoop {
            proportional: scale("current gain", self.proportional, 1.0)?,
            reset: scale("current reset", self.reset, 1.0)?,
            back_emf: scale("back_emf", self.back_emf, 1.0 / units.velocity)?,
            limit: scale("voltage limit", self.limit, 1.0)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{CurrentLoop, Electrical};
    use crate::friction::Units;
    use crate::scalar::{Q16, Scalar};

    const RESISTANCE: f64 = 2.6;
    const PERIOD: f64 = 1e-4;
    /// `ω·T`.
    const PACE: f64 = 0.04;

    /// In units of a millisecond, in which fixed point has numbers around 1.
    const UNITS: Units = Units {
        force: 1.0,
        position: 1e-3,
        velocity: 1.0,
    };

    fn drive(inductance: f64) -> CurrentLoop<f64> {
        let [proportional, reset] =
            CurrentLoop::tuned(RESISTANCE, inductance, PACE / PERIOD, PERIOD);
        CurrentLoop {
            proportional,
            reset,
            back_emf: 0.5,
            limit: 12.0,
        }
    }

    /// A winding under the loop: the current after each sample.
    struct Winding<T> {
        drive: CurrentLoop<T>,
        inductance: f64,
        sum: T,
        current: f64,
    }

    impl<T: Scalar> Winding<T> {
        fn new(inductance: f64) -> Self {
            let drive = drive(inductance).scaled(&UNITS).unwrap();
            assert!(drive.is_valid());
            Self {
                drive,
                inductance,
                sum: T::ZERO,
                current: 0.0,
            }
        }

        /// A sample, with so much voltage at hand; the voltage applied.
        fn advance(&mut self, wanted: f64, velocity: f64, available: f64) -> f64 {
            let number = T::from_f64;
            let at = Electrical {
                wanted: number(wanted),
                current: number(self.current),
                velocity: number(velocity),
                available: number(available),
            };
            let (voltage, excess) = self.drive.step(&mut self.sum, at);
            let voltage = voltage.to_f64();
            assert!(voltage.abs() <= available.min(12.0));
            assert!(excess == T::ZERO || excess.to_f64() * voltage > 0.0);
            let (gone, _) = (RESISTANCE * PERIOD / self.inductance).relax();
            self.current += ((voltage - 0.5 * velocity) / RESISTANCE - self.current) * gone;
            voltage
        }
    }

    /// From a winding that hardly changes in a sample to one that is through with it: the error falls by `1 − ω·T` each time.
    fn follows<T: Scalar>(tolerance: f64) {
        for inductance in [1.8e-3, 1.8e-4, 5e-5] {
            for velocity in [0.0, 8.0] {
                let mut winding = Winding::<T>::new(inductance);
                for k in 1..=200 {
                    winding.advance(2.0, velocity, 24.0);
                    let theory = 2.0 * (1.0 - (1.0 - PACE).powi(k));
                    let off = (winding.current - theory).abs();
                    assert!(off < tolerance, "{k}: {} and not {theory}", winding.current);
                }
            }
        }
    }

    #[test]
    fn the_current_follows_as_theory_says_whatever_winding_and_speed() {
        follows::<f64>(1e-9);
        follows::<f32>(1e-4);
        // A rounding of the voltage, 2⁻¹⁷ V, lasts for a time constant.
        follows::<Q16>(0.01);
    }

    #[test]
    fn a_low_bus_does_not_wind_the_integral_up() {
        let mut winding = Winding::<f64>::new(1.8e-3);
        // 2 A at 8 rad/s take 9.2 V, and there are 6.
        for _ in 0..5000 {
            assert!(winding.advance(2.0, 8.0, 6.0) <= 6.0);
        }
        assert!((winding.current - 2.0 / RESISTANCE).abs() < 1e-6);
        // From then on as if it had been asked for that current all along: it turns round at once.
        let start = winding.current;
        for k in 1..=100 {
            winding.advance(-2.0, 8.0, 12.0);
            let theory = -2.0 + (start + 2.0) * (1.0 - PACE).powi(k);
            assert!((winding.current - theory).abs() < 1e-6, "{k}");
        }
    }

    #[test]
    fn the_integral_stays_within_what_was_applied() {
        let mut winding = Winding::<f32>::new(1.8e-3);
        for k in 0..5000 {
            let sign = if k / 700 % 2 == 0 { 1.0 } else { -1.0 };
            winding.advance(50.0 * sign, 20.0 * sign, 6.0);
            assert!(winding.sum.abs() <= 12.0);
        }
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        let good = drive(1.8e-3);
        assert!(good.is_valid());
        let with = |change: fn(&mut CurrentLoop<f64>, f64), value| {
            let mut changed = good;
            change(&mut changed, value);
            changed.is_valid()
        };
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(!with(|l, x| l.limit = x, bad));
            assert!(!with(|l, x| l.proportional = x, bad));
            assert!(!with(|l, x| l.reset = x, bad));
        }
        assert!(!with(|l, x| l.reset = x, 1.001) && with(|l, x| l.reset = x, 1.0));
        assert!(!with(|l, x| l.back_emf = x, f64::NAN) && with(|l, x| l.back_emf = x, -0.1));
    }
}
