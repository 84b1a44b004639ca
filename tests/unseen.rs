//! What no window of the usual width passes, and what moves behind the measured side, is found all the same.

mod cli;

use cli::{BASELINE, Folder, PLAIN};
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
