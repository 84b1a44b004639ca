//! # What it is
//! Small inputs produce no torque, and larger ones less by as much: `u − half_width·sgn u` beyond `|u| = half_width`, zero
//! within. Or inputs beyond a `threshold` act in full, with a jump.
//!
//! # What it looks like in a recording
//! Around zero drive the axis coasts although something is commanded; a loop hunts. The residual has the sign of the
//! drive and a constant size.
//!
//! # What excites it
//! Slow changes of the drive through zero while the axis moves: braking and speeding up at the same speed.
//!
//! # Confused with
//! The Coulomb level, which has the sign of velocity: brake as much as you speed up. backlash: small steps of several
//! sizes, or log the current.
//!
//! # Example
//! Dead time of an inverter's bridge, dead band of an amplifier, overlap of a hydraulic valve.
//!
//! # References
//! G. Tao, P. V. Kokotović, Adaptive control of plants with unknown dead-zones, IEEE TAC 39(1), 1994, eq. 2.1.

use super::input_dead_zone_jump::InputDeadZoneJump;
use super::{Confusion, Effect, Given, Motion, Path, Quantity, Seat, Spec, Survey, geometric, uncut};
use crate::format::significant;

pub(super) struct InputDeadZone;

impl Effect for InputDeadZone {
    fn id(&self) -> &'static str {
        "input-dead-zone"
    }
    fn name(&self) -> &'static str {
        "Input dead zone"
    }
    fn doc(&self) -> &'static str {
        include_str!("input_dead_zone.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::within("half_width", Quantity::Input, (0.0, f64::INFINITY))] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "load-dependent-friction",
                    tell_apart_by: "hold a constant load and move both ways: a dead zone takes the same off every drive, load-dependent friction a share of it",
                },
                Confusion {
                    id: "backlash",
                    tell_apart_by: "step the drive by several small amounts and log the current: a dead zone leaves the current at zero, backlash lets the motor move alone",
                },
                Confusion {
                    id: "direction-asymmetry",
                    tell_apart_by: "drive with both signs in each direction: an offset keeps its sign, a dead zone has that of the drive",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        format!(
            "Inputs up to u = ±{} do nothing and larger ones act less by as much: add this amount with the sign of u, and check dead time and dead band of the amplifier.",
            significant(p[0], 3)
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&InputDeadZoneJump]
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        uncut(axis)
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
        geometric(0.01 * survey.input.0, survey.input.0, 14)
    }
    fn transmit(&self, p: &[f64], path: &mut Path) {
        path.dead_zone += p[0];
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, InputDeadZone};
    use crate::effects::Path;

    #[test]
    fn it_takes_the_same_off_every_larger_input() {
        let mut path = Path::default();
        InputDeadZone.transmit(&[0.2], &mut path);
        assert_eq!([0.1, 0.5, -1.2].map(|u| path.pass(u)), [0.0, 0.3, -1.0]);
    }
}
