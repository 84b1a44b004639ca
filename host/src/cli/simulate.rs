//! `bristle simulate`

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{self, Outputs};
use super::{DONE, Outcome, terminal};
use crate::axis::Axis;
use crate::error::Error;
use crate::fit;
use crate::model::{Causality, Model};
use crate::recording::Recording;
use crate::simulate::State;
use crate::weak::Track;

/// Run a model from a recording's first state, driven by its u alone
///
/// Writes t,u,q,v in SI units at the recording's own instants. With --horizon the run restarts from the measured
/// state every so many seconds. A model whose causality is "inverse" follows the measured motion, and u is its force.
///
/// Example: bristle simulate --model fitted.toml --input run.csv --out predicted.csv --horizon 1
#[derive(Args, Debug)]
pub(super) struct Command {
    /// Model file with a value for every parameter, as identify and diagnose write it
    #[arg(long, value_name = "M.toml")]
    model: PathBuf,
    /// Recording whose u drives the model
    #[arg(long, value_name = "REC.csv")]
    input: PathBuf,
    /// Where to write the prediction
    #[arg(long, value_name = "PRED.csv")]
    out: PathBuf,
    /// Restart from the measured state every so many seconds
    #[arg(long, value_name = "SECONDS")]
    horizon: Option<f64>,
}

impl Command {
    pub fn run(&self) -> Outcome {
        output::check(&[&self.input as &Path, &self.model], &[Some(&self.out)])?;
        let horizon = self.horizon.unwrap_or(f64::INFINITY);
        if horizon.is_nan() || horizon <= 0.0 {
            return Err(Error::Usage(format!(
                "--horizon {horizon} must be a positive number of seconds"
            )));
        }
        let model = Model::read(&self.model)?;
        let axis = Axis::new(&model).map_err(|error| match error {
            Error::Usage(what) => self.unusable(what),
            other => other,
        })?;
        let recording = Recording::read(&self.input, &model.columns, model.motion)?;
        let text =
            predict(&model, &axis, &recording, horizon).map_err(|what| self.unusable(what))?;
        let mut outputs = Outputs::default();
        outputs.add(Some(&self.out), || Ok(text))?;
        terminal::written(&outputs.write()?);
        Ok(DONE)
    }

    fn unusable(&self, what: String) -> Error {
        Error::Model {
            path: self.model.clone(),
            what,
        }
    }
}

/// The prediction as CSV; a message if the model runs away.
fn predict(
    model: &Model,
    axis: &Axis,
    recording: &Recording,
    horizon: f64,
) -> Result<String, String> {
    let track = Track::new(recording, model.motion, None);
    let (states, u): (Vec<State>, Vec<f64>) = match model.causality {
        Causality::Forward => (
            fit::predict(axis, recording, &track, horizon, 0, recording.len()),
            recording.u.clone(),
        ),
        Causality::Inverse => {
            let states = (0..recording.len())
                .map(|k| fit::measured_state(recording, &track, k))
                .collect();
            (states, fit::inverse(axis, recording, &track))
        }
    };
    if let Some(k) = states
        .iter()
        .position(|s| !(s.q.is_finite() && s.v.is_finite()))
    {
        return Err(format!(
            "the model runs away: its state is no longer finite at t = {} s; check the signs and sizes of its parameters, or use --horizon",
            recording.t[k]
        ));
    }
    let mut text = String::from("t,u,q,v\n");
    for ((t, u), state) in recording.t.iter().zip(&u).zip(&states) {
        // `{:?}` writes the shortest decimal that reads back as the same number.
        let _ = writeln!(text, "{t:?},{u:?},{:?},{:?}", state.q, state.v);
    }
    Ok(text)
}
