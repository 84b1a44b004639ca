//! Recordings of any length are identified in pieces, as if they had been in memory.

mod cli;

use cli::{BASELINE, Folder, PLAIN, UNBALANCED, csv, record};
use serde_json::Value;

/// Three pieces, of which none is the whole of anything.
const SECONDS: f64 = 180.0;
/// What the training rows are weighed by (the law of the noise, the balance that decides on rest, and the functions that
/// tell outliers) comes from parts of them when streamed, and the whole alone has the bias taken off that twins of it show,
/// which is within the errors: estimates differ by this share of their standard errors at most.
const SHARE: f64 = 1.0;

fn folder(truth: &str, model: &str) -> Folder {
    let folder = Folder::new();
    folder.write("run.csv", csv(&record(truth, SECONDS, 5)));
    folder.write("axis.toml", model);
    folder
}

/// Identifies with options and reads the JSON.
fn identify(folder: &Folder, recordings: &str, options: &str) -> Value {
    let ran = folder.run(&format!(
        "identify {recordings} --model axis.toml --json out.json {options}"
    ));
    assert_eq!(ran.status, 0, "{ran:?}");
    folder.json("out.json")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// Asserts that two identifications agree: values within a share of their errors, errors themselves, and fits.
fn agree(streamed: &Value, whole: &Value) {
    assert!(streamed["passes"].is_u64() && whole["passes"].is_null());
    assert_eq!(streamed["samples"], whole["samples"]);
    let parameters = whole["parameters"].as_object().expect("parameters");
    let estimated = |p: &&Value| p["se"].as_f64().is_some_and(|se| se > 0.0);
    for (name, expected) in parameters.iter().filter(|(_, p)| estimated(p)) {
        let found = &streamed["parameters"][name];
        let (se, error) = (number(&expected["se"]), number(&found["se"]));
        let apart = (number(&found["value"]) - number(&expected["value"])).abs();
        assert!(apart < SHARE * se, "{name}: {found} against {expected}");
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
    let whole = identify(&folder, "run.csv", "");
    agree(&identify(&folder, "run.csv", "--stream-above 1000"), &whole);
}

#[test]
fn effects_and_several_recordings_stream_as_well() {
    let model = format!("{BASELINE}\n[effects.gravity]\n");
    let folder = folder(UNBALANCED, &model);
    folder.write("more.csv", csv(&record(UNBALANCED, 60.0, 6)));
    let whole = identify(&folder, "run.csv more.csv", "");
    let streamed = identify(
        &folder,
        "run.csv more.csv",
        "--stream-above 1000 --report out.html",
    );
    agree(&streamed, &whole);
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
