//! How `bristle identify` estimates: the options that say so, and what comes of them.

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::terminal::Meter;
use crate::error::{Error, Result};
use crate::fit::{self, Fit};
use crate::identify::{Identified, Workbench};
use crate::model::Model;
use crate::pem::{self, Optimiser, Options, Outcome};
use crate::recording::Recording;

/// Ways to estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Method {
    /// Distribution-based identification: the weak form, in a second
    Dbi,
    /// Prediction errors, minimised by Levenberg-Marquardt: the most precise, some seconds
    Pem,
    /// The same errors, minimised without derivatives by the simplex of Nelder and Mead: slow
    NelderMead,
    /// The same errors, minimised by the quasi-Newton method BFGS
    Bfgs,
}

/// Where to start from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Start {
    /// What DBI finds
    Dbi,
    /// The values in the model file, { value = …, known = false }
    Model,
}

/// Options of the iterative methods.
#[derive(Args, Debug)]
pub(super) struct MethodArgs {
    /// How to estimate
    #[arg(long, value_enum, default_value = "dbi")]
    pub method: Method,
    /// Where pem, nelder-mead and bfgs start
    #[arg(long, value_enum, default_value = "dbi")]
    start: Start,
    /// Minimise the output error over windows of this length in place of the error of one-step predictions, for
    /// torque that is known without noise
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    horizon: Option<f64>,
    /// Most iterations of pem, nelder-mead and bfgs
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    max_iterations: u32,
    /// Fit the friction law to the steady-state torque-speed curve: the points at which the recording holds its speed,
    /// as a staircase of drive levels does. By Levenberg-Marquardt, or the method chosen. An axis, a DC motor or a
    /// geared servo; the rest of the model stays as it is
    #[arg(long)]
    pub curve: bool,
}

/// What a minimisation did, for the JSON.
#[derive(Serialize)]
pub(super) struct Minimisation {
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Free-run errors of the model that it started from.
    pub fit_at_start: Fit,
}

impl Method {
    /// The optimiser, unless it is DBI alone.
    pub fn optimiser(self) -> Option<Optimiser> {
        match self {
            Self::Dbi => None,
            Self::Pem => Some(Optimiser::LevenbergMarquardt),
            Self::NelderMead => Some(Optimiser::NelderMead),
            Self::Bfgs => Some(Optimiser::Bfgs),
        }
    }
}

impl MethodArgs {
    /// Refuses combinations that mean nothing.
    pub fn check(&self) -> Result<()> {
        let refuse = |what: &str| Err(Error::Usage(what.to_owned()));
        if self.horizon.is_some_and(|h| h.is_nan() || h <= 0.0) {
            return refuse("--horizon must be a positive number of seconds");
        }
        if self.method == Method::Dbi
            && !self.curve
            && (self.horizon.is_some() || self.start == Start::Model)
        {
            return refuse(
                "--horizon and --start belong to --method pem, nelder-mead and bfgs; DBI predicts nothing and needs no start",
            );
        }
        Ok(())
    }

    /// Refuses what a curve does not have.
    pub fn check_curve(&self, report: bool, whole: bool) -> Result<()> {
        let refuse = |what: &str| Err(Error::Usage(what.to_owned()));
        if self.horizon.is_some() {
            return refuse("--horizon belongs to predictions of motion; leave it out with --curve");
        }
        if whole {
            return refuse(
                "--whole belongs to fits of motion; a curve is fitted to all of its points already",
            );
        }
        if report {
            return refuse(
                "--report shows the motion of a complete model; leave it out with --curve, whose --json has the points and the fitted law",
            );
        }
        Ok(())
    }

    /// Refuses what would need a whole long recording in memory.
    pub fn check_long(&self, whole: bool) -> Result<()> {
        let what = if self.method != Method::Dbi {
            "only --method dbi does"
        } else if whole {
            "--whole does not"
        } else {
            return Ok(());
        };
        Err(Error::Usage(format!(
            "the recordings are read piece by piece, which {what}; cut a stretch out of them, or raise --stream-above to load them whole"
        )))
    }

    /// Most iterations.
    pub fn most(&self) -> usize {
        self.max_iterations as usize
    }

    /// Whether the values of the model file are the start, and if so that it has them.
    pub fn starts_from_file(&self, model: &Model) -> Result<bool> {
        if self.start == Start::Dbi {
            return Ok(false);
        }
        match model.first_unknown() {
            None => Ok(true),
            Some(missing) => Err(Error::Usage(format!(
                "--start model: the model file has no value for {missing} to start from; write {{ value = …, known = false }}, or leave --start out to start from what DBI finds"
            ))),
        }
    }

    /// Goes on from what DBI found, or from the model file, by the chosen method; nothing more for DBI itself.
    pub fn refine(
        &self,
        identified: &mut Identified,
        bench: &Workbench,
        (model, recordings): (&Model, &[Recording]),
        progress: &Meter,
    ) -> Result<Option<Minimisation>> {
        let Some(optimiser) = self.method.optimiser() else {
            return Ok(None);
        };
        if self.starts_from_file(model)? {
            identified.model = model.clone();
            identified.fit = fit::judge(model, recordings, &bench.problem.tracks)?;
        }
        let options = Options {
            optimiser,
            horizon: self.horizon,
            most: self.most(),
        };
        let tell = |text: String| progress.say(&text);
        let tracks = &bench.problem.tracks;
        let (model, outcome) =
            pem::estimate(recordings, tracks, &identified.model, options, &tell)?;
        let after = fit::judge(&model, recordings, tracks)?;
        identified.model = model;
        let fit_at_start = std::mem::replace(&mut identified.fit, after);
        Ok(Some(Minimisation {
            outcome,
            fit_at_start,
        }))
    }
}
