//! The firmware in the emulator: the image that would be flashed, in closed loop and under every fault.
//!
//! Needs `qemu-system-arm` and the target `thumbv7em-none-eabihf`. Without them the tests say so and pass, unless
//! `BRISTLE_REQUIRE_QEMU=1` is set.
#![cfg(unix)]

mod current;
mod emulator;
mod fixed_point;

use std::path::Path;

use bristle::emulate::{
    self, Board, Driver, Launch, Machine, OnHost, Outcome, Period, Plan, Sensors, Setup, Transport,
};
use bristle::flash;
use bristle::image;
use bristle::link::Recorded;
use bristle::model::Model;
use bristle::plant;
use bristle::tune::{self, Wish};
use bristle_core::control::{Effects, Learning, SetPoint, Stage};
use bristle_core::drive::recorder::{Order, Trigger};
use bristle_core::drive::signal::{Selection, Signal};
use bristle_core::drive::store::checksum;
use bristle_core::drive::{Bounds, Fault, Number, Parameters, Refusal, Sample, State};
use bristle_core::friction::Units;
use bristle_core::link::{Answer, Command, Counters, Deframer, Injection, Packet, Report, decode};
use emulator::{Calls, booted, images, runnable_images};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, elf};

const SENSORS: Sensors = Sensors {
    count: std::f64::consts::TAU / 16384.0,
    current_per_count: 0.02,
    bus_per_count: 0.015,
    bus: 24.0,
};

/// A stiff axis with gravity, driven by torque.
const AXIS: &str = "[plant]\nmotion = \"rotary\"\ninput = \"torque\"\ngain = 1.0\ninertia = 0.002\n\
    [friction]\nmodel = \"lugre\"\ncoulomb = 0.2\nviscous = 0.015\nstatic = 0.25\nstribeck_velocity = 0.1\n\
    bristle_stiffness = 200.0\nbristle_damping = 0.3\n[effects.gravity]\namplitude = 0.1\nphase = 0.3\n";

fn model() -> Model {
    Model::parse(AXIS).expect("a model")
}

const SETUP: Setup = Setup {
    wish: Wish {
        bandwidth: 12.0,
        rate: 1000.0,
        counts: 16384.0,
        limit: 1.0,
        current: None,
    },
    compensate: true,
};

fn parameters() -> Parameters<f32> {
    let mut parameters = emulate::parameters(&model(), &SETUP, &SENSORS).expect("a controller");
    let limits = &mut parameters.limits;
    (limits.stall, limits.stall_periods) = (0.9, 20);
    (limits.command_timeout, limits.link_timeout) = (30, 40);
    parameters
}

/// A board that is set up and on.
fn running(transport: Transport, parameters: &Parameters<f32>) -> Option<Board<f32>> {
    Some(switched_on(booted(transport)?, *parameters))
}

fn switched_on<T: Number>(mut board: Board<T>, parameters: Parameters<T>) -> Board<T> {
    board
        .tell(Command::Set(parameters))
        .expect("valid parameters");
    board.tell(Command::Enable).expect("nothing is wrong");
    board
}

/// Position control along a sum of two sines.
fn plan<T: Number>(samples: usize, units: &Units) -> Plan<T> {
    let reference = |t: f64| {
        let (a, b) = (2.0 * t, 11.0 * t);
        let q = 0.5 * a.sin() + 0.1 * b.sin();
        let v = a.cos() + 1.1 * b.cos();
        (q, (v, -2.0 * a.sin() - 12.1 * b.sin()))
    };
    plan_along(reference, samples, units)
}

/// Position control along a path of position, velocity and acceleration at every instant.
fn plan_along<T: Number>(
    reference: impl Fn(f64) -> (f64, (f64, f64)),
    samples: usize,
    units: &Units,
) -> Plan<T> {
    let t: Vec<f64> = (0..samples).map(|k| k as f64 * 1e-3).collect();
    let set_point = |t: &f64| {
        let (q, rates) = reference(*t);
        emulate::position(q, rates, SENSORS.count, units)
    };
    Plan {
        set_points: t.iter().map(set_point).collect(),
        positions: t.iter().map(|t| reference(*t).0).collect(),
        t,
        loads: Vec::new(),
        sensors: SENSORS,
    }
}

fn run(driver: &mut dyn Driver<f32>, samples: usize) -> Outcome<f32> {
    follow(driver, &plan(samples, &tune::SI))
}

fn follow<T: Number>(driver: &mut dyn Driver<T>, plan: &Plan<T>) -> Outcome<T> {
    let mut plant = plant::new(&model()).expect("a plant");
    emulate::run(driver, plant.as_mut(), plan).expect("a run")
}

/// Asserts that two runs are the same bits, period by period.
fn assert_same<T: Number>(board: &Outcome<T>, host: &Outcome<T>) {
    for (k, (b, h)) in board.periods.iter().zip(&host.periods).enumerate() {
        let same = b.input.to_word() == h.input.to_word();
        assert!(
            same && b.bridge == h.bridge && b.faults == h.faults,
            "{k}: {b:?}, {h:?}"
        );
    }
    assert_eq!(board.periods.len(), host.periods.len());
    assert_eq!(board.record.u, host.record.u);
    assert_eq!(board.record.q, host.record.q);
}

#[test]
fn ten_seconds_in_closed_loop_equal_the_hosts_bit_for_bit() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let mut host = OnHost::new(parameters()).expect("valid parameters");
    let (board, host) = (run(&mut board, 10_000), run(&mut host, 10_000));
    assert_same(&board, &host);
    assert_followed(&board);
}

/// It is control and not noise: the axis follows to a hundredth of its travel.
fn assert_followed<T>(board: &Outcome<T>) {
    let errors = board.record.set_point.iter().zip(&board.record.q);
    let worst = errors
        .skip(500)
        .fold(0.0_f64, |m, (r, q)| m.max((r - q).abs()));
    assert!(worst < 0.012, "{worst}");
}

/// A driver to which something is done with a set of parameters, every 97 periods.
struct Changing<D> {
    driver: D,
    period: usize,
    set: fn(&mut D, Parameters<f32>),
}

/// What is known of the axis in turn: friction, gains and learning.
fn known(turn: usize) -> Parameters<f32> {
    let mut set = parameters();
    let control = &mut set.control;
    if turn % 2 == 1 {
        control.friction.coulomb *= 0.8;
        control.velocity_gain *= 1.2;
        control.observer_bandwidth *= 0.9;
    }
    if turn % 3 == 2 {
        control.adaptation.method = Learning::Rows;
        control.effects = Effects::NONE;
    }
    set
}

impl<D: Driver<f32>> Driver<f32> for Changing<D> {
    fn period(
        &mut self,
        set_point: Option<SetPoint<f32>>,
        sample: Sample,
    ) -> bristle::error::Result<Period<f32>> {
        self.period += 1;
        if self.period.is_multiple_of(97) {
            (self.set)(&mut self.driver, known(self.period / 97));
        }
        self.driver.period(set_point, sample)
    }
}

fn changing<D: Driver<f32>>(driver: D, set: fn(&mut D, Parameters<f32>)) -> Changing<D> {
    Changing {
        driver,
        period: 0,
        set,
    }
}

#[test]
fn parameters_under_way_are_in_force_in_the_same_period_as_on_the_host() {
    let Some(board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let mut board = changing(board, |board, set| {
        board.tell(Command::Set(set)).expect("it is taken");
        // Nothing of this goes to flash.
        assert_eq!(
            board.ask(Command::Store).expect("an answer"),
            Answer::Refused(Refusal::Running)
        );
    });
    let host = OnHost::new(parameters()).expect("valid parameters");
    let mut host = changing(host, |host, set| host.set(&set).expect("it is taken"));
    let (ran, expected) = (run(&mut board, 6000), run(&mut host, 6000));
    assert_same(&ran, &expected);
    assert_followed(&ran);
    let mut unchanged = OnHost::new(parameters()).expect("valid parameters");
    assert_ne!(ran.record.u, run(&mut unchanged, 6000).record.u);
    board.driver.restart().expect("it starts anew");
    let held = board.driver.ask(Command::Get).expect("an answer");
    assert_eq!(held, Answer::Parameters(Parameters::harmless()));
}

#[test]
fn a_set_that_comes_damaged_or_does_not_fit_changes_nothing_of_a_run() {
    let Some(board) = running(Transport::Serial, &parameters()) else {
        return;
    };
    let mut board = changing(board, |board, set| {
        let packet = Packet {
            sequence: 0,
            command: Command::Set(set),
        };
        let mut frame = bristle_core::link::encode(&packet)
            .expect("a frame")
            .to_vec();
        // Without its second half, and with one bit that is not its own.
        let half = frame.len() / 2;
        let mut damaged = frame.split_off(half);
        frame.push(0);
        damaged.insert(0, 1);
        for bytes in [frame, damaged] {
            board.machine().write(&bytes).expect("the line is open");
        }
        let mut bad = set;
        bad.control.friction.viscous = f32::NAN;
        let answer = board.ask(Command::Set(bad)).expect("an answer");
        assert_eq!(answer, Answer::Refused(Refusal::Invalid));
        bad = set;
        bad.control.gain *= -1.0;
        let answer = board.ask(Command::Set(bad)).expect("an answer");
        assert_eq!(answer, Answer::Refused(Refusal::Fixed));
    });
    let mut host = OnHost::new(parameters()).expect("valid parameters");
    assert_same(&run(&mut board, 300), &run(&mut host, 300));
    let held = board.driver.ask(Command::Get).expect("an answer");
    assert_eq!(held, Answer::Parameters(parameters()));
    assert_eq!(status(&mut board.driver).2.damaged, 6);
}

#[test]
fn the_serial_port_gives_the_same_as_the_fast_transport() {
    let Some(mut serial) = running(Transport::Serial, &parameters()) else {
        return;
    };
    let mut host = OnHost::new(parameters()).expect("valid parameters");
    assert_same(&run(&mut serial, 300), &run(&mut host, 300));
    let counters = status(&mut serial).2;
    assert_eq!(counters, Counters::default());
}

fn status<T: Number>(board: &mut Board<T>) -> (State, Vec<Fault>, Counters) {
    match board.ask(Command::Status).expect("an answer") {
        Answer::Status {
            state,
            faults,
            mut counters,
        } => {
            counters.stack = 0;
            (state, faults.iter().collect(), counters)
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_ring_holds_what_the_host_saw_from_the_trigger_on() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let order = Order {
        selection: Selection::of(&[Signal::Input, Signal::Position, Signal::Velocity]),
        every: 2,
        trigger: Trigger::Rises(Signal::Position, 1000.0),
        before: 20,
    };
    board.record(order).expect("the order is taken");
    let outcome = run(&mut board, 3000);
    board.tell(Command::StopRecording).expect("it stops");
    let Recorded { contents, words } = board.recorded().expect("a recording");
    let rows: Vec<&[u32]> = words.chunks(3).collect();
    assert_eq!(rows.len(), contents.rows as usize);
    assert!(rows.len() > 500);
    let first = (contents.first - outcome.periods[0].number) as usize;
    for (row, k) in rows.iter().zip((first..).step_by(2)) {
        assert_eq!(
            row[0],
            outcome.periods[k].input.to_bits(),
            "row of sample {k}"
        );
        let q = f64::from(row[1] as i32) * SENSORS.count;
        assert_eq!(q, outcome.record.q[k], "row of sample {k}");
        // The observer sees the velocity to a few counts a period.
        let v = f64::from(f32::from_bits(row[2]));
        assert!(
            (v - outcome.record.truth[k].v).abs() < 0.3,
            "row of sample {k}"
        );
    }
    // The row of the trigger is the first at or above its level, 20 rows in.
    let counts: Vec<i32> = rows.iter().map(|row| row[1] as i32).collect();
    assert!(
        counts[20] >= 1000 && counts[19] < 1000,
        "{:?}",
        &counts[..22]
    );
}

const HEALTHY: Sample = Sample {
    count: 500,
    current: 2048,
    bus: 1600,
    gate_fault: false,
};

/// One period with a set point that asks for half of the input.
fn healthy<T: Number>(board: &mut Board<T>) -> Period<T> {
    let period = board.period(Some(SetPoint::Command(T::ONE.half())), HEALTHY);
    period.expect("an answer")
}

/// The number of periods of a kind in which the bridge is still on, until a fault turns it off.
///
/// After that it must stay off, whatever the board is told, until the fault is cleared; and go on again then.
fn periods_on(
    board: &mut Board<f32>,
    fault: Fault,
    mut period: impl FnMut(&mut Board<f32>) -> Period<f32>,
) -> u32 {
    for k in 0..200 {
        let seen = period(board);
        if seen.bridge {
            assert!(seen.faults.is_empty() && seen.input != 0.0);
            continue;
        }
        assert_eq!(seen.input, 0.0);
        assert!(seen.faults.contains(fault), "{:?}", seen.faults);
        let refused = board.ask(Command::Enable).expect("an answer");
        assert_eq!(refused, Answer::Refused(Refusal::Faulted));
        assert!(!healthy(board).bridge);
        assert_eq!(status(board).0, State::Faulted);
        board
            .tell(Command::Set(parameters()))
            .expect("parameters heal");
        board.tell(Command::Clear).expect("a fault is cleared");
        board
            .tell(Command::Enable)
            .expect("nothing is wrong any more");
        assert!((0..5).all(|_| healthy(board).bridge));
        return k;
    }
    panic!("{fault:?} is not noticed");
}

/// What goes wrong with a sample.
type Damage = fn(&mut Sample);

#[test]
fn every_fault_of_a_sample_turns_the_bridge_off_in_its_own_period() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    assert!((0..5).all(|_| healthy(&mut board).bridge));
    let cases: [(Fault, Damage); 7] = [
        (Fault::EncoderJump, |s| s.count = s.count.wrapping_add(4097)),
        (Fault::EncoderJump, |s| s.count = s.count.wrapping_sub(4097)),
        (Fault::Overcurrent, |s| s.current = 4095),
        (Fault::Overcurrent, |s| s.current = 0),
        (Fault::Undervoltage, |s| s.bus = 700),
        (Fault::Overvoltage, |s| s.bus = 2500),
        (Fault::GateDriver, |s| s.gate_fault = true),
    ];
    for (fault, damage) in cases {
        let mut sample = HEALTHY;
        damage(&mut sample);
        let bad = |board: &mut Board<f32>| {
            let period = board.period(Some(SetPoint::Command(0.5)), sample);
            period.expect("an answer")
        };
        // The way back is a jump, too: it happens while the bridge is off, and is cleared with the rest.
        assert_eq!(periods_on(&mut board, fault, bad), 0, "{fault:?}");
    }
}

/// Travel and current in the period of the sample that is beyond; speed as soon as the observer shows it; u is cut from the
/// first period on.
#[test]
fn the_bounds_of_a_run_end_it_in_time() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    board.tell(Command::Disable).expect("it is turned off");
    let bounds = Bounds {
        travel: 800,
        speed: 10.0,
        input: 0.25,
        current: 5.0,
    };
    // A steady motion of so many counts a period, with the current of a converter's reading; how many periods the bridge was on.
    let mut on = |counts: u16, current: u16, fault: Fault| {
        board
            .tell(Command::EnableWithin(bounds))
            .expect("nothing is wrong");
        for k in 0..1000 {
            let sample = Sample {
                count: HEALTHY.count + counts * k,
                current,
                ..HEALTHY
            };
            let period = board.period(Some(SetPoint::Command(0.5)), sample);
            let period = period.expect("an answer");
            if period.bridge {
                assert_eq!(period.input, 0.25, "u is cut");
                continue;
            }
            assert!(period.faults.iter().eq([fault]), "{:?}", period.faults);
            let refused = board.ask(Command::EnableWithin(bounds));
            assert_eq!(
                refused.expect("an answer"),
                Answer::Refused(Refusal::Faulted)
            );
            // The way back may be a jump.
            board.period(None, HEALTHY).expect("an answer");
            board.tell(Command::Clear).expect("it is cleared");
            return k;
        }
        panic!("{fault:?} is not noticed");
    };
    // 20 counts a period are 7.7 rad/s: 800 counts after the first 41 samples, beyond which the 42nd is.
    assert_eq!(on(20, 2048, Fault::Travel), 41);
    // 5 A are 250 counts of the converter.
    assert_eq!(on(0, 2048 + 251, Fault::Overcurrent), 0);
    assert_eq!(on(0, 2048 - 251, Fault::Overcurrent), 0);
    // 40 counts a period are 15.3 rad/s; an observer of bandwidth ω shows two thirds of a speed by ωt = 2.3, and the input,
    // which the model takes for a push, only makes it see more.
    let seen = 2.3 / f64::from(parameters().control.observer_bandwidth * 1e-3);
    assert!(f64::from(on(40, 2048, Fault::Overspeed)) <= seen.ceil());
    // The next run without bounds has none.
    board.tell(Command::Enable).expect("nothing is wrong");
    assert_eq!(healthy(&mut board).input, 0.5);
}

#[test]
fn silence_and_standstill_turn_the_bridge_off_when_their_limits_say() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let limits = parameters().limits;
    let stale = |board: &mut Board<f32>| {
        // Frames go on, set points do not.
        board.tell(Command::StopRecording).expect("an answer");
        board.period(None, HEALTHY).expect("an answer")
    };
    healthy(&mut board);
    let on = periods_on(&mut board, Fault::StaleCommand, stale);
    assert_eq!(on, u32::from(limits.command_timeout));
    // The input of a period shows in the sample after it.
    let stalled = |board: &mut Board<f32>| {
        let period = board.period(Some(SetPoint::Command(0.95)), HEALTHY);
        period.expect("an answer")
    };
    let on = periods_on(&mut board, Fault::EncoderLoss, stalled);
    assert_eq!(on, u32::from(limits.stall_periods));

    let mut patient = parameters();
    patient.limits.command_timeout = 0;
    board.tell(Command::Disable).expect("it is turned off");
    board.tell(Command::Set(patient)).expect("valid parameters");
    board.tell(Command::Enable).expect("nothing is wrong");
    healthy(&mut board);
    let silent = |board: &mut Board<f32>| board.period(None, HEALTHY).expect("an answer");
    let on = periods_on(&mut board, Fault::LinkLoss, silent);
    assert_eq!(on, u32::from(limits.link_timeout));
}

#[test]
fn what_goes_wrong_inside_turns_the_bridge_off_as_well() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let not_a_number = |board: &mut Board<f32>| {
        let period = board.period(Some(SetPoint::Torque(f32::NAN)), HEALTHY);
        period.expect("an answer")
    };
    assert_eq!(periods_on(&mut board, Fault::Unsound, not_a_number), 0);

    // Two samples at once: the second comes before the step of the first.
    let hasty = |board: &mut Board<f32>| {
        let twice = vec![Command::Sample(HEALTHY), Command::Sample(HEALTHY)];
        board.send_all(twice).expect("the line is open");
        board.actuation().expect("an answer")
    };
    assert_eq!(periods_on(&mut board, Fault::Overrun, hasty), 0);

    let inject = |board: &mut Board<f32>, injection| {
        board
            .tell(Command::Inject(injection))
            .expect("it is injected");
    };
    inject(&mut board, Injection::CorruptParameter);
    assert!(periods_on(&mut board, Fault::CorruptParameters, healthy) <= 64);
    inject(&mut board, Injection::Clock);
    assert_eq!(periods_on(&mut board, Fault::Clock, healthy), 0);
}

#[test]
fn a_hang_ends_in_a_reset_with_the_bridge_off() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    assert!(healthy(&mut board).bridge);
    board
        .send(Command::Inject(Injection::Hang))
        .expect("the line is open");
    board.greet().expect("the board starts anew");
    let (state, faults, _) = status(&mut board);
    assert_eq!((state, faults), (State::Faulted, vec![Fault::Watchdog]));
    assert!(!healthy(&mut board).bridge);
}

#[test]
fn stored_parameters_survive_a_restart_and_damage_to_one_record() {
    let Some(mut board) = booted::<f32>(Transport::Fast) else {
        return;
    };
    let restart = |board: &mut Board<f32>| {
        board
            .send(Command::Inject(Injection::Restart))
            .expect("the line is open");
        board.greet().expect("the board starts anew");
    };
    let get = |board: &mut Board<f32>| board.ask(Command::Get).expect("an answer");
    assert_eq!(get(&mut board), Answer::Parameters(Parameters::harmless()));
    let (first, mut second) = (parameters(), parameters());
    second.control.friction.coulomb = 0.123;
    for set in [first, second] {
        board.tell(Command::Set(set)).expect("valid parameters");
        board.tell(Command::Store).expect("they are stored");
        restart(&mut board);
        assert_eq!(get(&mut board), Answer::Parameters(set));
    }
    // The first record holds the older set, the second the newer.
    let corrupt = |record| Command::Inject(Injection::CorruptFlash { record });
    board.tell(corrupt(1)).expect("it is injected");
    restart(&mut board);
    assert_eq!(get(&mut board), Answer::Parameters(first));
    assert_eq!(status(&mut board).0, State::Off);
    board.tell(corrupt(0)).expect("it is injected");
    restart(&mut board);
    assert_eq!(get(&mut board), Answer::Parameters(Parameters::harmless()));
    let (state, faults, _) = status(&mut board);
    assert_eq!(
        (state, faults),
        (State::Faulted, vec![Fault::CorruptParameters])
    );
}

/// Runs the program in a folder; its exit status and what it said on the error stream.
fn bristle(folder: &std::path::Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_bristle"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the program runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), said)
}

#[test]
fn the_commands_give_the_same_bytes_with_and_without_the_emulator() {
    let Some(images) = runnable_images() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
    write("axis.toml", AXIS).expect("it is written");
    let image = images.firmware.to_str().expect("a path in UTF-8");
    let run = |verb: &str, out: &str, more: &[&str]| {
        let mut arguments = vec![verb, "--model", "axis.toml", "--out", out];
        arguments.extend([
            "--excite",
            "multisine",
            "--amplitude",
            "0.7",
            "--duration",
            "3",
        ]);
        arguments.extend(more);
        let (status, said) = bristle(folder.path(), &arguments);
        assert_eq!(status, Some(0), "{said}");
        std::fs::read_to_string(folder.path().join(out)).expect("it was written")
    };
    let json = [
        "--image", image, "--json", "run.json", "--report", "run.html",
    ];
    let emulated = run("emulate", "emulated.csv", &json);
    assert_eq!(emulated, run("emulate", "again.csv", &["--image", image]));
    assert_eq!(emulated, run("emulate", "host.csv", &["--on-host"]));
    let by_ring = run("emulate", "ring.csv", &["--ring", "--image", image]);
    assert_eq!(emulated, by_ring);
    assert_eq!(emulated.lines().next(), Some("t[s],u[N*m],q[rad]"));
    assert_eq!(emulated.lines().count(), 3001);
    let report = std::fs::read_to_string(folder.path().join("run.json")).expect("a report");
    let page = std::fs::read_to_string(folder.path().join("run.html")).expect("a page");
    assert!(page.contains("A run in the emulator") && page.contains("in single precision"));
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!(
        (&report["samples"], &report["trip"]),
        (&3000.into(), &().into())
    );

    let wrong = [
        "emulate",
        "--model",
        "axis.toml",
        "--excite",
        "chirp",
        "--amplitude",
        "1",
    ];
    for (more, part) in [
        (&["--image", "none.elf", "--out", "x.csv"][..], "none.elf"),
        (
            &["--image", "axis.toml", "--out", "x.csv"],
            "axis.toml: is no 32-bit ELF file",
        ),
        (
            &["--out", "x.csv", "--follow", "position", "--on-host"],
            "--limit",
        ),
        (&["--out", "x.csv", "--rate", "0", "--on-host"], "--rate"),
        (&["--out", "axis.toml", "--on-host"], "input"),
    ] {
        let (status, said) = bristle(folder.path(), &[&wrong[..], more].concat());
        assert!(
            status == Some(2) && said.contains(part),
            "{status:?}: {said}"
        );
        assert!(!folder.path().join("x.csv").exists());
    }
}

#[test]
fn faults_are_explained_by_name_and_by_number() {
    let run = |id: &str| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_bristle"))
            .args(["explain", id])
            .output()
            .expect("the program runs");
        assert!(output.status.success());
        String::from_utf8(output.stdout).expect("text")
    };
    for fault in Fault::ALL {
        let page = run(fault.page().id);
        assert!(page.contains(fault.page().remedy));
        assert_eq!(page, run(&fault.number().to_string()));
    }
}

#[test]
fn what_must_not_be_is_refused_by_name() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let refused = |board: &mut Board<f32>, command, why| {
        assert_eq!(board.ask(command).expect("an answer"), Answer::Refused(why));
    };
    let mut other = parameters();
    other.control.command_limit = 2.0;
    refused(&mut board, Command::Set(other), Refusal::Fixed);
    refused(&mut board, Command::Store, Refusal::Running);
    refused(&mut board, Command::Enable, Refusal::Running);
    board.tell(Command::Disable).expect("it is turned off");
    let mut invalid = parameters();
    invalid.control.inertia = -1.0;
    refused(&mut board, Command::Set(invalid), Refusal::Invalid);
    let nothing = Order {
        selection: Selection::default(),
        every: 1,
        trigger: Trigger::Now,
        before: 0,
    };
    refused(
        &mut board,
        Command::Record(nothing),
        Refusal::NothingSelected,
    );
}

#[test]
fn telemetry_comes_as_chosen_and_in_step_with_the_periods() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let selection = Selection::of(&[Signal::Input, Signal::Bus]);
    board
        .tell(Command::Telemetry {
            selection,
            every: 5,
        })
        .expect("it is chosen");
    let periods: Vec<Period<f32>> = (0..100).map(|_| healthy(&mut board)).collect();
    let counters = status(&mut board).2;
    let (telemetry, lost) = board.take_telemetry();
    assert_eq!(
        (telemetry.len(), lost, counters),
        (20, 0, Counters::default())
    );
    for (frame, period) in telemetry.iter().zip(periods.iter().step_by(5)) {
        assert_eq!(frame.period, period.number);
        assert_eq!(frame.words[0], period.input.to_bits());
        assert!((f32::from_bits(frame.words[1]) - 24.0).abs() < 1e-3);
    }
}

#[test]
fn garbage_and_gaps_are_counted_and_do_not_stop_the_loop() {
    let Some(mut board) = running(Transport::Serial, &parameters()) else {
        return;
    };
    let mut expected = Counters::default();
    for seed in 1..=8 {
        let noise = noise(seed);
        expected.damaged += frames_in(&noise);
        board.machine().write(&noise).expect("the line is open");
        assert!(healthy(&mut board).bridge);
        board.skip_number();
        expected.missing += 1;
        assert_eq!(status(&mut board).2, expected);
    }
}

/// Some 700 reproducible bytes, ended by a delimiter; the higher the seed, the rarer the delimiters inside, up to
/// frames that are too long.
fn noise(seed: u32) -> Vec<u8> {
    let mut state = seed.wrapping_mul(0x9E37_79B9);
    let mut bytes: Vec<u8> = (0..700)
        .map(|_| {
            // xorshift32 (Marsaglia 2003)
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            let rare_zero = state.trailing_zeros() >= seed;
            if rare_zero {
                0
            } else {
                (state >> 24) as u8 | 1
            }
        })
        .collect();
    bytes.push(0);
    bytes
}

/// How many frames a receiver sees in `bytes`, all of them bad.
fn frames_in(bytes: &[u8]) -> u32 {
    let mut deframer = Deframer::new();
    let message = |byte: &u8| Some(deframer.push(*byte)?.and_then(decode::<Packet<f32>>));
    let messages = bytes.iter().filter_map(message);
    messages.map(|m| assert!(m.is_err())).count() as u32
}

#[test]
fn a_flood_of_commands_is_answered_in_order_or_accounted_for() {
    const COMMANDS: u32 = 200;
    let Some(mut board) = booted::<f32>(Transport::Serial) else {
        return;
    };
    let flood = (0..COMMANDS).map(|_| Command::Get).collect();
    board.send_all(flood).expect("the line is open");
    // Every sample behind the flood is answered, and lets one more of the answers out that wait on the board.
    let (mut answered, mut last, mut quiet) = (0, None, 0);
    while quiet < 20 {
        board
            .send(Command::Sample(HEALTHY))
            .expect("the line is open");
        quiet += 1;
        while let Report::Answer { to, .. } = board.receive().expect("a report") {
            assert!(last < Some(to), "{last:?} before {to}");
            last = Some(to);
            answered += 1;
            quiet = 0;
        }
    }
    assert_eq!(answered + status(&mut board).2.dropped, COMMANDS);
}

/// The host waits for what the bridge does before it sends the next sample: that must not be lost, however much else waits.
#[test]
fn what_the_bridge_does_waits_for_no_answer() {
    for transport in [Transport::Fast, Transport::Serial] {
        let Some(mut board) = booted::<f32>(transport) else {
            return;
        };
        let mut burst = vec![Command::Get; 12];
        burst.push(Command::Sample(HEALTHY));
        for period in 1..=20 {
            board.send_all(burst.clone()).expect("the line is open");
            assert_eq!(board.actuation().expect("an answer").number, period);
        }
    }
}

#[test]
fn the_board_runs_the_image_that_was_built() {
    let Some(board) = booted::<f32>(Transport::Fast) else {
        return;
    };
    // The one that `bristle flash` puts onto a board, as the flash then holds it.
    let path = &runnable_images().expect("it runs").firmware;
    let image = flash::Image::read(path, &image::F405).expect("an image for the board");
    let hello = board.hello().expect("it has greeted");
    assert_eq!(hello.build, checksum(&image.bytes));
}

#[test]
fn faults_of_the_processor_end_the_emulation_with_their_own_status() {
    let Some(images) = runnable_images() else {
        return;
    };
    for (image, status) in [(&images.panic, 101), (&images.hard_fault, 102)] {
        let mut machine = Machine::start(image, Launch::F405, Transport::Fast).expect("a machine");
        let ended = machine.end().expect("the image ends by itself");
        assert_eq!(ended.code(), Some(status));
    }
}

#[test]
fn the_image_fits_its_budget() {
    let Some(images) = images() else { return };
    let image = std::fs::read(&images.firmware).expect("the image was just built");
    let image = object::File::parse(&*image).expect("the image is an ELF file");
    for (key, used) in [
        ("flash_bytes", occupied(&image, in_flash)),
        ("static_ram_bytes", occupied(&image, in_ram)),
    ] {
        within_budget(key, used);
    }
}

/// What of an image may not be reached from the control task: panics and what leads to them.
const PANICS: [&str; 5] = [
    "panic",
    "unwrap_failed",
    "expect_failed",
    "slice_index",
    "_fail",
];

fn leads_to_panic(name: &str) -> bool {
    PANICS.iter().any(|part| name.contains(part))
}

/// The double-precision routines of the compiler's library (ARM RTABI 4.1.2), which a processor for single precision
/// needs a hundred instructions for.
fn is_double(name: &str) -> bool {
    let rest = name.strip_prefix("__aeabi_").unwrap_or_default();
    let conversions = ["f2d", "d2f", "i2d", "ui2d", "l2d", "ul2d"];
    rest.starts_with('d') && !rest.contains("divmod") || conversions.contains(&rest)
}

#[test]
fn the_control_task_cannot_panic_and_nothing_computes_in_double_precision() {
    let Some(images) = images() else { return };
    let bytes = std::fs::read(&images.firmware).expect("the image was just built");
    let image = object::File::parse(&*bytes).expect("the image is an ELF file");
    let calls = Calls::of(&image);
    // RTIC gives the task the name of its interrupt.
    let reached = calls.reachable("ADC");
    println!(
        "functions that the control task can reach: {}",
        reached.len()
    );
    assert!(reached.len() > 2, "{reached:?}");
    let panics: Vec<_> = reached.iter().filter(|n| leads_to_panic(n)).collect();
    assert!(panics.is_empty(), "{panics:?}");
    let doubles: Vec<&str> = image
        .symbols()
        .filter_map(|s| s.name().ok())
        .filter(|name| is_double(name))
        .collect();
    assert!(doubles.is_empty(), "{doubles:?}");
}

/// The same search in the image that panics on purpose: it does find what it looks for.
#[test]
fn a_panic_that_can_be_reached_is_found() {
    let Some(images) = images() else { return };
    let bytes = std::fs::read(&images.panic).expect("the image was just built");
    let image = object::File::parse(&*bytes).expect("the image is an ELF file");
    let reached = Calls::of(&image).reachable("main");
    assert!(
        reached.iter().any(|name| name.contains("panic")),
        "{reached:?}"
    );
}

/// Counts that repeat to the instruction, whatever the machine is busy with.
#[test]
fn a_control_period_fits_its_budget_of_instructions() {
    let Some(images) = runnable_images() else {
        return;
    };
    count_instructions(&images.cost, "", 1);
    count_instructions(&images.stages, "", STAGES);
    count_instructions(&images.sets, "", 1);
}

/// What `examples/stages.rs` counts: the control law, and each stage.
const STAGES: usize = 1 + Stage::ALL.len();

/// Runs an image that prints so many lines `stage median most`, and compares with the budgets of that prefix.
fn count_instructions(image: &Path, prefix: &str, lines: usize) {
    let output = std::process::Command::new(emulate::QEMU)
        .args(["-M", Launch::F405.machine, "-nographic", "-monitor", "none"])
        .args(["-serial", "null", "-icount", "shift=0"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(image)
        .output()
        .expect("the emulator runs");
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).expect("text");
    let stages: Vec<Vec<&str>> = text.lines().map(|l| l.split(' ').collect()).collect();
    assert_eq!(stages.len(), lines, "{text}");
    for stage in stages {
        let [name, median, most] = stage[..] else {
            panic!("{text}")
        };
        for (what, count) in [("median", median), ("most", most)] {
            let count = count.parse().expect("a count");
            within_budget(&format!("{prefix}{name}_instructions_{what}"), count);
        }
    }
}

/// On both boards, in the image that has a log. The others hold no trace of it.
#[cfg(feature = "log")]
#[test]
fn the_log_tells_what_happened_and_in_which_period() {
    if runnable_images().is_none() {
        return;
    }
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("logging");
    for (target, launch) in [(image::F405, Launch::F405), (image::F100, Launch::F100)] {
        let log = ["--features", "log"];
        let image = image::build(target, Some(&directory), &log).expect("the firmware builds");
        let launch = Launch {
            logged: true,
            ..launch
        };
        let text = if target == image::F405 {
            logged::<f32>(&image, launch, parameters())
        } else {
            logged(&image, launch, fixed_point::parameters())
        };
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines,
            [
                "0 info started in the emulator",
                "1 info the drive is running",
                "6 error fault 7: gate-driver",
                "6 info the drive is faulted",
                "6 warn packet 14 refused: faults are latched",
                "6 info parameters stored",
            ],
        );
    }
}

/// What a board logs in six periods, of which the last brings a fault.
#[cfg(feature = "log")]
fn logged<T: Number>(image: &Path, launch: Launch, parameters: Parameters<T>) -> String {
    let mut board = Board::boot(image, launch, Transport::Fast).expect("the board greets");
    board
        .tell(Command::Set(parameters))
        .expect("valid parameters");
    board.tell(Command::Enable).expect("nothing is wrong");
    assert!((0..5).all(|_| healthy(&mut board).bridge));
    let sample = Sample {
        gate_fault: true,
        ..HEALTHY
    };
    assert!(!board.period(None, sample).expect("an answer").bridge);
    let refused = board.ask(Command::Enable).expect("an answer");
    assert_eq!(refused, Answer::Refused(Refusal::Faulted));
    board.tell(Command::Store).expect("they are stored");
    let frames = board.machine().take_log();
    emulate::decode(image, &frames).expect("a log")
}

/// Everything that uses the stack at once: closed loop and recording by the port's interrupt, telemetry, commands with the
/// largest answers, and the flash.
#[test]
fn the_stack_fits_its_budget() {
    let Some(mut board) = booted::<f32>(Transport::Serial) else {
        return;
    };
    board
        .tell(Command::Set(parameters()))
        .expect("valid parameters");
    board.tell(Command::Store).expect("they are stored");
    let selection = Selection::of(&Signal::ALL);
    board
        .tell(Command::Telemetry {
            selection,
            every: 3,
        })
        .expect("it is chosen");
    board.tell(Command::Enable).expect("nothing is wrong");
    run(&mut board, 100);
    // No more than the board lets wait: one more could be dropped.
    for command in [Command::Get, Command::Recorded] {
        board.send(command).expect("the line is open");
    }
    let Answer::Status { counters, .. } = board.ask(Command::Status).expect("an answer") else {
        panic!("no status")
    };
    within_budget("stack_bytes", counters.stack.into());
}

/// Prints a figure beside its budget and fails if it is larger.
fn within_budget(key: &str, used: u64) {
    let budget = include_str!("../firmware/budget.toml");
    let budget: toml_edit::DocumentMut = budget.parse().expect("the budget is TOML");
    let limit = budget[key].as_integer().expect("the budget is a number");
    let limit = u64::try_from(limit).expect("the budget is positive");
    println!("{key}: {used} of {limit}");
    assert!(
        used > 0 && used <= limit,
        "{key}: {used}, the budget is {limit}"
    );
}

/// The bytes of the sections that `counts` picks from those that exist on the target at all.
fn occupied(image: &object::File<'_>, counts: impl Fn(SectionKind, u64) -> bool) -> u64 {
    image
        .sections()
        .filter(|section| match section.flags() {
            SectionFlags::Elf { sh_flags } => {
                sh_flags & u64::from(elf::SHF_ALLOC) != 0 && counts(section.kind(), sh_flags)
            }
            _ => false,
        })
        .map(|section| section.size())
        .sum()
}

/// Everything with content, as also the initial values of variables are kept there.
fn in_flash(kind: SectionKind, _: u64) -> bool {
    kind != SectionKind::UninitializedData
}

/// Everything writable, with initial values or without.
fn in_ram(_: SectionKind, flags: u64) -> bool {
    flags & u64::from(elf::SHF_WRITE) != 0
}
