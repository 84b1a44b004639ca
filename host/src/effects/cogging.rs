//! # What it is
//! A torque periodic in position with `periods` per turn (or per metre), whatever the drive does:
//! `τ = amplitude·sin(2π·periods·x + phase)` with `x` in turns (or metres). With a `second_amplitude` and a `second_phase` a wave of
//! twice the periods comes on top, with a `third_amplitude` and a `third_phase` one of three times as many.
//!
//! # What it looks like in a recording
//! The axis settles in evenly spaced positions and ripples at slow speed, with a frequency proportional to speed.
//!
//! # What excites it
//! Slow motion over many periods. Fast motion averages it out.
//!
//! # Confused with
//! torque-ripple, which grows with the drive: repeat under another load. gravity, when there is one period a turn.
//!
//! # Example
//! Brushless motors (least common multiple of slots and poles), linear motors, gear mesh.
//!
//! # References
//! D. Hanselman, Brushless Permanent Magnet Motor Design, 2006, ch. 5.

use super::overtone::{Overtone, SECOND_AMPLITUDE, SECOND_PHASE, THIRD_AMPLITUDE, THIRD_PHASE};
use super::{Confusion, Effect, Inner, Motion, Quantity, Scale, Spec, Survey, Wave, cartesian, periodicities, polar};
use crate::format::{quantity, shortest};

pub(super) struct Cogging;

const WAVE: [Spec; 3] = [
    Spec::new("amplitude", Quantity::Torque),
    Spec::new("phase", Quantity::Phase),
    Spec::new("periods", Quantity::Periodicity),
];

/// With a wave of twice the periods beside.
pub(super) const OCTAVE: Overtone =
    Overtone { plain: &Cogging, parameters: &[WAVE[0], WAVE[1], WAVE[2], SECOND_AMPLITUDE, SECOND_PHASE] };

/// With one of three times the periods as well.
pub(super) const THREE_WAVES: Overtone = Overtone {
    plain: &Cogging,
    parameters: &[WAVE[0], WAVE[1], WAVE[2], SECOND_AMPLITUDE, SECOND_PHASE, THIRD_AMPLITUDE, THIRD_PHASE],
};

impl Effect for Cogging {
    fn id(&self) -> &'static str {
        "cogging"
    }
    fn name(&self) -> &'static str {
        "Cogging"
    }
    fn doc(&self) -> &'static str {
        include_str!("cogging.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        &WAVE
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "torque-ripple",
                    tell_apart_by: "repeat the slow motion under another constant load: cogging keeps its size, torque ripple grows with the drive",
                },
                Confusion {
                    id: "position-dependent-friction",
                    tell_apart_by: "cross the same positions slowly in both directions: cogging keeps its sign, friction changes it",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        let (torque, per) = if motion == Motion::Rotary { ("torque", "turn") } else { ("force", "metre") };
        format!(
            "A {torque} of {} repeats {} times per {per}: compensate with a table over position, or stay above the speed where it shows.",
            quantity(p[0], Quantity::Torque.unit(motion)),
            shortest(p[2], 4)
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&OCTAVE, &THREE_WAVES]
    }
    fn width(&self) -> usize {
        2
    }
    fn fast(&self) -> bool {
        true
    }
    fn inner(&self) -> Option<usize> {
        Some(2)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        // One period a turn is gravity.
        periodicities(survey, 2)
    }
    fn wave(&self, inner: Inner) -> Option<Wave> {
        Some(Wave { number: inner[0], coordinate: |at| at.angle, carrier: |_| 1.0 })
    }
    fn named(&self, inner: Inner, c: &[f64], _scale: Scale) -> Vec<f64> {
        let [amplitude, phase] = polar(c);
        vec![amplitude, phase, inner[0]]
    }
    fn linear(&self, p: &[f64], _scale: Scale) -> (Inner, Vec<f64>) {
        ([p[2], 0.0], cartesian(p[0], p[1]))
    }
}
