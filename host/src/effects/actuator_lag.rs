//! # What it is
//! A first-order lag between the input and the torque: `time_constant·ẏ = u − y`, the torque being `k·y`.
//!
//! # What it looks like in a recording
//! Edges of the drive are rounded off in the motion: the axis answers a step late and softly. The residual has the shape
//! of the slope of `u`.
//!
//! # What excites it
//! Fast changes of the drive: steps, or a chirp up to `1/(2π·time_constant)`.
//!
//! # Confused with
//! delay when both are about 1 ms or less, or short against the test functions: chirp higher, or sample faster.
//!
//! # Example
//! The electrical time constant L/R of a motor driven by voltage, the bandwidth of a current loop, a filter on the command.
//!
//! # References
//! W. Leonhard, Control of Electrical Drives, 2001, sec. 5.1 (the armature circuit) and 7.1 (the current loop).

use super::{Confusion, Effect, Given, Motion, Path, Quantity, Seat, Spec, Survey, geometric};
use crate::format::quantity;

/// Longest lag that is sought, s. A fit may go on to twice as much, as far as the free runs reach by which it is judged.
const LONGEST: f64 = 0.5;

pub(super) struct ActuatorLag;

impl Effect for ActuatorLag {
    fn id(&self) -> &'static str {
        "actuator-lag"
    }
    fn name(&self) -> &'static str {
        "Actuator lag"
    }
    fn doc(&self) -> &'static str {
        include_str!("actuator_lag.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::within("time_constant", Quantity::Time, (0.0, f64::INFINITY))] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "delay",
                    tell_apart_by: "chirp the drive up to 1/(2π·time_constant) or sample faster: a lag rounds the edges of the response, a delay only shifts them",
                },
                Confusion {
                    id: "compliance",
                    tell_apart_by: "chirp the drive past the suspected resonance: a lag only weakens the response, an elastic transmission raises it first",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        format!(
            "The torque follows the drive with a time constant of {}: raise the bandwidth of the current loop, or keep that of the position loop well below {}.",
            quantity(1e3 * p[0], "ms"),
            quantity(1.0 / (std::f64::consts::TAU * p[0]), "Hz")
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        (!axis.driven).then_some("under causality = \"inverse\" the input is a reaction, which nothing drives")
    }
    fn seat(&self) -> Seat {
        Seat::Input
    }
    fn width(&self) -> usize {
        0
    }
    fn inner(&self) -> Option<usize> {
        Some(0)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        let most = survey.half_width.max(LONGEST);
        geometric(0.25 * survey.period, most, 20)
    }
    fn transmit(&self, p: &[f64], path: &mut Path) {
        path.lag += p[0];
    }
}
