//! # What it is
//! A viscous coefficient that differs by direction: `τ = difference·|v|`, so that the coefficients are
//! `Fv⁺ = Fv + difference` and `Fv⁻ = Fv − difference`.
//!
//! # What it looks like in a recording
//! Fast moves need more drive in one direction than in the other, slow moves do not. The residual is a V in velocity.
//!
//! # What excites it
//! Several speeds in both directions.
//!
//! # Confused with
//! direction-asymmetry when only one speed was driven; quadratic-drag when the fast moves went one way only.
//!
//! # Example
//! A ball screw with a fatigued flank (EMPS); a seal with a lip; a fan or pump on the axis.
//!
//! # References
//! A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, 2019 (direction-dependent model).

use super::{Confusion, Derived, Effect, Inner, Motion, Point, Quantity, Spec};
use crate::format::quantity;

pub(super) struct ViscousAsymmetry;

impl Effect for ViscousAsymmetry {
    fn id(&self) -> &'static str {
        "viscous-asymmetry"
    }
    fn name(&self) -> &'static str {
        "Direction-dependent viscous friction"
    }
    fn doc(&self) -> &'static str {
        include_str!("viscous_asymmetry.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::new("difference", Quantity::Viscous)] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "direction-asymmetry",
                    tell_apart_by: "drive at least three constant speeds in each direction: an asymmetric viscous part grows with speed, an offset does not",
                },
                Confusion {
                    id: "quadratic-drag",
                    tell_apart_by: "drive the highest speed in both directions: drag bends both branches alike",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        let side = if p[0] > 0.0 { "positive" } else { "negative" };
        format!(
            "Viscous friction is {} higher in the {side} direction than in the other: compensate with a coefficient for each direction, and look for wear on one flank.",
            quantity(2.0 * p[0].abs(), Quantity::Viscous.unit(motion))
        )
    }
    fn basis(&self, _inner: Inner, at: Point, out: &mut [f64]) {
        out[0] = at.v.abs();
    }
    fn derived(&self) -> &'static [Derived] {
        const {
            &[
                Derived { name: "viscous_positive", quantity: Quantity::Viscous, weights: [1.0, 0.0, 1.0] },
                Derived { name: "viscous_negative", quantity: Quantity::Viscous, weights: [-1.0, 0.0, 1.0] },
            ]
        }
    }
}
