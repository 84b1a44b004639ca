//! Everything that a controller has to be told.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::{Adaptation, Backlash, Compensation, Effects, Friction, Harmonic};
use crate::Scalar;
use crate::friction::{OutOfRange, Units};

/// Parameters of a [`Controller`](super::Controller), in SI units, or in scaled ones by [`Parameters::scaled`].
///
/// `J·q̈ = gain·(u − back_emf·q̇) − F − effects`, with `u` held over each `period`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters<T> {
    /// Sampling period, s.
    pub period: T,
    /// rad or m to an encoder count.
    pub count: T,
    /// `J`, kg·m² or kg.
    pub inertia: T,
    /// Torque or force per unit of `u`.
    pub gain: T,
    /// What velocity takes off `u`, per rad/s or m/s; zero unless `u` is a voltage.
    pub back_emf: T,
    /// Largest `|u|`.
    pub command_limit: T,
    /// Largest torque or force, N·m or N.
    pub torque_limit: T,
    /// Of the observer of position and velocity, rad/s.
    pub observer_bandwidth: T,
    /// `kp`: velocity asked for per position error, 1/s.
    pub position_gain: T,
    /// `kv`: torque per velocity error, N·m·s/rad or N·s/m.
    pub velocity_gain: T,
    /// `ki`: torque per velocity error and second, N·m/rad or N/m.
    pub velocity_integral: T,
    /// Friction of the axis.
    pub friction: Friction<T>,
    /// What is done about it.
    pub compensation: Compensation<T>,
    /// How its Coulomb level is adapted.
    pub adaptation: Adaptation<T>,
    /// Further physics, which is always compensated.
    pub effects: Effects<T>,
}

/// A parameter that is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Invalid {
    /// The field of [`Parameters`].
    pub parameter: &'static str,
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is outside the range that its field documents",
            self.parameter
        )
    }
}

impl core::error::Error for Invalid {}

impl<T: Scalar> Parameters<T> {
    /// Whether both are of one drive: whatever tells what a sample and a command are is the same. That is the period, the
    /// encoder's count, what `u` makes (`gain`, and with its sign the polarity, and `back_emf`) and the limits of both.
    pub fn is_same_drive(&self, other: &Self) -> bool {
        let fixed = |p: &Self| {
            [
                p.period,
                p.count,
                p.gain,
                p.back_emf,
                p.command_limit,
                p.torque_limit,
            ]
        };
        fixed(self) == fixed(other)
    }

    /// Whether [`Parameters::check`] finds nothing.
    pub fn is_valid(&self) -> bool {
        self.check().is_ok()
    }

    /// Names the first parameter that is out of range. Checked once, so that the control path needs no checks.
    pub fn check(&self) -> Result<(), Invalid> {
        let positive = |x: T| x.is_finite() && x > T::ZERO;
        let non_negative = |x: T| x.is_finite() && x >= T::ZERO;
        let checks = [
            ("period", positive(self.period)),
            ("count", positive(self.count)),
            ("inertia", positive(self.inertia)),
            ("gain", self.gain.is_finite() && self.gain != T::ZERO),
            ("back_emf", self.back_emf.is_finite()),
            ("command_limit", positive(self.command_limit)),
            ("torque_limit", positive(self.torque_limit)),
            ("observer_bandwidth", positive(self.observer_bandwidth)),
            ("position_gain", non_negative(self.position_gain)),
            ("velocity_gain", non_negative(self.velocity_gain)),
            ("velocity_integral", non_negative(self.velocity_integral)),
            ("friction", self.friction.is_valid()),
            (
                "compensation",
                self.compensation.is_safe(self.velocity_gain),
            ),
            ("adaptation", self.adaptation.is_valid(self.period)),
            ("effects", self.effects.is_valid(self.inertia)),
        ];
        let bad = checks.into_iter().find(|(_, holds)| !holds);
        bad.map_or(Ok(()), |(parameter, _)| Err(Invalid { parameter }))
    }
}

impl Parameters<f64> {
    /// The parameters in `units`, with the unit of `u` being that of torque over `gain`'s: `u` keeps its own unit.
    ///
    /// Time counts in [`Units::time`]. For fixed point, a force around the Coulomb level, a position around a few counts
    /// and a velocity around the largest of the axis over a hundred keep all numbers in range.
    pub fn scaled<T: Scalar>(&self, units: &Units) -> Result<Parameters<T>, OutOfRange> {
        let time = units.time();
        let (force, position, velocity) = (units.force, units.position, units.velocity);
        let viscous = force / velocity;
        let scale = Units::scale::<T>;
        let friction = &self.friction;
        let (compensation, adaptation) = (&self.compensation, &self.adaptation);
        Ok(Parameters {
            period: scale("period", self.period, time)?,
            count: scale("count", self.count, position)?,
            inertia: scale("inertia", self.inertia, force * time / velocity)?,
            gain: scale("gain", self.gain, force)?,
            back_emf: scale("back_emf", self.back_emf, 1.0 / velocity)?,
            command_limit: scale("command_limit", self.command_limit, 1.0)?,
            torque_limit: scale("torque_limit", self.torque_limit, force)?,
            observer_bandwidth: scale("observer_bandwidth", self.observer_bandwidth, 1.0 / time)?,
            position_gain: scale("position_gain", self.position_gain, 1.0 / time)?,
            velocity_gain: scale("velocity_gain", self.velocity_gain, viscous)?,
            velocity_integral: scale("velocity_integral", self.velocity_integral, viscous / time)?,
            friction: Friction {
                coulomb: scale("coulomb", friction.coulomb, force)?,
                viscous: scale("viscous", friction.viscous, viscous)?,
                static_level: scale("static", friction.static_level, force)?,
                stribeck_velocity: scale(
                    "stribeck_velocity",
                    friction.stribeck_velocity,
                    velocity,
                )?,
                curve: friction.curve,
                bristle_stiffness: scale(
                    "bristle_stiffness",
                    friction.bristle_stiffness,
                    force / position,
                )?,
                bristle_damping: scale("bristle_damping", friction.bristle_damping, viscous)?,
            },
            compensation: Compensation {
                method: compensation.method,
                driver: compensation.driver,
                share: scale("share", compensation.share, 1.0)?,
                slope: scale("slope", compensation.slope, viscous)?,
                crossing: scale("crossing", compensation.crossing, velocity)?,
            },
            adaptation: Adaptation {
                method: adaptation.method,
                speed: scale("adaptation speed", adaptation.speed, velocity)?,
                lowest: scale("lowest level", adaptation.lowest, force)?,
                highest: scale("highest level", adaptation.highest, force)?,
                rate: scale("adaptation rate", adaptation.rate, 1.0 / time)?,
                window: scale("adaptation window", adaptation.window, time)?,
                forgotten: scale("forgotten share", adaptation.forgotten, 1.0)?,
                offset: scale("expected offset", adaptation.offset, 1.0)?,
            },
            effects: self.effects.scaled(units)?,
        })
    }
}

impl Effects<f64> {
    fn scaled<T: Scalar>(&self, units: &Units) -> Result<Effects<T>, OutOfRange> {
        // An amplitude may be as small as it likes: what the number type cannot hold is no torque.
        let wave = |wave: &Harmonic<f64>| Harmonic {
            cycle: wave.cycle,
            sine: T::from_f64(wave.sine / units.force),
            cosine: T::from_f64(wave.cosine / units.force),
        };
        let scale = Units::scale::<T>;
        Ok(Effects {
            offset: T::from_f64(self.offset / units.force),
            viscous_difference: scale(
                "viscous difference",
                self.viscous_difference,
                units.force / units.velocity,
            )?,
            stiffness: scale("stiffness", self.stiffness, units.force / units.position)?,
            waves: self.waves.each_ref().map(wave),
            friction: wave(&self.friction),
            backlash: Backlash {
                gap: scale("gap", self.backlash.gap, 1.0)?,
                inertia: scale(
                    "load inertia",
                    self.backlash.inertia,
                    units.force * units.time() / units.velocity,
                )?,
                speed: scale("flank speed", self.backlash.speed, units.velocity)?,
            },
        })
    }
}
