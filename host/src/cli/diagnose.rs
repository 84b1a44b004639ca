//! `bristle diagnose`

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::input::{Input, named, stretches};
use super::output::{self, Outputs};
use super::terminal::Meter;
use super::windows::Windows;
use super::{DONE, Outcome, terminal};
use crate::diagnose::{Diagnosis, Outcome as Diagnosed, Verdict, diagnose};
use crate::error::Error;
use crate::experiment::{self, NextExperiment};
use crate::identify::{identify, steadied};
use crate::model::{Causality, Model};
use crate::recording::Recording;
use crate::report;
use crate::stream;

/// Exit status of `--check` when the model leaves something out.
const LEFT_OUT: u8 = 3;

/// Say where model and recording part, what physics was left out, and prove that adding it helps
///
/// Fits the model to the first 70 % of each recording, tries every effect of the catalogue on what remains, and
/// confirms on the held-out 30 %. The verdict is one of: adequate (nothing significant is left out), explained (the
/// findings account for the mismatch), unknown (something is left out that no effect explains).
///
/// Of recordings with more than 250,000 samples together it diagnoses stretches spread evenly over them, 131,000 samples in
/// all, each like a recording of its own; a line on the error stream says so.
///
/// Example: bristle diagnose run.csv --model axis.toml --model-out fitted.toml --report report.html
#[derive(Args, Debug)]
pub(super) struct Command {
    /// Recordings (CSV, Parquet or MATLAB level 5) of one axis; each is an experiment of its own, all share the parameters
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    /// Model file (TOML) of the baseline; "?" marks what is to be estimated
    #[arg(long, value_name = "M.toml")]
    model: PathBuf,
    /// Write the model with the findings in it and all values with standard errors
    #[arg(long, value_name = "OUT.toml")]
    model_out: Option<PathBuf>,
    /// Write the diagnosis as JSON (schema bristle.diagnosis/1)
    #[arg(long, value_name = "OUT.json")]
    json: Option<PathBuf>,
    /// Write a self-contained HTML report with plots
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    /// Write the excitation that would decide most: t, u to apply, and the position to expect
    #[arg(long, value_name = "OUT.csv")]
    next_experiment: Option<PathBuf>,
    #[command(flatten)]
    windows: Windows,
    /// Exit with status 3 when the model leaves something out, for use in a pipeline
    #[arg(long)]
    check: bool,
}

/// What goes into the JSON.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    next_experiment: Option<&'a NextExperiment>,
    /// Samples of the recordings, and how many of them were diagnosed.
    samples: usize,
    diagnosed_samples: usize,
}

impl Command {
    pub fn run(&self) -> Outcome {
        let diagnosis = self.diagnose()?.diagnosis;
        let left_out = self.check && diagnosis.verdict != Verdict::Adequate;
        Ok(if left_out { LEFT_OUT } else { DONE })
    }

    /// Diagnoses, writes and prints.
    pub fn diagnose(&self) -> crate::error::Result<Diagnosed> {
        let mut inputs: Vec<&Path> = self.recordings.iter().map(PathBuf::as_path).collect();
        inputs.push(&self.model);
        output::check(
            &inputs,
            &[
                self.model_out.as_ref(),
                self.json.as_ref(),
                self.report.as_ref(),
                self.next_experiment.as_ref(),
            ],
        )?;
        let progress = Meter::new();
        let model = Model::read_to_fit(&self.model)?;
        if self.next_experiment.is_some() && model.causality == Causality::Inverse {
            return Err(Error::Usage(format!(
                "--next-experiment does not apply to {}: its causality is \"inverse\", so another machine imposes the motion and there is no u to choose",
                self.model.display()
            )));
        }
        let input = Input::open(&self.recordings, &model, stream::LONG, &progress)?;
        let samples = input.samples();
        let recordings = match input {
            Input::Memory(recordings) => recordings,
            Input::Files(files) => stretches(&files)?,
        };
        let diagnosed = recordings.iter().map(Recording::len).sum();
        progress.say("fitting the baseline");
        let recordings = steadied(recordings, &model, self.windows.options()?)
            .map_err(|e| named(e, &self.recordings, &self.model))?;
        let (bench, baseline) = identify(&recordings, &model, self.windows.options()?)
            .map_err(|e| named(e, &self.recordings, &self.model))?;
        let outcome = diagnose(&bench, &baseline, &recordings, &|what| {
            progress.say(what);
        })
        .map_err(|e| named(e, &self.recordings, &self.model))?;
        let next = if self.next_experiment.is_some() || experiment::undecided(&outcome.diagnosis) {
            progress.say("planning the next experiment");
            experiment::next(&outcome, &bench, &recordings)?
        } else {
            None
        };
        progress.say("writing");
        let mut outputs = Outputs::default();
        outputs.add(self.model_out.as_ref(), || Ok(outcome.after.to_toml()))?;
        outputs.add(self.json.as_ref(), || {
            json(&Written {
                diagnosis: &outcome.diagnosis,
                next_experiment: next.as_ref(),
                samples,
                diagnosed_samples: diagnosed,
            })
        })?;
        outputs.add(self.report.as_ref(), || {
            report::diagnosis(&outcome, next.as_ref(), &bench, &recordings)
        })?;
        outputs.add(self.next_experiment.as_ref(), || match &next {
            Some(next) => Ok(next.csv.clone()),
            None => Err(Error::NotIdentifiable(
                "no excitation within the levels of u, speed and travel recorded so far would tell anything new; leave --next-experiment out, or record at higher levels".to_owned(),
            )),
        })?;
        let written = outputs.write()?;
        progress.finish();
        terminal::warnings(&outcome.diagnosis.warnings);
        if diagnosed < samples {
            terminal::note(&format!(
                "of {samples} samples, {} stretches of {diagnosed} samples in all were diagnosed, spread evenly over the recordings; identify reads every sample",
                recordings.len()
            ));
        }
        terminal::diagnosis(&outcome.diagnosis, outcome.after.causality);
        if let Some(next) = &next {
            anstream::println!("\n{}", next.text);
        }
        terminal::written(&written);
        Ok(outcome)
    }

    /// The command that `bristle demo` runs on its own recording.
    pub fn demo(recording: PathBuf, model: PathBuf, folder: &Path) -> Self {
        Self {
            recordings: vec![recording],
            model,
            model_out: Some(folder.join("diagnosed.toml")),
            json: Some(folder.join("diagnosis.json")),
            report: Some(folder.join("report.html")),
            next_experiment: None,
            windows: Windows::default(),
            check: false,
        }
    }
}

/// Pretty JSON with a final line break.
pub(super) fn json(value: &impl serde::Serialize) -> crate::error::Result<String> {
    serde_json::to_string_pretty(value)
        .map(|text| text + "\n")
        .map_err(|e| Error::Internal(format!("cannot write JSON: {e}")))
}
