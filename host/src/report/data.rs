//! Assembles the page from a diagnosis or an identification.

use super::findings;
use super::page::{self, Figure, Item, Page, Section, Table};
use super::rows::{Rows, friction_section, residual_section};
use super::runs;
use super::spread::{Block, FEWEST, Spread};
use super::subject::{Judged, Prediction, Subject};
use crate::diagnose::{Diagnosis, Estimate, Outcome, Verdict};
use crate::error::Result;
use crate::fit::HORIZON;
use crate::format::{
    self, percent, quantity, scaled_unit, shortest, significant, value, with_unit,
};
use crate::identify::{Identified, Workbench};
use crate::model::Model;
use crate::problem::Response;
use crate::recording::Recording;
use crate::weak::{Part, TRAIN_SHARE};

/// Standard errors of the error figures of both parts.
struct Spreads {
    train: Spread,
    held_out: Spread,
}

/// The page of a diagnosis.
pub(super) fn diagnosis(
    outcome: &Outcome,
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
        figures: figures(&subject, &spreads),
        figures_note: figures_note(&subject, &predictions),
        sections: vec![
            runs::section(&subject, &predictions)?,
            residual_section(&subject, &rows, place),
            friction_section(&subject, &rows)?,
            findings::section(diagnosis, &spreads.held_out),
            findings::next_experiment(&subject, diagnosis),
            parameters(&subject),
            errors(&subject, &spreads),
            method(&subject),
        ],
    })
}

/// The page of an identification.
pub(super) fn identification(
    identified: &Identified,
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
        figures: figures(&subject, &spreads),
        figures_note: figures_note(&subject, &predictions),
        sections: vec![
            parameters(&subject),
            runs::section(&subject, &predictions)?,
            residual_section(
                &subject,
                &rows,
                Err(
                    "Structure in it is physics that the model leaves out: bristle diagnose says which, and where.",
                ),
            ),
            friction_section(&subject, &rows)?,
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

fn predictions(subject: &Subject) -> Result<Vec<Prediction>> {
    (0..subject.recordings.len())
        .map(|index| subject.predict(index))
        .collect()
}

impl Spreads {
    fn of(subject: &Subject, predictions: &[Prediction]) -> Self {
        let part = |held_out: bool| {
            let blocks: Vec<Block> = predictions
                .iter()
                .flat_map(|p| Block::of(p, held_out, subject.inverse()))
                .collect();
            Spread::of(&blocks)
        };
        Self {
            train: part(false),
            held_out: part(true),
        }
    }
}

fn named(model: &Model) -> &str {
    if model.name.is_empty() {
        "an axis without a name"
    } else {
        &model.name
    }
}

fn facts(subject: &Subject) -> Vec<[String; 2]> {
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
    if !subject.inverse() {
        let whole = |x: f64| {
            let (factor, unit) = scaled_unit(x, si);
            quantity(factor * x, &unit)
        };
        figures.push(Figure {
            label: "Whole-run RMS error".to_owned(),
            before: before.map(|b| whole(b.free_run_rmse)),
            after: whole(after.free_run_rmse),
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

/// All parameters, baseline beside final model.
fn parameters(subject: &Subject) -> Section {
    let cells = |model: &Model| -> Vec<(String, String)> {
        let labels = model.labels().into_iter().zip(model.parameters());
        labels
            .map(|(label, p)| {
                let name = label.effect.map_or_else(
                    || label.name.to_owned(),
                    |id| format!("{id}.{}", label.name),
                );
                let estimate = Estimate {
                    value: p.value.unwrap_or(f64::NAN),
                    se: (!p.known).then(|| p.se.unwrap_or(f64::NAN)),
                    unit: label.unit,
                };
                (name, estimate_text(&estimate))
            })
            .collect()
    };
    let before = subject.before.map(|b| cells(b.model));
    let rows = cells(subject.after.model).into_iter().map(|(name, value)| {
        let old = before.as_ref().map(|before| {
            let same = before.iter().find(|(n, _)| *n == name);
            same.map_or("–", |(_, v)| v).to_owned()
        });
        [Some(name), old, Some(value)]
            .into_iter()
            .flatten()
            .collect()
    });
    Section {
        title: "Parameters".to_owned(),
        items: vec![Item::Table(Table {
            columns: columns(subject, "Parameter", "Value"),
            rows: rows.collect(),
        })],
    }
}

/// Heading of the first column, then one for each model; a model alone is called `single`.
fn columns(subject: &Subject, first: &str, single: &str) -> Vec<String> {
    let models: &[&str] = if subject.before.is_some() {
        &["Baseline", "Final model"]
    } else {
        &[single]
    };
    let all = std::iter::once(first).chain(models.iter().copied());
    all.map(str::to_owned).collect()
}

/// A parameter as tables show it; one that was not estimated says so.
pub(super) fn estimate_text(estimate: &Estimate) -> String {
    let text = format::parameter(estimate.value, estimate.se, estimate.unit);
    if estimate.se.is_some() {
        text
    } else {
        format!("{text} (given)")
    }
}

/// Prediction errors of both parts.
fn errors(subject: &Subject, spreads: &Spreads) -> Section {
    let (_, si) = subject.compared();
    let models = [
        subject
            .before
            .map(|b| (b.fit, spreads.train.before, spreads.held_out.before)),
        Some((
            subject.after.fit,
            spreads.train.after,
            spreads.held_out.after,
        )),
    ];
    let mut rows = [
        "Training part, NRMSE",
        "Training part, RMS error",
        "Held-out part, NRMSE",
        "Held-out part, RMS error",
    ]
    .map(|title| vec![title.to_owned()]);
    for (fit, train, held_out) in models.into_iter().flatten() {
        rows[0].push(nrmse(fit.train.nrmse, train.nrmse));
        rows[1].push(rms(fit.train.rmse, train.rmse, si));
        rows[2].push(nrmse(fit.held_out.nrmse, held_out.nrmse));
        rows[3].push(rms(fit.held_out.rmse, held_out.rmse, si));
    }
    Section {
        title: "Prediction errors".to_owned(),
        items: vec![Item::Table(Table {
            columns: columns(subject, "", "Model"),
            rows: rows.to_vec(),
        })],
    }
}

/// An RMS error in a convenient unit.
fn rms(rmse: f64, se: Option<f64>, si: &str) -> String {
    let (factor, unit) = scaled_unit(rmse, si);
    let se = telling(rmse, se).map(|se| factor * se);
    with_unit(&value(factor * rmse, se), &unit)
}

/// An NRMSE as a percentage.
pub(super) fn nrmse(nrmse: f64, se: Option<f64>) -> String {
    percent(nrmse, telling(nrmse, se))
}

/// The standard error of an error figure, unless it exceeds the figure: then the few samples of a model that ran away
/// rule both, and the windows tell nothing.
fn telling(figure: f64, se: Option<f64>) -> Option<f64> {
    se.filter(|se| *se <= figure)
}

/// How the numbers came about.
fn method(subject: &Subject) -> Section {
    let problem = &subject.bench.problem;
    let mut widths: Vec<String> = problem
        .windows
        .iter()
        .zip(&problem.tracks)
        .map(|(w, t)| significant(w.reach as f64 * t.period, 3))
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

#[cfg(test)]
mod tests {
    use super::{nrmse, rms};

    #[test]
    fn an_error_larger_than_its_figure_is_left_out() {
        assert_eq!(nrmse(0.05, Some(0.01)), "5.0 ± 1.0 %");
        assert_eq!(nrmse(0.05, Some(1e14)), "5.00 %");
        assert_eq!(rms(0.005, Some(0.001), "m"), "5.0 ± 1.0 mm");
        assert_eq!(rms(0.005, Some(0.1), "m"), "5.00 mm");
    }
}
