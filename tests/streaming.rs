//! Recordings of any length are identified in pieces, as if they had been in memory.

mod cli;

use bristle::diagnose::estimates;
use bristle::identify::{Options, identify};
use bristle::model::Model;
use bristle::recording::Recording;
use cli::{BASELINE, Folder, PLAIN, UNBALANCED, csv, record};
use serde_json::{Value, json};

/// Three pieces, of which none is the whole of anything.
const SECONDS: f64 = 180.0;
/// What the training rows are weighed by (the law of the noise, the balance that decides on rest, and the functions that
/// tell outliers) comes from parts of them when streamed: estimates differ by this share of their standard errors at most.
const SHARE: f64 = 0.5;
/// The command takes off the whole, and off the whole alone, the bias that twins of it show, which is within the errors.
const SHARE_WITH_BIAS: f64 = 1.0;

fn folder(truth: &str, model: &str) -> Folder {
    let folder = Folder::new();
    folder.write("run.csv", csv(&record(truth, SECONDS, 5)));
    folder.write("axis.toml", model);
    folder
}

/// Identifies with options and reads the JSON.
fn command(folder: &Folder, recordings: &str, options: &str) -> Value {
    let ran = folder.run(&format!(
        "identify {recordings} --model axis.toml --json out.json {options}"
    ));
    assert_eq!(ran.status, 0, "{ran:?}");
    folder.json("out.json")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// What the whole gives in memory, no bias taken off.
fn biased(folder: &Folder, recordings: &str) -> Value {
    let model = Model::read_to_fit(&folder.path("axis.toml")).expect("a model");
    let read = |name| Recording::read(&folder.path(name), &model.columns, model.motion);
    let recordings: Result<Vec<_>, _> = recordings.split(' ').map(read).collect();
    let recordings = recordings.expect("recordings");
    let (_, found) = identify(&recordings, &model, Options::default()).expect("a fit");
    json!({ "parameters": estimates(&found.model, None), "fit": found.fit })
}

/// Asserts that recordings give the same in pieces, with further options, as whole.
fn agree(folder: &Folder, recordings: &str, options: &str) {
    let streamed = command(
        folder,
        recordings,
        &format!("--stream-above 1000 {options}"),
    );
    let whole = command(folder, recordings, "");
    assert!(streamed["passes"].is_u64() && whole["passes"].is_null());
    assert_eq!(streamed["samples"], whole["samples"]);
    within(SHARE, &streamed, &biased(folder, recordings));
    within(SHARE_WITH_BIAS, &streamed, &whole);
}

/// Asserts that two identifications agree: values within a share of their errors, errors themselves, and fits.
fn within(share: f64, streamed: &Value, whole: &Value) {
    let parameters = whole["parameters"].as_object().expect("parameters");
    let estimated = |p: &&Value| p["se"].as_f64().is_some_and(|se| se > 0.0);
    for (name, expected) in parameters.iter().filter(|(_, p)| estimated(p)) {
        let found = &streamed["parameters"][name];
        let (se, error) = (number(&expected["se"]), number(&found["se"]));
        let apart = (number(&found["value"]) - number(&expected["value"])).abs();
        assert!(apart < share * se, "{name}: {found} against {expected}");
        assert!(
            (error / se - 1.0).abs() < 0.3,
            "{name}: {found} against {expected}"
        );
    }
    for part in ["train", "held_out"] {
        let figure = |fit: &Value, name: &str| number(&fit["fit"][part][name]);
        // The same samples in the same windows, so the same motion; the states that runs begin in are smoothed alike.
        let (a, b) = (figure(streamed, "signal"), figure(whole, "signal"));
        assert!((a / b - 1.0).abs() < 1e-9, "{part}: {a} and {b}");
        let (a, b) = (figure(streamed, "nrmse"), figure(whole, "nrmse"));
        assert!((a / b - 1.0).abs() < 0.05, "{part}: {a} and {b}");
    }
}

#[test]
fn pieces_give_what_the_whole_gives() {
    let folder = folder(PLAIN, BASELINE);
    agree(&folder, "run.csv", "");
}

#[test]
fn effects_and_several_recordings_stream_as_well() {
    let model = format!("{BASELINE}\n[effects.gravity]\n");
    let folder = folder(UNBALANCED, &model);
    folder.write("more.csv", csv(&record(UNBALANCED, 60.0, 6)));
    agree(&folder, "run.csv more.csv", "--report out.html");
    let report = std::fs::read_to_string(folder.path("out.html")).expect("a report");
    assert!(
        report.contains("run.csv from 0 s"),
        "the report names its stretches"
    );
}

#[test]
fn a_bad_cell_far_into_a_long_recording_is_named_and_nothing_is_written() {
    let folder = folder(PLAIN, BASELINE);
    let mut text = csv(&record(PLAIN, SECONDS, 5));
    let samples = text.lines().count() - 1;
    text += "1e9,oops,0\n";
    folder.write("run.csv", &text);
    let before = folder.files();
    let ran = folder.run(
        "identify run.csv --model axis.toml --model-out o.toml --json o.json --stream-above 1000",
    );
    assert_eq!(ran.status, 2, "{ran:?}");
    let place = format!("run.csv, line {}, column u", samples + 2);
    assert!(ran.stderr.contains(&place), "{}", ran.stderr);
    assert!(folder.files() == before, "files were written");
}
