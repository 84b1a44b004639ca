//! `bristle demo`

use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;

use super::output::Outputs;
use super::{Outcome, diagnose};
use crate::bench::{self, Control, Sensors};
use crate::error::{Error, Result};
use crate::model::Model;
use crate::plant;
use crate::showcase::{AXIS, BASELINE, COUNTS, DISTURBANCE};

/// Run the main job on a built-in recording: an axis with concealed physics, simulated, recorded and diagnosed
///
/// Simulates an axis under position control whose friction has a Stribeck curve, writes what its driver would have
/// recorded (torque and a 16384-count encoder), and diagnoses that against a model which knows only Coulomb and
/// viscous friction.
///
/// With --loop it goes all the way round: the firmware in QEMU moves and records an axis that conceals an unbalance as
/// well, the diagnosis is deployed to it, and the same task is tracked before and after. Needs qemu-system-arm and, unless
/// --image is given, cargo with the target thumbv7em-none-eabihf.
#[derive(Args, Debug)]
pub(super) struct Command {
    /// Folder for the recording, the models, the JSON and the report
    #[arg(long, value_name = "DIR", default_value = "bristle-demo")]
    out: PathBuf,
    /// Seed of the simulated noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Go all the way round: record on the emulated board, diagnose, deploy, and track again
    #[cfg(unix)]
    #[arg(long = "loop")]
    round: bool,
    /// Image of the firmware for --loop [default: built from the sources by cargo]
    #[cfg(unix)]
    #[arg(long, value_name = "ELF", requires = "round")]
    image: Option<PathBuf>,
}

const RATE: usize = 1000;
const SECONDS: usize = 24;

impl Command {
    pub fn run(&self) -> Outcome {
        std::fs::create_dir_all(&self.out).map_err(|reason| Error::Unwritable {
            path: self.out.clone(),
            reason,
        })?;
        #[cfg(unix)]
        if self.round {
            return super::cycle::run(&self.out, self.image.as_deref(), self.seed);
        }
        let (recording, model) = (
            self.out.join("recording.csv"),
            self.out.join("baseline.toml"),
        );
        let mut outputs = Outputs::default();
        let text = record(self.seed)?;
        outputs.add(Some(&recording), || Ok(text))?;
        outputs.add(Some(&model), || Ok(BASELINE.to_owned()))?;
        outputs.write()?;
        anstream::println!(
            "Simulated {SECONDS} s of an axis with concealed physics: {}\nDiagnosing it against a model of Coulomb and viscous friction: {}\n",
            recording.display(),
            model.display()
        );
        let status = diagnose::Command::demo(recording, model, &self.out).run()?;
        anstream::println!(
            "\nOpen {} in a browser.",
            self.out.join("report.html").display()
        );
        Ok(status)
    }
}

/// Runs the axis under position control and writes what its driver would have recorded.
fn record(seed: u64) -> Result<String> {
    let model = Model::parse(AXIS).map_err(Error::Internal)?;
    let t: Vec<f64> = (0..SECONDS * RATE)
        .map(|k| k as f64 / RATE as f64)
        .collect();
    // Two slow waves and a faster one: speeds from creeping to brisk, in both directions.
    let wave = |t: f64, hertz: f64| (TAU * hertz * t).sin();
    let reference = |&t: &f64| 1.5 * wave(t, 0.23) + 0.6 * wave(t, 0.71) + 0.12 * wave(t, 2.3);
    let reference: Vec<f64> = t.iter().map(reference).collect();
    let control = Control {
        proportional: 6.0,
        derivative: 0.05,
    };
    let sensors = Sensors {
        count: TAU / COUNTS,
        load_noise: DISTURBANCE,
        seed,
        ..Sensors::default()
    };
    let mut plant = plant::new(&model)?;
    let record = bench::record(plant.as_mut(), t, &reference, Some(control), sensors);
    Ok(bench::csv(&record, Some(&model)))
}
