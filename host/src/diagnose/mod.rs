//! Diagnosis: where a model and its recordings part, what was left out, and the proof that adding it helps.

mod locate;
mod select;
mod trial;

use std::collections::BTreeMap;

use serde::Serialize;

pub use locate::Where;

use crate::effects;
use crate::error::Result;
use crate::fit::{self, Fit};
use crate::identify::{Identified, Workbench};
use crate::model::Model;
use crate::recording::Recording;
use crate::system;
use crate::weak::Part;
use select::{Leftover, Selected};
use trial::Trial;

/// A value with its standard error and unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Standard error; `None` for a value that was given, 0 in JSON.
    #[serde(serialize_with = "number")]
    pub se: Option<f64>,
    /// SI unit.
    pub unit: &'static str,
}

/// A number whatever the case, as other programs expect; an error without bound becomes the largest one.
#[allow(clippy::ref_option)] // The signature that serde asks for.
fn number<S: serde::Serializer>(se: &Option<f64>, to: S) -> std::result::Result<S::Ok, S::Error> {
    to.serialize_f64(se.unwrap_or(0.0).min(f64::MAX))
}

/// Parameters by name.
pub type Estimates = BTreeMap<String, Estimate>;

/// What the verdict says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Nothing significant is left out.
    Adequate,
    /// The findings account for the mismatch.
    Explained,
    /// A significant mismatch stays that no effect explains.
    Unknown,
}

/// The baseline and how it predicts.
#[derive(Clone, Debug, Serialize)]
pub struct Baseline {
    /// Its parameters.
    pub parameters: Estimates,
    /// Its prediction errors.
    pub fit: Fit,
}

/// How strongly the data speak for a finding.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Evidence {
    /// Fall of BIC when the effect joins the others found.
    pub delta_bic: f64,
    /// Share of the baseline's cross-validated squared error that goes with it.
    pub share_of_residual: f64,
}

/// Another effect that would explain much the same.
#[derive(Clone, Debug, Serialize)]
pub struct Rival {
    /// Its id.
    pub id: &'static str,
    /// Its fall of BIC at the stage where the finding was preferred.
    pub delta_bic: f64,
    /// All parameters of the model with it in the place of the finding.
    pub model: Estimates,
    /// The fit of that model.
    pub fit: Fit,
    /// The experiment that decides.
    pub tell_apart_by: String,
}

/// An effect that was left out.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// Stable id.
    pub id: &'static str,
    /// Name that a person reads.
    pub name: &'static str,
    /// Probability that this effect, and no rival, is the right name.
    pub confidence: f64,
    /// One sentence that a person can act on.
    pub text: String,
    /// Where it shows.
    #[serde(rename = "where")]
    pub place: Where,
    /// Its parameters in the final model, with quantities that follow from them.
    pub parameters: Estimates,
    /// Evidence for it.
    pub evidence: Evidence,
    /// All parameters of the model with this finding and those before it.
    pub model: Estimates,
    /// The fit of that model.
    pub fit: Fit,
    /// Rivals.
    pub rivals: Vec<Rival>,
}

/// Something that generic functions follow and no effect explains.
#[derive(Clone, Debug, Serialize)]
pub struct Unexplained {
    /// Share of the cross-validated squared error that generic functions take away.
    pub gain: f64,
    /// RMS of the torque or force that goes with it, as a share of the RMS of the drive.
    pub size: f64,
    /// Coordinates it may depend on with their own shares, best first.
    pub coordinates: Vec<(&'static str, f64)>,
}

/// Fit of the baseline and of the final model.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BeforeAfter {
    /// Baseline.
    pub before: Fit,
    /// Final model.
    pub after: Fit,
}

/// The outcome: the contract's `bristle.diagnosis/1`.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// `bristle.diagnosis/1`.
    pub schema: &'static str,
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in a sentence.
    pub text: String,
    /// The baseline.
    pub baseline: Baseline,
    /// Where the baseline fails.
    #[serde(rename = "where")]
    pub place: Where,
    /// What was left out, strongest first.
    pub findings: Vec<Finding>,
    /// What stays unexplained.
    pub unexplained: Option<Unexplained>,
    /// What generic functions of each coordinate would still gain, significant or not.
    pub leftover: Unexplained,
    /// Parameters of the final model.
    pub parameters: Estimates,
    /// Before and after.
    pub fit: BeforeAfter,
    /// Half-width of the test functions, s, of each recording.
    pub half_width: Vec<f64>,
}

/// A diagnosis together with the models behind it.
pub struct Outcome {
    /// What goes into the JSON.
    pub diagnosis: Diagnosis,
    /// The baseline with its estimates.
    pub before: Model,
    /// The final model.
    pub after: Model,
}

/// A model whose free run errs by more than this share of the motion on both parts is not adequate, whatever the weak
/// form can tell apart.
const HOPELESS: f64 = 0.5;

/// Share of what generic functions gain that the named effects must reach: below it, the names are not the physics.
const SHARE_OF_GENERIC: f64 = 0.6;

/// Diagnoses a baseline that has been fitted on a workbench. `progress` is told what is being done.
pub fn diagnose(
    bench: &Workbench,
    baseline: &Identified,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Outcome> {
    let before = &baseline.model;
    let (selected, after) = confirmed(bench, before, recordings, progress)?;
    progress("looking for what is left");
    let base_error = error(bench, before)?;
    let mut leftover = select::leftover(bench, &after)?;
    let remaining = error(bench, &after)?;
    let reached = (base_error - remaining)
        / (base_error - remaining * (1.0 - leftover.gain)).max(f64::MIN_POSITIVE);
    let significant = leftover.certain;
    let (selected, after) = if significant && reached < SHARE_OF_GENERIC && !selected.is_empty() {
        leftover = select::leftover(bench, before)?;
        (Vec::new(), before.clone())
    } else {
        (selected, after)
    };
    let hopeless =
        selected.is_empty() && baseline.fit.train.nrmse.min(baseline.fit.held_out.nrmse) > HOPELESS;
    let verdict = if significant || hopeless {
        Verdict::Unknown
    } else if selected.is_empty() {
        Verdict::Adequate
    } else {
        Verdict::Explained
    };
    let (findings, after_fit) =
        findings(bench, baseline, &selected, &after, recordings, base_error)?;
    let z_before = whitened(bench, before);
    let z_after = if selected.is_empty() {
        vec![1.0; z_before.len()]
    } else {
        whitened(bench, &after)
    };
    let leftover = unexplained(&leftover);
    let unexplained = significant.then(|| leftover.clone());
    let diagnosis = Diagnosis {
        schema: "bristle.diagnosis/1",
        verdict,
        text: verdict_sentence(verdict, &findings, unexplained.as_ref()),
        baseline: Baseline {
            parameters: estimates(before, None),
            fit: baseline.fit,
        },
        place: locate::locate(bench, before, &z_before, &z_after),
        findings,
        unexplained,
        leftover,
        parameters: estimates(&after, None),
        fit: BeforeAfter {
            before: baseline.fit,
            after: after_fit,
        },
        half_width: bench
            .problem
            .windows
            .iter()
            .zip(&bench.problem.tracks)
            .map(|(w, t)| w.reach as f64 * t.period)
            .collect(),
    };
    Ok(Outcome {
        diagnosis,
        before: before.clone(),
        after,
    })
}

fn unexplained(leftover: &Leftover) -> Unexplained {
    Unexplained {
        gain: leftover.gain,
        size: leftover.size,
        coordinates: leftover.coordinates.iter().take(3).copied().collect(),
    }
}

/// Cross-validated squared error of a model per training row.
fn error(bench: &Workbench, model: &Model) -> Result<f64> {
    let base = trial::Base::new(bench, model)?;
    Ok(base.map_or(f64::INFINITY, |b| b.score.cross_validated / b.rows()))
}

fn whitened(bench: &Workbench, model: &Model) -> Vec<f64> {
    bench.noise.whiten(&system::residual(&bench.problem, model))
}

/// χ² of the held-out rows.
fn held_out_chi2(bench: &Workbench, model: &Model) -> f64 {
    let z = whitened(bench, model);
    z.iter()
        .zip(&bench.problem.rows)
        .filter(|(_, r)| r.part == Part::HeldOut)
        .map(|(z, _)| z * z)
        .sum()
}

/// Selects effects and confirms them on the held-out part; what that part refutes makes room for others.
fn confirmed(
    bench: &Workbench,
    before: &Model,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<(Vec<Selected>, Model)> {
    let mut refuted: Vec<&str> = Vec::new();
    loop {
        let (selected, after) = select::select(bench, before, recordings, &refuted, progress)?;
        progress("confirming on the held-out part");
        let ids: Vec<&str> = selected.iter().map(|s| s.trial.effect.id()).collect();
        let (kept, after) = confirm(bench, before, selected, after, recordings)?;
        let dropped = |id: &&str| !kept.iter().any(|s| s.trial.effect.id() == *id);
        let count = refuted.len();
        refuted.extend(ids.into_iter().filter(dropped));
        if refuted.len() == count {
            return Ok((kept, after));
        }
    }
}

/// Drops effects without which the held-out part is predicted as well: weak-form error and free run both count, as far
/// as the axis moves enough there for them to tell.
fn confirm(
    bench: &Workbench,
    before: &Model,
    mut selected: Vec<Selected>,
    mut after: Model,
    recordings: &[Recording],
) -> Result<(Vec<Selected>, Model)> {
    let rows = bench.problem.count(Part::HeldOut);
    let mut k = selected.len();
    while k > 0 {
        k -= 1;
        let (without, _) = bench.estimate(&select::without(&after, before.terms.len() + k))?;
        let judge = |model: &Model| fit::judge(model, recordings, &bench.problem.tracks);
        let (with_it, without_it) = (judge(&after)?, judge(&without)?);
        let moves = with_it.held_out.signal > LEAST_MOTION * with_it.train.signal;
        let weak_form_helps =
            rows < FEWEST_HELD_OUT || held_out_chi2(bench, &after) < held_out_chi2(bench, &without);
        let free_run_helps =
            !moves || with_it.held_out.nrmse < FREE_RUN_TOLERANCE * without_it.held_out.nrmse;
        if !(weak_form_helps && free_run_helps) {
            selected.remove(k);
            after = without;
        }
    }
    Ok((selected, after))
}

/// A held-out free run over a handful of windows scatters by a few per cent through its measured starting
/// velocities alone.
const FREE_RUN_TOLERANCE: f64 = 1.05;
/// A held-out part that moves by less than this share of the training part's motion says nothing about a free run.
const LEAST_MOTION: f64 = 0.1;
/// Nor do fewer rows than this about the weak form.
const FEWEST_HELD_OUT: usize = 20;

/// The findings in order of strength with their nested fits, and the fit of the final model.
fn findings(
    bench: &Workbench,
    baseline: &Identified,
    selected: &[Selected],
    after: &Model,
    recordings: &[Recording],
    base_error: f64,
) -> Result<(Vec<Finding>, Fit)> {
    let first = baseline.model.terms.len();
    let mut findings: Vec<Finding> = Vec::new();
    let mut last_fit = baseline.fit;
    let mut last_error = base_error;
    let mut last_z = whitened(bench, &baseline.model);
    let mut last_stage = baseline.model.clone();
    for (k, selected) in selected.iter().enumerate() {
        let mut stage = after.clone();
        stage.terms.truncate(first + k + 1);
        let stage = if k + 1 == after.terms.len() - first {
            after.clone()
        } else {
            bench.estimate(&stage)?.0
        };
        let z = whitened(bench, &stage);
        let now = error(bench, &stage)?;
        last_fit = fit::judge(&stage, recordings, &bench.problem.tracks)?;
        let effect = selected.trial.effect;
        findings.push(Finding {
            id: effect.id(),
            name: effect.name(),
            confidence: confidence(selected, now),
            text: effect.sentence(&system::values(&after.terms[first + k]), after.motion),
            place: locate::locate(bench, &stage, &last_z, &z),
            parameters: estimates(after, Some(first + k)),
            evidence: Evidence {
                delta_bic: selected.trial.delta_bic,
                share_of_residual: (last_error - now) / base_error,
            },
            model: estimates(&stage, None),
            fit: last_fit,
            rivals: rivals(bench, &last_stage, selected, recordings)?,
        });
        (last_error, last_z, last_stage) = (now, z, stage);
    }
    Ok((findings, last_fit))
}

/// Posterior probability of the finding among the effects that passed with it, evidence tempered by the error
/// that remains (an over-dispersed χ² counts for less).
fn confidence(selected: &Selected, error_after: f64) -> f64 {
    let temper = 0.5 / error_after.max(1.0);
    let others: f64 = selected
        .others
        .iter()
        .map(|o| (temper * (o.delta_bic - selected.trial.delta_bic)).exp())
        .sum();
    (0.99 / (1.0 + others)).max(0.01)
}

/// Effects that would have explained at least half as much, each fitted in the place of the finding.
fn rivals(
    bench: &Workbench,
    before: &Model,
    selected: &Selected,
    recordings: &[Recording],
) -> Result<Vec<Rival>> {
    let close = selected
        .others
        .iter()
        .filter(|o| o.delta_bic >= 0.5 * selected.trial.delta_bic);
    let rival = |other: &Trial| {
        let instead = bench.fit(&select::with_trial(before, other), recordings)?;
        Ok(Rival {
            id: other.effect.id(),
            delta_bic: other.delta_bic,
            model: estimates(&instead.model, None),
            fit: instead.fit,
            tell_apart_by: effects::tell_apart(selected.trial.effect, other.effect),
        })
    };
    close.map(rival).collect()
}

/// Parameters of a whole model, or of one of its terms with what follows from them.
pub fn estimates(model: &Model, term: Option<usize>) -> Estimates {
    if let Some(index) = term {
        return term_estimates(model, index);
    }
    let labels = model.labels();
    labels
        .iter()
        .zip(model.parameters())
        .map(|(label, parameter)| {
            let name = label.effect.map_or_else(
                || label.name.to_owned(),
                |id| format!("{id}.{}", label.name),
            );
            (name, estimate(parameter, label.unit))
        })
        .collect()
}

fn estimate(parameter: &crate::model::Parameter, unit: &'static str) -> Estimate {
    Estimate {
        value: parameter.value.unwrap_or(f64::NAN),
        se: if parameter.known { None } else { parameter.se },
        unit,
    }
}

fn term_estimates(model: &Model, index: usize) -> Estimates {
    let term = &model.terms[index];
    let specs = term.effect.parameters();
    let mut all: Estimates = specs
        .iter()
        .zip(&term.parameters)
        .map(|(spec, parameter)| {
            (
                spec.name.to_owned(),
                estimate(parameter, model.unit(spec.quantity)),
            )
        })
        .collect();
    for derived in term.effect.derived() {
        let parts = [&term.parameters[0], &model.coulomb, &model.viscous];
        let sum = |f: &dyn Fn(&crate::model::Parameter) -> f64, power: i32| {
            parts
                .iter()
                .zip(derived.weights)
                .map(|(p, w)| w.powi(power) * f(p))
                .sum::<f64>()
        };
        // Errors of the parts are nearly independent: one column is even in velocity, the other odd.
        let variance = sum(&|p| p.se.unwrap_or(0.0).powi(2), 2);
        let value = Estimate {
            value: sum(&|p| p.value.unwrap_or(0.0), 1),
            se: Some(variance.sqrt()),
            unit: model.unit(derived.quantity),
        };
        all.insert(derived.name.to_owned(), value);
    }
    all
}

fn verdict_sentence(
    verdict: Verdict,
    findings: &[Finding],
    unexplained: Option<&Unexplained>,
) -> String {
    let names: Vec<String> = findings
        .iter()
        .map(|f| format!("{} ({})", f.name, f.id))
        .collect();
    match verdict {
        Verdict::Adequate => "The model is adequate: nothing significant is left out.".to_owned(),
        Verdict::Explained => format!(
            "The model leaves out: {}. With {} in, nothing significant remains.",
            names.join("; "),
            if names.len() > 1 { "them" } else { "it" }
        ),
        Verdict::Unknown => {
            let Some(unexplained) = unexplained else {
                return "The model hardly predicts the motion, and the recording is too noisy or too uniform to tell what is left out: record again with both directions, several speeds and reversals.".to_owned();
            };
            let coordinate = unexplained
                .coordinates
                .first()
                .map_or("none of the coordinates alone", |c| c.0);
            let found = if names.is_empty() {
                String::new()
            } else {
                format!(" besides {}", names.join("; "))
            };
            format!(
                "Something is left out{found} that no effect of the catalogue explains; it depends on {coordinate}."
            )
        }
    }
}
