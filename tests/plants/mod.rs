//! Simulated servo axes for validating the diagnosis, written apart from the diagnosing code.
//!
//! A [`Recipe`] says what is wanted; [`simulate`] draws an axis and an excitation from its seed, adds
//! the effects, sizes them and returns what a drive would have logged. Nothing is shared with the host
//! program. Friction is a set-valued law at velocity level, solved by projection in every step
//! (Moreau, "Numerical aspects of the sweeping process", 1999; Acary and Brogliato, "Numerical
//! Methods for Nonsmooth Dynamical Systems", 2008, ch. 10), so the axis truly sticks; steps are 50 µs.
//!
//! An effect's size is the RMS of the torque that it adds and that no choice of Coulomb level, viscous
//! coefficient and inertia can imitate, over the RMS of `u`.
//!
//! `checks.rs` holds the simulator's own tests. It is not declared here, because every test program
//! that includes this module would run it again: declare it in one of them with
//! `#[path = "plants/checks.rs"] mod checks;`.
#![allow(
    dead_code,
    unused_imports,
    reason = "each test program uses its own part of this module"
)]
#![allow(
    clippy::match_same_arms,
    clippy::unused_self,
    reason = "one line or one method for each effect, alike or not"
)]

mod draw;
mod effect;
mod excitation;
mod integrator;
mod measure;
mod output;
mod recipe;
mod run;
mod simulate;

pub use integrator::{Axis, State};
pub use output::{baseline_toml, keep};
pub use recipe::{Control, Motion, Noise, Recipe, pair};
pub use simulate::simulate;

/// The effects that the catalogue names.
pub const NAMED: [&str; 24] = [
    "direction-asymmetry",
    "viscous-asymmetry",
    "stribeck",
    "quadratic-drag",
    "power-law-viscous",
    "gravity",
    "spring",
    "hardening-spring",
    "cogging",
    "delay",
    "presliding",
    "torque-ripple",
    "load-step",
    "periodic-disturbance",
    "thermal-drift",
    "position-dependent-friction",
    "load-dependent-friction",
    "inertia-mismatch",
    "saturation",
    "input-dead-zone",
    "actuator-lag",
    "sensor-eccentricity",
    "backlash",
    "compliance",
];

/// Effects that it does not name: to be called unknown, or at least not misnamed badly.
pub const OTHERS: [&str; 4] = [
    "position-dependent-viscous",
    "centrifugal",
    "fading-gain",
    "jamming",
];

/// What a drive would have logged, and what was true.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Instants, s.
    pub t: Vec<f64>,
    /// Commanded torque (N·m) or force (N), held from its instant until the next.
    pub u: Vec<f64>,
    /// Encoder reading, rad or m.
    pub q: Vec<f64>,
    /// Rotary or linear, for the units.
    pub motion: Motion,
    /// What was simulated.
    pub truth: Case,
}

/// The truth behind a recording.
#[derive(Clone, Debug)]
pub struct Case {
    /// The recipe's seed.
    pub seed: u64,
    /// Each effect with the size reached, as a fraction of RMS `u`.
    pub effects: Vec<(&'static str, f64)>,
    /// Each effect's parameters in SI units: effect id, parameter, value.
    pub parameters: Vec<(&'static str, &'static str, f64)>,
    /// kg·m² or kg.
    pub inertia: f64,
    /// Coulomb level, N·m or N.
    pub coulomb: f64,
    /// Viscous coefficient, N·m·s/rad or N·s/m.
    pub viscous: f64,
    /// RMS of the commanded torque or force.
    pub u_rms: f64,
    /// RMS of the process torque that was not recorded.
    pub noise_rms: f64,
    /// Greatest speed, rad/s or m/s.
    pub top_speed: f64,
    /// Greatest minus least position, rad or m.
    pub travel: f64,
    /// Reversals of motion, ignoring those below 1 % of top speed.
    pub reversals: usize,
    /// Fraction of the samples in which the axis moved.
    pub moving: f64,
    /// Encoder count, rad or m.
    pub count: f64,
    /// Kind of excitation.
    pub excitation: &'static str,
    /// True positions at the instants of the recording.
    pub q: Vec<f64>,
    /// True velocities at the instants of the recording.
    pub v: Vec<f64>,
    /// Whether motion is sane and every effect within 20 % of the size asked for.
    pub met: bool,
}
