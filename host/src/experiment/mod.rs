//! The next experiment, computed: of many safe excitations, the one whose predicted responses differ most.
//!
//! Between rival models it maximises the RMS difference of their predictions over the prediction error that the
//! recordings have shown, for the closest pair (T-optimality: W. G. Hunter, A. M. Reiner, "Designs for discriminating
//! between two rival models", Technometrics 7, 1965; G. E. P. Box, W. J. Hill, Technometrics 9, 1967). Without rivals it
//! minimises the variance of the least certain parameter, from simulated sensitivities.

mod candidates;
mod judge;

use std::fmt::Write;

use rayon::prelude::*;
use serde::Serialize;

use crate::axis::Axis;
use crate::diagnose::{Diagnosis, Outcome};
use crate::effects::{self, Quantity};
use crate::error::Result;
use crate::format::{quantity, significant};
use crate::identify::Workbench;
use crate::model::{Causality, Model, Parameter, Term};
use crate::recording::Recording;
use candidates::{Candidate, Safe};
use judge::Judge;

/// Most rivals that are told apart at once.
const MOST_RIVALS: usize = 4;
/// Differences below this many standard deviations decide nothing within a run.
const DECISIVE: f64 = 1.0;

/// An excitation to run next, and why.
#[derive(Clone, Debug, Serialize)]
pub struct NextExperiment {
    /// What it is, what it decides and how strongly, in a sentence or two.
    pub text: String,
    /// Ids of the finding and its rivals; without rivals, the parameter that it pins down.
    pub between: Vec<String>,
    /// The kind of excitation.
    pub shape: String,
    /// RMS difference of the predictions over 1 s, in standard deviations of the prediction error; without rivals, by which
    /// factor the standard error of the parameter falls.
    pub discrimination: f64,
    /// Length, s.
    pub duration: f64,
    /// Largest magnitude of u, in its unit.
    pub largest_u: f64,
    /// Predicted travel, rad or m.
    pub predicted_travel: f64,
    /// The excitation as a recording's columns: time, u, predicted position.
    #[serde(skip)]
    pub csv: String,
}

/// Whether there are rivals that the recordings cannot tell apart.
pub fn undecided(diagnosis: &Diagnosis) -> bool {
    let found = |id: &str| diagnosis.findings.iter().any(|f| f.id == id);
    let mut rivals = diagnosis.findings.iter().flat_map(|f| &f.rivals);
    rivals.any(|rival| !rival.separated && !found(rival.id))
}

/// The experiment that would decide most; `None` for inverse recordings, to which nothing can be applied, and where no
/// safe excitation was found.
pub fn next(
    outcome: &Outcome,
    bench: &Workbench,
    recordings: &[Recording],
) -> Result<Option<NextExperiment>> {
    let model = &outcome.after;
    if model.causality == Causality::Inverse {
        return Ok(None);
    }
    let (between, rivals) = rivals(outcome, bench);
    let safe = Safe::of(bench, recordings);
    let judge = Judge {
        positions: recordings.iter().all(|r| r.q.is_some()),
        noise: prediction_noise(outcome, bench),
    };
    let target = judge::least_certain(model);
    if rivals.is_empty() && target.is_none() {
        return Ok(None);
    }
    let score = |candidate: Candidate| -> Result<(f64, Candidate)> {
        let score = match target {
            Some(target) if rivals.is_empty() => judge.improvement(model, target, &candidate)?,
            _ => judge.discrimination(model, &rivals, &candidate)?,
        };
        Ok((score, candidate))
    };
    let candidates = candidates::all(model, &rivals, &safe)?.into_par_iter();
    let scored: Vec<(f64, Candidate)> = candidates.map(score).collect::<Result<_>>()?;
    // Of equals the first, whatever thread came first.
    let best = scored
        .into_iter()
        .filter(|(score, _)| score.is_finite())
        .rev()
        .max_by(|a, b| a.0.total_cmp(&b.0));
    Ok(best.map(|(score, candidate)| {
        let between = match target {
            Some(k) if rivals.is_empty() => vec![model.labels()[k].to_string()],
            _ => between,
        };
        told(outcome, between, !rivals.is_empty(), score, &candidate)
    }))
}

/// The final model with each rival in the place of the finding, fitted; and the ids of all.
fn rivals(outcome: &Outcome, bench: &Workbench) -> (Vec<String>, Vec<Model>) {
    let first = outcome.before.terms.len();
    let findings = outcome.diagnosis.findings.iter().enumerate();
    let mut ids: Vec<String> = Vec::new();
    let mut models = Vec::new();
    for (k, finding) in findings {
        for rival in &finding.rivals {
            let Some(effect) = effects::find(rival.id) else {
                continue;
            };
            let decided = rival.separated || outcome.after.has(rival.id);
            if models.len() == MOST_RIVALS || decided {
                continue;
            }
            let mut model = outcome.after.clone();
            model.terms[first + k] = Term {
                effect,
                parameters: vec![Parameter::unknown(); effect.parameters().len()],
                in_law: false,
            };
            // One that cannot be fitted is no rival, nor one that another finding leaves no room for.
            let Ok((model, _)) = bench.estimate(&model) else {
                continue;
            };
            if Axis::new(&model).is_err() {
                continue;
            }
            for id in [finding.id, rival.id] {
                if !ids.iter().any(|known| known == id) {
                    ids.push(id.to_owned());
                }
            }
            models.push(model);
        }
    }
    (ids, models)
}

/// RMS error of the final model over held-out windows of 1 s: encoder, torque noise and all; at least the sensor's own.
fn prediction_noise(outcome: &Outcome, bench: &Workbench) -> f64 {
    let own = bench.problem.tracks.iter().map(|t| t.position_noise);
    let own = own.fold(f64::MIN_POSITIVE, f64::max);
    outcome.diagnosis.fit.after.held_out.rmse.max(own)
}

fn told(
    outcome: &Outcome,
    between: Vec<String>,
    rivals: bool,
    score: f64,
    candidate: &Candidate,
) -> NextExperiment {
    let model = &outcome.after;
    let (input, position) = (model.input_unit(), model.unit(Quantity::Position));
    let largest_u = candidate.u.iter().fold(0.0, |m: f64, u| m.max(u.abs()));
    let duration = candidate.t.last().copied().unwrap_or_default();
    let what = format!(
        "{} for {}, with u up to {} and a predicted travel of {} around {}",
        candidate.shape,
        quantity(duration, "s"),
        quantity(largest_u, input),
        quantity(candidate.travel(), position),
        quantity(candidate.middle(), position)
    );
    let why = if !rivals {
        format!(
            "No rivals are left; this lowers the standard error of {} most, about {}-fold.",
            between[0],
            significant(score, 2)
        )
    } else if score >= DECISIVE {
        format!(
            "It decides between {}: over 1 s their predictions differ by {} standard deviations.",
            between.join(" and "),
            significant(score, 2)
        )
    } else {
        format!(
            "Within the levels recorded so far nothing decides between {}: their predictions differ by {} standard deviations at most; go beyond in speed, travel or load.",
            between.join(" and "),
            significant(score, 2)
        )
    };
    NextExperiment {
        text: format!("Next experiment: {what}. {why}"),
        between,
        shape: candidate.shape.clone(),
        discrimination: score,
        duration,
        largest_u,
        predicted_travel: candidate.travel(),
        csv: csv(candidate, input, position),
    }
}

fn csv(candidate: &Candidate, input: &str, position: &str) -> String {
    let mut text = format!("t[s],u[{input}],q_predicted[{position}]\n");
    let rows = candidate.t.iter().zip(&candidate.u).zip(&candidate.states);
    for ((t, u), state) in rows {
        // `{:?}` writes the shortest decimal that reads back as the same number.
        let _ = writeln!(text, "{t:?},{u:?},{:?}", state.q);
    }
    text
}
