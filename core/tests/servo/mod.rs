//! A servo axis to try controllers on, in double precision and with nothing of `control` in it.

use bristle_core::control::{
    Adaptation, Compensation, Driver, Effects, Friction, Learning, Method, Parameters,
};
use bristle_core::friction::{Curve, Dynamic, ModifiedLuGre, Units};

/// What really acts on the axis.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub inertia: f64,
    pub coulomb: f64,
    pub static_level: f64,
    pub viscous: f64,
    pub stribeck_velocity: f64,
    /// Bristle stiffness; zero for a stiff contact, which sticks exactly.
    pub stiffness: f64,
    /// A torque over position and velocity that resists motion.
    pub other: fn(f64, f64) -> f64,
    /// What the level of friction has at a position beyond its mean; not with bristles.
    pub wave: fn(f64) -> f64,
}

/// Position, velocity and bristle deflection.
#[derive(Clone, Copy, Debug, Default)]
pub struct Axis {
    pub q: f64,
    pub v: f64,
    pub z: f64,
}

const SUBSTEPS: u32 = 20;

impl Axis {
    /// Advances by `h` seconds under a constant torque, in implicit steps that stick exactly.
    pub fn advance(&mut self, truth: &Truth, torque: f64, h: f64) {
        let dt = h / f64::from(SUBSTEPS);
        for _ in 0..SUBSTEPS {
            let driven = torque - (truth.other)(self.q, self.v) - truth.viscous * self.v;
            let before = self.v;
            if truth.stiffness > 0.0 {
                let law = ModifiedLuGre {
                    coulomb: truth.coulomb,
                    viscous: 0.0,
                    static_level: truth.static_level,
                    stribeck_velocity: truth.stribeck_velocity,
                    bristle_stiffness: truth.stiffness,
                    bristle_damping: 0.0,
                };
                let step = law.step(self.z, self.v, dt);
                self.z = step.deflection;
                self.v += (driven - step.force) * dt / truth.inertia;
            } else {
                let ratio = self.v / truth.stribeck_velocity;
                let level =
                    truth.coulomb + (truth.static_level - truth.coulomb) / (1.0 + ratio * ratio);
                let level = level + (truth.wave)(self.q);
                let free = self.v + driven * dt / truth.inertia;
                let brake = level * dt / truth.inertia;
                self.v = free - free.clamp(-brake, brake);
            }
            self.q += 0.5 * (before + self.v) * dt;
        }
    }
}

/// SI units, in which floating point works.
pub const SI: Units = Units {
    force: 1.0,
    position: 1.0,
    velocity: 1.0,
};

pub const PERIOD: f64 = 1e-3;
/// An encoder of 4096 counts a turn.
pub const COUNT: f64 = std::f64::consts::TAU / 4096.0;

pub const TRUTH: Truth = Truth {
    inertia: 2e-3,
    coulomb: 0.2,
    static_level: 0.2,
    viscous: 0.015,
    stribeck_velocity: 0.1,
    stiffness: 0.0,
    other: |_, _| 0.0,
    wave: |_| 0.0,
};

/// A controller that knows the axis, with a velocity loop of `omega` rad/s and a position loop of a quarter of that.
pub fn parameters(truth: &Truth, omega: f64) -> Parameters<f64> {
    let velocity_gain = truth.inertia * omega;
    Parameters {
        period: PERIOD,
        count: COUNT,
        inertia: truth.inertia,
        gain: 1.0,
        back_emf: 0.0,
        command_limit: 0.7,
        torque_limit: 0.7,
        observer_bandwidth: 400.0,
        position_gain: omega / 4.0,
        velocity_gain,
        velocity_integral: velocity_gain * omega / 8.0,
        friction: Friction {
            coulomb: truth.coulomb,
            viscous: truth.viscous,
            static_level: truth.static_level,
            stribeck_velocity: truth.stribeck_velocity,
            curve: Curve::Rational,
            bristle_stiffness: if truth.stiffness > 0.0 {
                truth.stiffness
            } else {
                100.0
            },
            bristle_damping: 0.0,
        },
        compensation: Compensation {
            method: Method::Static,
            driver: Driver::Command,
            share: 1.0,
            slope: 0.999 * velocity_gain,
            crossing: 0.01,
        },
        adaptation: Adaptation {
            method: Learning::Off,
            rate: 10.0,
            window: 0.1,
            forgotten: 0.1,
            offset: 0.0,
            speed: 0.1,
            lowest: 0.0,
            highest: 0.5,
        },
        effects: Effects::NONE,
    }
}
