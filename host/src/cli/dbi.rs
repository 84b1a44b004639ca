//! `bristle dbi`

use std::path::{Path, PathBuf};

use clap::Args;

use super::diagnose::json;
use super::input::{Input, named, stretches};
use super::output::{self, Outputs};
use super::terminal::Meter;
use super::windows::Windows;
use super::{DONE, Outcome, terminal};
use crate::check;
use crate::dbi::Study;
use crate::identify::{Workbench, steadied};
use crate::model::Model;
use crate::report;
use crate::stream;

/// Show how distribution-based identification (DBI) comes to its estimates, and whether to trust them
///
/// For recordings and a model: the test functions and what they pass, the windows and why they are so wide, the
/// functionals that the equation of motion becomes, both sides of it row by row, what the fit leaves before and after
/// whitening, the correlations of the estimates, and the estimates under windows of some ten half-widths from 15 to
/// 300 ms. Under the laws dahl, stribeck and modified-lugre also the estimates of the form that is linear in products of
/// the parameters, with the bias that encoder noise gives it. Of recordings with millions of samples, stretches are studied, spread
/// evenly over them.
///
/// Example: bristle dbi run.csv --model axis.toml --report study.html
#[derive(Args, Debug)]
pub(super) struct Command {
    /// Recordings (CSV, Parquet or MATLAB level 5) of one axis; each is an experiment of its own, all share the parameters
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    /// Model file (TOML); "?" marks what is to be estimated
    #[arg(long, value_name = "M.toml")]
    model: PathBuf,
    /// Write all figures as JSON (schema bristle.dbi/1)
    #[arg(long, value_name = "OUT.json")]
    json: Option<PathBuf>,
    /// Write a self-contained HTML report with plots
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    windows: Windows,
}

impl Command {
    pub fn run(&self) -> Outcome {
        let mut inputs: Vec<&Path> = self.recordings.iter().map(PathBuf::as_path).collect();
        inputs.push(&self.model);
        output::check(&inputs, &[self.json.as_ref(), self.report.as_ref()])?;
        let progress = Meter::new();
        let model = Model::read_to_fit(&self.model)?;
        let recordings = match Input::open(&self.recordings, &model, stream::LONG, &progress)? {
            Input::Memory(recordings) => recordings,
            Input::Files(files) => stretches(&files)?,
        };
        progress.say("identifying");
        let recordings = steadied(recordings, &model, self.windows.options()?)
            .map_err(|e| named(e, &self.recordings, &self.model))?;
        let bench = Workbench::new(&recordings, &model, self.windows.options()?)
            .map_err(|e| named(e, &self.recordings, &self.model))?;
        let (identified, model, less) = bench
            .fit_curved(&model, &recordings)
            .map_err(|e| named(e, &self.recordings, &self.model))?;
        let mut study = Study::new(&bench, &identified, &model, &recordings, &|what| {
            progress.say(what);
        });
        study.warnings.extend(less.map(check::falls_otherwise));
        let mut outputs = Outputs::default();
        outputs.add(self.json.as_ref(), || json(&study))?;
        outputs.add(self.report.as_ref(), || {
            report::study(&study, &identified, &bench, &recordings)
        })?;
        let written = outputs.write()?;
        progress.finish();
        terminal::warnings(&study.warnings);
        terminal::study(&study);
        terminal::written(&written);
        Ok(DONE)
    }
}
