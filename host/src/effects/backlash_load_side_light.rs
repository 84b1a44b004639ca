//! Lost motion between a motor without friction of its own and a measured load that is lighter: see [`crate::slack`] for the equation.

use super::backlash::{Backlash, CONTACT};
use super::{
    Confusion, Coupling, Effect, Given, MOTOR, Motion, Path, Quantity, Seat, Spec, Survey,
};
use crate::format::quantity;

pub(super) struct BacklashLoadSideLight;

impl Effect for BacklashLoadSideLight {
    fn id(&self) -> &'static str {
        Backlash.id()
    }
    fn name(&self) -> &'static str {
        Backlash.name()
    }
    fn doc(&self) -> &'static str {
        Backlash.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::within("gap", Quantity::Position, (0.0, f64::INFINITY)),
                // Neither side is without inertia.
                Spec::within("motor_share", Quantity::Number, (0.05, 0.95)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        Backlash.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "The measured side, which has the friction, follows the drive with a play of {}: preload or replace the gear or coupling, or cross the gap slowly at reversals.",
            quantity(p[0], Quantity::Position.unit(motion))
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        Backlash.unsuited(axis)
    }
    fn seat(&self) -> Seat {
        Seat::Input
    }
    fn divides(&self) -> bool {
        true
    }
    fn width(&self) -> usize {
        0
    }
    fn inner(&self) -> Option<usize> {
        Some(0)
    }
    fn shape(&self) -> Option<usize> {
        Some(1)
    }
    fn textbook(&self) -> Option<f64> {
        Some(MOTOR)
    }
    fn shapes(&self, _survey: &Survey) -> Vec<f64> {
        // Half as heavy again as the load, and three times as heavy.
        vec![0.6, 0.75]
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        Backlash.grid(survey)
    }
    fn transmit(&self, p: &[f64], path: &mut Path) {
        (path.gap, path.friction_before_gap, path.inertia_before_gap) = (p[0], 0.0, p[1]);
    }
    fn coupling(&self, p: &[f64], inertia: f64, [coulomb, viscous]: [f64; 2]) -> Option<Coupling> {
        let load = (1.0 - p[1]) * inertia;
        // Without a gap both sides are one.
        (p[0] > 0.0).then_some(Coupling {
            inertia: load,
            stiffness: load * CONTACT * CONTACT,
            damping: 2.0 * load * CONTACT,
            gap: p[0],
            friction: coulomb,
            viscous,
            load_side: true,
        })
    }
}
