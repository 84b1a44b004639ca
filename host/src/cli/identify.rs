//! `bristle identify`

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::diagnose::{json, named, read_all};
use super::output::{self, Outputs};
use super::windows::Windows;
use super::{DONE, Outcome, terminal};
use crate::check::{self, Warning};
use crate::diagnose::{Estimates, estimates};
use crate::fit::Fit;
use crate::identify::{Tried, identify};
use crate::model::Model;
use crate::report;

/// Estimate the unknown parameters of a model from recordings, with standard errors
///
/// Distribution-based identification (DBI): test functions turn the equation of motion into algebraic rows, so that
/// no noisy signal is differentiated. The fit sees the first 70 % of each recording; the errors are reported for
/// that part and for the rest.
///
/// Example: bristle identify run.csv --model axis.toml --model-out fitted.toml
#[derive(Args, Debug)]
pub(super) struct Command {
    /// Recordings (CSV, Parquet or MATLAB level 5) of one axis; each is an experiment of its own, all share the parameters
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    /// Model file (TOML); "?" marks what is to be estimated
    #[arg(long, value_name = "M.toml")]
    model: PathBuf,
    /// Write the model with all values and standard errors
    #[arg(long, value_name = "OUT.toml")]
    model_out: Option<PathBuf>,
    /// Write parameters and fit as JSON (schema bristle.identification/1)
    #[arg(long, value_name = "OUT.json")]
    json: Option<PathBuf>,
    /// Write a self-contained HTML report with plots
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    windows: Windows,
}

/// What goes into the JSON.
#[derive(Serialize)]
struct Identification {
    schema: &'static str,
    warnings: Vec<Warning>,
    parameters: Estimates,
    fit: Fit,
    half_width: Vec<f64>,
    rows: usize,
    windows: Choice,
}

/// Why the windows are what they are.
#[derive(Serialize)]
struct Choice {
    reason: String,
    tried: Vec<Tried>,
}

impl Command {
    pub fn run(&self) -> Outcome {
        let mut inputs: Vec<&Path> = self.recordings.iter().map(PathBuf::as_path).collect();
        inputs.push(&self.model);
        output::check(
            &inputs,
            &[
                self.model_out.as_ref(),
                self.json.as_ref(),
                self.report.as_ref(),
            ],
        )?;
        let progress = terminal::progress();
        progress.set_message("reading");
        let model = Model::read_to_fit(&self.model)?;
        let recordings = read_all(&self.recordings, &model)?;
        progress.set_message("identifying");
        let (bench, identified) = identify(&recordings, &model, self.windows.options()?)
            .map_err(|e| named(e, &self.recordings, &self.model))?;
        let problem = &bench.problem;
        let identification = Identification {
            schema: "bristle.identification/1",
            warnings: check::warnings(&bench, &identified.model, &recordings),
            parameters: estimates(&identified.model, None),
            fit: identified.fit,
            half_width: problem
                .windows
                .iter()
                .zip(&problem.tracks)
                .map(|(w, t)| w.reach as f64 * t.period)
                .collect(),
            rows: problem.rows.len(),
            windows: Choice {
                reason: bench.width.reason(),
                tried: bench.width.tried.clone(),
            },
        };
        let mut outputs = Outputs::default();
        outputs.add(self.model_out.as_ref(), || Ok(identified.model.to_toml()))?;
        outputs.add(self.json.as_ref(), || json(&identification))?;
        outputs.add(self.report.as_ref(), || {
            report::identification(&identified, &identification.warnings, &bench, &recordings)
        })?;
        let written = outputs.write()?;
        progress.finish_and_clear();
        terminal::warnings(&identification.warnings);
        terminal::identification(
            &identification.parameters,
            &identification.fit,
            identified.model.causality,
            &identification.windows.reason,
        );
        terminal::written(&written);
        Ok(DONE)
    }
}
