//! Diagnosis: where a model and its recordings part, what was left out, and the proof that adding it helps.

mod confirm;
mod findings;
mod leftover;
mod locate;
mod outcome;
mod pairs;
mod select;
mod sharpen;
mod trial;

pub use findings::{estimate, estimates};
pub use locate::Where;
pub use outcome::{
    Baseline, BeforeAfter, Diagnosis, Estimate, Estimates, Evidence, Finding, Outcome, Rival,
    Unexplained, Verdict,
};

use crate::check;
use crate::error::Result;
use crate::identify::{Identified, Workbench};
use crate::model::Model;
use crate::recording::Recording;
use crate::system;
use confirm::confirmed;
use findings::findings;
use leftover::Leftover;
use select::Scope;
use sharpen::sharpened;

/// A model whose free run errs by more than this share of the motion on both parts is not adequate, whatever the weak
/// form can tell apart.
const HOPELESS: f64 = 0.5;

/// Share of what generic functions gain that the named effects must reach: below it, the names are not the physics.
const SHARE_OF_GENERIC: f64 = 0.6;

/// Where the held-out part errs by more than this many times the error of the training part, something acts there that the
/// training part did not show.
const DEPARTS: f64 = 2.0;

/// How much less a name is worth while something unexplained remains, which it may stand in for: of the findings beside an
/// `unknown` verdict about this share is right, as the `validate` example shows for physics outside the catalogue.
const BESIDE_UNKNOWN: f64 = 0.3;

/// Diagnoses a baseline that has been fitted on a workbench. `progress` is told what is being done.
pub fn diagnose(
    bench: &Workbench,
    baseline: &Identified,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Outcome> {
    let before = &baseline.model;
    let nothing = (Vec::new(), before.clone());
    let found = confirmed(&Scope::usual(bench), before, &nothing, recordings, progress)?;
    let ((selected, after), fine) = sharpened(bench, before, found, recordings, progress)?;
    progress("looking for what is left");
    let base_error = error(bench, before)?;
    let mut leftover = leftover::of(bench, &after)?;
    let remaining = error(bench, &after)?;
    let reached = (base_error - remaining)
        / (base_error - remaining * (1.0 - leftover.gain)).max(f64::MIN_POSITIVE);
    let certain = leftover.certain;
    let little = leftover.size < select::SOUGHT && reached >= 1.0 - select::FLOOR;
    let significant = certain && (selected.is_empty() || !little);
    let (selected, mut after) = if significant && reached < SHARE_OF_GENERIC && !selected.is_empty()
    {
        leftover = leftover::of(bench, before)?;
        (Vec::new(), before.clone())
    } else {
        (selected, after)
    };
    let departure = confirm::departure(bench, &after);
    let departs = selected.is_empty() && departure > DEPARTS && leftover::counts(bench, &after);
    progress("how certain it is");
    // What windows of the usual width do not show is told by those that do.
    let fine = fine.filter(|_| !selected.is_empty());
    match &fine {
        Some(fast) => after = fast.settle(bench, &after, recordings)?,
        None if !selected.is_empty() => bench.settle(&mut after, recordings),
        None => {}
    }
    let bench = fine.as_ref().map_or(bench, |fast| &fast.bench);
    let hopeless =
        selected.is_empty() && baseline.fit.train.nrmse.min(baseline.fit.held_out.nrmse) > HOPELESS;
    let verdict = if significant || departs || hopeless {
        Verdict::Unknown
    } else if selected.is_empty() {
        Verdict::Adequate
    } else {
        Verdict::Explained
    };
    let (mut findings, after_fit) = findings(bench, baseline, &selected, &after, recordings)?;
    if verdict == Verdict::Unknown {
        findings
            .iter_mut()
            .for_each(|f| f.confidence *= BESIDE_UNKNOWN);
    }
    let z_before = whitened(bench, before);
    let z_after = if selected.is_empty() {
        vec![1.0; z_before.len()]
    } else {
        whitened(bench, &after)
    };
    let warnings = check::warnings(bench, before, recordings);
    let leftover = unexplained(&leftover);
    let remains = certain.then_some(&leftover);
    let unexplained = remains.filter(|_| significant).cloned();
    let diagnosis = Diagnosis {
        schema: "bristle.diagnosis/1",
        verdict,
        text: verdict_sentence(verdict, &findings, remains, departs, !warnings.is_empty()),
        warnings,
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
        departure,
        half_width: bench.problem.half_widths().collect(),
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
    Ok(base.map_or(f64::INFINITY, |b| b.score().cross_validated / b.rows()))
}

fn whitened(bench: &Workbench, model: &Model) -> Vec<f64> {
    let emphasis = system::emphasis(&bench.problem, model);
    let mut residual = bench.noise.whiten(&system::residual(&bench.problem, model));
    residual.iter_mut().for_each(|r| *r *= emphasis);
    residual
}

fn verdict_sentence(
    verdict: Verdict,
    findings: &[Finding],
    remains: Option<&Unexplained>,
    departs: bool,
    doubtful: bool,
) -> String {
    let names: Vec<String> = findings
        .iter()
        .map(|f| format!("{} ({})", f.name, f.id))
        .collect();
    match verdict {
        Verdict::Adequate if doubtful => "The model is adequate as far as this recording can tell, which the warnings limit: nothing significant is left out.".to_owned(),
        Verdict::Adequate => "The model is adequate: nothing significant is left out.".to_owned(),
        Verdict::Explained => {
            let they = if names.len() > 1 { "them" } else { "it" };
            let rest = match remains {
                None => "nothing significant remains".to_owned(),
                Some(rest) => format!(
                    "no more than {:.1} % of the drive remains unexplained",
                    100.0 * rest.size
                ),
            };
            format!(
                "The model leaves out: {}. With {they} in, {rest}.",
                names.join("; ")
            )
        }
        Verdict::Unknown => {
            let Some(unexplained) = remains else {
                if departs {
                    return "The last 30 % of the recording, which no fit has seen, depart from what the rest says: something acts there that the rest does not show. Record again so that all levels of drive, speed and position come early and late.".to_owned();
                }
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
