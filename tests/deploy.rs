//! From a model onto a board, over a serial port and in the emulator, and the whole loop.
//!
//! Needs `qemu-system-arm` and the target `thumbv7em-none-eabihf`. Without them the tests that run a board say so and pass,
//! unless `BRISTLE_REQUIRE_QEMU=1` is set.
#![cfg(unix)]

mod cli;
#[allow(
    dead_code,
    unused_imports,
    reason = "the tests of the firmware use all of it"
)]
mod emulator;
mod port;

use bristle_core::link::Command as Request;
use cli::Folder;
use emulator::runnable_images;
use port::OnPort;

const AXIS: &str = "[plant]\nmotion = \"rotary\"\ninput = \"torque\"\ngain = 1.0\ninertia = 0.012\n\
    [friction]\ncoulomb = 0.18\nviscous = 0.02\n[effects.gravity]\namplitude = 0.1\nphase = 0.3\n";

#[test]
fn a_board_on_a_serial_port_takes_stores_and_holds_a_model() {
    let Some(images) = runnable_images() else {
        return;
    };
    let board = OnPort::start(&images.firmware);
    let folder = Folder::new();
    folder.write("axis.toml", AXIS);
    let line = |more: &str| {
        let port = &board.port;
        format!("deploy axis.toml --port {port} --bandwidth 6 --limit 1.5 {more}")
    };
    let fresh = folder.run(&line("--check"));
    assert_eq!(fresh.status, 3, "{fresh:?}");
    assert!(fresh.stdout.contains("control.inertia"), "{fresh:?}");
    let said = folder.done(&line("--json out.json"));
    assert!(said.contains(&board.port), "{said}");
    let written = folder.json("out.json");
    assert_eq!(written["schema"], "bristle.deployment/1");
    assert_eq!(
        (&written["written"], &written["restarted"]),
        (&true.into(), &false.into())
    );
    let inertia = written["parameters"]["control"]["inertia"].as_f64();
    assert_eq!(inertia, Some(0.012));
    folder.done(&line("--check"));

    folder.write(
        "other.toml",
        AXIS.replace("coulomb = 0.18", "coulomb = 0.19"),
    );
    let other = line("--check").replace("axis.toml", "other.toml");
    let other = folder.run(&other);
    assert_eq!(other.status, 3, "{other:?}");
    for field in ["friction.coulomb", "friction.static_level"] {
        assert!(other.stdout.contains(field), "{other:?}");
    }
    assert!(!other.stdout.contains("inertia"), "{other:?}");

    board.tell(Request::Enable);
    let running = folder.run(&line(""));
    assert_eq!(running.status, 2, "{running:?}");
    assert!(running.stderr.contains("running"), "{running:?}");
    board.tell(Request::Disable);
    folder.done(&line(""));
}

#[test]
fn an_emulated_board_holds_a_model_after_a_restart() {
    let Some(images) = runnable_images() else {
        return;
    };
    let folder = Folder::new();
    folder.write("axis.toml", AXIS);
    let image = images.firmware.display();
    let line = format!(
        "deploy axis.toml --emulated --image {image} --bandwidth 6 --limit 1.5 --json out.json"
    );
    assert!(folder.done(&line).contains("after a restart"));
    let written = folder.json("out.json");
    assert_eq!(written["restarted"], true);
    let wave = &written["parameters"]["control"]["effects"]["waves"][0];
    let (sine, cosine) = (wave["sine"].as_f64(), wave["cosine"].as_f64());
    let size = sine.unwrap_or_default().hypot(cosine.unwrap_or_default());
    // An unbalance of 0.1 N·m, rounded to single precision.
    assert!((size - 0.1).abs() < 1e-8, "{wave}");
}

#[test]
fn what_cannot_be_deployed_is_refused_before_any_board_is_asked() {
    let folder = Folder::new();
    folder.write("axis.toml", AXIS);
    folder.write(
        "unknown.toml",
        AXIS.replace("inertia = 0.012", "inertia = \"?\""),
    );
    let good = "--bandwidth 6 --limit 1.5";
    for (line, part) in [
        (format!("axis.toml {good}"), "--port"),
        (format!("axis.toml --port no/port {good}"), "no/port"),
        (
            format!("axis.toml --port axis.toml {good}"),
            "a file and no serial port",
        ),
        (format!("unknown.toml --emulated {good}"), "inertia"),
        (format!("none.toml --emulated {good}"), "none.toml"),
        (
            format!("axis.toml --emulated --image none.elf {good}"),
            "none.elf",
        ),
        (
            "axis.toml --emulated --bandwidth 90 --limit 1.5".to_owned(),
            "--bandwidth",
        ),
        (
            "axis.toml --emulated --bandwidth 6 --limit 0".to_owned(),
            "--limit",
        ),
        (format!("axis.toml --emulated --bus 0 {good}"), "--bus"),
        (
            format!("axis.toml --emulated --current -2 {good}"),
            "--current",
        ),
        (
            format!("axis.toml --emulated --image out.json {good}"),
            "is an input",
        ),
    ] {
        let ran = folder.run(&format!("deploy {line} --json out.json"));
        assert!(
            ran.status == 2 && ran.stderr.contains(part),
            "{line}: {ran:?}"
        );
        assert!(!folder.path("out.json").exists(), "{line}");
    }
}

/// RMS of `q_ref − q` in a recording.
fn tracking(recording: &str) -> f64 {
    let mut lines = recording.lines();
    let header = lines.next().expect("a header");
    let at = |name: &str| {
        let found = header
            .split(',')
            .position(|c| c.split('[').next() == Some(name));
        found.unwrap_or_else(|| panic!("no {name} in {header}"))
    };
    let (q, q_ref) = (at("q"), at("q_ref"));
    let errors: Vec<f64> = lines
        .map(|line| {
            let cells: Vec<f64> = line
                .split(',')
                .map(|c| c.parse().expect("a number"))
                .collect();
            cells[q_ref] - cells[q]
        })
        .collect();
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn the_loop_finds_what_is_concealed_and_halves_the_error_and_more() {
    let Some(images) = runnable_images() else {
        return;
    };
    let (folder, again) = (Folder::new(), Folder::new());
    let line = format!(
        "demo --loop --out out --image {}",
        images.firmware.display()
    );
    let said = folder.done(&line);
    assert!(said.contains("out/loop.html"), "{said}");
    assert_eq!(said, again.done(&line));
    let contents = |folder: &Folder| -> Vec<Vec<u8>> {
        folder.files().into_iter().map(|(_, bytes)| bytes).collect()
    };
    assert!(contents(&folder) == contents(&again), "not the same bytes");

    let turned = folder.json("out/loop.json");
    let mut found: Vec<&str> = turned["findings"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|id| id.as_str())
        .collect();
    found.sort_unstable();
    assert_eq!(found, ["gravity", "stribeck"]);
    let lap = |k: usize, figure: &str| turned["laps"][k][figure].as_f64().expect("a number");
    for figure in ["rms", "peak"] {
        let [alone, before, after] = [0, 1, 2].map(|k| lap(k, figure));
        assert!(2.0 * after < before && before < alone, "{turned}");
    }
    // The files tell the same by the encoder, whose counts lie up to one below the truth.
    let count = std::f64::consts::TAU / 16384.0;
    for (k, name) in [(1, "out/before.csv"), (2, "out/after.csv")] {
        let measured = tracking(&folder.read(name));
        assert!((measured - lap(k, "rms")).abs() <= count, "{measured}");
    }
    assert!(folder.read("out/loop.html").contains("as diagnosed"));
}

/// Runs an experiment on the host and under the firmware, way by way: how many sets of parameters the running board took.
/// Every period has to be the host's, bit for bit, and what came of it as well.
fn on_board(line: &str, periods: u64) -> Option<Vec<(String, u64)>> {
    let images = runnable_images()?;
    let folder = Folder::new();
    let image = images.firmware.display();
    let said = folder.done(&format!(
        "experiment {line} --json out.json --report out.html --qemu --image {image}"
    ));
    let page = folder.read("out.html");
    assert!(page.contains("On the firmware") && page.contains("On the host"));
    let json = folder.json("out.json");
    let runs = json["on_board"].as_array().expect("a list").iter();
    let told = runs.map(|run| {
        assert_eq!(run["periods"], periods);
        assert_eq!(run["equal"], run["periods"], "{run}");
        assert_eq!(run["firmware"], run["host"], "{run}");
        let way = run["way"].as_str().expect("a way").to_owned();
        (way, run["sets"].as_u64().expect("a number"))
    });
    let told: Vec<_> = told.collect();
    let lines = said.lines().filter(|l| l.starts_with("firmware in QEMU"));
    assert_eq!(lines.count(), told.len(), "{said}");
    Some(told)
}

#[test]
fn the_firmware_makes_of_an_experiment_what_the_host_does() {
    let Some(runs) = on_board("srv02 --plants 2 --plant 1 --seed 5", 26_000) else {
        return;
    };
    assert_eq!(runs.len(), 4);
    assert!(runs.iter().all(|(_, sets)| *sets == 0), "{runs:?}");
}

#[test]
fn the_firmware_takes_what_dbi_found_of_a_motor_under_way() {
    let Some(runs) = on_board("dc-motor --plants 1 --seed 5", 24_000) else {
        return;
    };
    let sets: Vec<_> = runs.iter().map(|(w, sets)| (w.as_str(), *sets)).collect();
    assert_eq!(
        sets,
        [("classic", 0), ("off-line", 0), ("reidentified", 1)],
        "{runs:?}"
    );
}

#[test]
fn the_firmware_is_tuned_again_while_the_mass_moves() {
    let Some(runs) = on_board("mass-spring --plants 1 --seed 5", 38_000) else {
        return;
    };
    let sets: Vec<_> = runs.iter().map(|(w, sets)| (w.as_str(), *sets)).collect();
    let expected = [
        ("classic", 0),
        ("off-line", 1),
        ("tuned", 3),
        ("self-tuned", 3),
    ];
    assert_eq!(sets, expected);
}

#[test]
fn a_current_loop_is_tuned_and_deployed_with_a_motor() {
    let folder = Folder::new();
    folder.write(
        "motor.toml",
        "[plant]\nkind = \"dc-motor\"\nmotion = \"rotary\"\ninput = \"voltage\"\ninertia = 2e-3\nresistance = 1.3\n\
        inductance = 2e-3\ntorque_constant = 0.05\n[friction]\ncoulomb = 0.01\nviscous = 2e-4\n",
    );
    let wish = "motor.toml --bandwidth 4 --limit 20 --current-bandwidth 30 --current-limit 8";
    let said = folder.done(&format!("tune {wish} --json tuned.json"));
    assert!(said.contains("current gain"), "{said}");
    let tuned = folder.json("tuned.json");
    let number = |json: &serde_json::Value, key: &str| json[key].as_f64().expect("a number");
    // 1 − e^(−R·T/L), and a torque constant in place of one over the resistance.
    let reset = 1.0 - (-1.3e-3 / 2e-3_f64).exp();
    assert!((number(&tuned["current"], "reset") - reset).abs() < 1e-12);
    assert_eq!(number(&tuned["parameters"], "gain"), 0.05);
    assert_eq!(number(&tuned["parameters"], "command_limit"), 8.0);
    // A loop so slow that the position loop would ring.
    let slow = wish.replace("--current-bandwidth 30", "--current-bandwidth 4");
    let refused = folder.run(&format!("tune {slow}"));
    assert_eq!(refused.status, 2, "{refused:?}");
    assert!(refused.stderr.contains("phase margin"), "{refused:?}");
    let Some(images) = runnable_images() else {
        return;
    };
    let image = images.firmware.display();
    folder.done(&format!(
        "deploy {wish} --emulated --image {image} --json out.json"
    ));
    let out = folder.json("out.json");
    let held = number(&out["parameters"]["current"], "reset");
    assert!((held - reset).abs() < 1e-6);
    let tight = folder.run(&format!(
        "deploy {wish} --current 7 --emulated --image {image}"
    ));
    assert_eq!(tight.status, 2, "{tight:?}");
    assert!(tight.stderr.contains("--current-limit"), "{tight:?}");
}
