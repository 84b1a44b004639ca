//! # What it is
//! The input acts later than recorded: `u(t − delay)`.
//!
//! # What it looks like in a recording
//! Every edge of the drive shows in the motion some samples late; a loop that should be stable rings. The residual has
//! the shape of the slope of `u`.
//!
//! # What excites it
//! Fast changes of the drive: steps, or a chirp up to `1/(2π·delay)`.
//!
//! # Confused with
//! actuator-lag when both are about 1 ms or less: chirp higher, or sample faster.
//!
//! # Example
//! Field-bus latency, computation delay of one control period, filtered measurements.
//!
//! # References
//! K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 1997, ch. 3 (delay under a zero-order hold).

use super::{Confusion, Effect, Motion, Path, Quantity, Seat, Spec, Survey};
use crate::format::quantity;

pub(super) struct Delay;

impl Effect for Delay {
    fn id(&self) -> &'static str {
        "delay"
    }
    fn name(&self) -> &'static str {
        "Input delay"
    }
    fn doc(&self) -> &'static str {
        include_str!("delay.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::within("delay", Quantity::Time, (0.0, f64::INFINITY))] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[Confusion {
                id: "actuator-lag",
                tell_apart_by: "chirp the drive up to 1/(2π·delay) or sample faster: a lag rounds the edges of the response, a delay only shifts them",
            }]
        }
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        format!(
            "The drive acts {} later than recorded: look for bus latency or a late sample, and take the delay into account when choosing the bandwidth.",
            quantity(1e3 * p[0], "ms")
        )
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
        // A delay beyond the half-width of the windows would decorrelate drive and response altogether.
        let most = survey.half_width.max(8.0 * survey.period);
        super::geometric(0.25 * survey.period, most, 16)
    }
    fn admissible(&self, _c: &[f64]) -> bool {
        true
    }
    fn transmit(&self, p: &[f64], path: &mut Path) {
        path.delay += p[0];
    }
}

