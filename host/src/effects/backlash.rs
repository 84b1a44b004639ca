//! # What it is
//! Lost motion: part of the inertia, `load_inertia`, is carried along with a play of `gap` in all. Within it the load flies on
//! by itself; at its ends it is caught without a rebound. The model's inertia is that of both together.
//!
//! A load with friction of its own is slowed by it at `load_deceleration`, down to rest; of the model's Coulomb level
//! `load_inertia·load_deceleration` is then the load's. With the load ahead by `y`, moving in direction `s_L` while the measured
//! side moves in direction `s`, `J·q̈ + J_L·(ÿ + load_deceleration·(s_L − s)) + F = k·u`. Left out, all friction is the measured
//! side's.
//!
//! Where the encoder sits on the load, the load goes on by itself while the motor crosses the gap, and the drive reaches it with
//! a blow. A recording then shows hardly more of inertia and gap than their product, so that the parameters are `matched_gap`,
//! the gap if both sides weigh alike (the gap times twice the motor's share of the inertia), and `motor_friction`, the share of
//! the friction that is the motor's. A light load with all the friction parts from its motor only when that brakes hard, and tells
//! both: `gap`, and `motor_share`, the motor's share of the inertia. `diagnose` tries all four, and a model file may have any.
//!
//! # What it looks like in a recording
//! Where the axis slows down or reverses it is, for a moment, lighter than before, and has less friction, until the load is
//! caught with a jerk.
//!
//! # What excites it
//! Reversals and hard changes of the drive, with strokes of several sizes; an encoder of at least six counts in the gap.
//!
//! # Confused with
//! compliance, presliding and input-dead-zone: small steps of several amplitudes, or a load-side encoder.
//!
//! # Example
//! Gear trains, worn couplings and keys, nuts of ball screws without preload.
//!
//! # References
//! M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38(10), 2002, sec. 2.

use super::backlash_braked::BacklashBraked;
use super::backlash_load_side::BacklashLoadSide;
use super::{Carried, Confusion, Coupling, Effect, Given, Inner, Motion, Quantity, Seat, Spec, Survey, geometric, undriven};
use crate::format::quantity;

/// Natural frequency of the contact at the ends of the gap in simulation, rad/s: a catch within about a millisecond.
pub const CONTACT: f64 = 2000.0;

pub(super) struct Backlash;

impl Effect for Backlash {
    fn id(&self) -> &'static str {
        "backlash"
    }
    fn name(&self) -> &'static str {
        "Backlash"
    }
    fn doc(&self) -> &'static str {
        include_str!("backlash.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::within("load_inertia", Quantity::Inertia, (0.0, f64::INFINITY)),
                Spec::within("gap", Quantity::Position, (0.0, f64::INFINITY)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "compliance",
                    tell_apart_by: "make small steps of several amplitudes, or add a load-side encoder: a spring answers in proportion, lost motion is the same whatever the step",
                },
                Confusion {
                    id: "presliding",
                    tell_apart_by: "reverse with strokes of several sizes: in a gap the drive meets no resistance at all and the load jumps at its end, bristles resist from the first count on",
                },
                Confusion {
                    id: "input-dead-zone",
                    tell_apart_by: "step the drive by several small amounts and log the current: a dead zone leaves the current at zero, backlash lets the motor move alone",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "A load of {} follows with a play of {}: preload or replace the gear or coupling, or cross the gap slowly at reversals.",
            quantity(p[0], Quantity::Inertia.unit(motion)),
            quantity(p[1], Quantity::Position.unit(motion))
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&BacklashBraked, &BacklashLoadSide::ALIKE, &BacklashLoadSide::LIGHT]
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        undriven(axis)
    }
    fn seat(&self) -> Seat {
        Seat::Load
    }
    fn inner(&self) -> Option<usize> {
        Some(1)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        // A quantiser's noise is its count over √12: six counts. Beyond a tenth of the travel a gap would be seen.
        let most = 0.1 * (survey.travel.1 - survey.travel.0).max(f64::MIN_POSITIVE);
        let least = (6.0 * 12f64.sqrt() * survey.position_noise).max(1e-4 * most);
        geometric(least.min(0.5 * most), most, 14)
    }
    fn load(&self, inner: Inner, _q: &[f64], v: &[f64], period: f64) -> Carried {
        carried(inner[0], 0.0, v, period)
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0] > 0.0
    }
    fn coupling(&self, p: &[f64], _inertia: f64, _friction: [f64; 2]) -> Option<Coupling> {
        Some(Coupling {
            inertia: p[0],
            stiffness: p[0] * CONTACT * CONTACT,
            damping: 2.0 * p[0] * CONTACT,
            gap: p[1],
            friction: 0.0,
            viscous: 0.0,
            load_side: false,
        })
    }
}

/// A mass between two walls that move with the measured side at velocity `v`, slowed by friction of its own and caught where it
/// meets one. Velocities are the smoothed ones: a wall that jitters by counts would throw the load.
pub(super) fn carried(gap: f64, deceleration: f64, v: &[f64], period: f64) -> Carried {
    let (half, braked) = (0.5 * gap, deceleration.max(0.0) * period);
    let (mut y, mut rate) = (0.0_f64, 0.0);
    let (mut ahead, mut resisting) = (vec![0.0], Vec::new());
    for pair in v.windows(2) {
        let before = rate;
        let speed = pair[0] + before;
        let slowed = speed - speed.clamp(-braked, braked);
        rate = slowed - pair[1];
        y += 0.5 * (before + rate) * period;
        let mut parted = true;
        if y.abs() >= half {
            y = half.copysign(y);
            // The wall holds it until it draws away.
            if rate * y > 0.0 {
                rate = 0.0;
                parted = false;
            }
        }
        ahead.push(y);
        if braked > 0.0 {
            let along = mean_direction(pair[0], pair[1]) * braked;
            resisting.push(if parted { (speed - slowed - along) / period } else { 0.0 });
        }
    }
    Carried { ahead, resisting }
}

/// Direction of a motion whose velocity goes from one value to another in a straight line: a mean where it changes sign.
fn mean_direction(from: f64, to: f64) -> f64 {
    (from + to) / (from.abs() + to.abs()).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::{Backlash, Effect};

    #[test]
    fn the_load_flies_on_through_the_gap_and_is_caught() {
        // One side starts at 1 rad/s after 0.1 s and stops at 0.5 s; the load, caught at the rear wall after 0.1 rad, flies
        // on through 0.2 rad.
        let v: Vec<f64> = (0..1000).map(|k| f64::from((100..500).contains(&k))).collect();
        let relative = Backlash.load([0.2, 0.0], &[], &v, 1e-3).ahead;
        assert!((relative[400] + 0.1).abs() < 1e-12);
        assert!(relative[600].abs() < 2e-3, "{}", relative[600]);
        assert!((relative[800] - 0.1).abs() < 1e-12);
    }
}
