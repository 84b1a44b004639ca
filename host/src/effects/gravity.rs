//! # What it is
//! Unbalance of a rotary axis: `τ = amplitude·sin(q + phase)`, amplitude > 0. A pendulum whose rest position is
//! `q = 0` has phase 0 and amplitude `m·g·l`.
//!
//! # What it looks like in a recording
//! The axis needs drive to hold some positions; in free run it falls towards one. The residual is one sine per turn.
//!
//! # What excites it
//! Travel of at least half a turn, better a full one.
//!
//! # Confused with
//! spring and hardening-spring when the travel is a small part of a turn: use at least one full turn.
//!
//! # Example
//! A robot joint with a horizontal axis; a pan-tilt head; an eccentric chuck.
//!
//! # References
//! B. Siciliano et al., Robotics: Modelling, Planning and Control, 2009, ch. 7 (gravity terms).

use super::{Confusion, Effect, FREE, Given, Inner, Motion, Point, Quantity, Scale, Spec, cartesian, polar};
use crate::format::quantity;
use std::f64::consts::{PI, TAU};

pub(super) struct Gravity;

impl Effect for Gravity {
    fn id(&self) -> &'static str {
        "gravity"
    }
    fn name(&self) -> &'static str {
        "Gravity (unbalance)"
    }
    fn doc(&self) -> &'static str {
        include_str!("gravity.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("amplitude", Quantity::Torque),
                Spec::new("phase", Quantity::Phase),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "spring",
                    tell_apart_by: "turn the axis at least once around: gravity repeats every turn, a spring keeps winding up",
                },
                Confusion {
                    id: "hardening-spring",
                    tell_apart_by: "turn the axis at least once around: gravity repeats every turn, a hardening spring keeps stiffening",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        // The stable rest position, from −π to π.
        let rest = (PI - p[1]).rem_euclid(TAU) - PI;
        format!(
            "An unbalance of {} pulls the axis towards q = {}: balance it, or feed amplitude·sin(q + phase) forward.",
            quantity(p[0], Quantity::Torque.unit(motion)),
            quantity(rest, Quantity::Phase.unit(motion))
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        (axis.motion == Motion::Linear)
            .then_some("an unbalance turns; on a linear axis the weight is a constant force, direction-asymmetry")
    }
    fn width(&self) -> usize {
        2
    }
    fn basis(&self, _inner: Inner, at: Point, out: &mut [f64]) {
        (out[0], out[1]) = at.q.sin_cos();
    }
    fn named(&self, _inner: Inner, c: &[f64], _scale: Scale) -> Vec<f64> {
        polar(c).to_vec()
    }
    fn linear(&self, p: &[f64], _scale: Scale) -> (Inner, Vec<f64>) {
        (FREE, cartesian(p[0], p[1]))
    }
}
