//! What the diagnosis says of each recording, which is all that it sees.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use bristle::diagnose::{Verdict, diagnose};
use bristle::effects;
use bristle::identify::{Options, identify};
use bristle::model::Model;
use bristle::recording::Recording;
use indicatif::{ParallelProgressIterator, ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::labels::{HEADER, Kind, Label};
use crate::plants::{baseline_toml, keep, simulate};

/// A case with the answer to it.
pub struct Answer {
    pub label: Label,
    pub said: Said,
    /// Error of 1 s free runs on the held-out part: of the true structure, fitted to the same rest; none where it is
    /// outside the catalogue.
    pub true_model: Option<f64>,
}

/// What a diagnosis says.
pub struct Said {
    pub verdict: Verdict,
    /// Ids of the findings with their confidences.
    pub findings: Vec<(&'static str, f64)>,
    /// Rivals of the first finding that the data do not tell from it.
    pub open: Vec<&'static str>,
    /// What something unexplained depends on.
    pub coordinate: Option<&'static str>,
    /// Error of 1 s free runs on the held-out part, of the baseline and of the final model.
    pub held_out: [f64; 2],
}

/// Answers to all cases whose plant can be made to move as asked; the others are left out. Recordings and baselines are kept in
/// the folder `dump`.
pub fn all(labels: &[Label], dump: Option<&Path>) -> Vec<Answer> {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} recordings, {eta} left");
    let bar = ProgressBar::new(labels.len() as u64);
    let bar = style.map_or(bar.clone(), |style| bar.with_style(style));
    labels
        .par_iter()
        .progress_with(bar)
        .filter_map(|label| answer(label, dump))
        .collect()
}

fn answer(label: &Label, dump: Option<&Path>) -> Option<Answer> {
    let recipe = label.recipe();
    let made = simulate(&recipe).filter(|m| m.truth.met && m.truth.top_speed >= 1e-3)?;
    let mut baseline = baseline_toml(&recipe, &made.truth);
    if label.inertia_given {
        let given = format!("inertia = {}", made.truth.inertia);
        baseline = baseline.replace("inertia = \"?\"", &given);
    }
    if let Some(folder) = dump {
        keep(folder, &made, &baseline);
    }
    let recording = [Recording {
        path: "concealed.csv".into(),
        t: made.t,
        u: made.u,
        q: Some(made.q),
        ..Recording::default()
    }];
    Some(Answer {
        said: say(&recording, &baseline),
        true_model: true_model(label, &recording, &baseline),
        label: label.clone(),
    })
}

/// The whole of what the tool is told: a recording and a baseline.
fn say(recording: &[Recording], baseline: &str) -> Said {
    let model = Model::parse(baseline).expect("the baseline is a valid model");
    let outcome = identify(recording, &model, Options::default())
        .and_then(|(bench, fitted)| diagnose(&bench, &fitted, recording, &|_| {}));
    match outcome {
        Ok(outcome) => {
            let d = outcome.diagnosis;
            Said {
                verdict: d.verdict,
                findings: d.findings.iter().map(|f| (f.id, f.confidence)).collect(),
                open: d.findings.first().map_or(Vec::new(), |first| {
                    let rivals = first.rivals.iter().filter(|r| !r.separated);
                    rivals.map(|r| r.id).collect()
                }),
                coordinate: d.leftover.coordinates.first().map(|c| c.0),
                held_out: [d.fit.before.held_out.nrmse, d.fit.after.held_out.nrmse],
            }
        }
        Err(error) => {
            eprintln!("refused: {error}");
            Said {
                verdict: Verdict::Unknown,
                findings: Vec::new(),
                open: Vec::new(),
                coordinate: None,
                held_out: [f64::NAN; 2],
            }
        }
    }
}

/// Writes what was said of each case into a folder: the label, the verdict, the findings, and the held-out error of the baseline,
/// of the final model and of the true structure.
pub fn write(answers: &[Answer], folder: &Path) -> Result<(), String> {
    let mut lines = format!("{HEADER},verdict,findings,before,after,true_model\n");
    for Answer {
        label,
        said,
        true_model,
    } in answers
    {
        let findings: Vec<&str> = said.findings.iter().map(|f| f.0).collect();
        let [before, after] = said.held_out;
        let truth = true_model.unwrap_or(f64::NAN);
        let (label, verdict, findings) = (label.line(), said.verdict, findings.join("+"));
        let _ = writeln!(
            lines,
            "{label},{verdict:?},{findings},{before:.4},{after:.4},{truth:.4}"
        );
    }
    let path = folder.join("answers.csv");
    fs::write(&path, lines).map_err(|e| format!("{}: {e}", path.display()))
}

fn true_model(label: &Label, recording: &[Recording], baseline: &str) -> Option<f64> {
    if label.kind() == Kind::Outside {
        return None;
    }
    let mut model = Model::parse(baseline).ok()?;
    for id in &label.effects {
        model = model.with_effect(effects::find(id)?);
    }
    let (_, fitted) = identify(recording, &model, Options::default()).ok()?;
    Some(fitted.fit.held_out.nrmse)
}
