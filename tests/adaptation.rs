//! The source's three experiments and the gains they use, as their users run them.

mod cli;

use cli::{Folder, PLAIN};
use serde_json::Value;

/// Runs an experiment on a few plants; its JSON.
fn experiment(name: &str, options: &str) -> Value {
    let folder = Folder::new();
    let printed = folder.done(&format!(
        "experiment {name} {options} --json out.json --report out.html"
    ));
    let json = folder.json("out.json");
    // What is printed, reported and written is the same.
    for claim in json["claims"].as_array().expect("claims") {
        let found = claim["found"].as_str().expect("what was found");
        assert!(
            printed.contains(found) && folder.read("out.html").contains(found),
            "{found}"
        );
    }
    json
}

/// The figure of a way, plant by plant.
fn figures<'a>(json: &'a Value, way: &'a str, figure: &'a str) -> impl Iterator<Item = f64> + 'a {
    let plants = json["plants"].as_array().expect("plants");
    plants.iter().map(move |plant| {
        let merits = plant["merits"].as_array().expect("merits");
        let own = merits
            .iter()
            .find(|m| m["way"] == way)
            .expect("the way was tried");
        own[figure].as_f64().unwrap_or(f64::NAN)
    })
}

fn median(figures: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = figures.collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// With a way, the median error is at most a fifth of that without, and no plant has a larger one.
fn pays(json: &Value, way: &str) {
    let both = || figures(json, "classic", "rms").zip(figures(json, way, "rms"));
    assert!(
        median(both().map(|(without, with)| without / with)) >= 5.0,
        "{json:#}"
    );
    assert!(both().all(|(without, with)| with < without), "{json:#}");
}

/// Every standstill is within an encoder count, and at rest.
fn stands(json: &Value, way: &str) {
    assert!(
        figures(json, way, "standstill").all(|counts| counts <= 1.0),
        "{json:#}"
    );
    assert!(
        figures(json, way, "travel").all(|counts| counts <= 1.0),
        "{json:#}"
    );
}

#[test]
fn the_servo_learns_its_friction_on_line() {
    let json = experiment("srv02", "--plants 5 --seed 11");
    for way in ["observer", "rows"] {
        pays(&json, way);
        stands(&json, way);
    }
    // Fewer plants than the claim is about: the observer always converges in time, rows nearly always.
    assert!(figures(&json, "observer", "convergence").all(|seconds| seconds <= 2.0));
    assert!(median(figures(&json, "rows", "convergence")) <= 2.0);
    // What was identified before the change helps less than what is learned after it.
    let rms = |way| median(figures(&json, way, "rms"));
    assert!(rms("observer") < rms("off-line") && rms("rows") < rms("off-line"));
}

#[test]
fn the_motor_is_adapted_by_dbi_off_line() {
    let json = experiment("dc-motor", "--plants 4 --seed 12");
    pays(&json, "reidentified");
    for plant in json["plants"].as_array().expect("plants") {
        for asked in plant["identified"].as_array().expect("what DBI said") {
            let ratio = asked[0].as_f64().expect("an estimate");
            assert!(
                (ratio - 1.0).abs() < 0.1 && asked[1] == "identified",
                "{asked}"
            );
        }
    }
}

#[test]
fn the_mass_on_its_spring_tunes_itself() {
    let json = experiment("mass-spring", "--plants 6 --seed 13");
    pays(&json, "self-tuned");
    stands(&json, "self-tuned");
    // Gains alone do not do it: friction is what is left.
    let rms = |way| median(figures(&json, way, "rms"));
    assert!(rms("self-tuned") < 0.2 * rms("tuned") && rms("tuned") < rms("classic"));
}

#[test]
fn a_seed_is_an_experiment_and_another_is_another() {
    let run =
        |seed| experiment("mass-spring", &format!("--plants 1 --seed {seed}"))["plants"].clone();
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

#[test]
fn tune_prints_gains_and_margins_and_writes_them() {
    let folder = Folder::new();
    folder.write(
        "axis.toml",
        format!("{PLAIN}[effects.delay]\ndelay = 0.001\n"),
    );
    let printed = folder.done("tune axis.toml --bandwidth 5 --limit 2 --json out.json");
    for part in [
        "velocity gain",
        "following",
        "correcting friction",
        "Not compensated by a controller: delay.",
    ] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    let json = folder.json("out.json");
    let number = |value: &Value| value.as_f64().expect("a number");
    // kv = 2·J·p with p = 2π·5 Hz/√(√2 − 1).
    let pole = std::f64::consts::TAU * 5.0 / (2f64.sqrt() - 1.0).sqrt();
    let gain = number(&json["parameters"]["velocity_gain"]);
    assert!((gain / (2.0 * 0.012 * pole) - 1.0).abs() < 1e-9);
    assert!(number(&json["following"]["phase"]) > number(&json["standing"]["phase"]));
    assert!(number(&json["standing"]["phase"]) > 30.0);
}

#[test]
fn what_cannot_be_tuned_or_run_is_refused_in_one_line() {
    let folder = Folder::new();
    folder.write("axis.toml", PLAIN);
    folder.write("unknown.toml", cli::BASELINE);
    folder.write(
        "inverse.toml",
        PLAIN.replace("[friction]", "causality = \"inverse\"\n[friction]"),
    );
    let before = folder.files();
    for (line, part) in [
        (
            "tune axis.toml --bandwidth 500 --limit 2 --json out.json",
            "phase margin",
        ),
        (
            "tune axis.toml --bandwidth 0 --limit 2 --json out.json",
            "--bandwidth 0",
        ),
        (
            "tune axis.toml --bandwidth 5 --limit -2 --json out.json",
            "--limit",
        ),
        (
            "tune unknown.toml --bandwidth 5 --limit 2 --json out.json",
            "unknown.toml: the model has no value for plant.inertia",
        ),
        (
            "tune inverse.toml --bandwidth 5 --limit 2 --json out.json",
            "inverse",
        ),
        (
            "tune axis.toml --bandwidth 5 --limit 2 --json axis.toml",
            "axis.toml is an input",
        ),
        ("experiment srv02 --plants 0 --json out.json", "--plants 0"),
        (
            "experiment srv02 --plants 3 --plant 3 --json out.json",
            "--plant 3",
        ),
        ("experiment srv02 --json none/out.json", "none/out.json"),
        ("experiment pendulum --json out.json", "pendulum"),
    ] {
        let ran = folder.run(line);
        assert_eq!(ran.status, 2, "bristle {line}: {ran:?}");
        assert!(
            ran.stderr.contains(part),
            "{part:?} is not in: {}",
            ran.stderr
        );
    }
    assert!(folder.files() == before);
}
