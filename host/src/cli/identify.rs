//! `bristle identify`

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde::Serialize;

use super::curve;
use super::diagnose::json;
use super::input::{Input, named};
use super::method::{Method, MethodArgs, Minimisation};
use super::output::{self, Outputs};
use super::terminal::Meter;
use super::windows::Windows;
use super::{DONE, Outcome, terminal};
use crate::check::{self, Warning};
use crate::diagnose::{Estimates, estimates};
use crate::error::{Error, Result};
use crate::fit::Fit;
use crate::identify::{Identified, Tried, Workbench, steadied};
use crate::model::Model;
use crate::recording::Recording;
use crate::report;
use crate::stream;

/// Estimate the unknown parameters of a model from recordings, with standard errors
///
/// Distribution-based identification (DBI): test functions turn the equation of motion into algebraic rows, so that
/// no noisy signal is differentiated. With --method pem the fit goes on from there and minimises the errors of
/// predicting each reading from those before it, which takes some seconds and is more precise, for friction near
/// standstill above all. The fit sees the first 70 % of each recording; the errors are reported for that part and
/// for the rest. With --whole the values are then estimated anew from all of each recording, while the errors stay those
/// of values that have not seen the rest.
///
/// Recordings of any length: those with more samples than --stream-above, together, are read piece by piece in memory that
/// does not depend on their length. CSV files are, that is; Parquet and MATLAB files are loaded whole, and worked on in
/// pieces.
///
/// Example: bristle identify run.csv --model axis.toml --method pem --model-out fitted.toml
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
    /// Read recordings with more samples than this, together, piece by piece; a report then shows stretches of them
    #[arg(long, value_name = "SAMPLES", default_value_t = stream::LONG)]
    stream_above: usize,
    /// Estimate the values anew from the whole of each recording once they have been judged on the last 30 %. The report
    /// shows both, and the plots and errors of the judged ones
    #[arg(long)]
    whole: bool,
    #[command(flatten)]
    how: MethodArgs,
    #[command(flatten)]
    windows: Windows,
}

/// What goes into the JSON.
#[derive(Serialize)]
struct Identification {
    schema: &'static str,
    warnings: Vec<Warning>,
    method: Method,
    #[serde(skip_serializing_if = "Option::is_none")]
    minimisation: Option<Minimisation>,
    parameters: Estimates,
    /// Whether the parameters are those of the whole recordings, where the fit is that of values from the training part.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    whole: bool,
    fit: Fit,
    half_width: Vec<f64>,
    rows: usize,
    windows: Choice,
    /// Samples of all recordings, and how many of them a second went through it all, reading included.
    samples: usize,
    samples_per_second: f64,
    /// Passes over recordings that were read piece by piece, beside the one that checks them.
    #[serde(skip_serializing_if = "Option::is_none")]
    passes: Option<usize>,
}

/// Why the windows are what they are.
#[derive(Serialize)]
struct Choice {
    reason: String,
    tried: Vec<Tried>,
}

/// What was identified, and what a report shows of it.
struct Found {
    identified: Identified,
    /// The model with values from the whole recordings, where it was asked for.
    whole: Option<Model>,
    bench: Workbench,
    shown: Vec<Recording>,
    rows: usize,
    passes: Option<usize>,
    minimisation: Option<Minimisation>,
    /// What there is to know of the curve of its law.
    curve: Option<Warning>,
}

impl Command {
    pub fn run(&self) -> Outcome {
        self.how.check()?;
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
        if self.how.curve {
            let outputs = (self.model_out.as_ref(), self.json.as_ref());
            self.how.check_curve(self.report.is_some(), self.whole)?;
            return curve::run(&self.recordings, &self.model, outputs, &self.how);
        }
        let begun = Instant::now();
        let progress = Meter::new();
        let model = Model::read_to_fit(&self.model)?;
        self.how.starts_from_file(&model)?;
        let input = Input::open(&self.recordings, &model, self.stream_above, &progress)?;
        let samples = input.samples();
        let found = self
            .found(input, &model, &progress)
            .map_err(|e| named(e, &self.recordings, &self.model))?;
        let mut warnings = check::warnings(&found.bench, &found.identified.model, &found.shown);
        warnings.extend(found.curve);
        let told = found.whole.as_ref().unwrap_or(&found.identified.model);
        let identification = Identification {
            schema: "bristle.identification/1",
            method: self.how.method,
            minimisation: found.minimisation,
            warnings,
            parameters: estimates(told, None),
            whole: self.whole,
            fit: found.identified.fit,
            half_width: found.bench.problem.half_widths().collect(),
            rows: found.rows,
            samples,
            samples_per_second: samples as f64 / begun.elapsed().as_secs_f64(),
            passes: found.passes,
            windows: Choice {
                reason: found.bench.width.reason(),
                tried: found.bench.width.tried.clone(),
            },
        };
        let mut outputs = Outputs::default();
        outputs.add(self.model_out.as_ref(), || Ok(told.to_toml()))?;
        outputs.add(self.json.as_ref(), || json(&identification))?;
        outputs.add(self.report.as_ref(), || {
            report::identification(
                &found.identified,
                found.whole.as_ref(),
                &identification.warnings,
                &found.bench,
                &found.shown,
            )
        })?;
        let written = outputs.write()?;
        progress.finish();
        terminal::warnings(&identification.warnings);
        terminal::identification(
            &identification.parameters,
            &identification.fit,
            found.identified.model.causality,
            &identification.windows.reason,
        );
        if self.whole {
            terminal::from_whole();
        }
        if let Some(minimisation) = &identification.minimisation {
            terminal::minimisation(&minimisation.outcome, &minimisation.fit_at_start);
        }
        terminal::throughput(samples, identification.samples_per_second);
        terminal::written(&written);
        Ok(DONE)
    }

    fn found(&self, input: Input, model: &Model, progress: &Meter) -> Result<Found> {
        let options = self.windows.options()?;
        match input {
            Input::Memory(recordings) => {
                let recordings = steadied(recordings, model, options)?;
                let bench = Workbench::new(&recordings, model, options)?;
                progress.say("identifying");
                let (found, model, less) = bench.fit_curved(model, &recordings)?;
                let given = (&model, recordings.as_slice());
                let (identified, minimisation) = self.refined(found, &bench, given, progress)?;
                let whole = self.whole.then(|| {
                    let bench = bench.on_whole(&model, options)?;
                    progress.say("identifying");
                    let found = bench.fit(&model, &recordings)?;
                    let (all, _) = self.refined(found, &bench, given, progress)?;
                    Ok::<_, Error>(all.model)
                });
                Ok(Found {
                    identified,
                    whole: whole.transpose()?,
                    rows: bench.problem.rows.len(),
                    bench,
                    shown: recordings,
                    passes: None,
                    minimisation,
                    curve: less.map(check::falls_otherwise),
                })
            }
            Input::Files(files) => {
                self.how.check_long(self.whole)?;
                let streamed =
                    stream::identify(&files, model, options, &|done| progress.follow(done))?;
                Ok(Found {
                    identified: streamed.identified,
                    whole: None,
                    rows: streamed.rows,
                    bench: streamed.pilot,
                    shown: streamed.stretches,
                    passes: Some(streamed.passes),
                    minimisation: None,
                    curve: streamed.less.map(check::falls_otherwise),
                })
            }
        }
    }

    /// What was found on a workbench, refined by the chosen method.
    fn refined(
        &self,
        found: Identified,
        bench: &Workbench,
        given: (&Model, &[Recording]),
        progress: &Meter,
    ) -> Result<(Identified, Option<Minimisation>)> {
        progress.say("taking off what sensors and smoothing do");
        let mut identified = bench.unbiased(found, given.1)?;
        let minimisation = self.how.refine(&mut identified, bench, given, progress)?;
        Ok((identified, minimisation))
    }
}
