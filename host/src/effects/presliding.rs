//! # What it is
//! Elastic deflection before sliding: the surfaces hold each other by bristles of stiffness `σ0`, which bend by `z` and
//! yield at the level `g` of the friction law: `ż = v − σ0·|v|·z/g(v)`, `τ = σ0·z` in place of `g(v)·sgn v`. Friction then
//! builds up over the breakaway distance `g/σ0` instead of jumping where velocity changes sign.
//!
//! Bristles may damp besides: with `bristle_damping`, `σ1`, it is `τ = σ0·z + σ1·ż`. `diagnose` takes that form where it has
//! the better evidence; a model file that names `bristle_damping` means it.
//!
//! # What it looks like in a recording
//! After each reversal the axis moves a little too easily, as far as the bristles need to bend the other way; at rest it
//! springs back when the drive is taken away. The residual has the sign opposite to velocity and lives within a few
//! breakaway distances behind reversals.
//!
//! # What excites it
//! Many reversals, small strokes of a few breakaway distances, slow torque ramps below break-away; an encoder that
//! resolves the breakaway distance, or at least reversals slow enough that many samples fall on it.
//!
//! # Confused with
//! stribeck (a function of speed, not of displacement): torque ramps below break-away tell.
//! backlash (no force at all in the gap) and delay (acts at any instant, not only at reversals).
//!
//! # Example
//! Preloaded ball bearings, seals, harmonic drives: breakaway distances of micrometres to tenths of a degree.
//!
//! # References
//! P. R. Dahl, A solid friction model, 1968; C. Canudas de Wit, H. Olsson, K. J. Åström and P. Lischinsky, A new model for
//! control of systems with friction, IEEE TAC 40(3), 1995.

use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Scale, Spec, Survey, geometric};
use crate::format::quantity;

/// The effect of the catalogue; under a law without bristles of its own it turns Coulomb friction into the simplified
/// law of Dahl.
pub(super) struct Presliding;

/// Bristles of a friction law: those of Dahl.
pub static BRISTLES: Bristles = Bristles { damped: false };
/// Bristles of a friction law with damping `σ1`, `τ = σ0·z + σ1·ż`: those of the `LuGre` laws.
pub const DAMPED_BRISTLES: Bristles = Bristles { damped: true };

/// Bristles as part of a friction law.
pub struct Bristles {
    damped: bool,
}

const STIFFNESS: Spec = Spec::within(
    "bristle_stiffness",
    Quantity::Stiffness,
    (f64::MIN_POSITIVE, f64::INFINITY),
);
const DAMPING: Spec = Spec::within("bristle_damping", Quantity::Viscous, (0.0, f64::INFINITY));

/// Factor between breakaway distances that are tried, at most.
const STEP: f64 = 1.7;

/// Breakaway distances from below what the encoder tells apart, or what an axis that friction alone accelerates moves from one
/// sample to the next at a reversal, to a share of the travel.
fn stiffnesses(survey: &Survey) -> Vec<f64> {
    let nearest = 0.5 * survey.deceleration * survey.period * survey.period;
    let [shortest, longest] = breakaways(survey, nearest);
    let steps = (longest / shortest).log(STEP).ceil();
    stiffnesses_of(survey, &geometric(shortest, longest, steps as usize + 1))
}

/// The same for the bristles of a law, which other parameters stand in for where they are short: none that yield between two samples
/// at speed.
fn stiffnesses_of_law(survey: &Survey) -> Vec<f64> {
    let [shortest, longest] = breakaways(survey, 0.1 * survey.top_speed * survey.period);
    stiffnesses_of(survey, &geometric(shortest, longest, 20))
}

/// The shortest breakaway distance, which is `nearest` if the encoder tells that, and the longest.
fn breakaways(survey: &Survey, nearest: f64) -> [f64; 2] {
    let longest = 0.3 * (survey.travel.1 - survey.travel.0);
    let shortest = nearest.max(0.5 * survey.position_noise).min(0.1 * longest);
    [shortest, longest]
}

/// Stiffnesses that go with breakaway distances, in the opposite order.
fn stiffnesses_of(survey: &Survey, distances: &[f64]) -> Vec<f64> {
    let level = survey.level.max(f64::MIN_POSITIVE);
    distances.iter().rev().map(|distance| level / distance).collect()
}

impl Effect for Presliding {
    fn id(&self) -> &'static str {
        "presliding"
    }
    fn name(&self) -> &'static str {
        "Presliding"
    }
    fn doc(&self) -> &'static str {
        include_str!("presliding.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[STIFFNESS] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "stribeck",
                    tell_apart_by: "ramp the drive slowly up and down below break-away: bristles deflect and spring back, a Stribeck curve gives no motion at all",
                },
                Confusion {
                    id: "backlash",
                    tell_apart_by: "reverse with strokes of several sizes: in a gap the drive meets no resistance at all and the load jumps at its end, bristles resist from the first count on",
                },
                Confusion {
                    id: "delay",
                    tell_apart_by: "step the drive at constant speed: a delay shows there as well, bristles only where velocity changes sign",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "Friction builds up elastically at {} after each reversal instead of jumping: compensate with a bristle state (Dahl or LuGre) instead of the sign of velocity.",
            quantity(p[0], Quantity::Stiffness.unit(motion))
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        const { &[&DAMPED_BRISTLES] }
    }
    fn width(&self) -> usize {
        0
    }
    fn inner(&self) -> Option<usize> {
        Some(0)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        stiffnesses(survey)
    }
    fn bristle_stiffness(&self, p: &[f64]) -> Option<f64> {
        Some(p[0])
    }
}

impl Effect for Bristles {
    fn id(&self) -> &'static str {
        Presliding.id()
    }
    fn name(&self) -> &'static str {
        Presliding.name()
    }
    fn doc(&self) -> &'static str {
        Presliding.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const BOTH: &[Spec] = &[STIFFNESS, DAMPING];
        &BOTH[..=usize::from(self.damped)]
    }
    fn confusions(&self) -> &'static [Confusion] {
        Presliding.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        Presliding.sentence(p, motion)
    }
    fn width(&self) -> usize {
        usize::from(self.damped)
    }
    fn inner(&self) -> Option<usize> {
        Some(0)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        stiffnesses_of_law(survey)
    }
    fn basis(&self, _inner: Inner, at: Point, out: &mut [f64]) {
        if self.damped {
            out[0] = at.bending;
        }
    }
    fn named(&self, inner: Inner, c: &[f64], _scale: Scale) -> Vec<f64> {
        [&inner[..1], c].concat()
    }
    fn linear(&self, p: &[f64], _scale: Scale) -> (Inner, Vec<f64>) {
        ([p[0], 0.0], p[1..].to_vec())
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c.iter().all(|damping| *damping >= 0.0)
    }
    fn bristle_stiffness(&self, p: &[f64]) -> Option<f64> {
        Some(p[0])
    }
}
