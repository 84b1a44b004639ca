//! The current loop: the image drives a motor whose winding is simulated, against what the sampled loop does in theory.

use bristle::emulate::{self, Driver, OnHost, Outcome, Plan, Sensors, Setup, Transport};
use bristle::model::Model;
use bristle::plant;
use bristle::tune::{Inner, Wish};
use bristle_core::control::SetPoint;
use bristle_core::drive::Parameters;
use bristle_core::link::{Answer, Command};

use crate::{SENSORS, assert_same, running};

/// Its torque constant makes 2 A of 0.1 N·m.
const MOTOR: &str = "[plant]\nkind = \"dc-motor\"\nmotion = \"rotary\"\ninput = \"voltage\"\ninertia = 2e-3\n\
    resistance = 1.3\ninductance = 2e-3\ntorque_constant = 0.05\n[friction]\ncoulomb = 0.01\nviscous = 2e-4\n";

/// The share of its error that the loop takes away in a sample.
const PACE: f64 = 0.2;

/// What the converter's rounding leaves, half of a count of 0.02 A, as the loop does not amplify what it measures, and as
/// much again for a back-EMF that changes by up to 4e-3 V in a sample.
const TOLERANCE: f64 = 0.02;

fn model() -> Model {
    Model::parse(MOTOR).expect("a model")
}

fn parameters() -> Parameters<f32> {
    let wish = Wish {
        bandwidth: 5.0,
        rate: 1000.0,
        counts: 16384.0,
        limit: 24.0,
        current: Some(Inner {
            bandwidth: PACE * 1000.0 / std::f64::consts::TAU,
            limit: Some(10.0),
        }),
    };
    let setup = Setup {
        wish,
        compensate: true,
    };
    emulate::parameters(&model(), &setup, &SENSORS).expect("a controller")
}

/// A run along torques, each for so many samples.
fn follow(driver: &mut dyn Driver<f32>, torques: &[(f32, usize)]) -> Outcome<f32> {
    let steps = torques.iter();
    let set_points: Vec<SetPoint<f32>> = steps
        .flat_map(|(torque, samples)| vec![SetPoint::Torque(*torque); *samples])
        .collect();
    drive(driver, set_points, SENSORS)
}

fn drive(
    driver: &mut dyn Driver<f32>,
    set_points: Vec<SetPoint<f32>>,
    sensors: Sensors,
) -> Outcome<f32> {
    let plan = Plan {
        t: (0..set_points.len()).map(|k| k as f64 * 1e-3).collect(),
        set_points,
        positions: Vec::new(),
        loads: Vec::new(),
        sensors,
    };
    let mut plant = plant::new(&model()).expect("a plant");
    let outcome = emulate::run(driver, plant.as_mut(), &plan).expect("a run");
    assert!(outcome.periods.iter().all(|p| p.bridge), "a fault");
    outcome
}

/// How far the current is from theory, at most, in `samples` from `first` on, at which `wanted` is asked for.
fn off(outcome: &Outcome<f32>, first: usize, samples: usize, wanted: f64) -> f64 {
    let current = &outcome.record.current;
    let start = wanted - current[first];
    (0..samples).fold(0.0, |most: f64, k| {
        let theory = wanted - start * (1.0 - PACE).powi(k as i32);
        most.max((current[first + k] - theory).abs())
    })
}

#[test]
fn a_torque_becomes_its_current_within_the_bandwidth_asked_for() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let steps = [(0.1, 60), (-0.1, 60), (0.0, 60)];
    let seen = follow(&mut board, &steps);
    for (k, wanted) in [2.0, -2.0, 0.0].into_iter().enumerate() {
        let off = off(&seen, 60 * k, 60, wanted);
        assert!(off < TOLERANCE, "{off} A from theory, asked for {wanted} A");
    }
    let mut host = OnHost::new(parameters()).expect("valid parameters");
    assert_same(&seen, &follow(&mut host, &steps));
    // The search does find what it looks for: a loop without gain lets the current be.
    let mut weak = parameters();
    weak.current.as_mut().expect("a loop").proportional = 1e-6;
    let mut weak = OnHost::new(weak).expect("valid parameters");
    assert!(off(&follow(&mut weak, &steps), 0, 60, 2.0) > 1.0);
}

/// Ten seconds of position control through the winding, where host and board are the same bits, and the axis follows.
#[test]
fn position_control_through_the_current_loop_equals_the_hosts_bit_for_bit() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let path = |k: usize| {
        let t = k as f64 * 1e-3;
        let (q, v, a) = (0.5 - 0.5 * t.cos(), 0.5 * t.sin(), 0.5 * t.cos());
        emulate::position(q, (v, a), SENSORS.count, &bristle::tune::SI)
    };
    let run =
        |driver: &mut dyn Driver<f32>| drive(driver, (0..10_000).map(path).collect(), SENSORS);
    let mut host = OnHost::new(parameters()).expect("valid parameters");
    let seen = run(&mut board);
    assert_same(&seen, &run(&mut host));
    let worst = (1000..10_000).fold(0.0_f64, |worst, k| {
        let aim = 0.5 - 0.5 * (k as f64 * 1e-3).cos();
        worst.max((seen.record.q[k] - aim).abs())
    });
    assert!(worst < 0.01, "{worst}");
}

#[test]
fn no_torque_asks_for_more_than_the_limit_of_current() {
    let mut host = OnHost::new(parameters()).expect("valid parameters");
    let seen = follow(&mut host, &[(5.0, 100)]);
    assert!(off(&seen, 0, 100, 10.0) < 0.1);
    assert!(seen.record.current.iter().all(|i| *i < 10.0 + TOLERANCE));
}

/// Along a torque for which the bus is too low once the axis turns: the input stays within 15/16 of the bus, and when the
/// torque turns round the current does so as fast as ever.
#[test]
fn a_low_bus_saturates_the_voltage_and_winds_nothing_up() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    let steps = [(0.4, 4000), (-0.1, 60)];
    let seen = follow(&mut board, &steps);
    // 24 V are 1600 counts of 0.015 V.
    let most = 24.0 * 15.0 / 16.0;
    assert!(seen.record.u.iter().all(|u| u.abs() <= most + 1e-5));
    assert!(
        seen.record.u[3000..4000]
            .iter()
            .all(|u| (u - most).abs() < 1e-5)
    );
    // Far from the 8 A asked for, as back-EMF takes most of the voltage.
    assert!(seen.record.current[3999] < 3.0);
    let off = off(&seen, 4000, 60, -2.0);
    assert!(off < 2.0 * TOLERANCE, "{off} A from theory");
    let mut host = OnHost::new(parameters()).expect("valid parameters");
    assert_same(&seen, &follow(&mut host, &steps));
}

/// Velocity control asks for a speed that the bus does not give, and then for one that it does: the velocity loop's integral
/// has not wound up meanwhile either.
#[test]
fn the_velocity_loop_above_does_not_wind_up_either() {
    let mut host = OnHost::new(parameters()).expect("valid parameters");
    let at = |velocity| SetPoint::Velocity {
        velocity,
        acceleration: 0.0,
    };
    let mut set_points = vec![at(600.0); 6000];
    set_points.extend(vec![at(200.0); 1500]);
    let seen = drive(&mut host, set_points, SENSORS);
    let speed = |k: usize| seen.record.truth[k].v;
    assert!(speed(5999) < 450.0, "{}", speed(5999));
    let lowest = (6000..7500).fold(f64::INFINITY, |least, k| least.min(speed(k)));
    assert!(lowest > 190.0, "{lowest}");
    assert!((speed(7499) - 200.0).abs() < 2.0, "{}", speed(7499));
}

/// A set with a current loop goes into the flash and comes back, and one out of range is refused.
#[test]
fn a_board_keeps_the_current_loop_and_refuses_a_bad_one() {
    let Some(mut board) = running(Transport::Fast, &parameters()) else {
        return;
    };
    board.tell(Command::Disable).expect("it is turned off");
    board.tell(Command::Store).expect("it is stored");
    board.restart().expect("the board starts anew");
    let held = board.ask(Command::Get).expect("an answer");
    assert_eq!(held, Answer::Parameters(parameters()));
    let mut bad = parameters();
    bad.current.as_mut().expect("a loop").reset = 1.5;
    assert!(board.tell(Command::Set(bad)).is_err());
}

/// The command, with and without the emulator, and what it refuses.
#[test]
fn the_command_runs_the_current_loop_with_and_without_the_emulator() {
    let Some(images) = crate::emulator::runnable_images() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("motor.toml"), MOTOR).expect("it is written");
    let image = images.firmware.to_str().expect("UTF-8");
    let run = |out: &str, more: &[&str]| {
        let mut arguments = vec!["emulate", "--model", "motor.toml", "--excite", "multisine"];
        arguments.extend([
            "--amplitude",
            "3",
            "--band",
            "0.5:5",
            "--duration",
            "2",
            "--limit",
            "24",
        ]);
        arguments.extend(["--out", out]);
        arguments.extend(more);
        crate::bristle(folder.path(), &arguments)
    };
    let bandwidth = ["--current-bandwidth", "30"];
    let written = |out: &str| std::fs::read(folder.path().join(out)).expect("it was written");
    assert_eq!(
        run("board.csv", &[&bandwidth[..], &["--image", image]].concat()).0,
        Some(0)
    );
    assert_eq!(
        run("host.csv", &[&bandwidth[..], &["--on-host"]].concat()).0,
        Some(0)
    );
    assert!(written("board.csv") == written("host.csv"));
    assert_eq!(run("voltage.csv", &["--on-host"]).0, Some(0));
    assert!(written("voltage.csv") != written("host.csv"));
    for (more, part) in [
        (&["--current-bandwidth", "50"][..], "39.7"),
        (
            &["--current-bandwidth", "30", "--current-limit", "60"],
            "--current-limit",
        ),
        (&["--current-limit", "5"], "--current-bandwidth"),
    ] {
        let (status, said) = run("bad.csv", &[more, &["--on-host"]].concat());
        assert!(status == Some(2) && said.contains(part), "{said}");
    }
    assert!(!folder.path().join("bad.csv").exists());
}
