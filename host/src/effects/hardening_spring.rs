//! # What it is
//! A restoring torque with a cubic part: `τ = stiffness·q + cubic·q³`, cubic > 0, at rest where `q = 0`; or, with a `rest`
//! position, the same of `q − rest`, as encoders count from anywhere.
//!
//! # What it looks like in a recording
//! Little happens in the middle of the travel, much at its ends. The residual is a cubic in position.
//!
//! # What excites it
//! Motion over the whole travel, both ends included.
//!
//! # Confused with
//! spring over a small travel; gravity, which softens where this hardens, over a part of a turn.
//!
//! # Example
//! Elastic end stops, membranes, leaf springs that tighten, cable drag chains.
//!
//! # References
//! G. Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, 1918.

use super::hardening_spring_off_centre::HardeningSpringOffCentre;
use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Spec};
use crate::format::quantity;

pub(super) struct HardeningSpring;

impl Effect for HardeningSpring {
    fn id(&self) -> &'static str {
        "hardening-spring"
    }
    fn name(&self) -> &'static str {
        "Hardening spring"
    }
    fn doc(&self) -> &'static str {
        include_str!("hardening_spring.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("stiffness", Quantity::Stiffness),
                Spec::new("cubic", Quantity::Cubic),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "spring",
                    tell_apart_by: "double the travel: a hardening spring bends away from the straight line",
                },
                Confusion {
                    id: "gravity",
                    tell_apart_by: "turn the axis at least once around: a hardening spring keeps stiffening, gravity repeats every turn",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "A spring that stiffens by {} resists at the ends of the travel: look for end stops or a tightening cable, or feed the cubic forward.",
            quantity(p[1], Quantity::Cubic.unit(motion))
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&HardeningSpringOffCentre]
    }
    fn width(&self) -> usize {
        2
    }
    fn essential(&self) -> Option<usize> {
        // Without the cubic it is a spring.
        Some(1)
    }
    fn includes(&self) -> Option<&'static str> {
        Some("spring")
    }
    fn basis(&self, _inner: Inner, at: Point, out: &mut [f64]) {
        out[0] = at.q;
        out[1] = at.q * at.q * at.q;
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[1] > 0.0
    }
}
