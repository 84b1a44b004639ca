//! # What it is
//! A Coulomb level that differs by direction, or a constant offset torque: the same thing while sliding.
//! `τ = offset`, resisting motion in the positive direction, so that the levels are
//! `Fc⁺ = Fc + offset` and `Fc⁻ = Fc − offset`.
//!
//! # What it looks like in a recording
//! The axis needs more drive in one direction than in the other at every speed alike. In free run the position
//! drifts steadily to one side. The residual is a constant.
//!
//! # What excites it
//! Any motion in both directions.
//!
//! # Confused with
//! viscous-asymmetry when only one speed was driven: use at least three speeds in each direction. An offset and an
//! asymmetric Coulomb level cannot be told apart while sliding: turn the axis over, or change the load.
//!
//! # Example
//! An axis that is not level; an amplifier or current sensor with an offset; a screw worn on one flank.
//!
//! # References
//! A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, 2019, eq. 1 (the offset).

use super::{Confusion, Derived, Effect, Inner, Motion, Point, Quantity, Spec};
use crate::format::quantity;

pub(super) struct DirectionAsymmetry;

impl Effect for DirectionAsymmetry {
    fn id(&self) -> &'static str {
        "direction-asymmetry"
    }
    fn name(&self) -> &'static str {
        "Direction-dependent Coulomb level or offset"
    }
    fn doc(&self) -> &'static str {
        include_str!("direction_asymmetry.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::new("offset", Quantity::Torque)] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[Confusion {
                id: "viscous-asymmetry",
                tell_apart_by: "drive at least three constant speeds in each direction: an offset is the same at each, an asymmetric viscous part grows with speed",
            }]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        let side = if p[0] > 0.0 { "positive" } else { "negative" };
        format!(
            "A constant {} resists motion in the {side} direction: level the axis, null the drive's offset, or feed the constant forward.",
            quantity(p[0].abs(), Quantity::Torque.unit(motion))
        )
    }
    fn basis(&self, _inner: Inner, _at: Point, out: &mut [f64]) {
        out[0] = 1.0;
    }
    fn derived(&self) -> &'static [Derived] {
        const {
            &[
                Derived { name: "coulomb_positive", quantity: Quantity::Torque, weights: [1.0, 1.0, 0.0] },
                Derived { name: "coulomb_negative", quantity: Quantity::Torque, weights: [-1.0, 1.0, 0.0] },
            ]
        }
    }
}
