//! Warnings about recordings: each kind of bad data is told by name, and good data are left in peace.

mod cli;

use std::f64::consts::TAU;

use cli::{BASELINE, Folder, PLAIN, Sample, record};

/// A recording as text, each row made of a number and a sample.
fn table(header: &str, row: impl Fn(usize, &Sample) -> String) -> String {
    let samples = record(PLAIN, 12.0, 1);
    let rows = samples.iter().enumerate();
    rows.fold(format!("{header}\n"), |text, (k, s)| {
        text + &row(k, s) + "\n"
    })
}

/// Ids and texts of the warnings about a recording under a model.
fn warned(recording: &str, model: &str) -> Vec<(String, String)> {
    let folder = Folder::new();
    folder.write("run.csv", recording);
    folder.write("axis.toml", model);
    let ran = folder.run("identify run.csv --model axis.toml --json out.json --report out.html");
    assert_eq!(ran.status, 0, "{ran:?}");
    let json = folder.json("out.json");
    let warnings = json["warnings"].as_array().expect("a list of warnings");
    let text = |w: &serde_json::Value, key: &str| w[key].as_str().expect("a text").to_owned();
    let warnings: Vec<(String, String)> = warnings
        .iter()
        .map(|w| (text(w, "id"), text(w, "text")))
        .collect();
    for (id, text) in &warnings {
        assert!(ran.stderr.contains(text.as_str()) && ran.stderr.contains(id.as_str()));
        let quoted = serde_json::to_string(text).expect("a text is JSON");
        assert!(folder.read("out.html").contains(&quoted), "{id}");
    }
    assert_eq!(ran.stderr.matches("warning:").count(), warnings.len());
    warnings
}

/// Asserts that a recording brings a warning whose text contains all of `parts`.
fn tells(recording: &str, model: &str, id: &str, parts: &[&str]) {
    let warnings = warned(recording, model);
    let found = warnings.iter().find(|(found, _)| found == id);
    let (_, text) = found.unwrap_or_else(|| panic!("no {id} in {warnings:?}"));
    for part in parts {
        assert!(text.contains(part), "{part:?} is not in: {text}");
    }
}

fn plain(_: usize, s: &Sample) -> String {
    format!("{:?},{:?},{:?}", s.t, s.u, s.q)
}

const HEADER: &str = "t[s],u[N*m],q[rad]";

#[test]
fn good_data_bring_no_warning() {
    assert_eq!(warned(&table(HEADER, plain), BASELINE), []);
    let with_velocity = table("t[s],u[N*m],q[deg],v[rad/s]", |_, s| {
        let v = 1.5 * TAU * 0.31 * (TAU * 0.31 * s.t).cos();
        format!("{:?},{:?},{:?},{v:?}", s.t, s.u, s.q.to_degrees())
    });
    // The set point's velocity is not quite that of the axis, but in the same unit.
    assert_eq!(warned(&with_velocity, BASELINE), []);
}

#[test]
fn time() {
    let in_milliseconds = table("t,u,q", |_, s| {
        format!("{:?},{:?},{:?}", 1e3 * s.t, s.u, s.q)
    });
    tells(
        &in_milliseconds,
        BASELINE,
        "time-unit",
        &["2.00 s", "t[ms]"],
    );
    let dropped: String = table(HEADER, plain)
        .lines()
        .enumerate()
        .filter(|(k, _)| k % 50 != 7 && !(1000..1040).contains(k))
        .flat_map(|(_, line)| [line, "\n"])
        .collect();
    tells(
        &dropped,
        BASELINE,
        "lost-samples",
        &["159 samples", "left out"],
    );
    let jittered = table(HEADER, |k, s| {
        let late = 6e-4 * (k as f64 * 2.4).sin();
        format!("{:?},{:?},{:?}", s.t + late, s.u, s.q)
    });
    tells(&jittered, BASELINE, "timing-jitter", &["2.00 ms", "even"]);
}

#[test]
fn units_and_signs() {
    let counts = table("t,u,q", |_, s| {
        format!("{:?},{:?},{:?}", s.t, s.u, (s.q * 16384.0 / TAU).floor())
    });
    tells(&counts, BASELINE, "position-counts", &["encoder counts"]);
    let turning = table("t,u,q", |_, s| {
        format!("{:?},{:?},{:?}", s.t, s.u, s.q.rem_euclid(TAU))
    });
    tells(&turning, BASELINE, "position-wraps", &["one turn in rad"]);
    let volts = table("t,u[V],q", plain);
    tells(&volts, BASELINE, "input-unit", &["voltage", "torque"]);
    let known = BASELINE.replace("inertia = \"?\"", "inertia = 0.012");
    assert_eq!(warned(&table(HEADER, plain), &known), []);
    let thousandfold = BASELINE.replace("inertia = \"?\"", "inertia = 12");
    tells(
        &table(HEADER, plain),
        &thousandfold,
        "given-inertia",
        &["10 to the power 3"],
    );
    let degrees = table("t,u,q", |_, s| {
        format!("{:?},{:?},{:?}", s.t, s.u, s.q.to_degrees())
    });
    tells(&degrees, &known, "given-inertia", &["degrees"]);
    let against = table(HEADER, |_, s| format!("{:?},{:?},{:?}", s.t, -s.u, s.q));
    tells(&against, &known, "sign-of-input", &["against u"]);
}

#[test]
fn what_a_recording_cannot_show() {
    let clipped = table(HEADER, |_, s| {
        format!("{:?},{:?},{:?}", s.t, s.u.clamp(-0.5, 0.5), s.q)
    });
    tells(
        &clipped,
        BASELINE,
        "input-saturated",
        &["0.500 N·m", "−0.500 N·m"],
    );
    let coarse = table(HEADER, |_, s| {
        let step = TAU / 24.0;
        format!("{:?},{:?},{:?}", s.t, s.u, (s.q / step).floor() * step)
    });
    tells(&coarse, BASELINE, "coarse-encoder", &["finer"]);
    let samples = record(PLAIN, 12.0, 1);
    let slow = table(HEADER, |k, s| {
        format!("{:?},{:?},{:?}", s.t, s.u, samples[k / 4 * 4].q)
    });
    tells(&slow, BASELINE, "repeated-samples", &["about 4.0 rows"]);
    let stalled = table(HEADER, |k, s| {
        let q = if (2020..2100).contains(&k) {
            samples[2020].q
        } else {
            s.q
        };
        format!("{:?},{:?},{q:?}", s.t, s.u)
    });
    tells(&stalled, BASELINE, "frozen-position", &["4.04"]);
    let losing = table(HEADER, |k, s| {
        let q = if k < 2020 { s.q } else { s.q - 0.1 };
        format!("{:?},{:?},{q:?}", s.t, s.u)
    });
    tells(&losing, BASELINE, "position-jumps", &["4.04 s"]);
    let late = table(HEADER, |k, s| {
        format!(
            "{:?},{:?},{:?}",
            s.t,
            s.u,
            samples[(k + 10).min(samples.len() - 1)].q
        )
    });
    tells(&late, BASELINE, "channels-shifted", &["before the drive"]);
}
