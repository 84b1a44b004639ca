//! # What it is
//! Torque that grows with the square of speed: `τ = coefficient·v·|v|`, coefficient > 0.
//!
//! # What it looks like in a recording
//! Top speed stays below what the linear model promises. The residual is odd in velocity and lives at high speed.
//!
//! # What excites it
//! Speeds over a range of at least one to three, in both directions.
//!
//! # Confused with
//! viscous friction where the speed range is narrow; saturation, where top speed and top drive coincide.
//!
//! # Example
//! Fans, propellers, churning oil, parts that move air.
//!
//! # References
//! H. Olsson et al., Friction models and friction compensation, European Journal of Control 4(3), 1998.

use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Spec};
use crate::format::quantity;

pub(super) struct QuadraticDrag;

impl Effect for QuadraticDrag {
    fn id(&self) -> &'static str {
        "quadratic-drag"
    }
    fn name(&self) -> &'static str {
        "Quadratic drag"
    }
    fn doc(&self) -> &'static str {
        include_str!("quadratic_drag.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::new("coefficient", Quantity::Quadratic)] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "saturation",
                    tell_apart_by: "coast from top speed with the drive off: drag still slows the axis faster at first, a saturating drive has no part in it",
                },
                Confusion {
                    id: "stribeck",
                    tell_apart_by: "add constant speeds at both ends of the range: drag bends the friction curve at the top, Stribeck at the bottom",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "Drag of {} bends the torque-speed curve at high speed: add the v·|v| term to the feed-forward and check the torque reserve at top speed.",
            quantity(p[0], Quantity::Quadratic.unit(motion))
        )
    }
    fn basis(&self, _inner: Inner, at: Point, out: &mut [f64]) {
        out[0] = at.v * at.v.abs();
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0] > 0.0
    }
}
