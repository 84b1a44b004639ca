//! The plants against what is known of them: closed solutions, an independent solver, and convergence.

use std::f64::consts::TAU;

use bristle::axis::Axis;
use bristle::effects::{self, Coupling};
use bristle::model::Model;
use bristle::plant::{DcMotor, WheelSlip, geared_servo, mass_spring};
use bristle::step::{Drive, Loaded, Mechanism, Memory, State, advance};
use bristle_core::friction::Curve;
use differential_equations::prelude::{ExplicitRungeKutta, IVP};

fn model(text: &str) -> Model {
    Model::parse(text).expect("the model parses")
}

/// A mass of 2 kg on a spring of 50 N/m.
fn spring(friction: &str) -> Axis {
    mass_spring(&model(&format!(
        "[plant]\nkind = \"mass-spring\"\nmotion = \"linear\"\ninertia = 2.0\nstiffness = 50.0\n[friction]\n{friction}"
    )))
    .expect("the model is complete")
}

const MOTOR: &str = "resistance = 2.6\ninductance = 0.18e-3\ntorque_constant = 7.68e-3\n";

fn motor(friction: &str) -> DcMotor {
    motor_with(MOTOR, friction)
}

fn motor_with(winding: &str, friction: &str) -> DcMotor {
    DcMotor::new(&model(&format!(
        "[plant]\nkind = \"dc-motor\"\nmotion = \"rotary\"\ninertia = 2e-5\n{winding}[friction]\n{friction}"
    )))
    .expect("the model is complete")
}

fn wheel(friction: &str, drag: f64) -> WheelSlip {
    WheelSlip::new(&model(&format!(
        "[plant]\nkind = \"wheel-slip\"\nmotion = \"linear\"\ninertia = 600.0\nwheel_mass = 900.0\nvehicle_mass = 18000.0\n\
         axle_stiffness = 8e6\naxle_damping = 4e3\nvehicle_drag = {drag}\n[friction]\n{friction}"
    )))
    .expect("the model is complete")
}

const STRIBECK: &str =
    "model = \"stribeck\"\ncoulomb = 3.0\nviscous = 0.4\nstatic = 5.0\nstribeck_velocity = 0.1\n";
const DAHL: &str = "model = \"dahl\"\ncoulomb = 3.0\nviscous = 0.4\nbristle_stiffness = 5e3\n";
const LUGRE: &str = "model = \"lugre\"\ncoulomb = 3.0\nviscous = 0.4\nstatic = 5.0\nstribeck_velocity = 0.1\nbristle_stiffness = 5e3\nbristle_damping = 60\n";

/// Runs a mechanism through `n` steps of `h`, driven by `u(t)` held over each step.
fn run<const N: usize>(
    plant: &impl Mechanism<N>,
    from: [f64; N],
    (n, h): (usize, f64),
    u: impl Fn(f64) -> f64,
) -> Vec<Memory<N>> {
    let mut state = Memory { x: from, z: 0.0 };
    let mut states = vec![state];
    for k in 0..n {
        let drive = Drive {
            t: (k as f64 + 0.5) * h,
            dt: h,
            u: u(k as f64 * h),
            load: 0.0,
        };
        state = advance(plant, drive, state, h);
        states.push(state);
    }
    states
}

fn close(a: f64, b: f64, tolerance: f64) {
    assert!(
        (a - b).abs() <= tolerance,
        "{a} and {b}, off by {:e}",
        a - b
    );
}

#[test]
fn free_decay_on_a_spring_loses_the_same_at_every_turn() {
    // Each half swing is a sine about ±Fc/k, so turning points lie 2·Fc/k nearer: 0.9, 0.66, 0.42, 0.18 m with
    // Fc/k = 0.12 m, and the next, at 0.06 m, is inside the sticking band ±Fc/k: the mass stays there. Half swings last
    // π·√(m/k), whatever their size.
    let plant = spring("coulomb = 6.0\nviscous = 0.0\n");
    let half = std::f64::consts::PI * (2.0_f64 / 50.0).sqrt();
    let per = 500;
    let states = run(&plant, [0.9, 0.0], (6 * per, half / per as f64), |_| 0.0);
    for (k, turn) in [0.9, -0.66, 0.42, -0.18].into_iter().enumerate() {
        close(states[k * per].x[0], turn, 1e-9);
    }
    // From −0.18 m the spring pulls with 9 N against 6 N, about the centre −0.12 m, to −0.06 m.
    close(states[4 * per].x[0], -0.06, 1e-9);
    assert!(
        states[4 * per + 1..]
            .iter()
            .all(|s| s.x == states[6 * per].x && s.x[1] == 0.0)
    );
}

#[test]
fn quasi_static_stick_slip_has_the_period_of_theory() {
    // The free end of the spring moves at V (force K·V·t): the mass breaks away at Fs, swings half a turn about Fc and
    // sticks 2·(Fs − Fc)/k further, where the spring must wind up by as much again. A mass that slips while the end
    // moves on makes a slip of (π + 2·atan(..)) with corrections of order V·√(m·k)/(Fs − Fc) = 1e-3 here.
    let text = "model = \"stribeck\"\ncoulomb = 6.0\nviscous = 0.0\nstatic = 10.0\nstribeck_velocity = 1e-4\n";
    let plant = spring(text);
    let (velocity, k, m) = (4e-4, 50.0_f64, 2.0_f64);
    let h = 0.01;
    let states = run(&plant, [0.0, 0.0], (200_000, h), |t| k * velocity * t);
    let slips: Vec<usize> = (1..states.len())
        .filter(|&j| states[j - 1].x[1] == 0.0 && states[j].x[1] > 0.0)
        .collect();
    assert!(slips.len() > 3, "{}", slips.len());
    let stick = 2.0 * (10.0 - 6.0) / (k * velocity);
    let slip = std::f64::consts::PI * (m / k).sqrt();
    for pair in slips[1..].windows(2) {
        close((pair[1] - pair[0]) as f64 * h, stick + slip, 2e-3 * stick);
        let jump = states[pair[1] - 1].x[0] - states[pair[0] - 1].x[0];
        close(jump, 2.0 * (10.0 - 6.0) / k, 2e-3 * 0.16);
    }
}

#[test]
fn a_motor_breaks_away_at_the_instant_that_its_current_says() {
    // Stuck, i = V/R·(1 − e^(−R·t/L)), and the rotor lets go when kt·i reaches Fc.
    let plant = motor("coulomb = 1.5e-3\nviscous = 0.0\n");
    let (r, l, kt, voltage) = (2.6_f64, 0.18e-3_f64, 7.68e-3_f64, 1.0_f64);
    let instant = -l / r * (1.0 - r * 1.5e-3 / (kt * voltage)).ln();
    // From then on ω̇ = (kt·i − Fc)/J ≈ kt·(di/dt)·τ/J, so that ω = ½·a·τ² tells the instant from a state just after.
    let slope = kt * (voltage - r * 1.5e-3 / kt) / l / 2e-5;
    for share in [0.05, 0.1] {
        let late = share * l / r;
        let end = run(&plant, [0.0; 3], (1, instant + late), |_| voltage)[1].x;
        let found = instant + late - (2.0 * end[1] / slope).sqrt();
        // The current's curvature takes a sixth of the share, in second order, off the rate at which torque rises.
        close(found, instant, 0.2 * share * late);
    }
    let before = run(&plant, [0.0; 3], (1, 0.999_9 * instant), |_| voltage)[1].x;
    assert!(before[1] == 0.0);
}

#[test]
fn a_motor_settles_where_its_torques_balance() {
    // ω = (kt·V/R − Fc)/(Fv + kt·ke/R)
    let plant = motor("coulomb = 1.5e-3\nviscous = 2e-6\n");
    let end = *run(&plant, [0.0; 3], (20_000, 1e-3), |_| 6.0)
        .last()
        .expect("states");
    let torque = 7.68e-3 * 6.0 / 2.6 - 1.5e-3;
    close(end.x[1], torque / (2e-6 + 7.68e-3 * 7.68e-3 / 2.6), 1e-6);
}

#[test]
fn the_servo_of_the_data_sheet_is_the_motor_that_its_output_shaft_feels() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/srv02.toml");
    let mut truth = Model::read(path.as_ref()).expect("the example is a model");
    truth.coulomb.value = Some(0.0);
    let plant = geared_servo(&truth).expect("the example is complete");
    // J = Jl + ηg·N²·Jm, and ω/V = kt′/(R·Fv + kt′·ke′) with kt′ = ηg·ηm·N·kt and ke′ = N·ke.
    let (kt, ke) = (0.90 * 0.69 * 70.0 * 7.68e-3, 70.0 * 7.68e-3);
    close(plant.axis.inertia, 5.3e-5 + 0.90 * 4900.0 * 4.61e-7, 1e-15);
    let end = *run(&plant, [0.0; 3], (1000, 1e-3), |_| 1.0)
        .last()
        .expect("states");
    close(end.x[1], kt / (2.6 * 0.015 + kt * ke), 1e-9);
}

#[test]
fn a_wheel_rolls_with_its_vehicle_until_adhesion_is_lost() {
    let adhesion = "model = \"stribeck\"\ncoulomb = 12e3\nviscous = 0.0\nstatic = 30e3\nstribeck_velocity = 5.0\n";
    let plant = wheel(adhesion, 0.0);
    let pull = |force: f64| {
        run(&plant, [0.0, 1.0, 0.0, 1.0, 1.0], (2000, 1e-3), move |t| {
            force * (t / 0.5).min(1.0)
        })
    };
    let mass = 600.0 + 900.0 + 18_000.0;
    for (force, holds) in [(20e3, true), (34e3, false)] {
        let states = pull(force);
        let end = states.last().expect("states").x;
        // Adhesion is internal: momentum is what the drive gave, ∫u dt, whether the wheel slips or not.
        let given: f64 = (0..2000)
            .map(|k| force * (f64::from(k) * 2e-3).min(1.0) * 1e-3)
            .sum();
        let momentum = 600.0 * end[1] + 900.0 * end[3] + 18_000.0 * end[4];
        close(momentum - mass, given, 1e-6 * given);
        assert_eq!(states.iter().all(|s| s.x[3] == s.x[4]), holds, "{end:?}");
        // Beyond the limit of 30 kN on wheel and vehicle the falling branch lets the wheel run away.
        assert!(holds || end[3] - end[4] > 2.0, "{end:?}");
    }
}

/// The state after `t` seconds, the deflection of the bristles last, by an adaptive method of order 8 that knows nothing
/// of ours: `M = N + 1`.
fn oracle<P: Mechanism<N>, const N: usize, const M: usize>(
    plant: &P,
    u: fn(f64) -> f64,
    from: [f64; N],
    t: f64,
) -> [f64; M] {
    let rate = |t: f64, y: &[f64; M], dy: &mut [f64; M]| {
        let x: [f64; N] = std::array::from_fn(|k| y[k]);
        let at = plant.sliding(&x);
        let contact = plant.contact();
        let drive = Drive {
            t,
            u: u(t),
            ..Drive::default()
        };
        let mut friction = contact.resistance(plant.moment(drive, &x), at, at.v.signum());
        if let Some(law) = contact.bristles() {
            friction += law.force(y[N], at.v);
            dy[N] = law.rate(y[N], at.v);
        }
        dy[..N].copy_from_slice(&plant.rate(drive, &x, friction));
    };
    let start = std::array::from_fn(|k| if k < N { from[k] } else { 0.0 });
    let method = ExplicitRungeKutta::dop853()
        .rtol(1e-12)
        .atol(1e-14)
        .max_steps(1_000_000);
    let solution = IVP::ode_from_fn(rate, 0.0, t, start).method(method).solve();
    *solution
        .expect("the oracle arrives")
        .y
        .last()
        .expect("the oracle has an end")
}

/// The differences of runs with `h`, `h/2`, `h/4`, … from the oracle, in the first two variables.
fn errors<P: Mechanism<N>, const N: usize, const M: usize>(
    plant: &P,
    u: fn(f64) -> f64,
    from: [f64; N],
    t: f64,
    steps: &[usize],
) -> Vec<f64> {
    let truth: [f64; M] = oracle(plant, u, from, t);
    let error = |&n: &usize| {
        let end = *run(plant, from, (n, t / n as f64), u)
            .last()
            .expect("states");
        (end.x[0] - truth[0]).hypot(end.x[1] - truth[1])
    };
    steps.iter().map(error).collect()
}

#[test]
fn sliding_is_of_fourth_order() {
    // From 3 m/s the mass slides one way for all of the 0.15 s: a smooth problem.
    let plant = spring(STRIBECK);
    let errors = errors::<_, 2, 3>(&plant, |_| 0.0, [0.0, 3.0], 0.15, &[5, 10, 20, 40]);
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(order > 3.6 && order < 4.5, "{errors:?}");
    }
}

#[test]
fn bristles_are_of_second_order() {
    for law in [DAHL, LUGRE, &LUGRE.replace("lugre", "modified-lugre")] {
        let plant = spring(law);
        // Bristles that start to slide one way: no reversal.
        let errors = errors::<_, 2, 3>(&plant, |_| 20.0, [0.0, 0.0], 0.3, &[400, 800, 1600, 3200]);
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!(order > 1.8 && order < 2.3, "{law}: {errors:?}");
        }
    }
}

#[test]
fn every_plant_agrees_with_an_independent_solver() {
    // Reversals, presliding and slip; a constant drive, as the steps hold it. The difference is that of second order
    // at ω·h = 0.05 and less.
    for law in [DAHL, LUGRE, &LUGRE.replace("lugre", "modified-lugre")] {
        let plant = spring(law);
        for error in errors::<_, 2, 3>(&plant, |_| 12.0, [0.4, 0.0], 2.0, &[2000, 200]) {
            assert!(error < 2e-4, "{law}: {error:e}");
        }
    }
    let small = "model = \"lugre\"\ncoulomb = 1e-3\nviscous = 1e-6\nstatic = 2e-3\nstribeck_velocity = 1.0\nbristle_stiffness = 1.0\nbristle_damping = 1e-3\n";
    let plant = motor(small);
    for error in errors::<_, 3, 4>(&plant, |_| 1.0, [0.0; 3], 0.1, &[100, 1000]) {
        assert!(error < 1e-3, "motor: {error:e}");
    }
    let adhesion = "model = \"lugre\"\ncoulomb = 12e3\nviscous = 0.0\nstatic = 30e3\nstribeck_velocity = 5.0\nbristle_stiffness = 2e7\nbristle_damping = 1e4\n";
    let plant = wheel(adhesion, 50.0);
    for error in errors::<_, 5, 6>(
        &plant,
        |_| 40e3,
        [0.0, 1.0, 0.0, 1.0, 1.0],
        1.0,
        &[1000, 4000],
    ) {
        assert!(error < 2e-3, "wheel: {error:e}");
    }
}

#[test]
fn sticking_and_slipping_do_not_depend_on_the_step() {
    // 8 s with reversals, standstills and break-aways under a drive that switches every second.
    let u = |t: f64| 14.0 * (1.3 * (t + 1e-9).floor() + 0.5).sin();
    let plant = spring(STRIBECK);
    let steps = [16, 64, 800, 8000];
    let runs = steps.map(|n| run(&plant, [0.0; 2], (n, 8.0 / n as f64), u));
    let ends = runs.each_ref().map(|states| states[states.len() - 1].x);
    let rests = runs[3].iter().filter(|s| s.x[1] == 0.0).count();
    assert!(rests > 1000 && rests < 7000, "{rests}");
    // Long steps are cut into substeps and at every event: the error is small from steps of half a second
    // on, and vanishes with them.
    let errors = ends.map(|end| (end[0] - ends[3][0]).abs());
    assert!(
        errors[0] < 1e-3 && errors[1] < 2e-5 && errors[2] < 1e-6,
        "{errors:?}"
    );
}

#[test]
fn stiff_bristles_do_not_blow_up() {
    // σ0·|v|·h/g = 1e6·10·1e-3/5 = 2000 at m = 2000 kg; ½·m·v² falls as Coulomb and viscous friction say.
    let text = "[plant]\nmotion = \"linear\"\ninertia = 2000.0\n[friction]\nmodel = \"lugre\"\ncoulomb = 5.0\nviscous = 0.0\nstatic = 5.0\nstribeck_velocity = 1.0\nbristle_stiffness = 1e6\nbristle_damping = 100\n";
    let plant = Axis::simulated(&model(text)).expect("the model is complete");
    let start = Memory::at_ease(&plant, State { q: 0.0, v: 10.0 });
    let mut state = start;
    for _ in 0..1000 {
        state = advance(&plant, Drive::default(), state, 1e-3);
        assert!(state.z.abs() <= 5.0 / 1e6 * (1.0 + 1e-12));
    }
    close(state.x[1], 10.0 - 5.0 / 2000.0, 1e-9);
}

#[test]
fn bristles_too_stiff_to_follow_act_as_dry_friction() {
    // √(σ0/m)·h = 1e4 and, damped, σ1/m·h = 1e7: no step resolves either. What is left of the bristles at this scale is the law
    // that sticks and slides, under a drive that breaks away, reverses and rests.
    let u = |t: f64| 14.0 * (1.3 * (t + 1e-9).floor() + 0.5).sin();
    let law = |bristles: &str| format!("coulomb = 4.0\nviscous = 0.5\n{bristles}");
    let steps = (8000, 1e-3);
    let dry = run(&spring(&law("")), [0.0; 2], steps, u);
    let rests = dry.iter().filter(|s| s.x[1] == 0.0).count();
    assert!(rests > 1000 && rests < 7000, "{rests}");
    for damping in [
        "",
        "static = 4.0\nstribeck_velocity = 0.1\nbristle_damping = 1e10\n",
    ] {
        let model = if damping.is_empty() { "dahl" } else { "lugre" };
        let text = format!("model = \"{model}\"\nbristle_stiffness = 1e14\n{damping}");
        let stiff = run(&spring(&law(&text)), [0.0; 2], steps, u);
        for (a, b) in stiff.iter().zip(&dry) {
            assert!(
                (a.x[0] - b.x[0]).abs() < 1e-4,
                "{model}: {} for {}",
                a.x[0],
                b.x[0]
            );
        }
    }
}

/// What soars with the first bit of speed lets the driven side creep by a few µrad, while the load swings as on a wall: `√(k/J_L)`
/// is 5 Hz.
#[test]
fn a_load_swings_on_while_the_driven_side_creeps() {
    let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\nmodel = \"coulomb-viscous\"\ncoulomb = 0.0\nviscous = 0.0\n[effects.power-law-viscous]\ncoefficient = 5.0\nexponent = 0.3\n";
    let axis = Axis::simulated(&model(text)).expect("the model is complete");
    let inertia = 0.004;
    let coupling = Coupling {
        inertia,
        stiffness: inertia * (TAU * 5.0).powi(2),
        damping: 0.0,
        gap: 0.0,
        friction: 0.0,
        viscous: 0.0,
        load_side: false,
    };
    let loaded = Loaded::new(axis, coupling);
    let at_rest = State { q: 0.0, v: 0.0 };
    let mut state = Memory {
        x: loaded.carrying(at_rest, [0.1, 0.0]),
        z: 0.0,
    };
    for turn in 1..=4 {
        for _ in 0..100 {
            state = advance(&loaded, Drive::default(), state, 1e-3);
        }
        let ahead = if turn % 2 == 0 { 0.1 } else { -0.1 };
        assert!((state.x[2] - ahead).abs() < 1e-3, "{:?}", state.x);
        assert!(state.x[0].abs() < 1e-4, "{:?}", state.x);
    }
}

/// Of 0.1 N·m of friction 0.06 is that of a load beyond a gap. Pushing it the driven side stands against 0.08 N·m; away from it
/// that side has 0.04 to overcome and 0.006 kg·m² to move, and the load stays where it is.
#[test]
fn a_load_with_friction_of_its_own_stands_while_the_driven_side_leaves_it() {
    let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\nmodel = \"coulomb-viscous\"\ncoulomb = 0.1\nviscous = 0.0\n";
    let after = |u: f64| {
        let axis = Axis::simulated(&model(text)).expect("the model is complete");
        let coupling = Coupling {
            inertia: 0.004,
            stiffness: 0.004 * 2000.0 * 2000.0,
            damping: 2.0 * 0.004 * 2000.0,
            gap: 0.2,
            friction: 0.06,
            viscous: 0.0,
            load_side: false,
        };
        let loaded = Loaded::new(axis, coupling);
        let mut state = Memory {
            x: loaded.carrying(State { q: 0.0, v: 0.0 }, [-0.1, 0.0]),
            z: 0.0,
        };
        let drive = Drive {
            u,
            ..Drive::default()
        };
        for _ in 0..200 {
            state = advance(&loaded, drive, state, 1e-3);
        }
        state.x
    };
    let [q, v, ..] = after(0.08);
    assert_eq!([q, v], [0.0, 0.0]);
    let [q, v, ahead, _] = after(-0.08);
    let acceleration = -(0.08 - 0.04) / 0.006;
    assert!((v / (0.2 * acceleration) - 1.0).abs() < 1e-3, "{v}");
    assert!((q / (0.02 * acceleration) - 1.0).abs() < 1e-3, "{q}");
    assert!((q + ahead + 0.1).abs() < 1e-6, "{ahead}");
    // Both together: 0.02 N·m beyond all friction on 0.01 kg·m².
    let [_, v, ..] = after(0.12);
    assert!((v / (0.2 * 0.02 / 0.01) - 1.0).abs() < 0.02, "{v}");
}

#[test]
fn a_mechanism_too_fast_to_follow_has_no_state() {
    // R/L·h = 2.6e9·1e-3: steps that neither resolve the winding nor solve its equation would only look like motion.
    let law = "model = \"dahl\"\ncoulomb = 1e-3\nviscous = 1e-6\nbristle_stiffness = 1.0\n";
    let plant = motor_with(&MOTOR.replace("0.18e-3", "1e-9"), law);
    let states = run(&plant, [0.0; 3], (2, 1e-3), |_| 1.0);
    assert!(
        states[1..]
            .iter()
            .all(|s| s.x[0].is_nan() && s.x[1].is_nan())
    );
}

#[test]
fn every_effect_acts_on_every_plant_or_is_refused_by_name() {
    let motor = format!("motion = \"rotary\"\ninertia = 0.01\n{MOTOR}");
    let plants = [
        ("axis", "motion = \"rotary\"\ninertia = 0.01\n".to_owned()),
        ("mass-spring", "motion = \"rotary\"\ninertia = 0.01\nstiffness = 1.0\n".to_owned()),
        ("dc-motor", motor.clone()),
        ("geared-servo", format!("{motor}gear_ratio = 10\nmotor_inertia = 1e-6\n")),
        ("wheel-slip", "motion = \"linear\"\ninertia = 0.01\nwheel_mass = 0.01\nvehicle_mass = 0.1\naxle_stiffness = 10\n".to_owned()),
    ];
    let laws = [
        "coulomb = 0.05\nviscous = 0.01\n",
        "model = \"dahl\"\ncoulomb = 0.05\nviscous = 0.01\nbristle_stiffness = 50\n",
    ];
    let mut refused = Vec::new();
    for effect in effects::ALL {
        let values = effect
            .parameters()
            .iter()
            .map(|p| format!("{} = 0.6\n", p.name));
        let section = format!("[effects.{}]\n{}", effect.id(), values.collect::<String>());
        for (kind, plant) in &plants {
            for law in laws {
                let text = format!("[plant]\nkind = \"{kind}\"\n{plant}[friction]\n{law}{section}");
                let model = match Model::parse(&text) {
                    Ok(model) => model,
                    Err(what) => {
                        assert!(what.contains(effect.id()), "{what}");
                        let turning = ["gravity", "sensor-eccentricity"];
                        let turns = turning.contains(&effect.id()) && *kind == "wheel-slip";
                        let twice = effect.id() == "presliding" && law.contains("dahl");
                        assert!(turns || twice, "{text}");
                        continue;
                    }
                };
                match bristle::plant::new(&model) {
                    Ok(mut plant) => {
                        let t: Vec<f64> = (0..400).map(|k| f64::from(k) * 1e-3).collect();
                        (0..399).for_each(|k| plant.advance(&t, &[0.4; 400], k, 0.0));
                        let end = plant.measured();
                        assert!(end.q.is_finite() && end.v.is_finite(), "{text}");
                    }
                    Err(error) => {
                        assert!(error.to_string().contains(effect.id()), "{error}");
                        refused.push((effect.id(), *kind));
                    }
                }
            }
        }
    }
    // What is friction, and so would act beside the wheel's adhesion: presliding repeats the law of Dahl.
    let of = |id: &str| refused.iter().filter(|(other, _)| *other == id).count();
    assert_eq!((of("stribeck"), of("presliding")), (2, 1));
    let varying = [
        "thermal-drift",
        "position-dependent-friction",
        "load-dependent-friction",
    ];
    assert!(varying.iter().all(|id| of(id) == 2), "{refused:?}");
    // A load is part of the inertia, and 0.6 is more than there is.
    assert_eq!((of("backlash"), of("compliance")), (10, 10));
    assert_eq!(refused.len(), 29, "{refused:?}");
}

#[test]
fn both_curves_of_lugre_bend_twice_and_the_modified_one_lies_above() {
    // The source says of the modified law that its response is faster and that it has no inflection points. With equal
    // parameters neither holds of the curve itself: e^(−x²) turns at x = 1/√2 and 1/(1 + x²) at x = 1/√3, and as
    // e^x² ≥ 1 + x² the rational level is the higher one, where bristles need g(v)/(σ0·|v|) and so longer to bend.
    for (curve, turn) in [
        (Curve::Exponential, 0.5_f64.sqrt()),
        (Curve::Rational, (1.0_f64 / 3.0).sqrt()),
    ] {
        let bend = |x: f64| {
            let d = |x: f64| -> f64 { curve.decay(x) };
            d(x + 1e-3) - 2.0 * d(x) + d(x - 1e-3)
        };
        assert!(bend(turn - 0.01) < 0.0 && bend(turn + 0.01) > 0.0);
    }
    for k in 1..100 {
        let x = f64::from(k) * 0.05;
        let (gauss, rational): (f64, f64) = (Curve::Exponential.decay(x), Curve::Rational.decay(x));
        assert!(rational > gauss);
    }
}
