//! From a model file to what a board has to be told.

use std::f64::consts::TAU;

use bristle_core::control::{
    self, Adaptation, Backlash, Compensation, Driver, Effects, Friction, Harmonic, Learning, Method,
};
use bristle_core::drive::{Number, Parameters};
use bristle_core::friction::{Curve, OutOfRange, Units};

use super::Sensors;
use crate::error::{Error, Result};
use crate::model::{Kind, Law, Model, Motion, Term};
use crate::system;

/// How an axis is to be controlled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// Control period, s.
    pub period: f64,
    /// Bandwidth of the velocity loop, Hz; the position loop has a quarter of it.
    pub bandwidth: f64,
    /// Largest `|u|`.
    pub input_limit: f64,
    /// Whether the model's friction and effects are compensated.
    pub compensate: bool,
    /// The units in which a board in fixed point counts.
    pub units: Units,
}

/// SI units, for floating point.
pub const SI: Units = Units {
    force: 1.0,
    position: 1.0,
    velocity: 1.0,
};

/// The parameters of a board that knows an axis by its model file. Fails if the model lacks a value, or says what no
/// controller knows, or a number does not fit the format.
pub fn parameters<T: Number>(
    model: &Model,
    setup: &Setup,
    sensors: &Sensors,
) -> Result<Parameters<T>> {
    if let Some(name) = model.first_unknown() {
        return Err(Error::Usage(format!(
            "{name} has no value, and a controller needs one; identify the model first"
        )));
    }
    let control = control_law(model, setup, sensors);
    let out_of_range = |e: OutOfRange| Error::Usage(format!("the board's numbers: {e}"));
    let parameters = Parameters {
        limits: sensors.limits(),
        control: control.scaled(&setup.units).map_err(out_of_range)?,
    };
    if let Err(invalid) = parameters.control.check() {
        return Err(Error::Usage(format!(
            "the model gives no valid controller: {invalid}"
        )));
    }
    Ok(parameters)
}

fn control_law(model: &Model, setup: &Setup, sensors: &Sensors) -> control::Parameters<f64> {
    let inertia = model.parameters()[model.moving_inertia()]
        .value
        .unwrap_or_default();
    let (gain, back_emf) = drive(model);
    let omega = TAU * setup.bandwidth;
    let velocity_gain = inertia * omega;
    let method = match (setup.compensate, model.bristles().is_some()) {
        (false, _) => Method::Off,
        (true, false) => Method::Static,
        (true, true) => Method::Bristles,
    };
    control::Parameters {
        period: setup.period,
        count: sensors.count,
        inertia,
        gain,
        back_emf,
        command_limit: setup.input_limit,
        torque_limit: (setup.input_limit * gain).abs(),
        // Faster than the loop by as much as the position loop is slower.
        observer_bandwidth: 4.0 * omega,
        position_gain: omega / 4.0,
        velocity_gain,
        velocity_integral: velocity_gain * omega / 8.0,
        friction: friction(model),
        compensation: Compensation {
            method,
            driver: Driver::Command,
            share: if method == Method::Bristles { 0.75 } else { 1.0 },
            slope: 2.0 * velocity_gain,
            // A count in four periods: slower, no encoder tells a speed from standstill.
            crossing: 0.25 * sensors.count / setup.period,
        },
        adaptation: Adaptation {
            method: Learning::Off,
            speed: 1.0,
            lowest: 0.0,
            highest: 0.0,
            rate: 0.0,
            window: 0.1,
            forgotten: 0.0,
            offset: 0.0,
        },
        effects: if setup.compensate {
            effects(model, sensors.count)
        } else {
            Effects::NONE
        },
    }
}

/// Torque or force per unit of `u`, and what velocity takes off `u`.
fn drive(model: &Model) -> (f64, f64) {
    let gain = model.gain.value.unwrap_or(1.0);
    let constant = |name: &str| model.constant(&format!("plant.{name}"));
    match model.kind {
        Kind::DcMotor | Kind::GearedServo => (
            gain * constant("torque_constant") / constant("resistance"),
            constant("back_emf") / gain,
        ),
        Kind::Axis | Kind::MassSpring | Kind::WheelSlip => (gain, model.back_emf()),
    }
}

fn friction(model: &Model) -> Friction<f64> {
    let coulomb = model.coulomb.value.unwrap_or_default();
    let falls = model.terms.iter().find(|t| t.falls());
    let fall = |k: usize| falls.and_then(|t| t.parameters.get(k)?.value);
    let bends = model.bristle_term().map(|k| &model.terms[k]);
    Friction {
        coulomb,
        viscous: model.viscous.value.unwrap_or_default(),
        static_level: fall(0).unwrap_or(coulomb).max(coulomb),
        stribeck_velocity: fall(1).unwrap_or(1.0),
        curve: match model.law {
            Law::ModifiedLuGre => Curve::Rational,
            _ => Curve::Exponential,
        },
        bristle_stiffness: bends.and_then(Term::bristle_stiffness).unwrap_or(1.0),
        bristle_damping: bends
            .and_then(|t| t.parameters.get(1)?.value)
            .unwrap_or(0.0),
    }
}

/// The effects that a controller knows; others are left to its feedback.
fn effects(model: &Model, count: f64) -> Effects<f64> {
    let mut effects = Effects {
        backlash: Backlash::NONE,
        ..Effects::NONE
    };
    let mut waves = effects.waves.iter_mut();
    for term in &model.terms {
        let p = system::values(term);
        match term.effect.id() {
            "direction-asymmetry" => effects.offset = p[0],
            "viscous-asymmetry" => effects.viscous_difference = p[0],
            "spring" => effects.stiffness = p[0],
            "gravity" => {
                if let Some(wave) = waves.next() {
                    *wave = harmonic(p[0], p[1], 1.0 / TAU, count);
                }
            }
            "cogging" => {
                let turn = match model.motion {
                    Motion::Rotary => TAU,
                    Motion::Linear => 1.0,
                };
                if let Some(wave) = waves.next() {
                    *wave = harmonic(p[0], p[1], p[2] / turn, count);
                }
            }
            _ => {}
        }
    }
    effects
}

/// `amplitude·sin(2π·periods·q + phase)` with `periods` per rad or m.
fn harmonic(amplitude: f64, phase: f64, periods: f64, count: f64) -> Harmonic<f64> {
    Harmonic {
        cycle: (periods * count * 2f64.powi(32)).round() as u32,
        sine: amplitude * phase.cos(),
        cosine: amplitude * phase.sin(),
    }
}
