//! Both forms recover the truth from simulated recordings with a fine encoder.

use super::{Solution, forms, solve};
use crate::axis::Axis;
use crate::model::Model;
use crate::problem::{Problem, Response};
use crate::recording::Recording;
use crate::simulate::{State, run_axis};
use crate::system;

const PERIOD: f64 = 1e-3;

/// An axis of a model under a sum of sines, 24 s at 1 kHz, seen by an encoder of `counts` a turn.
fn record(model: &Model, counts: f64, sines: &[(f64, f64)]) -> Recording {
    let axis = Axis::new(model).unwrap();
    let step = std::f64::consts::TAU / counts;
    let t: Vec<f64> = (0..24_000).map(|k| f64::from(k) * PERIOD).collect();
    let drive = |t: f64| -> f64 {
        let sines = sines.iter();
        sines.map(|(a, w)| a * (w * t + 3.0 * w).sin()).sum()
    };
    let mut recording = Recording {
        path: "simulated.csv".into(),
        u: t.iter().map(|&t| drive(t)).collect(),
        t,
        ..Recording::default()
    };
    let rest = State { q: 0.0, v: 0.0 };
    let states = run_axis(&axis, &recording, 0, recording.len() - 1, rest);
    recording.q = Some(states.iter().map(|s| (s.q / step).round() * step).collect());
    recording
}

fn found(model: &Model, recording: &Recording, half_width: f64) -> Solution {
    let tracks = Problem::tracks(std::slice::from_ref(recording), model.motion, None);
    let reach = (half_width / PERIOD).round() as usize;
    let problem = Problem::new(tracks, &[reach], model.motion, Response::Acceleration);
    let form = forms(model).remove(0);
    solve(form.as_ref(), &problem, &system::blocks(&problem), model).unwrap()
}

fn assert_close(solution: &Solution, truth: &[f64], tolerance: f64) {
    for ((value, se), truth) in solution.physical.iter().zip(&solution.se).zip(truth) {
        assert!(
            (value - truth).abs() < tolerance * truth,
            "{value} ± {se}, truth {truth}"
        );
        assert!(*se < tolerance * truth, "{value} ± {se}, truth {truth}");
    }
}

#[test]
fn the_dahl_form_recovers_the_truth() {
    let model = Model::parse(
        "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\nmodel = \"dahl\"\ncoulomb = 0.15\nviscous = 0.02\nbristle_stiffness = 3.0",
    )
    .unwrap();
    let recording = record(
        &model,
        4_194_304.0,
        &[(0.2, 2.3), (0.15, 7.1), (0.12, 13.7)],
    );
    // Breakaway takes 50 mrad: smoothing velocity over some ten samples rounds the law off by about a percent.
    assert_close(
        &found(&model, &recording, 0.05),
        &[0.01, 0.02, 3.0, 0.15],
        0.03,
    );
}

#[test]
fn the_rational_form_recovers_the_truth() {
    let model = Model::parse(
        "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\nmodel = \"modified-lugre\"\ncoulomb = 0.1\nviscous = 0.02\nstatic = 0.2\nstribeck_velocity = 5.0\nbristle_stiffness = 300\nbristle_damping = 0.0",
    )
    .unwrap();
    let recording = record(&model, 4_194_304.0, &[(0.3, 2.3), (0.2, 7.1), (0.1, 13.7)]);
    assert_close(
        &found(&model, &recording, 0.05),
        &[0.01, 0.02, 0.2, 0.1, 5.0],
        0.05,
    );
}
