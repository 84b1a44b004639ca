//! What no window of the usual width passes, and what moves behind the measured side, is found all the same.

mod cli;

use std::f64::consts::TAU;

use bristle::axis::Axis;
use bristle::model::Model;
use bristle::simulate::{State, advance};
use cli::{BASELINE, Folder, PLAIN, Sample, UNBALANCED, csv};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

/// Makes a recording of an axis with an effect and diagnoses it against Coulomb and viscous friction.
fn diagnosed(effect: &str, bench: &str) -> Value {
    let folder = Folder::new();
    folder.write("truth.toml", format!("{PLAIN}{effect}"));
    folder.write("axis.toml", BASELINE);
    folder.done(&format!(
        "simulate --model truth.toml --excite {bench} --rate 1000 --counts 65536 --noise 0.01 --seed 4 --out run.csv"
    ));
    folder.done("diagnose run.csv --model axis.toml --json out.json");
    folder.json("out.json")
}

fn value(finding: &Value, parameter: &str) -> f64 {
    finding["parameters"][parameter]["value"]
        .as_f64()
        .unwrap_or(f64::NAN)
}

/// The usual windows, 70 ms and more to either side, pass hardly anything of 24 Hz.
#[test]
fn a_fast_hum_is_found() {
    let json = diagnosed(
        "[effects.periodic-disturbance]\namplitude = 0.03\nphase = 0.4\nfrequency = 24.0\n",
        "multisine --amplitude 0.4 --band 0.2:3",
    );
    let finding = &json["findings"][0];
    assert_eq!(finding["id"], "periodic-disturbance", "{}", json["text"]);
    assert!(
        (value(finding, "frequency") - 24.0).abs() < 0.02,
        "{finding}"
    );
    assert!(
        (value(finding, "amplitude") - 0.03).abs() < 0.003,
        "{finding}"
    );
}

/// Free runs start where the load swings, which follows from the motion before: started at ease they would be no better
/// than without a load, and the finding would be refuted.
#[test]
fn a_load_that_swings_is_found_and_predicted() {
    let json = diagnosed(
        "[effects.compliance]\nload_inertia = 0.006\nantiresonance = 7.0\ndamping_ratio = 0.03\n",
        "multisine --amplitude 1 --band 0.2:6",
    );
    let finding = &json["findings"][0];
    assert_eq!(finding["id"], "compliance", "{}", json["text"]);
    assert!(
        (value(finding, "antiresonance") - 7.0).abs() < 0.1,
        "{finding}"
    );
    let nrmse = |fit: &Value| fit["held_out"]["nrmse"].as_f64().unwrap_or(f64::NAN);
    let (before, after) = (nrmse(&json["fit"]["before"]), nrmse(&json["fit"]["after"]));
    assert!(after < 0.3 * before, "{before} {after}");
}

/// Diagnoses 24 s of an axis under position control that is now the one and now the other of two.
fn diagnosed_alternately(truths: [&str; 2], second: impl Fn(f64) -> bool) -> Value {
    const RATE: f64 = 500.0;
    let axis = |text| Axis::new(&Model::parse(text).expect("a valid truth")).expect("all values");
    let axes = truths.map(axis);
    let count = TAU / 65_536.0;
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut state, mut before) = (State::default(), 0.0);
    let sample = |k: u32| {
        let t = f64::from(k) / RATE;
        let wave = |hertz: f64| (TAU * hertz * t).sin();
        let q = (state.q / count).floor() * count;
        let reference = 1.5 * wave(0.31) + 0.6 * wave(0.83) + 0.12 * wave(2.3);
        let u = 6.0 * (reference - q) - 0.05 * (q - before) * RATE;
        before = q;
        let noise: f64 = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let now = &axes[usize::from(second(t))];
        state = advance(now, u + 0.01 * noise, state, 1.0 / RATE);
        Sample { t, u, q }
    };
    let samples: Vec<Sample> = (0..12_000).map(sample).collect();
    let folder = Folder::new();
    folder.write("axis.toml", BASELINE);
    folder.write("run.csv", csv(&samples));
    folder.done("diagnose run.csv --model axis.toml --json out.json");
    folder.json("out.json")
}

/// No fit sees the last 30 %, so nothing names what acts there alone; but the model is not adequate.
#[test]
fn what_acts_in_the_held_out_part_alone_is_noticed() {
    let json = diagnosed_alternately([PLAIN, UNBALANCED], |t| t > 17.0);
    assert_eq!(json["verdict"], "unknown", "{}", json["text"]);
    let text = json["text"].as_str().unwrap_or_default();
    assert!(text.contains("last 30 %"), "{text}");
    let same = diagnosed_alternately([PLAIN, PLAIN], |t| t > 17.0);
    assert_eq!(same["verdict"], "adequate", "{}", same["text"]);
}

/// Friction that doubles for a second now and then follows no coordinate, and is no noise either.
#[test]
fn friction_in_spells_is_noticed() {
    let dirty = PLAIN.replace("coulomb = 0.12", "coulomb = 0.24");
    // Beats of two waves without a common period.
    let spell = |t: f64| (TAU * t / 3.1).sin() + (TAU * t / 7.3).sin() > 1.0;
    let json = diagnosed_alternately([PLAIN, &dirty], spell);
    assert_eq!(json["verdict"], "unknown", "{}", json["text"]);
    let coordinate = &json["unexplained"]["coordinates"][0][0];
    assert_eq!(
        coordinate, "time, as friction in spells",
        "{}",
        json["text"]
    );
}
