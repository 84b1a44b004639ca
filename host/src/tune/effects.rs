//! What a model has beyond its friction law, in the words of the controller.

use std::f64::consts::TAU;

use bristle_core::control::{Backlash, Effects, Harmonic, WAVES};

use super::Drive;
use crate::effects::Effect;
use crate::error::{Error, Result};
use crate::model::{Model, Term};

/// Effects that a controller has an answer to, or that need none.
pub(super) fn of(model: &Model, drive: &Drive, count: f64) -> Result<Effects<f64>> {
    let mut effects = Effects {
        stiffness: drive.stiffness,
        ..Effects::NONE
    };
    let mut waves = 0;
    for term in model.terms.iter().filter(|term| !term.in_law) {
        let value = |k: usize| term.parameters[k].value.unwrap_or_default();
        match term.effect.id() {
            "direction-asymmetry" => effects.offset += value(0),
            "viscous-asymmetry" => effects.viscous_difference += value(0),
            "spring" => {
                effects.stiffness += value(0);
                // A spring that rests elsewhere is one about zero with a constant beside it.
                let rest = term.parameters.get(1).and_then(|rest| rest.value);
                effects.offset -= value(0) * rest.unwrap_or_default();
            }
            "gravity" => place(
                &mut effects,
                &mut waves,
                harmonic(1.0 / TAU, count, value(0), value(1)),
            )?,
            "cogging" => {
                let periods = value(2) / model.motion.turn();
                let first = harmonic(periods, count, value(0), value(1));
                place(&mut effects, &mut waves, first)?;
                for (k, multiple) in (3..term.parameters.len()).step_by(2).zip([2.0, 3.0]) {
                    let overtone = harmonic(multiple * periods, count, value(k), value(k + 1));
                    place(&mut effects, &mut waves, overtone)?;
                }
            }
            "position-dependent-friction" => effects.friction = friction_wave(term, count),
            "backlash" if term.effect.hangs() => {
                effects.backlash = Backlash {
                    inertia: value(0),
                    gap: value(1) / count,
                    speed: 0.0,
                }
            }
            _ => {}
        }
    }
    Ok(effects)
}

fn place(effects: &mut Effects<f64>, waves: &mut usize, wave: Harmonic<f64>) -> Result<()> {
    let free = effects.waves.get_mut(*waves);
    let Some(free) = free else {
        return Err(Error::Usage(format!(
            "the model has more than {WAVES} waves over position, and a controller compensates {WAVES}; leave out the smallest"
        )));
    };
    *free = wave;
    *waves += 1;
    Ok(())
}

/// `amplitude·sin(2π·periods·q + phase)` with `periods` per rad or m.
fn harmonic(periods: f64, count: f64, amplitude: f64, phase: f64) -> Harmonic<f64> {
    let cycle = (periods * count).rem_euclid(1.0) * 4_294_967_296.0;
    Harmonic {
        cycle: cycle.round() as u64 as u32,
        sine: amplitude * phase.cos(),
        cosine: amplitude * phase.sin(),
    }
}

/// `position-dependent-friction`: amplitude, phase and wavelength, found by their names; nothing of a spot, which has none.
fn friction_wave(term: &Term, count: f64) -> Harmonic<f64> {
    let specs = term.effect.parameters().iter().zip(&term.parameters);
    let named = |name: &str| {
        let mut specs = specs.clone();
        let found = specs.find(|(spec, _)| spec.name == name);
        found.and_then(|(_, p)| p.value).unwrap_or_default()
    };
    let wavelength = named("wavelength");
    if wavelength <= 0.0 {
        return Harmonic::NONE;
    }
    harmonic(1.0 / wavelength, count, named("amplitude"), named("phase"))
}

/// Effects of a model that a controller does not compensate, by their ids. A Stribeck curve and bristles are part of the
/// friction that it knows, whether they come with the model's law or as effects of their own.
pub fn left_alone(model: &Model) -> Vec<&'static str> {
    const ANSWERED: [&str; 8] = [
        "direction-asymmetry",
        "viscous-asymmetry",
        "spring",
        "gravity",
        "cogging",
        "position-dependent-friction",
        "backlash",
        // The inertia that takes the given one's place is the one that is used.
        "inertia-mismatch",
    ];
    let own = model
        .terms
        .iter()
        .filter(|term| !term.in_law && !term.is_of_contact());
    // A gap before the encoder is no gap behind it, which is what the controller answers; a spot is no wave, which it knows alone.
    let spot = |effect: &dyn Effect| effect.parameters().iter().any(|spec| spec.name == "spread");
    let answered = |term: &&Term| {
        let effect = term.effect;
        ANSWERED.contains(&effect.id()) && !effect.on_load_side() && !spot(effect)
    };
    own.filter(|term| !answered(term))
        .map(|term| term.effect.id())
        .collect()
}
