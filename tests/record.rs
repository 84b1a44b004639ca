//! A guided excitation: on an emulated board, in QEMU and on the host, and on one behind a serial port.
//!
//! What needs `qemu-system-arm` or the target `thumbv7em-none-eabihf` says so and passes where they are missing.
#![cfg(unix)]

mod cli;
#[allow(
    dead_code,
    unused_imports,
    reason = "the tests of the firmware use all of it"
)]
mod emulator;
mod port;

use std::fs::File;
use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use bristle::emulate::{Axis, Board, Launch, Live, Sensors, Setup, Transport, Twin, parameters};
use bristle::link::{BLOCK, Peer, Wire};
use bristle::model::Model;
use bristle::tune::Wish;
use bristle_core::drive::State;
use bristle_core::link::{Answer, Command as Request};
use cli::{BASELINE, Folder, PLAIN, Ran, UNBALANCED};
use emulator::runnable_images;
use serialport::{SerialPort, TTYPort};

/// Periods of a millisecond after which a board at a port takes a set point for stale.
const STALE: u16 = 1000;
/// Of the emulated encoder, rad.
const COUNT: f64 = std::f64::consts::TAU / 16384.0;

fn bench(truth: &str) -> Folder {
    let folder = Folder::new();
    folder.write("truth.toml", truth);
    folder.write("axis.toml", BASELINE);
    folder
}

/// Rows of a recording: t, u, q.
fn rows(folder: &Folder, name: &str) -> Vec<[f64; 3]> {
    let text = folder.read(name);
    let row = |line: &str| {
        let mut cells = line.split(',').map(|cell| cell.parse().expect("a number"));
        [(); 3].map(|()| cells.next().expect("a cell"))
    };
    text.lines().skip(1).map(row).collect()
}

fn largest(rows: &[[f64; 3]], column: usize) -> f64 {
    rows.iter()
        .fold(0.0, |m: f64, row| m.max(row[column].abs()))
}

/// The estimate of a parameter of `identify --json` or in a finding.
fn value(json: &serde_json::Value) -> f64 {
    json["value"].as_f64().expect("a value")
}

#[test]
fn the_firmware_runs_a_sequence_that_identifies_the_axis_and_keeps_it_within_its_bounds() {
    let Some(images) = runnable_images() else {
        return;
    };
    let folder = bench(PLAIN);
    let board = format!(
        "record --emulate truth.toml --image {} --yes",
        images.firmware.display()
    );
    let said = folder.done(&format!(
        "{board} --amplitude 0.5 --travel 100 --speed 40 --out run.csv"
    ));
    // Before it moves: what, how far, how fast, how long, how strong. Afterwards: that it is off.
    for part in [
        "quasistatic backwards",
        "100 rad either way",
        "40 rad/s",
        "How long     10 s",
        "|u| up to 0.5 N·m",
        "1000 rows a second, in the memory of the board",
        "The axis is off",
        "without a gap",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // The board's memory begins a little before the host hears of it.
    let made = rows(&folder, "run.csv").len();
    assert!((10_000..10_050).contains(&made), "{made}");
    folder.done("identify run.csv --model axis.toml --json found.json");
    let found = folder.json("found.json");
    for (name, truth) in [("inertia", 0.012), ("coulomb", 0.12), ("viscous", 0.02)] {
        let found = value(&found["parameters"][name]);
        assert!((found / truth - 1.0).abs() < 0.02, "{name}: {found}");
    }

    let cut = |more: &str, fault: &str| {
        let ran = folder.run(&format!("{board} --amplitude 0.5 --out cut.csv {more}"));
        assert_eq!(ran.status, 3, "{ran:?}");
        assert!(ran.stdout.contains("The axis is off"), "{ran:?}");
        assert!(
            ran.stderr.contains("cut after") && ran.stderr.contains(fault),
            "{ran:?}"
        );
        rows(&folder, "cut.csv")
    };
    // The last row is of the period before the one that found it too far: within the bound, and the next would not have been.
    let far = cut("--travel 1 --speed 40", "travel");
    let way = largest(&far, 2);
    let step = (far[far.len() - 1][2] - far[far.len() - 2][2]).abs();
    assert!(
        way <= 1.0 && way + 2.0 * step + COUNT > 1.0,
        "{way}, {step} a period"
    );
    // The observer, of 6 poles at 10 Hz·2π and with the forces of the true model, is off by the encoder's count alone.
    let fast = cut("--travel 100 --speed 3", "overspeed");
    let last = &fast[fast.len() - 21..];
    let speed = (last[20][2] - last[0][2]) / 0.02;
    assert!((2.7..3.1).contains(&speed), "{speed}");
    // Cut, and not ended: the board was set up for 0.5.
    folder.done(&format!(
        "{board} --amplitude 0.5 --limit 0.2 --duration 2 --travel 100 --speed 40 --out clipped.csv"
    ));
    let clipped = rows(&folder, "clipped.csv");
    assert!((2000..2050).contains(&clipped.len()), "{}", clipped.len());
    assert_eq!(largest(&clipped, 1), f64::from(0.2_f32));
}

#[test]
fn a_concealed_effect_is_named_and_the_experiment_after_it_runs() {
    let folder = bench(UNBALANCED);
    folder.done("record --emulate truth.toml --on-host --yes --follow position --excite multisine --amplitude 1.5 --band 0.1:2 --limit 2 --travel 2 --speed 40 --duration 12 --out run.csv");
    folder.done("diagnose run.csv --model axis.toml --json found.json --model-out found.toml --next-experiment next.csv");
    let found = folder.json("found.json");
    assert_eq!(found["verdict"], "explained");
    let finding = &found["findings"][0];
    assert_eq!(finding["id"], "gravity");
    let amplitude = value(&finding["parameters"]["amplitude"]);
    assert!((amplitude / 0.08 - 1.0).abs() < 0.1, "{amplitude}");

    let said = folder.done("record --emulate truth.toml --on-host --yes --signal next.csv --travel 20 --speed 40 --out next_run.csv");
    assert!(said.contains("by the file"), "{said}");
    let (asked, made) = (rows(&folder, "next.csv"), rows(&folder, "next_run.csv"));
    assert_eq!(made.len(), 12_000);
    // Each u that the board applied is one of those asked for about then, in single precision.
    let mut off = 0;
    for (k, row) in made.iter().enumerate().skip(50) {
        let about = &asked[k - 50..=k.min(asked.len() - 1)];
        off += usize::from(!about.iter().any(|a| f64::from(a[1] as f32) == row[1]));
    }
    // A machine that is busy for longer than that sends a set point late.
    assert!(off < made.len() / 20, "{off}");
    folder.done("diagnose run.csv next_run.csv --model found.toml --json both.json");
    assert_eq!(folder.json("both.json")["verdict"], "adequate");
}

/// A run of the program that goes on.
fn start(folder: &Folder, line: &str, input: Stdio) -> Child {
    Command::new(env!("CARGO_BIN_EXE_bristle"))
        .args(line.split_whitespace())
        .current_dir(folder.path(""))
        .stdin(input)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

fn end(child: Child) -> Ran {
    let output = child.wait_with_output().expect("it ends");
    let text = |bytes| String::from_utf8(bytes).expect("output is UTF-8");
    Ran {
        status: output.status.code().expect("the program ends by itself"),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

fn signal(name: &str, child: &Child) {
    let id = child.id().to_string();
    let sent = Command::new("kill")
        .args([&format!("-{name}"), &id])
        .status();
    assert!(sent.expect("kill starts").success());
}

const LONG: &str = "--amplitude 0.5 --duration 50 --travel 1000 --speed 100 --out run.csv";

#[test]
fn a_signal_ends_a_run_with_the_axis_off_and_the_recording_kept() {
    let folder = bench(PLAIN);
    let line = format!("record --emulate truth.toml --on-host --yes {LONG}");
    let child = start(&folder, &line, Stdio::null());
    sleep(Duration::from_secs(2));
    signal("INT", &child);
    let ran = end(child);
    assert_eq!(ran.status, 3, "{ran:?}");
    assert!(
        ran.stdout
            .contains("The axis is off; the board has confirmed it."),
        "{ran:?}"
    );
    assert!(ran.stderr.contains("it was stopped from here"), "{ran:?}");
    let rows = rows(&folder, "run.csv").len();
    assert!((200..5000).contains(&rows), "{rows}");
}

/// A pseudo-terminal: one end of it, the name of the other, and that one held open, without which reads at the first fail.
fn terminal() -> (TTYPort, String, File) {
    let (mut ours, mut theirs) = TTYPort::pair().expect("a pseudo-terminal");
    theirs.set_exclusive(false).expect("it may be shared");
    ours.set_timeout(Duration::from_millis(2)).expect("a limit");
    let name = theirs.name().expect("a name");
    // This one is locked against other programs.
    drop(theirs);
    let held = File::options().read(true).write(true).open(&name);
    (ours, name, held.expect("it opens"))
}

#[test]
fn it_asks_before_anything_moves_and_any_key_stops_it() {
    let folder = bench(PLAIN);
    let line = format!("record --emulate truth.toml --on-host {LONG}");
    for (answer, status) in [("no\n", 2), ("yes\n", 3)] {
        let (mut keys, _, input) = terminal();
        let child = start(&folder, &line, input.into());
        sleep(Duration::from_millis(500));
        keys.write_all(answer.as_bytes()).expect("it is typed");
        if status == 3 {
            sleep(Duration::from_secs(2));
            keys.write_all(b"x").expect("it is typed");
        }
        let ran = end(child);
        assert_eq!(ran.status, status, "{ran:?}");
        assert_eq!(folder.path("run.csv").exists(), status == 3);
        assert_eq!(
            ran.stdout.contains("The axis is off"),
            status == 3,
            "{ran:?}"
        );
    }
}

/// A board with its axis behind a serial port of this machine, a pseudo-terminal.
struct OnPort {
    port: String,
    is_over: Arc<AtomicBool>,
    pump: Option<JoinHandle<()>>,
}

impl OnPort {
    fn start<W: Wire + Send + 'static>(board: Peer<f32, W>) -> Self {
        let model = Model::parse(PLAIN).expect("a model");
        let sensors = Sensors::emulated(COUNT);
        let wish = Wish {
            bandwidth: 10.0,
            rate: 1000.0,
            counts: 16384.0,
            limit: 0.5,
            current: None,
        };
        let setup = Setup {
            wish,
            compensate: false,
        };
        let mut parameters = parameters(&model, &setup, &sensors).expect("a controller");
        // Three processes have a hand in each set point, on a machine that is busy with other tests.
        parameters.limits.command_timeout = STALE;
        let axis = Axis {
            parameters,
            model,
            sensors,
        };
        let mut live = Live::start(board, axis).expect("it goes on");
        live.set_patience(Duration::from_millis(1))
            .expect("a limit");
        let (mut line, port, held) = terminal();
        let is_over = Arc::new(AtomicBool::new(false));
        let over = Arc::clone(&is_over);
        let pump = std::thread::spawn(move || {
            let _held = held;
            let mut block = [0; BLOCK];
            while !over.load(Ordering::Acquire) {
                // Nothing there is no failure, nor is a reader that is gone.
                if let Ok(length) = line.read(&mut block) {
                    live.write(&block[..length]).expect("the board listens");
                }
                let length = live.read(&mut block).expect("the board lives");
                let _ = line.write_all(&block[..length]);
            }
        });
        Self {
            port,
            is_over,
            pump: Some(pump),
        }
    }

    fn state(&self) -> State {
        let line = port::open(&self.port);
        let mut board = Peer::<f32, _>::called(line).expect("the board answers");
        match board.ask(Request::Status).expect("an answer") {
            Answer::Status { state, .. } => state,
            other => panic!("{other:?}"),
        }
    }
}

impl Drop for OnPort {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
        let _ = self.pump.take().map(JoinHandle::join);
    }
}

#[test]
fn a_board_at_a_port_looks_the_same_and_one_whose_host_is_killed_stops_by_itself() {
    let folder = bench(PLAIN);
    let board = OnPort::start(Peer::called(Twin::new().expect("a board")).expect("it greets"));
    let line = format!("record {} --model axis.toml --yes {LONG}", board.port);
    let mut child = start(&folder, &line, Stdio::null());
    sleep(Duration::from_secs(2));
    signal("KILL", &child);
    child.wait().expect("it ends");
    assert!(!folder.path("run.csv").exists());
    // STALE periods without a set point.
    let begun = Instant::now();
    while board.state() != State::Faulted {
        assert!(begun.elapsed() < Duration::from_secs(5), "it still runs");
    }
    // The next run says what is latched, and begins anew.
    let said = folder.done(&format!(
        "record {} --model axis.toml --yes --excite chirp --amplitude 0.4 --duration 2 --travel 100 --speed 50 --out run.csv",
        board.port
    ));
    assert!(said.contains("stale-command are latched"), "{said}");
    // The host's twin has no memory to record in, and the line carries no more.
    assert!(
        said.contains("one control period in 4, 250 rows a second, by telemetry"),
        "{said}"
    );
    let made = rows(&folder, "run.csv");
    assert!(
        made.len() > 450 && largest(&made, 2) > 0.1,
        "{}",
        made.len()
    );
    assert_eq!(board.state(), State::Off);

    let limit = folder.run(&format!(
        "record {} --yes --amplitude 0.6 --travel 1 --speed 1 --out more.csv",
        board.port
    ));
    assert_eq!(limit.status, 2);
    assert!(
        limit.stderr.contains("deployed with 0.5 at most"),
        "{limit:?}"
    );
}

#[test]
fn the_firmware_at_a_port_records_in_its_memory() {
    let Some(images) = runnable_images() else {
        return;
    };
    let folder = bench(PLAIN);
    let board = Board::boot(&images.firmware, Launch::F405, Transport::Fast);
    let board = OnPort::start(board.expect("the board greets"));
    let said = folder.done(&format!(
        "record {} --model axis.toml --yes --amplitude 0.5 --duration 5 --travel 100 --speed 50 --out run.csv",
        board.port
    ));
    assert!(
        said.contains("1000 rows a second, in the memory of the board"),
        "{said}"
    );
    assert!(said.contains("without a gap"), "{said}");
    folder.done("identify run.csv --model axis.toml --json found.json");
    let inertia = value(&folder.json("found.json")["parameters"]["inertia"]);
    assert!((inertia / 0.012 - 1.0).abs() < 0.02, "{inertia}");
    assert_eq!(board.state(), State::Off);
}

#[test]
fn what_cannot_be_run_says_why_and_moves_nothing() {
    let folder = bench(PLAIN);
    let good = "record --emulate truth.toml --on-host --yes --amplitude 0.5 --travel 1 --speed 1 --out run.csv";
    let cases = [
        (good.replace("--yes ", ""), "add --yes"),
        (good.replace("0.5", "0"), "drives nothing"),
        (good.replace("travel 1", "travel 0"), "--travel 0 must be"),
        (good.replace("travel 1", "travel 1e-6"), "encoder counts"),
        (good.replace("speed 1", "speed -1"), "--speed -1 must be"),
        (format!("{good} --duration 0.1"), "makes 100 samples"),
        (format!("{good} --band 1:600"), "--band goes up to 600 Hz"),
        (format!("{good} --follow position"), "--limit"),
        (
            good.replace("--amplitude 0.5", "--signal none.csv"),
            "none.csv",
        ),
        (good.replace("truth.toml", "none.toml"), "none.toml"),
        (good.replace("run.csv", "truth.toml"), "truth.toml"),
        (
            good.replace("--emulate truth.toml --on-host", "/dev/null"),
            "/dev/null",
        ),
    ];
    for (line, part) in cases {
        let before = folder.files();
        let ran = folder.run(&line);
        assert_eq!(ran.status, 2, "{line}: {ran:?}");
        assert!(ran.stderr.contains(part), "{line}: {ran:?}");
        assert!(!ran.stdout.contains("The axis is off"), "{line}: {ran:?}");
        assert!(folder.files() == before, "{line}");
    }
}
