//! The order of convergence that theory gives, against an integrator that shares nothing with ours.

use bristle_core::friction::{CoulombViscous, Dynamic, LuGre, Motion, Static};
use differential_equations::prelude::*;

const LAW: LuGre<f64> = LuGre {
    coulomb: 0.7,
    viscous: 0.1,
    static_level: 1.1,
    stribeck_velocity: 0.1,
    bristle_stiffness: 100.0,
    bristle_damping: 0.5,
};

/// The state at `end` by an adaptive method of order 8.
fn oracle<const N: usize>(
    rate: impl Fn(f64, &[f64; N]) -> [f64; N],
    start: [f64; N],
    end: f64,
) -> [f64; N] {
    let derivative = |t: f64, y: &[f64; N], dydt: &mut [f64; N]| *dydt = rate(t, y);
    let method = ExplicitRungeKutta::dop853()
        .rtol(1e-12)
        .atol(1e-14)
        .max_steps(1_000_000);
    let solution = IVP::ode_from_fn(derivative, 0.0, end, start)
        .method(method)
        .solve();
    *solution
        .expect("the problem is not stiff")
        .y
        .last()
        .expect("an end")
}

/// Asserts that halving the step divides the error by `2^order`, to a fifth of an order, from the coarsest step that
/// `steps` gives on.
fn assert_order(order: f64, steps: usize, error: impl Fn(usize) -> f64) {
    let errors = [1, 2, 4, 8].map(|k| error(k * steps).abs());
    for pair in errors.windows(2) {
        let found = (pair[0] / pair[1]).log2();
        assert!((found - order).abs() < 0.2, "order {found} from {errors:?}");
    }
}

/// The error of the deflection after sampling `velocity` at the share `at` of each step.
fn sampling_error(velocity: fn(f64) -> f64, at: f64, steps: usize) -> f64 {
    // At the ends, the bristles have been bent for less than they need to forget.
    let end = 0.52;
    let [exact] = oracle(|t, [z]| [LAW.rate(*z, velocity(t))], [0.0], end);
    let dt = end / steps as f64;
    let step = |z, k: usize| LAW.advance(z, velocity((k as f64 + at) * dt), dt);
    (0..steps).fold(0.0, step) - exact
}

#[test]
fn the_deflection_converges_with_the_order_of_the_sampled_velocity() {
    // The step is exact at constant velocity, so what is left is the error of holding v: of first order with the
    // velocity at the start of a step, through reversals, too, …
    let reversing = |t: f64| 0.3 * (7.0 * t).sin() + 0.1;
    assert_order(1.0, 1_000, |steps| sampling_error(reversing, 0.0, steps));
    // … and of second order with that in its middle where |v| is smooth.
    let sliding = |t: f64| 0.05 + 0.04 * (20.0 * t).sin();
    assert_order(2.0, 100, |steps| sampling_error(sliding, 0.5, steps));
}

#[test]
fn a_mass_on_a_spring_with_bristles_converges_to_the_oracle() {
    // 2 kg on 50 N/m, released 0.2 m out: it slides, turns three times and rings down in the bristles.
    let (mass, spring, end) = (2.0, 50.0, 3.0);
    let rate = |_: f64, [x, v, z]: &[f64; 3]| {
        [
            *v,
            (-spring * x - LAW.force(*z, *v)) / mass,
            LAW.rate(*z, *v),
        ]
    };
    let exact = oracle(rate, [0.2, 0.0, 0.0], end);
    // Half a step of position, a step of velocity and deflection, half a step of position: of second order but for
    // the friction, which holds the velocity at the start.
    let position = |steps: usize| {
        let dt = end / steps as f64;
        let (mut x, mut v, mut z) = (0.2, 0.0, 0.0);
        for _ in 0..steps {
            x += 0.5 * dt * v;
            let step = LAW.step(z, v, dt);
            v += dt * (-spring * x - step.force) / mass;
            z = step.deflection;
            x += 0.5 * dt * v;
        }
        x
    };
    assert_order(1.0, 4_000, |steps| position(steps) - exact[0]);
}

#[test]
fn sliding_under_a_changing_force_converges_with_second_order() {
    let law = Static {
        coulomb: 0.5,
        viscous: 0.2,
        static_level: 0.9,
        stribeck_velocity: 0.3,
    };
    let (mass, end) = (1.5, 2.0);
    let active = |t: f64| 0.8 + 0.9 * (3.0 * t).sin();
    let rate = |t: f64, [_, v]: &[f64; 2]| {
        let level = 0.5 + 0.4 * (-v.abs() / 0.3).exp();
        [*v, (active(t) - level * v.signum() - 0.2 * v) / mass]
    };
    // Fast enough never to stop.
    let exact = oracle(rate, [0.0, 1.0], end);
    let position = |steps: usize| {
        let dt = end / steps as f64;
        let start = Motion {
            position: 0.0,
            velocity: 1.0,
        };
        let step = |motion: Motion<f64>, k: usize| {
            let t = k as f64 * dt;
            assert!(motion.velocity > 0.0);
            motion.step(&law, mass, [active(t), active(t + dt)], dt)
        };
        (0..steps).fold(start, step).position
    };
    assert_order(2.0, 50, |steps| position(steps) - exact[0]);
}

#[test]
fn stopping_does_not_spoil_the_order() {
    // J·v̇ = −Fc − Fv·v stops at T = (J/Fv)·ln(1 + Fv·v0/Fc), at x = J·v0/Fv − Fc·T/Fv.
    let (law, inertia, start) = (
        CoulombViscous {
            coulomb: 0.6,
            viscous: 0.9,
        },
        1.3,
        2.0_f64,
    );
    let time = inertia / 0.9 * (1.0 + 0.9 * start / 0.6).ln();
    let exact = inertia * start / 0.9 - 0.6 * time / 0.9;
    let stopped = |steps: usize| {
        let dt = 1.7 * time / steps as f64;
        let start = Motion {
            position: 0.0,
            velocity: start,
        };
        let motion = (0..steps).fold(start, |motion, _| motion.step(&law, inertia, [0.0; 2], dt));
        assert!(motion.velocity == 0.0);
        motion.position
    };
    assert_order(2.0, 50, |steps| stopped(steps) - exact);
}
