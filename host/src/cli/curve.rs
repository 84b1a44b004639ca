//! `bristle identify --curve`: the friction law on the steady-state torque-speed curve.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::diagnose::{json, named, read_all};
use super::method::MethodArgs;
use super::output::Outputs;
use super::{DONE, Outcome, terminal};
use crate::curve::{self, Curve};
use crate::diagnose::{Estimates, estimates};
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
    let progress = terminal::progress();
    progress.set_message("reading");
    let model = Model::read(model_path)?;
    let given = how.starts_from_file(&model)?;
    let recordings = read_all(paths, &model)?;
    progress.set_message("fitting the curve");
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
    progress.finish_and_clear();
    terminal::curve(
        &fit.parameters,
        &curve,
        model.unit(crate::effects::Quantity::Torque),
    );
    terminal::written(&written);
    Ok(DONE)
}
