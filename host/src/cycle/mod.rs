//! The whole loop on a built-in axis: record → diagnose → model → deploy → verify, with the board in the emulator.
//!
//! The axis conceals a Stribeck curve and an unbalance. What its owner believes is Coulomb and viscous friction. The same
//! task is tracked three times, each time after the board was set up anew through [`deploy`]:
//! with nothing compensated, with what the owner believes, fitted to the recording, and with what the diagnosis found.

use std::f64::consts::TAU;

use bristle_core::drive::Fault;
use bristle_core::link::{Board as Kind, Command};
use serde::Serialize;

use crate::bench::{self, Record};
use crate::deploy::{self, Rig};
use crate::emulate::{self, Board, Plan, Sensors, Setup};
use crate::error::{Error, Result};
use crate::model::Model;
use crate::plant;
use crate::showcase::{AXIS, COUNTS, DISTURBANCE};
use crate::tune::{self, Wish};

/// What the axis conceals beside its Stribeck curve.
const UNBALANCE: &str = "[effects.gravity]
amplitude = 0.15
phase = 0.5
";

/// What the data sheets say, enough for a controller that moves the axis while it is recorded.
const DATA_SHEET: &str = "name = \"demonstration axis, data sheets\"

[plant]
motion  = \"rotary\"
input   = \"torque\"
inertia = 0.010

[friction]
model   = \"coulomb-viscous\"
coulomb = 0.0
viscous = 0.0
";

const RATE: f64 = 1000.0;
/// What is asked of every controller.
const WISH: Wish = Wish {
    bandwidth: 6.0,
    rate: RATE,
    counts: COUNTS,
    limit: 1.5,
};
const RECORDED: f64 = 24.0;
const TASK: f64 = 12.0;

/// What the controller knows while it tracks the task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Knowledge {
    /// The inertia of the baseline; friction and effects are left alone.
    Nothing,
    /// The baseline as identified from the recording.
    Baseline,
    /// What the diagnosis found.
    Diagnosis,
}

impl Knowledge {
    /// What a person reads.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "friction left alone",
            Self::Baseline => "Coulomb and viscous friction, as identified",
            Self::Diagnosis => "as diagnosed",
        }
    }
}

/// The task, tracked once.
#[derive(Clone, Debug, Serialize)]
pub struct Lap {
    /// What the controller knew.
    pub knowledge: Knowledge,
    /// RMS distance between set point and true position over the whole task, rad.
    pub rms: f64,
    /// The largest.
    pub peak: f64,
    /// RMS of the torque, N·m.
    pub effort: f64,
    /// The run.
    #[serde(skip)]
    pub record: Record,
}

/// The axis as it is, for whoever writes its recordings.
pub fn truth() -> Result<Model> {
    Model::parse(&format!("{AXIS}{UNBALANCE}")).map_err(Error::Internal)
}

/// Records the axis, which the board moves through slow and fast speeds knowing no more than data sheets.
pub fn record(board: &mut Board<f32>, seed: u64) -> Result<Record> {
    let model = Model::parse(DATA_SHEET).map_err(Error::Internal)?;
    // Two slow waves and a faster one, from rest: the axis turns once around, creeps and hurries in both directions.
    let waves = [(2.1, 0.11), (0.6, 0.71), (0.12, 2.3)];
    run(board, &model, false, &plan(RECORDED, &waves, seed))
}

/// Tracks the task with what a model knows.
pub fn track(
    board: &mut Board<f32>,
    model: &Model,
    knowledge: Knowledge,
    seed: u64,
) -> Result<Lap> {
    // Other waves than those of the recording, slow: friction rules, and gravity goes through half of its range.
    let waves = [(0.9, 0.17), (0.12, 0.83)];
    let compensate = knowledge != Knowledge::Nothing;
    let plan = plan(TASK, &waves, seed.wrapping_add(1));
    let record = run(board, model, compensate, &plan)?;
    let errors = record.set_point.iter().zip(&record.truth);
    let errors: Vec<f64> = errors.map(|(r, truth)| r - truth.q).collect();
    let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
    Ok(Lap {
        knowledge,
        rms: rms(&errors),
        peak: errors.iter().fold(0.0, |m, e| e.abs().max(m)),
        effort: rms(&record.u),
        record,
    })
}

/// A sum of `a·(1 − cos 2πft)`, so that it starts at rest at zero.
fn plan(seconds: f64, waves: &[(f64, f64)], seed: u64) -> Plan<f32> {
    let t: Vec<f64> = (0..(seconds * RATE) as usize)
        .map(|k| k as f64 / RATE)
        .collect();
    let sensors = Sensors::emulated(TAU / COUNTS);
    let at = |t: f64| {
        waves.iter().fold((0.0, 0.0, 0.0), |(q, v, a), (size, f)| {
            let (omega, phase) = (TAU * f, TAU * f * t);
            (
                q + size * (1.0 - phase.cos()),
                v + size * omega * phase.sin(),
                a + size * omega * omega * phase.cos(),
            )
        })
    };
    let set_point = |t: &f64| {
        let (q, v, a) = at(*t);
        emulate::position(q, (v, a), sensors.count, &tune::SI)
    };
    Plan {
        set_points: t.iter().map(set_point).collect(),
        positions: t.iter().map(|t| at(*t).0).collect(),
        loads: bench::loads(t.len(), DISTURBANCE, seed),
        t,
        sensors,
    }
}

/// Deploys a model, restarts the board, sees that it holds what it was sent, and runs the axis along a plan.
fn run(
    board: &mut Board<f32>,
    model: &Model,
    compensate: bool,
    plan: &Plan<f32>,
) -> Result<Record> {
    let setup = Setup {
        wish: WISH,
        compensate,
    };
    let rig = Rig {
        board: Kind::Emulated,
        bus: plan.sensors.bus,
        current: None,
    };
    let parameters = deploy::parameters(model, &setup, &rig)?;
    deploy::deploy(board, &parameters)?;
    board.restart()?;
    deploy::verify(board, &parameters)?;
    board.tell(Command::Enable)?;
    let mut plant = plant::new(&truth()?)?;
    let outcome = emulate::run(board, plant.as_mut(), plan)?;
    board.tell(Command::Disable)?;
    let faults = outcome.periods.iter().flat_map(|p| p.faults.iter());
    let faults: Vec<Fault> = faults.collect();
    match faults.first() {
        None => Ok(outcome.record),
        Some(fault) => Err(Error::Board(format!(
            "it turned its bridge off: {}",
            fault.page().id
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::{DATA_SHEET, WISH, plan, truth};
    use crate::model::Model;
    use crate::showcase::BASELINE;
    use crate::tune::parameters;

    #[test]
    fn the_models_are_valid_and_the_owners_do_not_know_the_effects() {
        assert!(parameters(&truth().unwrap(), &WISH).is_ok());
        assert!(parameters(&Model::parse(DATA_SHEET).unwrap(), &WISH).is_ok());
        let baseline = Model::parse(BASELINE).unwrap();
        assert!(baseline.terms.is_empty());
        assert!(parameters(&baseline, &WISH).is_err());
    }

    #[test]
    fn a_plan_starts_at_rest_and_its_rates_are_those_of_its_positions() {
        use bristle_core::control::SetPoint;
        let plan = plan(1.0, &[(0.5, 0.7), (0.1, 3.0)], 1);
        let q = &plan.positions;
        assert_eq!(q[0], 0.0);
        for k in 1..q.len() - 1 {
            let SetPoint::Position {
                velocity,
                acceleration,
                ..
            } = plan.set_points[k]
            else {
                panic!("no position")
            };
            // Central differences of a wave at ω err by (ωh)²/6 and (ωh)²/12 of its rates: 6e-5 at 3 Hz.
            let v = (q[k + 1] - q[k - 1]) / 2e-3;
            let a = (q[k + 1] - 2.0 * q[k] + q[k - 1]) / 1e-6;
            assert!((v - f64::from(velocity)).abs() < 6e-5 * 4.1, "{k}");
            assert!(
                (a - f64::from(acceleration)).abs() < 3e-5 * 46.0 + 1e-8,
                "{k}"
            );
        }
    }
}
