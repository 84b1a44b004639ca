//! Assembles the page from a diagnosis or an identification.

use super::findings;
use super::friction;
use super::page::{self, Figure, Item, Page, Section};
use super::rows::{self, Rows};
use super::runs;
use super::spread::{FEWEST, Spreads};
use super::subject::{Judged, Prediction, Subject};
use super::tables::{errors, nrmse, parameters, rms};
use crate::check::Warning;
use crate::diagnose::{Diagnosis, Outcome, Verdict};
use crate::error::Result;
use crate::experiment::NextExperiment;
use crate::fit::HORIZON;
use crate::format::{percent, quantity, scaled_unit, shortest, significant, value, with_unit};
use crate::identify::{Identified, Workbench};
use crate::model::Model;
use crate::problem::Response;
use crate::recording::Recording;
use crate::weak::{Part, TRAIN_SHARE};

/// The page of a diagnosis.
pub(super) fn diagnosis(
    outcome: &Outcome,
    next: Option<&NextExperiment>,
    bench: &Workbench,
    recordings: &[Recording],
) -> Result<Page> {
    let diagnosis = &outcome.diagnosis;
    let changed = !diagnosis.findings.is_empty();
    let subject = Subject {
        bench,
        recordings,
        before: changed.then_some(Judged {
            model: &outcome.before,
            fit: diagnosis.fit.before,
        }),
        after: Judged {
            model: &outcome.after,
            fit: diagnosis.fit.after,
        },
    };
    let predictions = predictions(&subject)?;
    let spreads = Spreads::of(&subject, &predictions);
    let rows = Rows::new(&subject);
    let word = format!("{:?}", diagnosis.verdict).to_lowercase();
    // An adequate model leaves noise: a region of noise would mislead.
    let place = match diagnosis.verdict {
        Verdict::Adequate => Err("No region is marked: nothing significant is left to locate."),
        Verdict::Explained | Verdict::Unknown => Ok(&diagnosis.place),
    };
    Ok(Page {
        title: format!("Diagnosis of {}", named(&outcome.after)),
        facts: facts(&subject),
        verdict: Some(page::Verdict {
            word,
            text: diagnosis.text.clone(),
            points: points(diagnosis),
        }),
        warnings: texts(&diagnosis.warnings),
        figures: figures(&subject, &spreads),
        figures_note: figures_note(&subject, &predictions),
        sections: vec![
            runs::section(&subject, &predictions)?,
            rows::section(&subject, &rows, place),
            friction::section(&subject, &rows)?,
            findings::section(diagnosis, &spreads.held_out),
            findings::next_experiment(&subject, diagnosis, next),
            parameters(&subject, None),
            errors(&subject, &spreads),
            method(&subject),
        ],
    })
}

/// The page of an identification.
pub(super) fn identification(
    identified: &Identified,
    whole: Option<&Model>,
    warnings: &[Warning],
    bench: &Workbench,
    recordings: &[Recording],
) -> Result<Page> {
    let subject = Subject {
        bench,
        recordings,
        before: None,
        after: Judged {
            model: &identified.model,
            fit: identified.fit,
        },
    };
    let predictions = predictions(&subject)?;
    let spreads = Spreads::of(&subject, &predictions);
    let rows = Rows::new(&subject);
    Ok(Page {
        title: format!("Identification of {}", named(&identified.model)),
        facts: facts(&subject),
        verdict: None,
        warnings: texts(warnings),
        figures: figures(&subject, &spreads),
        figures_note: figures_note(&subject, &predictions),
        sections: vec![
            parameters(&subject, whole),
            runs::section(&subject, &predictions)?,
            rows::section(
                &subject,
                &rows,
                Err(
                    "Structure in it is physics that the model leaves out: bristle diagnose says which, and where.",
                ),
            ),
            friction::section(&subject, &rows)?,
            errors(&subject, &spreads),
            method(&subject),
        ],
    })
}

/// The findings in a sentence each; what to be wary of in an adequate model that predicts poorly.
fn points(diagnosis: &Diagnosis) -> Vec<String> {
    let findings = diagnosis.findings.iter();
    let caution = findings::poor(diagnosis).map(|error| {
        format!(
            "Take care: the model still misses the held-out part by {}, and these recordings do not show why.",
            percent(error, None)
        )
    });
    findings
        .map(|f| format!("{}: {}", f.name, f.text))
        .chain(caution)
        .collect()
}

pub(super) fn texts(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().map(|w| w.text.clone()).collect()
}

fn predictions(subject: &Subject) -> Result<Vec<Prediction>> {
    (0..subject.recordings.len())
        .map(|index| subject.predict(index))
        .collect()
}

pub(super) fn named(model: &Model) -> &str {
    if model.name.is_empty() {
        "an axis without a name"
    } else {
        &model.name
    }
}

pub(super) fn facts(subject: &Subject) -> Vec<[String; 2]> {
    let model = subject.after.model;
    let mut facts = vec![[
        "Model".to_owned(),
        format!(
            "{} ({} motion, u is a {})",
            named(model),
            model.motion.as_str(),
            model.input
        ),
    ]];
    for recording in subject.recordings {
        let n = recording.len();
        let duration = recording.t[n - 1] - recording.t[0];
        facts.push([
            "Recording".to_owned(),
            format!(
                "{}: {n} samples over {} s ({} Hz)",
                recording.file_name(),
                shortest(duration, 4),
                shortest((n - 1) as f64 / duration, 4)
            ),
        ]);
    }
    facts
}

fn figures(subject: &Subject, spreads: &Spreads) -> Vec<Figure> {
    let (name, si) = subject.compared();
    let (scatter, after) = (&spreads.held_out, subject.after.fit);
    let before = subject.before.map(|b| b.fit);
    let (nrmse_note, rms_note) = if subject.inverse() {
        ("error of u over RMS of u".to_owned(), name.to_owned())
    } else {
        (
            format!("error over measured motion, {HORIZON:.0} s windows"),
            format!("{}, {HORIZON:.0} s windows", name.to_lowercase()),
        )
    };
    let mut figures = vec![Figure {
        label: "Held-out NRMSE".to_owned(),
        before: before.map(|b| nrmse(b.held_out.nrmse, scatter.before.nrmse)),
        after: nrmse(after.held_out.nrmse, scatter.after.nrmse),
        note: nrmse_note,
    }];
    if let Some(before) = before {
        let ratio = before.held_out.nrmse / after.held_out.nrmse;
        figures.push(Figure {
            label: "Improvement".to_owned(),
            before: None,
            after: with_unit(&value(ratio, scatter.factor), "times"),
            note: "held-out NRMSE before over after".to_owned(),
        });
    }
    figures.push(Figure {
        label: "Held-out RMS error".to_owned(),
        before: before.map(|b| rms(b.held_out.rmse, scatter.before.rmse, si)),
        after: rms(after.held_out.rmse, scatter.after.rmse, si),
        note: rms_note,
    });
    if let Some(free_run) = after.free_run_rmse.filter(|_| !subject.inverse()) {
        let whole = |x: f64| {
            let (factor, unit) = scaled_unit(x, si);
            quantity(factor * x, &unit)
        };
        figures.push(Figure {
            label: "Whole-run RMS error".to_owned(),
            before: before.and_then(|b| b.free_run_rmse).map(whole),
            after: whole(free_run),
            note: format!(
                "{}, one free run over each recording, never restarted",
                name.to_lowercase()
            ),
        });
    }
    figures
}

fn figures_note(subject: &Subject, predictions: &[Prediction]) -> String {
    let count: usize = predictions
        .iter()
        .map(|p| p.windows.iter().filter(|w| w.start >= p.boundary).count())
        .sum();
    let whole = if subject.inverse() {
        ""
    } else {
        " A whole run is a single sample, so its error carries none."
    };
    if count < FEWEST {
        return format!(
            "The held-out part has too few windows of {HORIZON:.0} s to tell how much the errors scatter, so no ± is given."
        );
    }
    format!(
        "± is one standard error, from the scatter between the {count} held-out windows (jackknife).{whole}"
    )
}

/// How the numbers came about.
fn method(subject: &Subject) -> Section {
    let problem = &subject.bench.problem;
    let mut widths: Vec<String> = problem
        .half_widths()
        .map(|width| significant(width, 3))
        .collect();
    widths.dedup();
    let side = match problem.response {
        Response::Acceleration => "acceleration",
        Response::Force => "the driving torque or force",
    };
    let nrmse = if subject.inverse() {
        "NRMSE: RMS error of u, as the model asks for it along the measured motion, over the RMS of u.".to_owned()
    } else {
        format!(
            "NRMSE: the model runs on u alone over windows of {HORIZON:.0} s, each from the measured state; RMS error of the change inside the windows over the RMS of the measured change."
        )
    };
    Section {
        title: "Method".to_owned(),
        items: vec![Item::List {
            points: vec![
                format!(
                    "Weak form (distribution-based identification): each row is the equation of motion under a smooth window of half-width {} s. {} rows of the first {:.0} % of each recording were fitted, {} rows of the rest were held out; rows at standstill are left out. The response of the fit is {side}.",
                    widths.join(" s, "),
                    problem.count(Part::Train),
                    100.0 * TRAIN_SHARE,
                    problem.count(Part::HeldOut),
                ),
                nrmse,
                "Errors of parameters: one standard error of the joint fit, the larger of the model-based one and of a block sandwich estimate (Liang and Zeger 1986), which stays valid where the model is not exact. Values marked as given were not estimated.".to_owned(),
                "ΔBIC: fall of the Bayesian information criterion through the effect; above 10 counts as very strong (Kass and Raftery 1995). Confidence: probability that the effect, and none of its rivals, is the right name. Neither is measured, so neither carries an error.".to_owned(),
                "Residual: weighted mean, over each window, of the torque or force that the model lacks; positive drives the axis in the positive direction.".to_owned(),
                "Long series are thinned for drawing; the smallest and the largest value of each stretch are kept.".to_owned(),
                format!("Written by Bristle {}.", env!("CARGO_PKG_VERSION")),
            ],
        }],
    }
}
