//! # What it is
//! The inertia that the model file gives as known is wrong; `inertia` is the one that moves. It can be told only where both
//! inertia and gain are given: an unknown inertia is estimated in any case.
//!
//! # What it looks like in a recording
//! The residual has the shape of the acceleration: the axis speeds up and slows down more, or less, than the model.
//!
//! # What excites it
//! Accelerations that take much of the drive, of both signs.
//!
//! # Confused with
//! An error of the gain scales inertia and friction together: add a known inertia.
//! actuator-lag and delay shift the acceleration instead of scaling it: chirp the drive.
//!
//! # Example
//! A data sheet without the load, a gear ratio forgotten or squared twice, a payload changed.
//!
//! # References
//! M. Gautier, W. Khalil, Direct calculation of minimum set of inertial parameters of serial robots, IEEE Trans. Robotics
//! and Automation 6(3), 1990 (what of the inertia a recording can show).

use super::{Confusion, Effect, Given, Motion, Quantity, Seat, Spec};
use crate::format::quantity;

pub(super) struct InertiaMismatch;

impl Effect for InertiaMismatch {
    fn id(&self) -> &'static str {
        "inertia-mismatch"
    }
    fn name(&self) -> &'static str {
        "Wrong inertia"
    }
    fn doc(&self) -> &'static str {
        include_str!("inertia_mismatch.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::within("inertia", Quantity::Inertia, (0.0, f64::INFINITY))] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "actuator-lag",
                    tell_apart_by: "chirp the drive: a wrong inertia errs by the same factor at every frequency, a lag by more and more",
                },
                Confusion {
                    id: "load-dependent-friction",
                    tell_apart_by: "compare speeding up with slowing down at the same drive: inertia errs alike in both, friction takes from one and helps the other",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "The inertia that moves is {}, not the one given: correct it in the model file and in the feedforward, and look for a load or gear ratio left out.",
            quantity(p[0], Quantity::Inertia.unit(motion))
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        (!axis.inertia).then_some(
            "it says that a given inertia is wrong, and plant.inertia and plant.gain are not both given as known",
        )
    }
    fn seat(&self) -> Seat {
        Seat::Inertia
    }
    fn width(&self) -> usize {
        0
    }
}
