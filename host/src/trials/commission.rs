//! What a plant is asked before it goes to work.

use std::f64::consts::TAU;

use super::{found, usable};
use crate::bench::{self, Control, Sensors};
use crate::error::{Error, Result};
use crate::excite::{Excitation, Shape};
use crate::model::Model;
use crate::plant;
use crate::recording::Recording;
use crate::tune::Wish;

/// A test run of a plant on a bench.
pub(super) struct Bench {
    /// Largest value of the multisine that the position follows, rad.
    pub amplitude: f64,
    /// Its lowest and highest frequency, Hz.
    pub band: (f64, f64),
    /// Torque that nobody knows, RMS, N·m.
    pub load_noise: f64,
    /// What phases and noise are drawn from.
    pub seed: u64,
}

/// Length of the test run, s, and bandwidth of its controller, Hz.
const SECONDS: f64 = 12.0;
const BANDWIDTH: f64 = 8.0;

/// What DBI makes of a test run of a rotary plant, for a model that asks.
pub(super) fn commission(
    truth: &Model,
    asked: &Model,
    wish: &Wish,
    bench: &Bench,
) -> Result<Model> {
    let t: Vec<f64> = (0..(SECONDS * wish.rate) as usize)
        .map(|k| k as f64 / wish.rate)
        .collect();
    let excitation = Excitation {
        shape: Shape::Multisine,
        amplitude: bench.amplitude,
        band: bench.band,
        duration: SECONDS,
        seed: bench.seed,
    };
    let signal = excitation.values(&t);
    let mut plant = plant::new(truth)?;
    let control = Control::of_bandwidth(BANDWIDTH, plant.authority());
    let sensors = Sensors {
        count: TAU / wish.counts,
        load_noise: bench.load_noise,
        seed: bench.seed,
        ..Sensors::default()
    };
    let record = bench::record(plant.as_mut(), t, &signal, Some(control), sensors);
    let recording = Recording {
        path: "off-line.csv".into(),
        t: record.t,
        u: record.u,
        q: Some(record.q),
        ..Recording::default()
    };
    found(&recording, asked)
        .filter(|model| usable(&model.inertia) && usable(&model.coulomb))
        .ok_or_else(|| {
            Error::Internal("DBI found no friction in a recording that shows it".to_owned())
        })
}
