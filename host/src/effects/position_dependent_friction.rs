//! # What it is
//! A friction level that varies with position: `τ = amplitude·sin(2π·q/wavelength + phase)·sgn v` beside the Coulomb level,
//! which is its mean. Or a tight or loose spot: `τ = amplitude·exp(−½·(d/spread)²)·sgn v`, where `d` is the distance from `centre`,
//! on a rotary axis the chord `2·sin(½·(q − centre))`, as the spot comes by with each turn. Which of the two forms a model file
//! means it says by the names of its parameters.
//!
//! # What it looks like in a recording
//! Some stretches of the travel take more drive than others, in both directions alike; the residual over position is a
//! wave that turns over with the direction.
//!
//! # What excites it
//! Slow motion over the whole travel, in both directions.
//!
//! # Confused with
//! gravity, spring and cogging keep their sign when the direction reverses: cross the same positions both ways.
//! A wave longer than twice the travel is a slope, and its length is not known.
//! Viscous friction that varies along the travel, which the catalogue lacks, is tried in its place.
//!
//! # Example
//! A guide that is tight in the middle or at its ends, a bent screw, a gear with a high tooth, a seal off centre.
//!
//! # References
//! B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and compensation methods for
//! the control of machines with friction, Automatica 30(7), 1994, sec. 2.1 (position dependence).

use super::position_dependent_friction_spot::PositionDependentFrictionSpot;
use super::position_dependent_viscous::PositionDependentViscous;
use super::{Confusion, Effect, Impostor, Inner, Motion, Quantity, Scale, Spec, Survey, Wave, cartesian, polar};
use crate::format::quantity;

/// Waves over the travel: from half of one on, thirds apart.
const THIRDS: std::ops::RangeInclusive<u32> = 2..=24;

/// Most waves within a turn: finer ones are ripple of teeth and poles, which the drive shows too.
const MOST_LOBES: u32 = 12;

pub(super) struct PositionDependentFriction;

impl Effect for PositionDependentFriction {
    fn id(&self) -> &'static str {
        "position-dependent-friction"
    }
    fn name(&self) -> &'static str {
        "Position-dependent friction"
    }
    fn doc(&self) -> &'static str {
        include_str!("position_dependent_friction.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("amplitude", Quantity::Torque),
                Spec::new("phase", Quantity::Phase),
                Spec::within("wavelength", Quantity::Position, (f64::MIN_POSITIVE, f64::INFINITY)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "cogging",
                    tell_apart_by: "cross the same positions slowly in both directions: cogging keeps its sign, friction changes it",
                },
                Confusion {
                    id: "gravity",
                    tell_apart_by: "cross the same positions slowly in both directions: an unbalance keeps its sign, friction changes it",
                },
                Confusion {
                    id: "torque-ripple",
                    tell_apart_by: "let the axis coast across the same positions: friction still varies there, torque ripple is gone with the drive",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "Friction varies by ±{} along the travel, with a wavelength of {}: check alignment and straightness there, or compensate with a table over position.",
            quantity(p[0].abs(), Quantity::Torque.unit(motion)),
            quantity(p[2], Quantity::Position.unit(motion))
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&PositionDependentFrictionSpot]
    }
    fn impostor(&self) -> Option<Impostor> {
        Some(Impostor { effect: &PositionDependentViscous, coordinate: "position and velocity" })
    }
    fn width(&self) -> usize {
        2
    }
    fn inner(&self) -> Option<usize> {
        Some(2)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        let travel = (survey.travel.1 - survey.travel.0).max(f64::MIN_POSITIVE);
        let mut waves: Vec<f64> = THIRDS.map(|k| 3.0 * travel / f64::from(k)).collect();
        if survey.motion == Motion::Rotary {
            // Over many turns, whatever closes on itself.
            let turns = (1..=MOST_LOBES).map(|k| std::f64::consts::TAU / f64::from(k));
            waves.extend(turns.filter(|wave| *wave < travel));
        }
        waves.sort_by(f64::total_cmp);
        waves
    }
    fn wave(&self, inner: Inner) -> Option<Wave> {
        Some(Wave { number: std::f64::consts::TAU / inner[0], coordinate: |at| at.q, carrier: |at| at.s })
    }
    fn named(&self, inner: Inner, c: &[f64], _scale: Scale) -> Vec<f64> {
        let [amplitude, phase] = polar(c);
        vec![amplitude, phase, inner[0]]
    }
    fn linear(&self, p: &[f64], _scale: Scale) -> (Inner, Vec<f64>) {
        ([p[2], 0.0], cartesian(p[0], p[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, PositionDependentFriction};
    use crate::effects::{Motion, Point, Scale};

    #[test]
    fn it_turns_over_with_the_direction() {
        let scale = Scale { coulomb: 0.0, gain: 1.0 };
        let (inner, c) = PositionDependentFriction.linear(&[0.2, 0.4, 3.0], scale);
        let torque = |s: f64| {
            let mut b = [0.0; 2];
            let at = Point::new(Motion::Linear, 0.7, s * 0.5, s);
            PositionDependentFriction.basis(inner, at, &mut b);
            c[0] * b[0] + c[1] * b[1]
        };
        let exact = 0.2 * (std::f64::consts::TAU * 0.7 / 3.0 + 0.4).sin();
        assert!((torque(1.0) - exact).abs() < 1e-15 && (torque(-1.0) + exact).abs() < 1e-15);
    }
}
