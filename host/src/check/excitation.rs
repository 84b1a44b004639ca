//! Whether the motion can tell the parameters of a model apart at all.

use super::{Warning, rms};
use crate::effects::Quantity;
use crate::format::{quantity, whole_percent};
use crate::identify::Workbench;
use crate::model::{Causality, Model, Parameter, Status};
use crate::recording::Recording;

/// Share of the motion in the rarer direction below which the recording says nothing about it.
const RARE: f64 = 0.02;
/// Share of the time at rest from which on the recording is mostly that.
const RESTING: f64 = 2.0 / 3.0;
/// `mean |v| / RMS v`, the correlation of the columns of Coulomb and viscous friction, from which on each inflates the
/// variance of the other tenfold: `1/(1 − ρ²) > 10` (Marquardt, Technometrics 12, 1970).
const COLLINEAR: f64 = 0.95;

/// Share of the drive that acceleration takes from which on it is not for want of acceleration if the inertia is uncertain, but for
/// something that the model leaves out.
const LITTLE: f64 = 1.0 / 3.0;

pub(super) fn check(bench: &Workbench, fitted: &Model, recordings: &[Recording]) -> Vec<Warning> {
    let sliding: Vec<(f64, f64)> = bench
        .problem
        .tracks
        .iter()
        .flat_map(|t| t.cells.iter().zip(&t.sliding))
        .map(|(cell, sliding)| (cell.v, *sliding))
        .collect();
    let moving = || sliding.iter().filter(|(_, s)| *s > 0.5).map(|(v, _)| *v);
    let mut warnings = Vec::new();
    warnings.extend(rest(&sliding));
    warnings.extend(direction(moving()));
    warnings.extend(speeds(moving(), fitted));
    if fitted.causality == Causality::Forward {
        warnings.extend(acceleration(bench, fitted, recordings));
    }
    warnings
}

fn rest(sliding: &[(f64, f64)]) -> Option<Warning> {
    let moving = sliding.iter().map(|(_, s)| s).sum::<f64>() / sliding.len().max(1) as f64;
    (1.0 - moving > RESTING).then(|| {
        Warning::weak(
            "mostly-at-rest",
            format!(
                "The axis rests for {} of the time, and standstill says nothing about what moves it: drive it above break-away for more of the recording.",
                whole_percent(1.0 - moving)
            ),
        )
    })
}

fn direction(velocities: impl Iterator<Item = f64>) -> Option<Warning> {
    let (forwards, all) = velocities.fold((0.0, 0.0_f64), |(forwards, all), v| {
        (forwards + f64::from(v > 0.0), all + 1.0)
    });
    let share = forwards / all.max(1.0);
    (share.min(1.0 - share) < RARE).then(|| {
        Warning::weak(
            "one-direction",
            format!(
                "{} of the motion is in the {} direction: Coulomb friction cannot be told from a constant load, nor anything that differs by direction. Record both directions, or give both recordings at once.",
                whole_percent(share.max(1.0 - share)),
                if share > 0.5 { "positive" } else { "negative" }
            ),
        )
    })
}

/// Free and not known to a tenth.
fn poor(parameter: &Parameter) -> bool {
    !parameter.known && parameter.status != Status::Identified
}

fn speeds(velocities: impl Iterator<Item = f64> + Clone, fitted: &Model) -> Option<Warning> {
    let both_free = !fitted.coulomb.known && !fitted.viscous.known;
    if !both_free || !(poor(&fitted.coulomb) || poor(&fitted.viscous)) {
        return None;
    }
    let count = velocities.clone().count().max(1) as f64;
    let mean = velocities.clone().map(f64::abs).sum::<f64>() / count;
    let rms = rms(velocities);
    let spread = (rms * rms - mean * mean).max(0.0).sqrt();
    (mean > COLLINEAR * rms).then(|| {
        Warning::weak(
            "one-speed",
            format!(
                "While it moves, the axis does so at nearly one speed ({} ± {}), so Coulomb and viscous friction look alike: record at least three speeds, the slowest a fifth of the fastest.",
                quantity(mean, ""),
                quantity(spread, fitted.unit(Quantity::Speed))
            ),
        )
    })
}

fn acceleration(bench: &Workbench, fitted: &Model, recordings: &[Recording]) -> Option<Warning> {
    let inertia = &fitted.inertia;
    let (value, gain) = (inertia.value?.abs(), fitted.gain.value?.abs());
    if !poor(inertia) {
        return None;
    }
    let accelerating = value * rms(bench.problem.acceleration.iter().copied());
    let drive = rms(recordings.iter().flat_map(|r| r.u.iter().copied()));
    let share = accelerating / (gain * drive).max(f64::MIN_POSITIVE);
    (share < LITTLE).then(|| Warning::weak(
        "no-acceleration",
        format!(
            "Acceleration takes about {} of the drive, too little to tell the inertia: add faster changes of speed, or give the inertia in the model file.",
            whole_percent(share)
        ),
    ))
}
