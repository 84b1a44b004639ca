//! An axis with Coulomb friction that follows a sine under full compensation and within bounds, and on the STM32F405 with a recording of two
//! signals; and a counter of instructions: with `-icount shift=0`, TIM5 of the model of the STM32F405 counts one for each.
//! The image for the STM32F100 runs there as well.

use core::hint::black_box;

use bristle_core::control::{
    self, Compensation, CurrentLoop, Driver, Friction, Harmonic, Learning, Method, Position,
    SetPoint,
};
use bristle_core::drive::recorder::{Order, Trigger};
use bristle_core::drive::signal::{Selection, Signal};
use bristle_core::drive::{Bounds, Drive, Faults, News, Parameters, Sample};
use bristle_core::friction::Curve;
use bristle_core::scalar::Scalar;
use bristle_firmware::board::device::{Peripherals, TIM5};
use bristle_firmware::fault::{self, PANIC_STATUS};
use semihosting::println;

#[cfg(target_abi = "eabihf")]
mod size {
    pub type Real = f32;
    pub const PERIODS: usize = 4000;
    pub const RING: usize = 4096;
    /// What counts as 1: SI units.
    pub const FORCE: f64 = 1.0;
    pub const POSITION: f64 = 1.0;
    pub const VELOCITY: f64 = 1.0;
}

/// In 8 KB.
#[cfg(not(target_abi = "eabihf"))]
mod size {
    pub type Real = bristle_core::scalar::Q16;
    pub const PERIODS: usize = 1000;
    pub const RING: usize = 0;
    /// What counts as 1: see `bristle::tune::units`.
    pub const FORCE: f64 = 1.0 / 64.0;
    pub const POSITION: f64 = 1.0 / 1024.0;
    pub const VELOCITY: f64 = 1.0 / 8.0;
}

use size::{FORCE, POSITION, VELOCITY};
pub use size::{PERIODS, RING, Real};

const COUNT: f64 = 3.834_952e-4;
const PERIOD: f64 = 1e-3;
const INERTIA: f64 = 2e-3;
const COULOMB: f64 = 0.2;
/// A to a count of the converter.
const CURRENT: f64 = 1.0 / 256.0;
const TIME: f64 = POSITION / VELOCITY;

fn number(value: f64, unit: f64) -> Real {
    Real::from_f64(value / unit)
}

pub fn parameters() -> Parameters<Real> {
    let viscous = FORCE / VELOCITY;
    let mut set = Parameters::harmless();
    set.limits.bus_max = number(1e3, 1.0);
    set.limits.bus_per_count = number(0.25, 1.0);
    set.limits.current_per_count = number(CURRENT, 1.0);
    set.limits.current = number(1e3, 1.0);
    let control = &mut set.control;
    control.period = number(PERIOD, TIME);
    control.count = number(COUNT, POSITION);
    control.inertia = number(INERTIA, FORCE * TIME / VELOCITY);
    control.gain = number(1.0, FORCE);
    control.command_limit = number(1.0, 1.0);
    control.torque_limit = number(1.0, FORCE);
    control.observer_bandwidth = number(800.0, 1.0 / TIME);
    control.position_gain = number(50.0, 1.0 / TIME);
    control.velocity_gain = number(0.4, viscous);
    control.velocity_integral = number(10.0, viscous / TIME);
    control.friction = Friction {
        coulomb: number(COULOMB, FORCE),
        viscous: number(0.015, viscous),
        static_level: number(0.25, FORCE),
        stribeck_velocity: number(0.1, VELOCITY),
        curve: Curve::Rational,
        bristle_stiffness: number(200.0, FORCE / POSITION),
        bristle_damping: number(0.3, viscous),
    };
    control.compensation = Compensation {
        method: Method::Static,
        driver: Driver::Command,
        share: Real::ONE,
        slope: number(0.3, viscous),
        crossing: number(0.01, VELOCITY),
    };
    control.adaptation.method = Learning::Observer;
    control.adaptation.rate = number(10.0, 1.0 / TIME);
    control.adaptation.speed = number(0.1, VELOCITY);
    control.adaptation.highest = number(1.0, FORCE);
    control.effects.waves[0] = Harmonic {
        cycle: 1 << 18,
        sine: number(0.1, FORCE),
        cosine: number(0.02, FORCE),
    };
    // 1 Ω, whose current is there within a sample, and 1 N·m/A.
    set.current = Some(CurrentLoop {
        proportional: number(0.9, 1.0),
        reset: Real::ONE,
        back_emf: number(0.01, 1.0 / VELOCITY),
        limit: number(20.0, 1.0),
    });
    set
}

/// Knows the axis otherwise: by its integral gain, its friction and an offset, in turn one way and the other.
#[allow(dead_code, reason = "only one of the images changes parameters")]
pub fn retune(control: &mut control::Parameters<Real>) {
    let other = parameters().control;
    let turned = control.friction.coulomb != other.friction.coulomb;
    *control = other;
    if !turned {
        control.velocity_integral = control.velocity_integral.half();
        control.friction.coulomb = control.friction.coulomb.half();
        control.effects.offset = number(0.01, FORCE);
    }
}

/// An axis with Coulomb friction, in explicit steps: what it does hardly matters, as long as it moves and sticks.
pub struct Axis {
    q: f32,
    v: f32,
}

impl Axis {
    pub const START: Self = Self { q: 0.0, v: 0.0 };

    pub fn advance(&mut self, torque: Real) {
        let kick = (PERIOD / INERTIA) as f32;
        let free = self.v + torque.to_f64() as f32 * kick;
        let brake = COULOMB as f32 * kick;
        self.v = free - free.clamp_symmetric(brake);
        self.q += self.v * PERIOD as f32;
    }
    pub fn counts(&self) -> i32 {
        (self.q / COUNT as f32).floor()
    }
}

/// A sine of 1 Hz and half a radian.
pub fn aim(k: usize) -> SetPoint<Real> {
    let phase = (k as u32).wrapping_mul((1_u64 << 32).div_euclid(1000) as u32);
    let (sine, cosine) = f32::wave(phase);
    let (sine, cosine) = (f64::from(sine), f64::from(cosine));
    let omega = core::f64::consts::TAU;
    SetPoint::Position {
        position: Position::from_f64(0.5 / COUNT * sine),
        velocity: number(0.5 * omega * cosine, VELOCITY),
        acceleration: number(-0.5 * omega * omega * sine, VELOCITY / TIME),
    }
}

/// Reads the counter, and knows what that costs.
pub struct Counter {
    timer: TIM5,
    /// What reading it costs.
    pub bracket: u32,
}

impl Counter {
    pub fn start(timer: TIM5) -> Self {
        timer.cr1().write(|w| w.cen().enabled());
        let mut counter = Self { timer, bracket: 0 };
        (counter.bracket, ()) = counter.count(|| ());
        counter
    }
    pub fn now(&self) -> u32 {
        self.timer.cnt().read().bits()
    }
    pub fn count<T>(&self, work: impl FnOnce() -> T) -> (u32, T) {
        let before = self.now();
        let done = work();
        (self.now().wrapping_sub(before) - self.bracket, done)
    }
}

pub fn report(name: &str, counts: &mut [u16]) {
    counts.sort_unstable();
    let at = |k: usize| counts.get(k).copied().unwrap_or_default();
    println!("{name} {} {}", at(PERIODS / 2), at(PERIODS - 1));
}

/// A drive along its sine; `step` makes a period of it and says what it cost.
pub fn drive(
    counts: &mut [u16],
    ring: &mut [u32],
    mut step: impl FnMut(&mut Drive<Real>, &Sample, &News<Real>) -> (u32, Real),
) -> Option<()> {
    let mut drive = Drive::new(parameters(), Faults::NONE, ring)?;
    drive.recorder().start(Order {
        selection: Selection::of(&[Signal::Input, Signal::Position]),
        every: 1,
        trigger: Trigger::Now,
        before: 0,
    });
    let bounds = Bounds {
        travel: 1 << 20,
        speed: number(100.0, VELOCITY),
        input: Real::ONE,
        current: number(1e3, 1.0),
    };
    drive.enable_within(&bounds).ok()?;
    // By its address, as the firmware has it.
    let drive = black_box(&mut drive);
    let mut axis = Axis::START;
    let mut current = 0.0;
    for (k, slot) in counts.iter_mut().enumerate() {
        let sample = Sample {
            count: axis.counts() as u16,
            current: (2048.0 + current / CURRENT) as u16,
            bus: 100,
            gate_fault: false,
        };
        let news = News {
            set_point: Some(aim(k)),
            heard: true,
            missed: false,
        };
        // Or the compiler would make of them inside the brackets what it could make before.
        let (sample, news) = black_box((sample, news));
        let (count, input) = step(drive, &sample, &news);
        *slot = u16::try_from(count).unwrap_or(u16::MAX);
        current = input.to_f64();
        axis.advance(input);
        if !drive.faults().is_empty() {
            return None;
        }
    }
    Some(())
}

/// Starts the counter, does all that is to be counted, and ends the emulation.
pub fn run(all: impl FnOnce(&Counter) -> Option<()>) -> ! {
    let counted = Peripherals::take().and_then(|device| all(&Counter::start(device.TIM5)));
    match counted {
        Some(()) => semihosting::process::exit(0),
        None => fault::stop(PANIC_STATUS),
    }
}
