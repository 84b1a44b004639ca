//! Controllers on a simulated axis: what they achieve, and what they must never do.

mod servo;

use bristle_core::Scalar;
use bristle_core::control::{
    Compensation, Controller, Driver, Learning, Method, Output, Parameters, Position, SetPoint,
};
use bristle_core::friction::Units;
use bristle_core::scalar::Q16;
use servo::{Axis, COUNT, PERIOD, SI, TRUTH, Truth, parameters};

/// A set point in SI units.
#[derive(Clone, Copy)]
struct Wanted {
    q: f64,
    v: f64,
    a: f64,
}

/// A sine of 0.5 rad at 0.2 Hz.
fn sine(t: f64) -> Wanted {
    let omega = std::f64::consts::TAU * 0.2;
    Wanted {
        q: 0.5 * (1.0 - (omega * t).cos()),
        v: 0.5 * omega * (omega * t).sin(),
        a: 0.5 * omega * omega * (omega * t).cos(),
    }
}

/// Units for fixed point: 0.2 N·m, eight counts, and a time of 12 ms.
const SCALED: Units = Units {
    force: 0.2,
    position: 8.0 * COUNT,
    velocity: 1.0,
};

/// Runs an axis for `seconds` under control; true states and outputs of each sample.
fn run<T: Scalar>(
    truth: impl Fn(f64) -> Truth,
    parameters: &Parameters<f64>,
    units: &Units,
    seconds: f64,
    wanted: impl Fn(f64) -> Wanted,
) -> Vec<(Axis, Output<T>)> {
    let mut controller = Controller::new(parameters.scaled::<T>(units).unwrap(), 0).unwrap();
    let mut axis = Axis {
        q: 0.5 * COUNT,
        ..Axis::default()
    };
    let samples = (seconds / PERIOD).round() as u32;
    let mut out = Vec::new();
    for k in 0..samples {
        let t = f64::from(k) * PERIOD;
        let counts = Scalar::floor(axis.q / COUNT);
        let aim = wanted(t);
        let set_point = SetPoint::Position {
            position: Position::from_f64(aim.q / COUNT + 0.5),
            velocity: T::from_f64(aim.v / units.velocity),
            acceleration: T::from_f64(aim.a * units.time() / units.velocity),
        };
        let output = controller.step(counts, set_point);
        assert!(output.finite);
        out.push((axis, output));
        // `u` keeps its own unit, and a gain of 1 makes it the torque.
        axis.advance(&truth(t), output.command.to_f64(), PERIOD);
    }
    out
}

/// RMS of the true position error in counts after `from` seconds.
fn rms<T>(run: &[(Axis, T)], from: f64, wanted: impl Fn(f64) -> Wanted) -> f64 {
    let first = (from / PERIOD) as usize;
    let errors = run.iter().enumerate().skip(first).map(|(k, (axis, _))| {
        let error = (wanted(k as f64 * PERIOD).q - (axis.q - 0.5 * COUNT)) / COUNT;
        error * error
    });
    (errors.sum::<f64>() / (run.len() - first) as f64).sqrt()
}

fn without(parameters: &Parameters<f64>) -> Parameters<f64> {
    let mut parameters = *parameters;
    parameters.compensation.method = Method::Off;
    // The observer may know friction all the same: it is the controller that differs.
    parameters
}

#[test]
fn compensation_takes_most_of_the_error_away() {
    let with = parameters(&TRUTH, 120.0);
    let compensated = rms(&run::<f64>(|_| TRUTH, &with, &SI, 10.0, sine), 1.0, sine);
    let plain = rms(
        &run::<f64>(|_| TRUTH, &without(&with), &SI, 10.0, sine),
        1.0,
        sine,
    );
    assert!(compensated < 0.2 * plain, "{compensated} {plain}");
}

/// The level learned at 2 s, before a change from 0.2 to 0.3 N·m at 10 s, and two seconds after it.
fn levels<T: Scalar>(method: Learning, start: f64, units: &Units) -> [f64; 3] {
    let changed = |t: f64| Truth {
        coulomb: if t < 10.0 { 0.2 } else { 0.3 },
        static_level: if t < 10.0 { 0.2 } else { 0.3 },
        ..TRUTH
    };
    let mut learning = parameters(&TRUTH, 120.0);
    learning.adaptation.method = method;
    learning.friction.coulomb = start;
    learning.friction.static_level = start;
    let run = run::<T>(changed, &learning, units, 20.0, sine);
    [2.0, 9.9, 12.0].map(|t| run[(t / PERIOD) as usize].1.coulomb.to_f64() * units.force)
}

#[test]
fn the_level_is_learned_within_two_seconds_from_anywhere() {
    for method in [Learning::Observer, Learning::Rows] {
        for start in [0.02, 0.2, 0.4] {
            for levels in [
                levels::<f64>(method, start, &SI),
                levels::<f32>(method, start, &SI),
                levels::<Q16>(method, start, &SCALED),
            ] {
                for (level, truth) in levels.into_iter().zip([0.2, 0.2, 0.3]) {
                    assert!(
                        (level - truth).abs() < 0.1 * truth,
                        "{method:?} from {start}: {levels:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn single_precision_and_fixed_point_control_as_well_as_double() {
    let mut with = parameters(&TRUTH, 120.0);
    with.adaptation.method = Learning::Observer;
    let double = rms(&run::<f64>(|_| TRUTH, &with, &SI, 10.0, sine), 1.0, sine);
    let single = rms(&run::<f32>(|_| TRUTH, &with, &SI, 10.0, sine), 1.0, sine);
    let fixed = rms(
        &run::<Q16>(|_| TRUTH, &with, &SCALED, 10.0, sine),
        1.0,
        sine,
    );
    assert!(single < 1.3 * double && fixed < 1.5 * double);
}
/// A smooth move of 0.5 rad in a second, then standstill.
fn settle(t: f64) -> Wanted {
    if t >= 1.0 {
        return Wanted {
            q: 0.5,
            v: 0.0,
            a: 0.0,
        };
    }
    let omega = std::f64::consts::PI;
    Wanted {
        q: 0.25 * (1.0 - (omega * t).cos()),
        v: 0.25 * omega * (omega * t).sin(),
        a: 0.25 * omega * omega * (omega * t).cos(),
    }
}

/// Largest error and travel in counts over the last second of a run.
fn standstill<T>(run: &[(Axis, T)]) -> (f64, f64) {
    let last = &run[run.len() - 1000..];
    let error = |q: f64| (0.5 - (q - 0.5 * COUNT)).abs() / COUNT;
    let worst = last
        .iter()
        .map(|(axis, _)| error(axis.q))
        .fold(0.0, f64::max);
    let travel = last.windows(2).map(|w| (w[1].0.q - w[0].0.q).abs() / COUNT);
    (worst, travel.sum())
}

#[test]
fn no_parameter_error_up_to_30_percent_makes_a_limit_cycle() {
    let mut worst = (0.0_f64, 0.0_f64);
    for error in [0.7, 0.85, 1.0, 1.15, 1.3] {
        for inertia in [0.7, 1.0, 1.3] {
            for stribeck in [1.0, 1.15, 1.3] {
                for method in [Learning::Off, Learning::Observer, Learning::Rows] {
                    let truth = Truth {
                        coulomb: TRUTH.coulomb * error,
                        static_level: TRUTH.coulomb * error * stribeck,
                        inertia: TRUTH.inertia * inertia,
                        ..TRUTH
                    };
                    let mut with = parameters(&TRUTH, 120.0);
                    with.adaptation.method = method;
                    let run = run::<f32>(|_| truth, &with, &SI, 5.0, settle);
                    let (off, travel) = standstill(&run);
                    worst = (worst.0.max(off), worst.1.max(travel));
                }
            }
        }
    }
    // Within a count by the estimate, which may be anywhere within the count that the encoder shows.
    assert!(worst.0 <= 2.0 && worst.1 == 0.0, "{worst:?}");
}

/// Every way to compensate that [`Compensation::is_safe`] lets pass.
fn safe_ways(gain: f64) -> [Compensation<f64>; 5] {
    let way = |method, driver, share, slope| Compensation {
        method,
        driver,
        share,
        slope,
        crossing: 0.01,
    };
    [
        way(Method::Static, Driver::Desired, 1.0, 0.0),
        way(Method::Static, Driver::Measured, 1.0, 0.499 * gain),
        way(Method::Static, Driver::Command, 1.0, 0.999 * gain),
        way(Method::Bristles, Driver::Desired, 1.0, 0.0),
        way(Method::Bristles, Driver::Measured, 0.66, 0.0),
    ]
}

#[test]
fn no_safe_compensation_hunts_with_parameters_off_by_30_percent() {
    let nominal = Truth {
        stiffness: 60.0,
        ..TRUTH
    };
    let with = parameters(&nominal, 120.0);
    for compensation in safe_ways(with.velocity_gain) {
        assert!(compensation.is_safe(with.velocity_gain));
        for level in [0.7, 1.0, 1.3] {
            for stiffness in [0.0, 0.7, 1.0, 1.3] {
                // Bristles that follow the measured velocity are for contacts that have some, and a standstill without
                // an integral, as the doc of `Compensation` says.
                let follows = compensation.driver == Driver::Measured
                    && compensation.method == Method::Bristles;
                if follows && stiffness == 0.0 {
                    continue;
                }
                let velocity_integral = if follows { 0.0 } else { with.velocity_integral };
                let truth = Truth {
                    coulomb: TRUTH.coulomb * level,
                    static_level: TRUTH.coulomb * level,
                    stiffness: 60.0 * stiffness,
                    ..TRUTH
                };
                let with = Parameters {
                    compensation,
                    velocity_integral,
                    ..with
                };
                let run = run::<f32>(|_| truth, &with, &SI, 8.0, settle);
                let (_, travel) = standstill(&run);
                // Bristles may still creep while the integral pushes on; nothing goes to and fro.
                let speeds = run[run.len() - 1000..].iter().map(|(axis, _)| axis.v);
                let (low, high) = speeds.fold((0.0_f64, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
                let swing = (-low).min(high) / COUNT;
                assert!(
                    travel < 2.0 && swing < 1.0,
                    "{compensation:?} {truth:?}: {travel} {swing}"
                );
            }
        }
    }
}

#[test]
fn what_could_hunt_is_refused() {
    let with = parameters(&TRUTH, 120.0);
    let gain = with.velocity_gain;
    let [_, measured, command, _, bristles] = safe_ways(gain);
    let refused = [
        Compensation {
            slope: 0.51 * gain,
            ..measured
        },
        Compensation {
            slope: 1.01 * gain,
            ..command
        },
        Compensation {
            share: 0.68,
            ..bristles
        },
        Compensation {
            share: 1.01,
            ..command
        },
        Compensation {
            crossing: 0.0,
            ..command
        },
        Compensation {
            slope: f64::NAN,
            ..command
        },
    ];
    for compensation in refused {
        let found = Parameters {
            compensation,
            ..with
        }
        .check()
        .err();
        assert_eq!(
            found.map(|e| e.parameter),
            Some("compensation"),
            "{compensation:?}"
        );
    }
    let remembered = Compensation {
        method: Method::Bristles,
        ..with.compensation
    };
    assert!(!remembered.is_safe(gain));
}

#[test]
fn numbers_that_are_none_give_no_command() {
    let mut controller =
        Controller::new(parameters(&TRUTH, 120.0).scaled::<f32>(&SI).unwrap(), 0).unwrap();
    let set_point = |velocity| SetPoint::Position {
        position: Position::at(3),
        velocity,
        acceleration: 0.0,
    };
    assert!(controller.step(0, set_point(0.0)).finite);
    let output = controller.step(0, set_point(f32::NAN));
    assert!(!output.finite && output.command == 0.0);
    controller.reset(7);
    let output = controller.step(7, SetPoint::Off);
    assert!(output.finite && output.command == 0.0);
}

/// RMS error in counts of a slow sine under a way to compensate bristles that bend over six counts.
fn over_bristles(method: Method, driver: Driver, share: f64, excess: f64) -> f64 {
    let truth = Truth {
        stiffness: 20.0,
        static_level: TRUTH.coulomb * excess,
        ..TRUTH
    };
    let mut with = parameters(&truth, 120.0);
    with.compensation = Compensation {
        method,
        driver,
        share,
        ..with.compensation
    };
    with.compensation.slope = 0.499 * with.velocity_gain;
    rms(&run::<f32>(|_| truth, &with, &SI, 10.0, sine), 1.0, sine)
}

#[test]
fn observed_bristles_beat_a_static_law_where_there_are_some() {
    // Dahl's law, and the LuGre law with 20 % more at break-away.
    for excess in [1.0, 1.2] {
        let error = |method, driver, share| over_bristles(method, driver, share, excess);
        let none = error(Method::Off, Driver::Desired, 1.0);
        let fixed = error(Method::Static, Driver::Desired, 1.0);
        let desired = error(Method::Bristles, Driver::Desired, 1.0);
        let measured = error(Method::Bristles, Driver::Measured, 0.66);
        println!("{excess}: {none} {fixed} {desired} {measured}");
        assert!(desired < 0.2 * none && desired < 0.5 * fixed);
        assert!(measured < 0.6 * none);
    }
}

#[test]
fn a_velocity_is_followed_and_a_long_saturation_left_without_a_swing() {
    let with = parameters(&TRUTH, 120.0);
    let mut controller = Controller::new(with, 0).unwrap();
    let mut axis = Axis::default();
    let (mut most, mut last) = (0.0_f64, 0.0);
    for k in 0..6000 {
        // Four seconds of a velocity that the torque never reaches, then one that it does.
        let velocity = if k < 4000 { 60.0 } else { 5.0 };
        let aim = SetPoint::Velocity {
            velocity,
            acceleration: 0.0,
        };
        let output = controller.step(Scalar::floor(axis.q / COUNT), aim);
        assert_eq!(output.saturated, k < 4000 || output.command.abs() >= 0.7);
        assert!(output.command.abs() <= 0.7);
        axis.advance(&TRUTH, output.command, PERIOD);
        if k > 4000 {
            most = most.max(5.0 - axis.v);
        }
        last = axis.v;
    }
    // A wound-up integral would drive far past the new velocity, or wait long at the limit.
    assert!((last - 5.0).abs() < 0.05 && most < 1.0, "{last} {most}");
}
