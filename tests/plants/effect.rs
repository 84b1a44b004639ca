//! The laws of the effects, each with one scalar that sizes it.

use std::f64::consts::TAU;

use super::integrator::Place;

/// An effect: its law, and the scalar `x` by which it grows from nothing.
#[derive(Clone, Debug)]
pub(super) struct Effect {
    pub id: &'static str,
    pub x: f64,
    pub law: Law,
}

/// How friction falls with speed over Stribeck velocity.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fall {
    /// `exp(−(v/vs)^p)`.
    Exponential(f64),
    /// `1/(1 + (v/vs)²)`.
    Rational,
}

/// Shapes of the laws. `x` is a torque (force), unless said otherwise.
#[derive(Clone, Copy, Debug)]
pub(super) enum Law {
    /// Up to `most` as a difference of friction levels, the rest as constant torque.
    DirectionAsymmetry {
        side: f64,
        most: f64,
    },
    /// `x`: viscous coefficient added in one direction.
    ViscousAsymmetry {
        side: f64,
    },
    Stribeck {
        velocity: f64,
        fall: Fall,
    },
    /// `x`: coefficient of `v²`.
    QuadraticDrag,
    /// `x`: coefficient of `|v|^exponent`.
    PowerLawViscous {
        exponent: f64,
    },
    Gravity {
        phase: f64,
    },
    /// `x`: stiffness about the position `rest`.
    Spring {
        rest: f64,
    },
    /// `x`: stiffness; torque `x·(q + q³/knee²)` of `q` less `rest`.
    HardeningSpring {
        knee: f64,
        rest: f64,
    },
    /// `wave`: radians of phase per unit of position; `second`: share of the second harmonic.
    Cogging {
        wave: f64,
        phase: f64,
        second: f64,
    },
    /// `x`: seconds. Applied by the sampled loop.
    Delay,
    /// `x`: breakaway distance. Applied by the integrator.
    Presliding {
        rise: f64,
        stribeck: f64,
        damping: f64,
    },
    PositionDependentFriction {
        wave: f64,
        phase: f64,
    },
    /// `x`: viscous coefficient that goes away with time constant `tau`.
    ThermalDrift {
        tau: f64,
    },
    /// `x`: friction per torque, no unit.
    LoadDependentFriction,
    PeriodicDisturbance {
        frequency: f64,
        phase: f64,
    },
    LoadStep {
        side: f64,
        on: f64,
        off: f64,
    },
    InputDeadZone,
    /// Torque limited to `peak·exp(−x)`.
    Saturation {
        peak: f64,
    },
    /// `x`: relative ripple, no unit.
    TorqueRipple {
        wave: f64,
        phase: f64,
    },
    /// `x`: viscous coefficient where it is greatest; no effect of the contract's catalogue.
    PositionDependentViscous {
        wave: f64,
        phase: f64,
    },
    /// `x`: torque per squared speed, as a body that turns with a joint exerts; no effect of the contract's catalogue.
    Centrifugal {
        wave: f64,
        phase: f64,
    },
    /// `x`: share of the drive's gain lost at the end, evenly over `end` seconds; no effect of the contract's catalogue.
    FadingGain {
        end: f64,
    },
    /// `x`: friction level added while two slow waves of those periods, in s, add up to more than one; no effect of the
    /// contract's catalogue.
    Jamming {
        periods: [f64; 2],
        phase: f64,
    },
    /// `x`: seconds. Applied by the sampled loop.
    ActuatorLag,
    /// `x`: square of the load's period, s², with the other side held; `share`: of the inertia. Applied by the integrator.
    Compliance {
        share: f64,
        damping: f64,
    },
    /// `x`: play in all; `share`: of the inertia; `friction`: share of the friction that is the load's. Applied by the
    /// integrator.
    Backlash {
        share: f64,
        friction: f64,
    },
    /// `x`: share by which the inertia of the model file is off. Nothing of it is in the motion.
    InertiaMismatch {
        side: f64,
    },
    /// `x`: rad. The encoder shows `x·sin(q + phase)` too much. Applied by the sampled loop.
    SensorEccentricity {
        phase: f64,
    },
}

impl Effect {
    /// Torque of the drive after this effect.
    pub fn drive(&self, u: f64, q: f64, t: f64) -> f64 {
        match self.law {
            Law::FadingGain { end } => u * (1.0 - self.x * t / end),
            Law::InputDeadZone => (u.abs() - self.x).max(0.0).copysign(u),
            Law::Saturation { peak } => {
                let limit = peak * (-self.x).exp();
                u.clamp(-limit, limit)
            }
            Law::TorqueRipple { wave, phase } => u * (1.0 + self.x * (wave * q + phase).sin()),
            _ => u,
        }
    }

    /// What the encoder shows too much.
    pub fn error(&self, q: f64) -> f64 {
        match self.law {
            Law::SensorEccentricity { phase } => self.x * (q + phase).sin(),
            _ => 0.0,
        }
    }

    /// Torque that does not depend on the direction of motion.
    pub fn external(&self, q: f64, v: f64, t: f64) -> f64 {
        let x = self.x;
        match self.law {
            Law::Centrifugal { wave, phase } => x * v * v * (wave * q + phase).sin(),
            Law::DirectionAsymmetry { side, most } => -side * (x - most).max(0.0),
            Law::Gravity { phase } => -x * (q + phase).sin(),
            Law::Spring { rest } => -x * (q - rest),
            Law::HardeningSpring { knee, rest } => {
                let q = q - rest;
                -x * q * (1.0 + (q / knee).powi(2))
            }
            Law::Cogging {
                wave,
                phase,
                second,
            } => {
                let angle = wave * q + phase;
                x * (angle.sin() + second * (2.0 * angle + 1.0).sin())
            }
            Law::PeriodicDisturbance { frequency, phase } => {
                x * (TAU * frequency * t + phase).sin()
            }
            Law::LoadStep { side, on, off } if t >= on && t < off => -side * x,
            _ => 0.0,
        }
    }

    /// Addition to the friction level at a speed, in the direction `side`.
    pub fn friction(&self, speed: f64, side: f64, at: &Place) -> f64 {
        let x = self.x;
        match self.law {
            Law::DirectionAsymmetry { side: heavy, most } => side * heavy * x.min(most),
            Law::ViscousAsymmetry { side: heavy } if side == heavy => x * speed,
            Law::Stribeck { velocity, fall } => x * fall.at(speed / velocity),
            Law::QuadraticDrag => x * speed * speed,
            Law::PowerLawViscous { exponent } => x * speed.powf(exponent),
            Law::PositionDependentFriction { wave, phase } => {
                0.5 * x * (1.0 + (wave * at.q + phase).sin())
            }
            Law::PositionDependentViscous { wave, phase } => {
                0.5 * x * speed * (1.0 + (wave * at.q + phase).sin())
            }
            Law::Jamming { periods, phase } => {
                let waves = periods.map(|p| (TAU * at.t / p + phase).sin());
                if waves[0] + waves[1] > 1.0 { x } else { 0.0 }
            }
            Law::ThermalDrift { tau } => x * speed * (-at.t / tau).exp(),
            Law::LoadDependentFriction => x * at.load,
            _ => 0.0,
        }
    }

    /// The parameters in SI units, for the record.
    pub fn parameters(&self) -> Vec<(&'static str, &'static str, f64)> {
        let x = self.x;
        let named: Vec<(&'static str, f64)> = match self.law {
            Law::DirectionAsymmetry { side, most } => {
                vec![("offset", side * x), ("friction_part", side * x.min(most))]
            }
            Law::ViscousAsymmetry { side } => vec![("added", x), ("side", side)],
            Law::Stribeck { velocity, fall } => vec![
                ("rise", x),
                ("stribeck_velocity", velocity),
                ("exponent", fall.exponent()),
            ],
            Law::QuadraticDrag => vec![("coefficient", x)],
            Law::PowerLawViscous { exponent } => vec![("coefficient", x), ("exponent", exponent)],
            Law::Gravity { phase } => vec![("amplitude", x), ("phase", phase)],
            Law::Spring { rest } => vec![("stiffness", x), ("rest", rest)],
            Law::HardeningSpring { knee, rest } => {
                vec![
                    ("stiffness", x),
                    ("cubic", x / (knee * knee)),
                    ("rest", rest),
                ]
            }
            Law::Cogging {
                wave,
                phase,
                second,
            } => vec![
                ("amplitude", x),
                ("wave", wave),
                ("phase", phase),
                ("second", second),
            ],
            Law::Delay => vec![("delay", x)],
            Law::Presliding {
                rise,
                stribeck,
                damping,
            } => vec![
                ("breakaway_distance", x),
                ("rise", rise),
                ("stribeck_velocity", stribeck),
                ("damping_ratio", damping),
            ],
            Law::FadingGain { end } => vec![("lost", x), ("end", end)],
            Law::Jamming { periods, phase } => vec![
                ("rise", x),
                ("period", periods[0]),
                ("second_period", periods[1]),
                ("phase", phase),
            ],
            Law::PositionDependentFriction { wave, phase }
            | Law::Centrifugal { wave, phase }
            | Law::PositionDependentViscous { wave, phase } => {
                vec![("rise", x), ("wave", wave), ("phase", phase)]
            }
            Law::ThermalDrift { tau } => vec![("viscous_lost", x), ("tau", tau)],
            Law::LoadDependentFriction => vec![("coefficient", x)],
            Law::PeriodicDisturbance { frequency, phase } => {
                vec![("amplitude", x), ("frequency", frequency), ("phase", phase)]
            }
            Law::LoadStep { side, on, off } => {
                vec![("torque", -side * x), ("on", on), ("off", off)]
            }
            Law::InputDeadZone => vec![("half_width", x)],
            Law::Saturation { peak } => vec![("limit", peak * (-x).exp())],
            Law::TorqueRipple { wave, phase } => {
                vec![("ripple", x), ("wave", wave), ("phase", phase)]
            }
            Law::Compliance { share, damping } => vec![
                ("antiresonance", x.sqrt().recip()),
                ("load_share", share),
                ("damping_ratio", damping),
            ],
            Law::Backlash { share, friction } => vec![
                ("gap", x),
                ("load_share", share),
                ("load_friction_share", friction),
            ],
            Law::ActuatorLag => vec![("time_constant", x)],
            Law::InertiaMismatch { side } => vec![("true_over_given", (side * x).exp())],
            Law::SensorEccentricity { phase } => vec![("amplitude", x), ("phase", phase)],
        };
        let with_id = |(name, value)| (self.id, name, value);
        named.into_iter().map(with_id).collect()
    }
}

impl Fall {
    /// Share of the breakaway rise left at a relative speed.
    fn at(self, speed: f64) -> f64 {
        match self {
            Self::Exponential(power) => (-speed.powf(power)).exp(),
            Self::Rational => 1.0 / (1.0 + speed * speed),
        }
    }

    /// The exponent, 0 for the rational form.
    fn exponent(self) -> f64 {
        match self {
            Self::Exponential(power) => power,
            Self::Rational => 0.0,
        }
    }
}
