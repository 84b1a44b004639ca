//! # What it is
//! A restoring torque linear in position: `τ = stiffness·q`, stiffness > 0, at rest where `q = 0`; or
//! `τ = stiffness·(q − rest)`, as encoders count from anywhere. A constant offset beside a spring says the same as another
//! `rest` position, so `diagnose` names the spring alone.
//!
//! # What it looks like in a recording
//! The axis needs a drive that grows with its distance from where it rests. The residual is a straight line in position.
//!
//! # What excites it
//! Slow motion over the whole travel.
//!
//! # Confused with
//! gravity over a small part of a turn: use at least one full turn. hardening-spring over a small travel.
//!
//! # Example
//! A flexure stage, a return spring, a cable that bends, the mass-spring system of friction studies.
//!
//! # References
//! B. Armstrong-Hélouvry, Control of Machines with Friction, 1991 (mass-spring system with friction).

use super::spring_off_centre::SpringOffCentre;
use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Spec};
use crate::format::quantity;

pub(super) struct Spring;

impl Effect for Spring {
    fn id(&self) -> &'static str {
        "spring"
    }
    fn name(&self) -> &'static str {
        "Spring"
    }
    fn doc(&self) -> &'static str {
        include_str!("spring.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::new("stiffness", Quantity::Stiffness)] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "gravity",
                    tell_apart_by: "turn the axis at least once around: a spring keeps winding up, gravity repeats every turn",
                },
                Confusion {
                    id: "direction-asymmetry",
                    tell_apart_by: "let go of the axis from either side where friction is low: it comes to rest about the spring's rest position; turn it over, or take the spring off, and see whether an offset stays",
                },
                Confusion {
                    id: "hardening-spring",
                    tell_apart_by: "double the travel: a linear spring stays a straight line in position",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "A spring of {} pulls the axis towards its rest position: feed its torque forward, or raise the integral action at the ends of the travel.",
            quantity(p[0], Quantity::Stiffness.unit(motion))
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&SpringOffCentre]
    }
    fn basis(&self, _inner: Inner, at: Point, out: &mut [f64]) {
        out[0] = at.q;
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0] > 0.0
    }
}
