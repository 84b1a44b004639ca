//! # What it is
//! Friction that changes over the run as the axis warms and comes to rest at the model's own levels:
//! `τ = (coulomb_change·sgn v + viscous_change·v)·e^(−t/time_constant)`, time counted from the first sample. Positive
//! changes are what the cold axis has more.
//!
//! Friction that a model file gives may be that of the cold axis instead. With `coulomb_rise` and `viscous_rise` it begins there:
//! `τ = (coulomb_rise·sgn v + viscous_rise·v)·(1 − e^(−t/time_constant))`. `diagnose` tries both.
//!
//! # What it looks like in a recording
//! The same motion takes less and less drive; the residual has the sign of velocity and fades.
//!
//! # What excites it
//! The same motion over and over, in both directions at several speeds, for longer than the time constant, from cold.
//!
//! # Confused with
//! load-step and slow changes of the load: repeat the recording cold and warm.
//!
//! # Example
//! Grease that thins, seals that soften, preload that thermal growth takes away.
//!
//! # References
//! L. Simoni, M. Beschi, G. Legnani, A. Visioli, Modelling the temperature in joint friction of industrial
//! manipulators, Robotica 37(5), 2019 (friction that follows a first-order temperature).

use super::thermal_drift_from_cold::ThermalDriftFromCold;
use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Spec, Survey, geometric};
use crate::format::quantity;

pub(super) struct ThermalDrift;

impl Effect for ThermalDrift {
    fn id(&self) -> &'static str {
        "thermal-drift"
    }
    fn name(&self) -> &'static str {
        "Thermal drift of friction"
    }
    fn doc(&self) -> &'static str {
        include_str!("thermal_drift.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("coulomb_change", Quantity::Torque),
                Spec::new("viscous_change", Quantity::Viscous),
                Spec::within("time_constant", Quantity::Time, (f64::MIN_POSITIVE, f64::INFINITY)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "load-step",
                    tell_apart_by: "repeat the recording cold and warm: drift changes friction in both directions alike and gradually, a load step leans to one side at once",
                },
                Confusion {
                    id: "load-dependent-friction",
                    tell_apart_by: "repeat the recording cold and warm: drift is there only from cold, load-dependent friction both times",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "Friction drifts over the run with a time constant of {}, from {} and {} beside its final levels: warm the axis up before identifying, or let the controller adapt.",
            quantity(p[2], "s"),
            quantity(p[0], Quantity::Torque.unit(motion)),
            quantity(p[1], Quantity::Viscous.unit(motion))
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&ThermalDriftFromCold]
    }
    fn timed(&self) -> bool {
        true
    }
    fn width(&self) -> usize {
        2
    }
    fn inner(&self) -> Option<usize> {
        Some(2)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        // Faster is gone with the start, slower is a straight line.
        geometric(0.03 * survey.duration, 3.0 * survey.duration, 8)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        let left = (-at.moment.t / inner[0]).exp();
        (out[0], out[1]) = (at.s * left, at.v * left);
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, ThermalDrift};
    use crate::effects::{Moment, Motion, Point};

    #[test]
    fn what_is_added_when_cold_is_gone_when_warm() {
        let at = |t: f64| {
            let at = Point::new(Motion::Rotary, 0.0, -3.0, -1.0).at(Moment { t, dt: 0.0, u: 0.0 });
            let mut b = [0.0; 2];
            ThermalDrift.basis([5.0, 0.0], at, &mut b);
            b
        };
        assert_eq!(at(0.0), [-1.0, -3.0]);
        assert!((at(5.0)[1] + 3.0 * (-1f64).exp()).abs() < 1e-15 && at(1e3)[0].abs() < 1e-80);
    }
}
