//! One sample of a controller: its instructions on the target, in `f32` or with `--features fixed-point` in fixed point.
//!
//! In this folder, once for each of two numbers of samples; the difference of the two traces is what the additional
//! samples take:
//! ```text
//! T=thumbv7em-none-eabihf
//! for SAMPLES in 1000 2000; do
//!   SAMPLES=$SAMPLES cargo build --release --target $T --bin control
//!   qemu-system-arm -M netduinoplus2 -nographic -monitor none -serial none -singlestep -d exec,nochain -D trace \
//!     -semihosting-config enable=on,target=native -kernel target/$T/release/control; grep -c Trace trace
//! done
//! ```
#![cfg_attr(target_os = "none", no_std, no_main)]

use bristle_core::Scalar;
use bristle_core::control::{
    Adaptation, Compensation, Controller, Learning, Driver, Effects, Friction, Method, Output, Parameters, Position, SetPoint,
};
use bristle_core::friction::Curve;

#[cfg(feature = "fixed-point")]
type Number = bristle_core::scalar::Q16;
#[cfg(not(feature = "fixed-point"))]
type Number = f32;

/// A number from whole thousandths: at run time, and without double precision.
fn thousandths(x: i32) -> Number {
    Number::from_i32(core::hint::black_box(x)) / Number::from_i32(core::hint::black_box(1000))
}

/// An axis in units of its Coulomb level, eight counts and 1 rad/s, at 1 kHz.
fn parameters() -> Parameters<Number> {
    let method = if cfg!(feature = "bristles") { Method::Bristles } else { Method::Static };
    let driver = if cfg!(feature = "bristles") { Driver::Desired } else { Driver::Command };
    Parameters {
        period: thousandths(82),
        count: thousandths(125),
        inertia: thousandths(815),
        gain: thousandths(1000),
        back_emf: thousandths(500),
        command_limit: thousandths(4000),
        torque_limit: thousandths(4000),
        observer_bandwidth: thousandths(4900),
        position_gain: thousandths(367),
        velocity_gain: thousandths(1200),
        velocity_integral: thousandths(220),
        friction: Friction {
            coulomb: thousandths(1000),
            viscous: thousandths(75),
            static_level: thousandths(1200),
            stribeck_velocity: thousandths(100),
            curve: Curve::Rational,
            bristle_stiffness: thousandths(6000),
            bristle_damping: thousandths(100),
        },
        compensation: Compensation {
            method,
            driver,
            share: thousandths(1000),
            slope: thousandths(1200),
            crossing: thousandths(20),
        },
        adaptation: Adaptation {
            method: if cfg!(feature = "rows") { Learning::Rows } else { Learning::Observer },
            rate: thousandths(122),
            speed: thousandths(100),
            lowest: thousandths(0),
            highest: thousandths(2500),
            window: thousandths(8200),
            forgotten: thousandths(100),
            offset: thousandths(100),
        },
        effects: Effects::NONE,
    }
}

#[inline(never)]
fn sample(controller: &mut Controller<Number>, counts: i32, set_point: SetPoint<Number>) -> Output<Number> {
    controller.step(counts, set_point)
}

const fn samples() -> i32 {
    let Some(text) = option_env!("SAMPLES") else { return 1000 };
    let (bytes, mut k, mut sum) = (text.as_bytes(), 0, 0);
    while k < bytes.len() {
        sum = 10 * sum + (bytes[k] - b'0') as i32;
        k += 1;
    }
    sum
}

/// Counts that run to and fro as the set point does, with a step of one to either side.
fn run() {
    let Ok(mut controller) = Controller::new(parameters(), 0) else { return };
    let mut at = 0;
    for k in 0..samples() {
        let forward = k % 200 < 100;
        at += if forward { 1 } else { -1 };
        let velocity = if forward { thousandths(1530) } else { thousandths(-1530) };
        let set_point = SetPoint::Position { position: Position::at(at + k % 2), velocity, acceleration: Number::ZERO };
        core::hint::black_box(sample(&mut controller, core::hint::black_box(at), set_point));
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    run();
}

#[cfg(target_os = "none")]
mod target {
    use core::arch::asm;

    /// The initial stack pointer and the entry.
    #[repr(C)]
    pub struct Vectors(u32, extern "C" fn() -> !);

    #[used]
    #[unsafe(link_section = ".vectors")]
    static VECTORS: Vectors = Vectors(0x2000_8000, reset);

    #[unsafe(no_mangle)]
    extern "C" fn reset() -> ! {
        // SAFETY: full access to the floating-point unit, by the register that the architecture has for it.
        unsafe { core::ptr::write_volatile(0xE000_ED88 as *mut u32, 0xF << 20) };
        super::run();
        // SAFETY: semihosting's SYS_EXIT with ADP_Stopped_ApplicationExit; the emulator ends here.
        unsafe { asm!("bkpt 0xab", in("r0") 0x18, in("r1") 0x2_0026) };
        loop {}
    }

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        loop {}
    }
}
