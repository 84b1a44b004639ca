//! A look at recordings before their fit is trusted: warnings in plain words, with what was seen, the likely cause and
//! what to do next.
//!
//! Warnings change no result and no exit status; what is put right is time, by [`evened`], and an input that is read with noise, by
//! [`steadied`](crate::identify::steadied). What cannot be fitted
//! at all is an error elsewhere.

mod agreement;
mod encoder;
mod excitation;
mod saturation;
mod stamps;
mod timing;
mod units;

pub use stamps::evened;

use serde::Serialize;

use crate::format;
use crate::identify::Workbench;
use crate::model::{Model, Parameter, Term};
use crate::motion::Motion;
use crate::recording::Recording;
use crate::system;

/// What a warning says of the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// They contradict themselves or the model file: results may be wrong.
    Suspect,
    /// They say little about something: results may be uncertain.
    Weak,
}

/// Something about recordings that a person should know.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Warning {
    /// Stable id.
    pub id: &'static str,
    /// What it says of the data.
    pub severity: Severity,
    /// What was seen, the likely cause, and what to do next.
    pub text: String,
}

impl Warning {
    fn suspect(id: &'static str, text: String) -> Self {
        let severity = Severity::Suspect;
        Self { id, severity, text }
    }

    fn weak(id: &'static str, text: String) -> Self {
        let severity = Severity::Weak;
        Self { id, severity, text }
    }
}

/// What there is to know about recordings and the model that was fitted to them, the gravest first.
pub fn warnings(bench: &Workbench, fitted: &Model, recordings: &[Recording]) -> Vec<Warning> {
    let mut all = Vec::new();
    for (recording, track) in recordings.iter().zip(bench.problem.tracks.iter()) {
        let mut own = timing::check(recording, track);
        own.extend(units::check(recording, track, fitted));
        own.extend(encoder::check(recording, track, fitted));
        own.extend(saturation::check(recording, fitted));
        own.extend(noisy_input(recording));
        if recordings.len() > 1 {
            for warning in &mut own {
                warning.text = format!("{}: {}", recording.file_name(), warning.text);
            }
        }
        all.extend(own);
    }
    // Stretches of one long recording may all say the same.
    let mut seen: Vec<(&str, String)> = Vec::new();
    all.retain(|warning: &Warning| {
        let file = warning.text.split(": ").next().unwrap_or_default();
        let key = (warning.id, file.to_owned());
        let new = !seen.contains(&key);
        seen.push(key);
        new
    });
    all.extend(agreement::check(bench, fitted));
    all.extend(excitation::check(bench, fitted, recordings));
    all.sort_by_key(|warning| warning.severity);
    all
}

/// That the readings of the input have noise which the axis does not follow, if they have.
fn noisy_input(recording: &Recording) -> Option<Warning> {
    let share = recording.noise_taken_off()?;
    Some(Warning::weak(
        "noisy-input",
        format!(
            "The readings of u scatter by {:.1} % (RMS) about the levels that the drive holds, and the axis follows none of that: the mean of each level was taken in their place. Log the command instead of what is measured, or filter before sampling.",
            100.0 * share
        ),
    ))
}

/// What there is to know of an axis that [`effects::CREEP`] was found on.
///
/// [`effects::CREEP`]: crate::effects::CREEP
pub fn creeps(term: &Term, motion: Motion) -> Warning {
    let sentence = term.effect.sentence(&system::values(term), motion);
    Warning::weak(
        "smooth-friction",
        format!(
            "{sentence} Simulators smooth friction so, and soft parts between the sensor and the surfaces act alike; where the axis must hold its place without drive, record slow ramps of the drive below breakaway."
        ),
    )
}

/// What there is to know of a friction law whose curve has another exponent than the law by itself.
pub fn bends_otherwise(exponent: &Parameter) -> Warning {
    let exponent = format::parameter(exponent.value.unwrap_or_default(), exponent.se, "1");
    Warning::weak(
        "law-exponent",
        format!(
            "The friction law by itself does not hold: the exponent of its curve was estimated with the rest and comes out as {exponent}. To say so, write exponent = \"?\", or a number, into [friction]."
        ),
    )
}

/// What there is to know of a law whose Stribeck curve is the rational one, with which χ² is less by so much.
pub fn falls_otherwise(less: f64) -> Warning {
    Warning::weak(
        "law-curve",
        format!(
            "The friction law falls as 1/(1 + (v/vs)²), which fits better than e^(−(v/vs)²): χ² is {less:.0} less. To decide it yourself, write curve = \"rational\" or \"gaussian\" into [friction]."
        ),
    )
}

/// What there is to know of an axis that nothing was found on but at reversals that the encoder does not resolve.
pub fn unresolved() -> Warning {
    Warning::weak(
        "coarse-reversals",
        "The model fits all but reversals that take the axis too long over too few steps of the encoder to tell when it moves; there, nothing is said. Reverse faster, or use a finer encoder.".to_owned(),
    )
}

/// Whether warnings say that the position jumps.
pub fn jumps(warnings: &[Warning]) -> bool {
    warnings.iter().any(|warning| warning.id == encoder::JUMPS)
}

/// Root mean square.
fn rms(x: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = x.fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x * x));
    (sum / f64::max(count, 1.0)).sqrt()
}

/// The value that a share of all lies below.
///
/// # Panics
/// Without a value.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}
