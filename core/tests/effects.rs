//! What a diagnosis found, compensated: each effect on an axis that has it, with and without knowing it.

mod servo;

use bristle_core::Scalar;
use bristle_core::control::{
    Backlash, Controller, Driver, Effects, Harmonic, Learning, Method, Parameters, Position,
    SetPoint,
};
use servo::{Axis, COUNT, PERIOD, TRUTH, Truth, parameters};

const OMEGA: f64 = std::f64::consts::TAU * 0.2;

/// RMS error in counts over the second of two periods of a sine of 0.8 rad.
fn tracking(truth: &Truth, parameters: &Parameters<f64>) -> f64 {
    let mut controller = Controller::new(parameters.scaled::<f32>(&servo::SI).unwrap(), 0).unwrap();
    let mut axis = Axis {
        q: 0.5 * COUNT,
        ..Axis::default()
    };
    let (mut sum, mut n) = (0.0, 0.0);
    for k in 0..10_000 {
        let t = f64::from(k) * PERIOD;
        let (sine, cosine) = (OMEGA * t).sin_cos();
        let q = 0.8 * (1.0 - cosine);
        if t >= 5.0 {
            sum += ((q - (axis.q - 0.5 * COUNT)) / COUNT).powi(2);
            n += 1.0;
        }
        let set_point = SetPoint::Position {
            position: Position::from_f64(q / COUNT + 0.5),
            velocity: (0.8 * OMEGA * sine) as f32,
            acceleration: (0.8 * OMEGA * OMEGA * cosine) as f32,
        };
        let output = controller.step(Scalar::floor(axis.q / COUNT), set_point);
        axis.advance(truth, f64::from(output.command), PERIOD);
    }
    (sum / n).sqrt()
}

/// A wave of `periods` a turn with an amplitude at phase zero.
fn wave(periods: u32, amplitude: f64) -> Harmonic<f64> {
    Harmonic {
        cycle: periods << 20,
        sine: amplitude,
        cosine: 0.0,
    }
}

/// The tracking error without knowing an effect must be larger than with it by `factor`.
fn pays(other: fn(f64, f64) -> f64, effects: Effects<f64>, factor: f64) {
    let truth = Truth { other, ..TRUTH };
    let unaware = parameters(&TRUTH, 60.0);
    let aware = Parameters { effects, ..unaware };
    let (without, with) = (tracking(&truth, &unaware), tracking(&truth, &aware));
    assert!(factor * with < without, "{with} with, {without} without");
}

#[test]
fn gravity() {
    let mut effects = Effects::NONE;
    effects.waves[0] = wave(1, 0.15);
    pays(|q, _| 0.15 * q.sin(), effects, 3.0);
}

#[test]
fn cogging() {
    let mut effects = Effects::NONE;
    effects.waves[1] = wave(24, 0.08);
    pays(|q, _| 0.08 * (24.0 * q).sin(), effects, 3.0);
}

#[test]
fn a_spring() {
    pays(
        |q, _| 0.2 * q,
        Effects {
            stiffness: 0.2,
            ..Effects::NONE
        },
        3.0,
    );
}

#[test]
fn an_offset() {
    // While sliding the integral finds a constant; where the direction changes it does not matter. It pays at the start.
    pays(
        |_, _| 0.1,
        Effects {
            offset: 0.1,
            ..Effects::NONE
        },
        1.0,
    );
}

#[test]
fn viscous_asymmetry() {
    pays(
        |_, v| 0.1 * v.abs(),
        Effects {
            viscous_difference: 0.1,
            ..Effects::NONE
        },
        3.0,
    );
}

#[test]
fn friction_that_varies_with_position() {
    let effects = Effects {
        friction: wave(6, 0.1),
        ..Effects::NONE
    };
    let truth = Truth {
        wave: |q| 0.1 * (6.0 * q).sin(),
        ..TRUTH
    };
    let unaware = parameters(&TRUTH, 60.0);
    let aware = Parameters { effects, ..unaware };
    let (without, with) = (tracking(&truth, &unaware), tracking(&truth, &aware));
    assert!(3.0 * with < without, "{with} with, {without} without");
}

#[test]
fn an_offset_that_nobody_told_is_learned_by_rows() {
    let truth = Truth {
        other: |_, _| 0.08,
        ..TRUTH
    };
    let mut learning = parameters(&TRUTH, 60.0);
    learning.adaptation.method = Learning::Rows;
    learning.adaptation.offset = 0.5;
    let mut controller = Controller::new(learning, 0).unwrap();
    let mut axis = Axis {
        q: 0.5 * COUNT,
        ..Axis::default()
    };
    let mut last = None;
    for k in 0..8000 {
        let (sine, cosine) = (std::f64::consts::TAU * 0.5 * f64::from(k) * PERIOD).sin_cos();
        let set_point = SetPoint::Velocity {
            velocity: sine,
            acceleration: std::f64::consts::PI * cosine,
        };
        let output = controller.step(Scalar::floor(axis.q / COUNT), set_point);
        axis.advance(&truth, output.command, PERIOD);
        last = Some(output);
    }
    let output = last.unwrap();
    assert!(
        (output.offset - 0.08).abs() < 0.01 && (output.coulomb - 0.2).abs() < 0.02,
        "{output:?}"
    );
}

/// Motor and load with a gap between them: the load's largest error after each reversal, in counts.
fn load_error(backlash: Backlash<f64>) -> f64 {
    const GAP: f64 = 20.0 * COUNT;
    const LOAD: f64 = 0.8e-3;
    let mut with = parameters(&TRUTH, 120.0);
    with.effects.backlash = backlash;
    with.compensation.method = Method::Static;
    with.compensation.driver = Driver::Command;
    let mut controller = Controller::new(with, 0).unwrap();
    let motor_only = Truth {
        inertia: TRUTH.inertia - LOAD,
        ..TRUTH
    };
    let mut motor = Axis {
        q: 0.5 * COUNT,
        ..Axis::default()
    };
    let mut load = motor;
    let mut worst = 0.0_f64;
    for k in 0..10_000 {
        let t = f64::from(k) * PERIOD;
        let (sine, cosine) = (OMEGA * t).sin_cos();
        let q = 0.8 * (1.0 - cosine);
        // Away from the reversals, where the flank changes and nothing pushes the load.
        if t > 2.5 && sine.abs() > 0.3 {
            worst = worst.max(((q - (load.q - 0.5 * COUNT)) / COUNT).abs());
        }
        let set_point = SetPoint::Position {
            position: Position::from_f64(q / COUNT + 0.5),
            velocity: 0.8 * OMEGA * sine,
            acceleration: 0.8 * OMEGA * OMEGA * cosine,
        };
        let output = controller.step(Scalar::floor(motor.q / COUNT), set_point);
        motor.advance(&motor_only, output.command, PERIOD);
        // The load is carried by whichever flank it leans on, and light friction of its own keeps it there.
        let free = load.q;
        load.q = free.clamp(motor.q - 0.5 * GAP, motor.q + 0.5 * GAP);
        if load.q == free {
            load.v = 0.0;
        } else {
            let both = (motor_only.inertia * motor.v + LOAD * load.v) / TRUTH.inertia;
            (motor.v, load.v) = (both, both);
        }
    }
    worst
}

#[test]
fn the_load_behind_a_gap_follows_if_the_gap_is_known() {
    let known = Backlash {
        gap: 20.0,
        inertia: 0.8e-3,
        speed: 1.0,
    };
    let (without, with) = (load_error(Backlash::NONE), load_error(known));
    // Half of the gap of 20 counts is lost without.
    assert!(
        without > 8.0 && with < 0.3 * without,
        "{with} with, {without} without"
    );
}
