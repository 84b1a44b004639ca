//! `bristle identify --curve`: the friction law on the steady-state torque-speed curve.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::diagnose::json;
use super::input::{Input, named};
use super::method::MethodArgs;
use super::output::Outputs;
use super::terminal::Meter;
use super::{DONE, Outcome, terminal};
use crate::curve::{self, Curve};
use crate::diagnose::{Estimates, estimates};
use crate::error::Error;
use crate::model::Model;
use crate::pem::Optimiser;

/// What goes into the JSON.
#[derive(Serialize)]
struct CurveFit<'a> {
    schema: &'static str,
    method: &'static str,
    parameters: Estimates,
    curve: &'a Curve,
}

/// Fits the law of a model file to the steady points of recordings.
pub(super) fn run(
    paths: &[PathBuf],
    model_path: &Path,
    (model_out, json_out): (Option<&PathBuf>, Option<&PathBuf>),
    how: &MethodArgs,
) -> Outcome {
    let progress = Meter::new();
    let model = Model::read(model_path)?;
    let given = how.starts_from_file(&model)?;
    let Input::Memory(recordings) = Input::open(paths, &model, usize::MAX, &progress)? else {
        return Err(Error::Internal("a recording without bound".to_owned()));
    };
    progress.say("fitting the curve");
    let optimiser = how.method.optimiser();
    let optimiser = optimiser.unwrap_or(Optimiser::LevenbergMarquardt);
    let (model, curve) = curve::fit(&recordings, &model, optimiser, how.most(), given)
        .map_err(|e| named(e, paths, model_path))?;
    let shown = |name: &str| curve::SHOWN.contains(&name);
    let mut parameters = estimates(&model, None);
    parameters.retain(|name, _| shown(name));
    let fit = CurveFit {
        schema: "bristle.curve/1",
        method: match optimiser {
            Optimiser::LevenbergMarquardt => "levenberg-marquardt",
            Optimiser::NelderMead => "nelder-mead",
            Optimiser::Bfgs => "bfgs",
        },
        parameters,
        curve: &curve,
    };
    let mut outputs = Outputs::default();
    outputs.add(model_out, || Ok(model.to_toml()))?;
    outputs.add(json_out, || json(&fit))?;
    let written = outputs.write()?;
    progress.finish();
    terminal::curve(
        &fit.parameters,
        &curve,
        model.unit(crate::effects::Quantity::Torque),
    );
    terminal::written(&written);
    Ok(DONE)
}
