//! `bristle simulate`

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use super::bench::{Bench, Excite};
use super::output::{self, Outputs};
use super::{DONE, Outcome, terminal};
use crate::axis::Axis;
use crate::bench;
use crate::error::{Error, Result};
use crate::excite::Shape;
use crate::fit;
use crate::model::{Causality, Model};
use crate::plant::{self, Plant};
use crate::recording::Recording;
use crate::simulate::State;
use crate::weak::Track;

/// What the model file can describe, for the help.
const PLANTS: &str = "\
Plants, chosen by [plant] kind = \"...\" in the model file, and the constants that each asks for there:
  axis          one inertia with friction; this is what kind is when left out
  mass-spring   stiffness
  dc-motor      resistance, inductance, torque_constant, back_emf
  geared-servo  the same, and motor_inertia, gear_ratio, gear_efficiency, motor_efficiency
  wheel-slip    wheel_mass, vehicle_mass, axle_stiffness, axle_damping, vehicle_drag, all at the rim

Friction laws: coulomb-viscous, stribeck, static, dahl, lugre, modified-lugre.

Examples:
  bristle simulate --model fitted.toml --input run.csv --out predicted.csv --horizon 1
  bristle simulate --model axis.toml --excite multisine --amplitude 1 --control pd --counts 16384 --out run.csv";

/// Run a model: along a recording, or excited by a test signal to make a recording
///
/// With --input, from the recording's first state, driven by its u alone; writes t,u,q,v in SI units at the recording's
/// own instants. With --horizon the run restarts from the measured state every so many seconds. A model whose causality
/// is "inverse" follows the measured motion, and u is its force.
///
/// With --excite, from rest at zero, driven by the test signal, or by a position controller that follows it; writes a
/// recording as a driver would have made it, which diagnose and identify read.
#[derive(Args, Debug)]
#[command(after_long_help = PLANTS, group = ArgGroup::new("drive").required(true))]
pub(super) struct Command {
    /// Model file with a value for every parameter, as identify and diagnose write it
    #[arg(long, value_name = "M.toml")]
    model: PathBuf,
    /// Recording whose u drives the model
    #[arg(long, value_name = "REC.csv", group = "drive")]
    input: Option<PathBuf>,
    /// Where to write the prediction, or the recording
    #[arg(long, value_name = "OUT.csv")]
    out: PathBuf,
    /// With --input: restart from the measured state every so many seconds
    #[arg(
        long,
        value_name = "SECONDS",
        conflicts_with = "excite",
        allow_negative_numbers = true
    )]
    horizon: Option<f64>,
    /// Test signal that drives the model
    #[arg(long, value_name = "SHAPE", group = "drive", requires = "amplitude")]
    excite: Option<Excite>,
    #[command(flatten)]
    bench: Bench,
}

impl Command {
    pub fn run(&self) -> Outcome {
        let mut inputs: Vec<&Path> = vec![&self.model];
        inputs.extend(self.input.as_deref());
        output::check(&inputs, &[Some(&self.out)])?;
        let horizon = self.horizon.unwrap_or(f64::INFINITY);
        if horizon.is_nan() || horizon <= 0.0 {
            return Err(Error::Usage(format!(
                "--horizon {horizon} must be a positive number of seconds"
            )));
        }
        let model = Model::read(&self.model)?;
        let text = match (&self.input, self.excite) {
            (Some(input), _) => self.follow(&model, input, horizon)?,
            (None, Some(shape)) => self.excited(&model, shape.into())?,
            (None, None) => return Err(Error::Internal("neither --input nor --excite".to_owned())),
        };
        let mut outputs = Outputs::default();
        outputs.add(Some(&self.out), || Ok(text))?;
        terminal::written(&outputs.write()?);
        Ok(DONE)
    }

    /// The prediction along a recording.
    fn follow(&self, model: &Model, input: &Path, horizon: f64) -> Result<String> {
        let mut runner = self.runner(model)?;
        let recording = Recording::read(input, &model.columns, model.motion)?;
        predict(model, &mut runner, &recording, horizon).map_err(|what| self.unusable(what))
    }

    /// The recording of an excited plant.
    fn excited(&self, model: &Model, shape: Shape) -> Result<String> {
        if model.causality == Causality::Inverse {
            return Err(self.unusable(
                "plant.causality = \"inverse\" imposes the motion, and --excite drives the plant; write causality = \"forward\"".to_owned(),
            ));
        }
        let mut plant = plant::new(model).map_err(|error| error.in_model(&self.model))?;
        let record = self.bench.record(plant.as_mut(), shape, model.motion)?;
        let runs_away = |s: &State| !(s.q.is_finite() && s.v.is_finite());
        if let Some(k) = record.truth.iter().position(runs_away) {
            return Err(self.unusable(format!(
                "the model runs away: its state is no longer finite at t = {} s; check the signs and sizes of its parameters, or lower --amplitude or --bandwidth",
                record.t[k]
            )));
        }
        Ok(bench::csv(&record, Some(model)))
    }

    fn runner(&self, model: &Model) -> Result<Runner> {
        let runner = match model.unfittable() {
            None => Axis::new(model).map(|axis| Runner::Axis(axis.into())),
            Some((_, what)) if model.causality == Causality::Inverse => Err(Error::Usage(format!(
                "{what}; under causality = \"inverse\" it cannot be simulated either"
            ))),
            Some(_) => plant::new(model).map(Runner::Plant),
        };
        runner.map_err(|error| error.in_model(&self.model))
    }

    fn unusable(&self, what: String) -> Error {
        Error::Model {
            path: self.model.clone(),
            what,
        }
    }
}

/// What runs along a recording.
enum Runner {
    Axis(Box<Axis>),
    Plant(Box<dyn Plant>),
}

impl Runner {
    fn predict(&mut self, recording: &Recording, track: &Track, horizon: f64) -> Vec<State> {
        match self {
            Self::Axis(axis) => fit::predict(axis, recording, track, horizon, 0, recording.len()),
            Self::Plant(plant) => plant::follow(plant.as_mut(), recording, horizon, |k| {
                fit::measured_state(recording, track, k)
            }),
        }
    }
}

/// The prediction as CSV; a message if the model runs away.
fn predict(
    model: &Model,
    runner: &mut Runner,
    recording: &Recording,
    horizon: f64,
) -> std::result::Result<String, String> {
    let track = Track::new(recording, model.motion, None);
    let (states, u): (Vec<State>, Vec<f64>) = match (&*runner, model.causality) {
        (Runner::Axis(axis), Causality::Inverse) => {
            let states = (0..recording.len())
                .map(|k| fit::measured_state(recording, &track, k))
                .collect();
            (states, fit::inverse(axis, recording, &track))
        }
        _ => (
            runner.predict(recording, &track, horizon),
            recording.u.clone(),
        ),
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
