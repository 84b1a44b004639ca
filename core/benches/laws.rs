//! Steps per second and core, for each law and number type.
//!
//! ```text
//! cargo bench -p bristle-core
//! ```
//!
//! On an AMD EPYC of a shared machine, rustc 1.95, in millions a second:
//!
//! | law | f64 | f32 | Q16 |
//! | --- | --- | --- | --- |
//! | `Dahl` | 128 | 128 | 37 |
//! | `LuGre` | 54 | 70 | 19 |
//! | `ModifiedLuGre` | 78 | 98 | 20 |
//!
//! A step of a law with bristles is [`Dynamic::step`], the exact deflection and the mean force, in a chain where each
//! step needs the deflection of the last; one of a law without state is [`Friction::reaction`]. The velocities
//! pass through rest, presliding and sliding at every speed from a hundredth to a hundred Stribeck velocities.

use std::hint::black_box;
use std::time::Instant;

use bristle_core::Scalar;
use bristle_core::friction::{
    CoulombViscous, Curve, Dahl, Dynamic, Friction, LuGre, ModifiedLuGre, Static, Stribeck,
};
use bristle_core::scalar::Q16;

const VELOCITIES: usize = 4096;
const PASSES: usize = 200;
const REPETITIONS: usize = 15;

/// Velocities in units of the Stribeck velocity, with both signs and long stretches at rest.
fn velocities<S: Scalar>() -> Vec<S> {
    let speed = |k: usize| 10_f64.powf(4.0 * (k as f64 * 0.618).fract() - 2.0);
    let at = |k: usize| match k / 16 % 4 {
        0 => 0.0,
        1 => -speed(k),
        _ => speed(k),
    };
    (0..VELOCITIES).map(|k| S::from_f64(at(k))).collect()
}

/// Millions of steps a second, the best of some repetitions: what disturbs a measurement only slows it.
fn rate<S: Scalar>(mut step: impl FnMut(S, S) -> (S, S)) -> f64 {
    let velocities = velocities::<S>();
    let seconds = (0..REPETITIONS).map(|_| {
        let start = Instant::now();
        let (mut state, mut sum) = (S::ZERO, S::ZERO);
        for _ in 0..PASSES {
            for velocity in black_box(&velocities) {
                let output;
                (state, output) = step(state, *velocity);
                sum += output;
            }
        }
        black_box((state, sum));
        start.elapsed().as_secs_f64()
    });
    let best = seconds.fold(f64::INFINITY, f64::min);
    (VELOCITIES * PASSES) as f64 / best / 1e6
}

fn without_state<S: Scalar>(law: &impl Friction<S>) -> f64 {
    let active = S::from_f64(0.4);
    rate(|_, velocity| (S::ZERO, law.reaction(velocity, active)))
}

fn with_bristles<S: Scalar>(law: &impl Dynamic<S>) -> f64 {
    rate(|deflection, velocity| {
        let step = law.step(deflection, velocity, S::ONE);
        (step.deflection, step.force)
    })
}

/// The rates of all laws, in the order of [`NAMES`].
fn rates<S: Scalar>() -> [f64; 7] {
    let s = S::from_f64;
    let (coulomb, viscous, static_level) = (s(0.7), s(0.01), s(1.0));
    let (stribeck_velocity, bristle_stiffness, bristle_damping) = (s(1.0), s(1.0), s(0.3));
    let stribeck = |curve| Stribeck {
        coulomb,
        viscous,
        static_level,
        stribeck_velocity,
        curve,
    };
    [
        without_state(&black_box(CoulombViscous { coulomb, viscous })),
        without_state(&black_box(stribeck(Curve::Exponential))),
        without_state(&black_box(stribeck(Curve::Rational))),
        without_state(&black_box(Static {
            coulomb,
            viscous,
            static_level,
            stribeck_velocity,
        })),
        with_bristles(&black_box(Dahl {
            coulomb,
            viscous,
            bristle_stiffness,
        })),
        with_bristles(&black_box(LuGre {
            coulomb,
            viscous,
            static_level,
            stribeck_velocity,
            bristle_stiffness,
            bristle_damping,
        })),
        with_bristles(&black_box(ModifiedLuGre {
            coulomb,
            viscous,
            static_level,
            stribeck_velocity,
            bristle_stiffness,
            bristle_damping,
        })),
    ]
}

const NAMES: [&str; 7] = [
    "CoulombViscous",
    "Stribeck, exponential",
    "Stribeck, rational",
    "Static",
    "Dahl",
    "LuGre",
    "ModifiedLuGre",
];

fn main() {
    let (double, single, fixed) = (rates::<f64>(), rates::<f32>(), rates::<Q16>());
    println!(
        "million steps/s        {:>8} {:>8} {:>8}",
        "f64", "f32", "Q16"
    );
    for (k, name) in NAMES.iter().enumerate() {
        println!(
            "{name:<22} {:8.1} {:8.1} {:8.1}",
            double[k], single[k], fixed[k]
        );
    }
}
