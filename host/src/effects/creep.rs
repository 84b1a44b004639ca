//! # What it is
//! Friction that grows with speed from next to nothing at standstill instead of jumping there: of the Coulomb level,
//! `τ = level·(tanh(v/velocity) − sgn v)` is missing, `level > 0`.
//!
//! No effect of the catalogue: below breakaway an axis creeps in place of standing still, by so little that no controller
//! and no table minds. But Coulomb friction, which holds such an axis, leaves a torque there that is no noise either, and
//! effects that act now and then, or at small inputs, take it for theirs. Simulators smooth friction so.
//!
//! # References
//! D. Karnopp, Computer simulation of stick-slip friction in mechanical dynamic systems, ASME Journal of Dynamic Systems
//! 107, 1985 (why simulators do); E. Pennestrì et al., Review and comparison of dry friction force models, Nonlinear
//! Dynamics 83, 2016.

use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Spec, Survey, geometric};
use crate::format::quantity;

/// Sought beside the effects of the catalogue.
pub static CREEP: Creep = Creep;

/// See the module.
pub struct Creep;

impl Effect for Creep {
    fn id(&self) -> &'static str {
        "creep"
    }
    fn name(&self) -> &'static str {
        "Creep"
    }
    fn doc(&self) -> &'static str {
        include_str!("creep.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::within("level", Quantity::Torque, (0.0, f64::INFINITY)),
                Spec::within(
                    "velocity",
                    Quantity::Speed,
                    (f64::MIN_POSITIVE, f64::INFINITY),
                ),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        &[]
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "Below about {} friction grows with speed instead of holding the axis: it creeps where the model says that it stands.",
            quantity(p[1], Quantity::Speed.unit(motion))
        )
    }
    fn nuisance(&self) -> bool {
        true
    }
    fn inner(&self) -> Option<usize> {
        Some(1)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        // Up to where it would bend the friction curve that effects of the catalogue describe.
        geometric(3e-4 * survey.top_speed, 0.03 * survey.top_speed, 12)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        // A cell in which the velocity changes sign knows how much of it lies on either side.
        out[0] = if at.s.abs() < 1.0 {
            0.0
        } else {
            (at.v / inner[0]).tanh() - at.s
        };
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0] > 0.0
    }
}
