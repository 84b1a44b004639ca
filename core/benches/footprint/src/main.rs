//! One step of the modified `LuGre` law in fixed point: its size and instructions on the target, its speed on the host.
//!
//! In this folder, without and with `--features fixed`:
//! ```text
//! T=thumbv7em-none-eabihf
//! cargo build --release --target $T && nm --print-size --size-sort target/$T/release/footprint
//! qemu-system-arm -M netduinoplus2 -nographic -monitor none -serial none -singlestep -d exec,nochain -D trace \
//!   -semihosting-config enable=on,target=native -kernel target/$T/release/footprint; grep -c Trace trace
//! cargo run --profile bench
//! cargo clean && time cargo build --release
//! ```
//! The trace has a line for each instruction of 1000 steps.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(feature = "fixed")]
mod candidate;
#[cfg(target_os = "none")]
mod target;

use bristle_core::Scalar;
use bristle_core::friction::{Dynamic, ModifiedLuGre};
#[cfg(not(feature = "fixed"))]
use bristle_core::scalar::Q16 as Number;
#[cfg(feature = "fixed")]
use candidate::Number;

/// The step whose code is measured, with everything given at run time.
#[inline(never)]
fn step(law: &ModifiedLuGre<Number>, state: &mut [Number; 2], velocity: Number, dt: Number) {
    let step = law.step(state[0], velocity, dt);
    *state = [step.deflection, step.force];
}

/// A law in units of its static level and break-away deflection.
fn law() -> ModifiedLuGre<Number> {
    let tenths = |x: u8| {
        let ten = (0..10).fold(Number::ZERO, |sum, _| sum + Number::ONE);
        (0..x).fold(Number::ZERO, |sum, _| sum + Number::ONE) / ten
    };
    core::hint::black_box(ModifiedLuGre {
        coulomb: tenths(7),
        viscous: tenths(1),
        static_level: Number::ONE,
        stribeck_velocity: Number::ONE,
        bristle_stiffness: Number::ONE,
        bristle_damping: tenths(3),
    })
}

/// Velocities of every magnitude and both signs, by a linear congruential generator.
fn velocities() -> impl Iterator<Item = Number> {
    let mut seed = 1_i32;
    (0..1000).map(move |k| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        number(seed >> (11 + k % 8))
    })
}

#[cfg(not(feature = "fixed"))]
fn number(bits: i32) -> Number {
    Number::from_bits(bits)
}

#[cfg(feature = "fixed")]
use candidate::number;

#[cfg(not(target_os = "none"))]
fn main() {
    let law = law();
    let velocities: Vec<Number> = velocities().collect();
    let mut state = [Number::ZERO; 2];
    let best = (0..15).map(|_| {
        let start = std::time::Instant::now();
        for _ in 0..400 {
            for velocity in std::hint::black_box(&velocities) {
                step(&law, &mut state, *velocity, Number::ONE);
            }
        }
        start.elapsed().as_secs_f64()
    });
    let seconds = best.fold(f64::INFINITY, f64::min);
    println!("{:.1} million steps/s, {state:?}", 0.4 / seconds);
}
