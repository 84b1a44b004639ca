//! The commands from end to end, each through the program itself: what they write, print and return.

mod cli;

use bristle::effects;
use cli::{BASELINE, Folder, PLAIN, UNBALANCED, csv, record};
use serde_json::Value;

const SECONDS: f64 = 12.0;

/// The value under dotted keys.
fn at<'a>(json: &'a Value, path: &str) -> &'a Value {
    path.split('.').fold(json, |value, key| {
        value
            .get(key)
            .unwrap_or_else(|| panic!("no {path} in {value}"))
    })
}

fn number(json: &Value, path: &str) -> f64 {
    let value = at(json, path);
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{path} is {value}"))
}

fn text<'a>(json: &'a Value, path: &str) -> &'a str {
    let value = at(json, path);
    let text = value
        .as_str()
        .unwrap_or_else(|| panic!("{path} is {value}"));
    assert!(!text.is_empty(), "{path} is empty");
    text
}

fn list<'a>(json: &'a Value, path: &str) -> &'a [Value] {
    let value = at(json, path);
    value
        .as_array()
        .unwrap_or_else(|| panic!("{path} is {value}"))
}

/// Two finite numbers, the smaller first.
fn interval(value: &Value) -> (f64, f64) {
    let bounds: Vec<f64> = value
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_f64)
        .collect();
    let [low, high] = bounds[..] else {
        panic!("{value} is no interval")
    };
    assert!(low <= high, "{value}");
    (low, high)
}

/// The errors of one part or more of a fit.
fn errors(fit: &Value, parts: &[&str]) {
    for part in parts {
        let nrmse = number(fit, &format!("{part}.nrmse"));
        assert!(nrmse.is_finite() && nrmse >= 0.0, "{part}: {nrmse}");
    }
}

fn parameters(json: &Value) {
    let parameters = json.as_object().expect("parameters are an object");
    assert!(!parameters.is_empty());
    for (name, parameter) in parameters {
        assert!(number(parameter, "value").is_finite(), "{name}");
        let se = number(parameter, "se");
        assert!(se >= 0.0, "{name}: {se}");
        text(parameter, "unit");
    }
}

fn place(json: &Value) {
    for span in list(json, "time") {
        interval(span);
    }
    interval(at(json, "velocity"));
    interval(at(json, "position"));
    let directions = ["both", "positive", "negative"];
    assert!(directions.contains(&text(json, "direction")));
    assert!(at(json, "near_reversal").is_boolean());
    text(json, "text");
}

fn finding(json: &Value) {
    assert!(effects::find(text(json, "id")).is_some());
    text(json, "name");
    text(json, "text");
    assert!((0.0..=1.0).contains(&number(json, "confidence")));
    place(at(json, "where"));
    parameters(at(json, "parameters"));
    assert!(number(json, "evidence.delta_bic") > 0.0);
    assert!(number(json, "evidence.share_of_residual") <= 1.0);
    errors(at(json, "fit"), &["train", "held_out"]);
    for rival in list(json, "rivals") {
        text(rival, "id");
        text(rival, "tell_apart_by");
        assert!(number(rival, "delta_bic").is_finite());
    }
}

/// Every field that the contract promises, of the type that it promises.
fn diagnosis(json: &Value) {
    assert_eq!(text(json, "schema"), "bristle.diagnosis/1");
    assert!(["adequate", "explained", "unknown"].contains(&text(json, "verdict")));
    parameters(at(json, "baseline.parameters"));
    errors(at(json, "baseline.fit"), &["train", "held_out"]);
    place(at(json, "where"));
    list(json, "findings").iter().for_each(finding);
    errors(at(json, "fit"), &["before.held_out", "after.held_out"]);
    assert_eq!(
        text(json, "verdict") == "adequate",
        list(json, "findings").is_empty() && text(json, "verdict") != "unknown"
    );
}

#[test]
fn diagnose_names_what_is_left_out() {
    let folder = Folder::with(UNBALANCED, SECONDS);
    let shown = folder.done(
        "diagnose run.csv --model axis.toml --json out.json --model-out out.toml --report out.html",
    );
    let json = folder.json("out.json");
    diagnosis(&json);
    assert_eq!(text(&json, "verdict"), "explained");
    let first = &list(&json, "findings")[0];
    assert_eq!(text(first, "id"), "gravity");
    // Within four of its own standard errors, which would fail by chance once in 15,000 seeds.
    for (name, truth) in [("amplitude", 0.08), ("phase", 0.5)] {
        let value = number(first, &format!("parameters.{name}.value"));
        let se = number(first, &format!("parameters.{name}.se"));
        assert!((value - truth).abs() < 4.0 * se, "{name}: {value} ± {se}");
        assert!(se < 0.1 * truth, "{name}: {value} ± {se}");
    }
    assert_eq!(text(first, "parameters.amplitude.unit"), "N*m");
    let (before, after) = (
        number(&json, "fit.before.held_out.nrmse"),
        number(&json, "fit.after.held_out.nrmse"),
    );
    assert!(after < 0.5 * before, "{before} before, {after} after");
    for word in ["EXPLAINED", "gravity", "out.json", "out.toml", "out.html"] {
        assert!(shown.contains(word), "{word} is not in: {shown}");
    }
    assert!(folder.read("out.html").contains("gravity"));
    // Nothing is left to chance: the same command writes the same bytes.
    let first = folder.files();
    folder.done(
        "diagnose run.csv --model axis.toml --json out.json --model-out out.toml --report out.html",
    );
    assert!(folder.files() == first);
}

#[test]
fn diagnose_calls_a_complete_model_adequate() {
    let folder = Folder::with(PLAIN, SECONDS);
    folder.done("diagnose run.csv --model axis.toml --json out.json");
    let json = folder.json("out.json");
    diagnosis(&json);
    assert_eq!(text(&json, "verdict"), "adequate");
    assert!(list(&json, "findings").is_empty());
    for (name, truth) in [("inertia", 0.012), ("coulomb", 0.12), ("viscous", 0.02)] {
        let value = number(&json, &format!("baseline.parameters.{name}.value"));
        let se = number(&json, &format!("baseline.parameters.{name}.se"));
        assert!((value - truth).abs() < 4.0 * se, "{name}: {value} ± {se}");
    }
}

#[test]
fn check_tells_by_its_status() {
    let folder = Folder::with(UNBALANCED, SECONDS);
    let line = "diagnose run.csv --model axis.toml --check";
    assert_eq!(folder.run(line).status, 3);
    assert_eq!(folder.run("diagnose run.csv --model axis.toml").status, 0);
    folder.write("axis.toml", format!("{BASELINE}\n[effects.gravity]\n"));
    assert_eq!(folder.run(line).status, 0);
}

#[test]
fn what_diagnose_writes_is_a_model() {
    let folder = Folder::with(UNBALANCED, SECONDS);
    folder.done("diagnose run.csv --model axis.toml --model-out found.toml --json found.json");
    folder.done("simulate --model found.toml --input run.csv --out out.csv --horizon 1");
    folder.done("identify run.csv --model found.toml --json again.json");
    let (found, again) = (folder.json("found.json"), folder.json("again.json"));
    for name in [
        "inertia",
        "coulomb",
        "viscous",
        "gravity.amplitude",
        "gravity.phase",
    ] {
        let (a, b) = (
            number(&found["parameters"][name], "value"),
            number(&again["parameters"][name], "value"),
        );
        let se = number(&found["parameters"][name], "se");
        // The same model on the same data; only the noise is estimated anew, from a better start.
        assert!((a - b).abs() < se, "{name}: {a} and {b} ± {se}");
    }
    // With the findings in it, nothing is left out.
    let ran = folder.run("diagnose run.csv --model found.toml --check");
    assert_eq!(ran.status, 0, "{ran:?}");
}

#[test]
fn identify_estimates_with_errors() {
    let folder = Folder::with(PLAIN, SECONDS);
    let shown = folder.done(
        "identify run.csv --model axis.toml --json out.json --model-out out.toml --report out.html",
    );
    let json = folder.json("out.json");
    assert_eq!(text(&json, "schema"), "bristle.identification/1");
    parameters(at(&json, "parameters"));
    errors(at(&json, "fit"), &["train", "held_out"]);
    for (name, truth) in [("inertia", 0.012), ("coulomb", 0.12), ("viscous", 0.02)] {
        let value = number(&json, &format!("parameters.{name}.value"));
        let se = number(&json, &format!("parameters.{name}.se"));
        assert!((value - truth).abs() < 4.0 * se, "{name}: {value} ± {se}");
        assert!(se < 0.1 * truth, "{name}: {value} ± {se}");
        assert!(shown.contains(name));
    }
    assert_eq!(at(&json, "parameters.gain.value"), 1.0);
    // A value that is given stays as it is.
    folder.write(
        "axis.toml",
        BASELINE.replace("inertia = \"?\"", "inertia = 0.013"),
    );
    folder.done("identify run.csv --model axis.toml --json out.json");
    assert_eq!(
        at(&folder.json("out.json"), "parameters.inertia.value"),
        0.013
    );
}

/// Values from all of a recording are more certain; the errors stay those of values that have not seen the rest.
#[test]
fn the_whole_recording_is_fitted_once_the_values_are_judged() {
    let folder = Folder::with(PLAIN, SECONDS);
    folder.done("identify run.csv --model axis.toml --json part.json");
    let shown = folder.done(
        "identify run.csv --model axis.toml --whole --json whole.json --model-out whole.toml",
    );
    assert!(shown.contains("whole recordings"), "{shown}");
    let [part, whole] = ["part.json", "whole.json"].map(|file| folder.json(file));
    assert_eq!(part["fit"], whole["fit"]);
    assert_eq!(whole["whole"], true);
    assert!(part.get("whole").is_none());
    for (name, truth) in [("inertia", 0.012), ("coulomb", 0.12), ("viscous", 0.02)] {
        let get = |of: &Value, key: &str| number(of, &format!("parameters.{name}.{key}"));
        let (value, se) = (get(&whole, "value"), get(&whole, "se"));
        assert!((value - truth).abs() < 4.0 * se, "{name}: {value} ± {se}");
        assert!(se < get(&part, "se"), "{name}: {se}");
    }
    let written = std::fs::read_to_string(folder.path("whole.toml")).expect("a model");
    let value = number(&whole, "parameters.viscous.value");
    assert!(written.contains(&format!("value = {value}")), "{written}");
}

#[test]
fn dbi_shows_how_the_estimates_come_about() {
    let folder = Folder::with(PLAIN, SECONDS);
    let line = "dbi run.csv --model axis.toml --json out.json --report out.html";
    let shown = folder.done(line);
    let json = folder.json("out.json");
    assert_eq!(text(&json, "schema"), "bristle.dbi/1");
    parameters(at(&json, "parameters"));
    // Both sides of every row differ by the residual, and it is far smaller than either.
    let numbers = |path: &str| -> Vec<f64> {
        let values = list(&json, path).iter();
        values.map(|x| x.as_f64().expect("a number")).collect()
    };
    let [drive, model, residual] =
        ["drive", "model", "residual"].map(|side| numbers(&format!("functionals.{side}")));
    let power = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    for (k, r) in residual.iter().enumerate() {
        assert!((drive[k] - model[k] - r).abs() < 1e-12);
    }
    assert!(
        power(&residual) < 0.05 * power(&drive),
        "{} of {}",
        power(&residual),
        power(&drive)
    );
    // Neighbours share most of a window; whitening takes most of that out.
    let whiteness = at(&json, "whiteness");
    let shared = |key: &str| {
        let lags = list(whiteness, key)[1..=8].iter();
        lags.map(|r| r.as_f64().expect("a number").powi(2))
            .sum::<f64>()
    };
    let (before, after) = (shared("before"), shared("after"));
    assert!(before > 0.5 && after < before, "{before}, {after}");
    // A complete model agrees over the widths, one of which was chosen.
    let widths = list(&json, "widths");
    assert!(widths.len() >= 8, "{}", widths.len());
    assert_eq!(widths.iter().filter(|w| w["chosen"] == true).count(), 1);
    let agreement = list(&json, "agreement");
    assert_eq!(agreement.len(), 3);
    assert!(
        agreement.iter().all(|a| a["agree"] == true),
        "{agreement:?}"
    );
    let correlations = list(&json, "correlation.matrix");
    assert!((0..3).all(|k| (correlations[k][k].as_f64().unwrap() - 1.0).abs() < 1e-9));
    assert!(shown.contains("3 of 3") && folder.read("out.html").contains("Frequency response"));
    // The width that is asked for is taken.
    folder.done(&format!("{line} --half-width 0.1"));
    let json = folder.json("out.json");
    assert_eq!(list(&json, "test_functions")[0]["half_width"], 0.1);
    assert!(list(&json, "linear_forms").is_empty());
    // What cannot be done is refused with one message, and outputs stay as they are.
    let before = folder.files();
    for options in [
        "--half-width 0",
        "--report nowhere/out.html",
        "--json run.csv",
    ] {
        let ran = folder.run(&format!("dbi run.csv --model axis.toml {options}"));
        assert_eq!(ran.status, 2, "{ran:?}");
        assert_eq!(ran.stderr.lines().count(), 1, "{ran:?}");
    }
    assert!(folder.files() == before);
}

#[test]
fn dbi_shows_the_linear_form_of_a_law() {
    let folder = Folder::new();
    let dahl = "model = \"dahl\"\ncoulomb = 0.15\nviscous = 0.02\nbristle_stiffness = 3.0";
    folder.write("truth.toml", truth(ROTARY, dahl));
    folder.write("axis.toml", BASELINE.replace("coulomb-viscous", "dahl"));
    folder.done("simulate --model truth.toml --excite multisine --amplitude 0.4 --band 0.2:3 --counts 4194304 --out run.csv");
    folder.done("dbi run.csv --model axis.toml --json out.json --report out.html");
    let json = folder.json("out.json");
    assert_eq!(list(&json, "linear_forms").len(), 1);
    let widths = list(&json, "widths");
    let chosen = widths
        .iter()
        .find(|w| w["chosen"] == true)
        .expect("one is chosen");
    // Smoothing of velocity rounds the law off by some thousandths.
    for (parameter, truth) in list(&chosen["linear"][0], "parameters")
        .iter()
        .zip([0.012, 0.02, 3.0, 0.15])
    {
        let value = number(parameter, "value");
        assert!((value - truth).abs() < 0.02 * truth, "{parameter}");
        assert!(
            number(parameter, "bias.mean").abs() < 0.02 * truth,
            "{parameter}"
        );
    }
    assert!(folder.read("out.html").contains("Linear forms"));
}

#[test]
fn the_written_model_keeps_comments() {
    let folder = Folder::with(PLAIN, SECONDS);
    folder.write("axis.toml", format!("# bench 3\n{BASELINE}"));
    folder.done("identify run.csv --model axis.toml --model-out out.toml");
    let written = folder.read("out.toml");
    assert!(
        written.starts_with("# bench 3\n") && written.contains("se = "),
        "{written}"
    );
}

#[test]
fn several_recordings_share_the_parameters() {
    let folder = Folder::with(UNBALANCED, SECONDS);
    folder.write("two.csv", csv(&record(UNBALANCED, SECONDS, 2)));
    folder.done("identify run.csv --model axis.toml --json one.json");
    folder.done("identify run.csv two.csv --model axis.toml --json both.json");
    let inertia = |name: &str| {
        let json = folder.json(name);
        (
            number(&json, "parameters.inertia.value"),
            number(&json, "parameters.inertia.se"),
        )
    };
    let ((one, one_se), (both, both_se)) = (inertia("one.json"), inertia("both.json"));
    // Twice the data: about 1/√2 of the error, which itself is estimated.
    assert!(
        both_se < 0.9 * one_se,
        "{one} ± {one_se}, {both} ± {both_se}"
    );
    folder.done("diagnose run.csv two.csv --model axis.toml --json out.json --report out.html");
    let json = folder.json("out.json");
    diagnosis(&json);
    assert_eq!(text(&list(&json, "findings")[0], "id"), "gravity");
}

/// The columns of a prediction.
fn prediction(text: &str) -> Vec<[f64; 4]> {
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("t,u,q,v"));
    lines
        .map(|line| {
            let cells: Vec<f64> = line
                .split(',')
                .map(|cell| cell.parse().expect("a number"))
                .collect();
            cells.try_into().expect("four cells")
        })
        .collect()
}

#[test]
fn simulate_runs_at_the_instants_of_the_recording() {
    // Without noise that is not recorded, the model follows to within the encoder's count and its growth.
    let folder = Folder::with(PLAIN, SECONDS);
    folder.write("axis.toml", PLAIN);
    let samples = record(PLAIN, SECONDS, 1);
    folder.done("simulate --model axis.toml --input run.csv --out whole.csv");
    folder.done("simulate --model axis.toml --input run.csv --out windows.csv --horizon 0.5");
    let [whole, windows] = ["whole.csv", "windows.csv"].map(|name| prediction(&folder.read(name)));
    for rows in [&whole, &windows] {
        assert_eq!(rows.len(), samples.len());
        for (row, sample) in rows.iter().zip(&samples) {
            assert_eq!([row[0], row[1]], [sample.t, sample.u]);
            assert!(row[2].is_finite() && row[3].is_finite());
        }
        assert_eq!(rows[0][2], samples[0].q);
    }
    // At every restart the prediction stands where the axis was measured; 0.5 s are 250 samples.
    for (row, sample) in windows.iter().zip(&samples).step_by(250) {
        assert_eq!(row[2], sample.q, "at {} s", sample.t);
    }
    let error = |rows: &[[f64; 4]]| {
        let sum: f64 = rows
            .iter()
            .zip(&samples)
            .map(|(r, s)| (r[2] - s.q).powi(2))
            .sum();
        (sum / rows.len() as f64).sqrt()
    };
    let moved = samples.iter().map(|s| s.q * s.q).sum::<f64>() / samples.len() as f64;
    assert!(error(&windows) < 0.02 * moved.sqrt(), "{}", error(&windows));
    assert!(error(&windows) < error(&whole));
}

/// A model file with a plant and a friction law.
fn truth(plant: &str, friction: &str) -> String {
    format!("[plant]\n{plant}\n[friction]\n{friction}\n")
}

const ROTARY: &str = "motion = \"rotary\"\ninertia = 0.012";
const COULOMB: &str = "coulomb = 0.12\nviscous = 0.02";
const LUGRE: &str = "model = \"lugre\"\ncoulomb = 0.12\nviscous = 0.02\nstatic = 0.2\nstribeck_velocity = 0.3\nbristle_stiffness = 300\nbristle_damping = 0.5";

#[test]
fn an_excited_axis_gives_a_recording_that_diagnose_reads() {
    let folder = Folder::new();
    folder.write("axis.toml", BASELINE);
    folder.write("truth.toml", UNBALANCED);
    let line = "simulate --model truth.toml --excite multisine --amplitude 1.5 --band 0.1:2 --control pd --rate 500 --counts 65536 --noise 0.01 --out run.csv";
    folder.done(line);
    let first = folder.read("run.csv");
    assert!(
        first.starts_with("t[s],u[N*m],q[rad],q_ref[rad]\n0.0,"),
        "{}",
        &first[..80]
    );
    assert_eq!(first.lines().count(), 1 + 20 * 500);
    // The same seed gives the same bytes, another one another recording.
    folder.done(line);
    assert_eq!(first, folder.read("run.csv"));
    folder.done(&format!("{line} --seed 2"));
    assert_ne!(first, folder.read("run.csv"));
    folder.done("diagnose run.csv --model axis.toml --json out.json");
    let json = folder.json("out.json");
    diagnosis(&json);
    assert_eq!(text(&list(&json, "findings")[0], "id"), "gravity");
}

#[test]
fn every_plant_runs_under_every_law_and_signal() {
    let folder = Folder::new();
    let motor = "resistance = 2.6\ninductance = 2e-3\ntorque_constant = 0.05";
    let plants = [
        ("0.6", ROTARY.to_owned()),
        ("0.6", format!("kind = \"mass-spring\"\n{ROTARY}\nstiffness = 0.5")),
        ("20", format!("kind = \"dc-motor\"\n{ROTARY}\n{motor}")),
        ("8", format!("kind = \"geared-servo\"\n{ROTARY}\n{motor}\ngear_ratio = 10\nmotor_inertia = 1e-5")),
        ("0.6", "kind = \"wheel-slip\"\nmotion = \"linear\"\ninertia = 0.012\nwheel_mass = 0.01\nvehicle_mass = 0.1\naxle_stiffness = 100".to_owned()),
    ];
    let stribeck =
        format!("model = \"stribeck\"\n{COULOMB}\nstatic = 0.2\nstribeck_velocity = 0.3");
    let laws = [
        COULOMB.to_owned(),
        stribeck.replace("stribeck\"", "static\""),
        stribeck,
        format!("model = \"dahl\"\n{COULOMB}\nbristle_stiffness = 300"),
        LUGRE.to_owned(),
        LUGRE.replace("lugre", "modified-lugre"),
    ];
    let shapes = ["chirp", "multisine", "ramp", "triangle", "steps", "hold"];
    for (amplitude, plant) in &plants {
        for (law, shape) in laws.iter().zip(shapes) {
            folder.write("truth.toml", truth(plant, law));
            folder.done(&format!(
                "simulate --model truth.toml --excite {shape} --amplitude {amplitude} --duration 3 --out run.csv"
            ));
            folder.done("simulate --model truth.toml --input run.csv --out again.csv");
            // The model along its own recording, from the same start, is the recording: every plant starts at rest.
            let text = folder.read("run.csv");
            let recorded = text.lines().skip(1).map(|line| {
                let cells = line
                    .split(',')
                    .map(|cell| cell.parse::<f64>().expect("a number"));
                cells.collect::<Vec<f64>>()
            });
            let again = prediction(&folder.read("again.csv"));
            let travel = again.iter().fold(1e-9_f64, |m, row| m.max(row[2].abs()));
            for (recorded, again) in recorded.zip(&again) {
                assert!(
                    (recorded[2] - again[2]).abs() < 0.02 * travel,
                    "{plant}\n{law}\n{recorded:?} {again:?}"
                );
            }
        }
    }
}

#[test]
fn a_geared_servo_looks_like_an_axis_to_the_diagnosis() {
    // Behind its armature the servo is J = Jl + ηg·N²·Jm and Fv + ηg·ηm·N²·kt·ke/R, with the gain ηg·ηm·N·kt/R:
    // 2.086e-3 kg·m², 0.08403 N·m·s/rad and 0.1284 N·m/V.
    let folder = Folder::new();
    folder.write("srv02.toml", include_str!("../host/examples/srv02.toml"));
    let axis = BASELINE
        .replace("\"torque\"", "\"voltage\"")
        .replace("1.0", "0.128409");
    folder.write("axis.toml", axis);
    folder.done("simulate --model srv02.toml --excite multisine --amplitude 5 --band 0.1:5 --counts 4096 --noise 0.001 --out run.csv");
    folder.done("diagnose run.csv --model axis.toml --json out.json");
    let json = folder.json("out.json");
    assert_eq!(text(&json, "verdict"), "adequate");
    for (name, truth) in [
        ("inertia", 2.086e-3),
        ("coulomb", 0.02),
        ("viscous", 0.08403),
    ] {
        let value = number(&json, &format!("baseline.parameters.{name}.value"));
        let se = number(&json, &format!("baseline.parameters.{name}.se"));
        assert!((value - truth).abs() < 4.0 * se, "{name}: {value} ± {se}");
    }
}

#[test]
fn a_motor_records_its_current_under_the_names_of_the_model() {
    let folder = Folder::new();
    let motor = format!(
        "kind = \"dc-motor\"\n{ROTARY}\nresistance = 2.6\ninductance = 2e-3\ntorque_constant = 0.05"
    );
    folder.write(
        "truth.toml",
        truth(&motor, &format!("{COULOMB}\n[columns]\nu = \"volts\"")),
    );
    folder.done(
        "simulate --model truth.toml --excite chirp --amplitude 20 --duration 2 --out run.csv",
    );
    assert!(
        folder
            .read("run.csv")
            .starts_with("t[s],volts[V],q[rad],i[A]\n")
    );
    folder.done("simulate --model truth.toml --input run.csv --out again.csv");
}

/// Runs command lines that must be refused, each with a word in the message, and without an output.
fn refused(folder: &Folder, lines: &[(&str, &str)]) {
    for (line, said) in lines {
        let ran = folder.run(line);
        assert_eq!(ran.status, 2, "{line}: {ran:?}");
        assert!(ran.stderr.contains(said), "{line}: {}", ran.stderr);
        assert!(!folder.path("out.csv").exists(), "{line}");
    }
}

#[test]
fn options_that_do_not_go_together_are_refused() {
    let folder = Folder::with(PLAIN, SECONDS);
    folder.write("plain.toml", PLAIN);
    let both = "cannot be used with";
    let lines = [
        ("", "--excite"),
        ("--input run.csv --excite chirp --amplitude 1", both),
        ("--horizon 1 --excite chirp --amplitude 1", both),
        ("--input run.csv --amplitude 1", both),
        ("--excite chirp", "--amplitude"),
        ("--excite chirp --amplitude 1 --bandwidth 3", "--control"),
        (
            "--excite chirp --amplitude 1 --band 5:1",
            "the lower one first",
        ),
        ("--excite chirp --amplitude 1 --band 1:600", "--rate 1000"),
        ("--excite chirp --amplitude 1 --duration 0.1", "100 samples"),
        ("--excite chirp --amplitude 1 --counts 0", "--counts 0"),
        ("--excite chirp --amplitude 1 --noise=-1", "--noise"),
        ("--excite hold --amplitude 0", "drives nothing"),
    ];
    for (options, said) in lines {
        let line = format!("simulate --model plain.toml --out out.csv {options}");
        refused(&folder, &[(&line, said)]);
    }
}

#[test]
fn models_that_cannot_be_simulated_are_refused() {
    let folder = Folder::with(PLAIN, SECONDS);
    let motor = "kind = \"dc-motor\"\ninertia = 1\nresistance = 2.6\ninductance = 1e-3";
    let twice = format!("{LUGRE}\n[effects.stribeck]\nstatic = 0.3\nstribeck_velocity = 0.1");
    let inverse = format!("{ROTARY}\ncausality = \"inverse\"");
    let spot =
        format!("{COULOMB}\n[effects.position-dependent-friction]\namplitude = 0.05\ncentre = 0.3");
    for (text, said) in [
        (BASELINE.to_owned(), "no value for plant.inertia"),
        (
            truth(ROTARY, &LUGRE.replace("bristle_damping = 0.5", "")),
            "no value for friction.bristle_damping",
        ),
        (
            truth(&format!("motion = \"rotary\"\n{motor}"), COULOMB),
            "no value for plant.torque_constant",
        ),
        (
            truth(&format!("motion = \"linear\"\n{motor}"), COULOMB),
            "line 2: plant.kind = \"dc-motor\" turns",
        ),
        (truth(ROTARY, &twice), "effects.stribeck"),
        // No textbook says how wide a spot is.
        (
            truth(ROTARY, &spot),
            "no value for effects.position-dependent-friction.spread",
        ),
        (truth(&inverse, COULOMB), "causality"),
    ] {
        folder.write("truth.toml", text);
        refused(
            &folder,
            &[(
                "simulate --model truth.toml --excite chirp --amplitude 1 --out out.csv",
                said,
            )],
        );
    }
}

#[test]
fn an_imposed_motion_gives_the_force() {
    let folder = Folder::with(PLAIN, SECONDS);
    let inverse = |model: &str| model.replacen("[plant]", "[plant]\ncausality = \"inverse\"", 1);
    folder.write("axis.toml", inverse(BASELINE));
    folder.done("diagnose run.csv --model axis.toml --json out.json --report out.html");
    diagnosis(&folder.json("out.json"));
    // Slow enough a motion needs no inertia.
    let massless = inverse(BASELINE).replace("inertia = \"?\"", "inertia = 0");
    assert!(massless.contains("inertia = 0"), "{massless}");
    folder.write("massless.toml", massless);
    folder.done("identify run.csv --model massless.toml --json out.json");
    folder.write("truth.toml", inverse(PLAIN));
    folder.done("simulate --model truth.toml --input run.csv --out out.csv");
    let samples = record(PLAIN, SECONDS, 1);
    let rows = prediction(&folder.read("out.csv"));
    assert_eq!(rows.len(), samples.len());
    let (mut error, mut signal) = (0.0, 0.0);
    for (row, sample) in rows.iter().zip(&samples) {
        assert_eq!((row[0], row[2]), (sample.t, sample.q));
        error += (row[1] - sample.u).powi(2);
        signal += sample.u * sample.u;
    }
    // Acceleration comes from smoothed positions, so the force at reversals is rounded off.
    assert!(error < 0.1 * signal, "{error} of {signal}");
}

#[test]
fn explain_knows_the_whole_catalogue() {
    let folder = Folder::new();
    let listed = folder.done("explain");
    let ids: Vec<&str> = effects::ALL.iter().map(|effect| effect.id()).collect();
    assert_eq!(ids.len(), 24);
    for id in &ids {
        let entries = listed
            .lines()
            .filter(|l| l.split_whitespace().next() == Some(id));
        assert_eq!(entries.count(), 1, "{id} in: {listed}");
        let page = folder.done(&format!("explain {id}"));
        assert!(page.contains(id) && page.len() > 100, "{id}: {page}");
    }
    for effect in effects::ALL {
        let page = folder.done(&format!("explain {}", effect.id()));
        for heading in [
            "What it is",
            "looks like",
            "What excites it",
            "Confused with",
        ] {
            assert!(page.contains(heading), "{heading} of {}", effect.id());
        }
        for parameter in effect.parameters() {
            assert!(
                page.contains(parameter.name),
                "{} of {}",
                parameter.name,
                effect.id()
            );
        }
    }
    let ran = folder.run("explain stribek");
    assert_eq!(ran.status, 2);
    assert!(
        ran.stderr.contains("did you mean stribeck?"),
        "{}",
        ran.stderr
    );
}

#[test]
fn help_names_every_option() {
    let folder = Folder::new();
    let common = ["--model", "--model-out", "--json", "--report", "REC"];
    for (verb, options) in [
        ("identify", [common.as_slice(), &[]].concat()),
        ("diagnose", [common.as_slice(), &["--check"]].concat()),
        (
            "dbi",
            vec!["--model", "--json", "--report", "--half-width", "REC"],
        ),
        (
            "simulate",
            vec![
                "--model",
                "--input",
                "--out",
                "--horizon",
                "--excite",
                "--amplitude",
                "--band",
                "--duration",
                "--rate",
                "--seed",
                "--control",
                "--counts",
                "--noise",
                "--sensor-noise",
                "wheel-slip",
                "modified-lugre",
            ],
        ),
        ("explain", vec!["ID"]),
        ("demo", vec!["--out", "--loop"]),
        (
            "deploy",
            vec!["--port", "--emulated", "--check", "--bandwidth"],
        ),
    ] {
        assert!(folder.done("--help").contains(verb), "{verb}");
        let help = folder.done(&format!("{verb} --help"));
        for option in options {
            assert!(help.contains(option), "{option} of {verb}");
        }
    }
    let help = folder.done("--help");
    assert!(help.contains("Exit status"), "{help}");
    assert!(folder.done("--version").starts_with("bristle "));
}

#[test]
fn demo_leaves_a_report_and_names_it() {
    let folder = Folder::new();
    let shown = folder.done("demo");
    let last = shown.trim_end().lines().last().unwrap_or_default();
    assert!(last.contains("bristle-demo/report.html"), "{shown}");
    let json = folder.json("bristle-demo/diagnosis.json");
    diagnosis(&json);
    assert_eq!(text(&json, "verdict"), "explained");
    assert_eq!(text(&list(&json, "findings")[0], "id"), "stribeck");
    assert!(folder.read("bristle-demo/report.html").contains("stribeck"));
    folder.done("identify bristle-demo/recording.csv --model bristle-demo/diagnosed.toml");
    // Somewhere else, and from other noise.
    folder.done("demo --out else/where --seed 7");
    assert_ne!(
        folder.read("bristle-demo/recording.csv"),
        folder.read("else/where/recording.csv")
    );
}

#[test]
fn a_motor_under_voltage_is_fitted_with_its_armature() {
    let folder = Folder::with(PLAIN, SECONDS);
    let motor = "[plant]\nkind = \"dc-motor\"\nmotion = \"rotary\"\ninertia = 2e-4\nresistance = 2.6\ninductance = 1.8e-4\ntorque_constant = 0.05\n[friction]\ncoulomb = 0.01\nviscous = 2e-4\n";
    folder.write("motor.toml", motor);
    folder.done("simulate --model motor.toml --excite multisine --amplitude 8 --band 0.1:3 --duration 12 --counts 4096 --noise 2e-4 --out motor.csv");
    let asked = motor
        .replace("inertia = 2e-4", "inertia = \"?\"")
        .replace("viscous = 2e-4", "viscous = \"?\"")
        .replace("coulomb = 0.01", "coulomb = \"?\"");
    folder.write("asked.toml", asked.clone());
    folder.done("identify motor.csv --model asked.toml --json out.json --model-out found.toml");
    let parameters = &folder.json("out.json")["parameters"];
    // Seen from the voltage, back-EMF brakes by kt·ke/R = 9.6e-4 N·m·s/rad, five times the friction: that is not in it.
    for (name, truth) in [("inertia", 2e-4), ("coulomb", 0.01), ("viscous", 2e-4)] {
        let value = number(&parameters[name], "value");
        assert!((value / truth - 1.0).abs() < 0.05, "{name}: {value}");
    }
    folder.done("simulate --model found.toml --input motor.csv --out again.csv --horizon 1");
    folder.write("asked.toml", asked.replace("resistance = 2.6\n", ""));
    refused(
        &folder,
        &[(
            "identify motor.csv --model asked.toml --json out.json",
            "plant.resistance has no value",
        )],
    );
}

/// A model that gives every number is judged like any other: right as it is, and with what it leaves out named.
#[test]
fn a_model_without_unknowns_is_diagnosed() {
    for (truth, verdict) in [(PLAIN, "adequate"), (UNBALANCED, "explained")] {
        let folder = Folder::with(truth, 24.0);
        folder.write("axis.toml", PLAIN);
        folder.done("diagnose run.csv --model axis.toml --json out.json --model-out out.toml");
        let json = folder.json("out.json");
        assert_eq!(json["verdict"], verdict, "{}", json["text"]);
        folder.done("identify run.csv --model axis.toml --json fit.json");
        if verdict == "explained" {
            assert_eq!(json["findings"][0]["id"], "gravity");
            folder
                .done("simulate --model out.toml --input run.csv --out predicted.csv --horizon 1");
        }
    }
}
