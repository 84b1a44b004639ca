//! Friction that the model gives as it is while the axis is cold: `τ = (coulomb_rise·sgn v + viscous_rise·v)·(1 − e^(−t/time_constant))`.

use super::thermal_drift::ThermalDrift;
use super::{Confusion, Effect, Given, Inner, Motion, Point, Quantity, Spec, Survey};
use crate::format::quantity;

pub(super) struct ThermalDriftFromCold;

impl Effect for ThermalDriftFromCold {
    fn id(&self) -> &'static str {
        ThermalDrift.id()
    }
    fn name(&self) -> &'static str {
        ThermalDrift.name()
    }
    fn doc(&self) -> &'static str {
        ThermalDrift.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("coulomb_rise", Quantity::Torque),
                Spec::new("viscous_rise", Quantity::Viscous),
                Spec::within(
                    "time_constant",
                    Quantity::Time,
                    (f64::MIN_POSITIVE, f64::INFINITY),
                ),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        ThermalDrift.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "Friction drifts over the run with a time constant of {}, by {} and {} from where it begins: warm the axis up before identifying, or let the controller adapt.",
            quantity(p[2], "s"),
            quantity(p[0], Quantity::Torque.unit(motion)),
            quantity(p[1], Quantity::Viscous.unit(motion))
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        // Where the levels are free, final ones say the same.
        (!axis.friction).then_some("the model gives no friction for it to begin with")
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
        ThermalDrift.grid(survey)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        let risen = -(-at.moment.t / inner[0]).exp_m1();
        (out[0], out[1]) = (at.s * risen, at.v * risen);
    }
}
