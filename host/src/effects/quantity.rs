//! What the parameters of effects measure.

use crate::motion::Motion;

/// What a parameter measures; the unit follows from it and from the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// kg·m² or kg.
    Inertia,
    /// Torque or force per unit of `u`.
    Gain,
    /// N·m or N.
    Torque,
    /// Torque or force per speed.
    Viscous,
    /// Torque or force per squared speed.
    Quadratic,
    /// Torque or force per speed to a power below one.
    PowerLaw,
    /// Torque or force per displacement.
    Stiffness,
    /// Torque or force per cubed displacement.
    Cubic,
    /// rad/s or m/s.
    Speed,
    /// rad/s² or m/s².
    Acceleration,
    /// rad or m.
    Position,
    /// rad.
    Phase,
    /// Periods per turn or per metre.
    Periodicity,
    /// s.
    Time,
    /// Hz.
    Frequency,
    /// What the input is measured in.
    Input,
    /// A pure number.
    Number,
}

impl Quantity {
    /// Whether only whole numbers make sense: what repeats within a turn closes on itself.
    pub fn is_whole(self, motion: Motion) -> bool {
        self == Self::Periodicity && motion == Motion::Rotary
    }

    /// The SI unit on an axis of this motion.
    pub fn unit(self, motion: Motion) -> &'static str {
        let (rotary, linear) = match self {
            Self::Inertia => ("kg*m^2", "kg"),
            Self::Torque | Self::Input => ("N*m", "N"),
            Self::Viscous => ("N*m*s/rad", "N*s/m"),
            Self::Quadratic => ("N*m*s^2/rad^2", "N*s^2/m^2"),
            Self::PowerLaw => ("N*m*(s/rad)^exponent", "N*(s/m)^exponent"),
            Self::Stiffness => ("N*m/rad", "N/m"),
            Self::Cubic => ("N*m/rad^3", "N/m^3"),
            Self::Speed => ("rad/s", "m/s"),
            Self::Acceleration => ("rad/s^2", "m/s^2"),
            Self::Position => ("rad", "m"),
            Self::Phase => ("rad", "rad"),
            Self::Periodicity => ("1/turn", "1/m"),
            Self::Time => ("s", "s"),
            Self::Frequency => ("Hz", "Hz"),
            Self::Gain | Self::Number => ("1", "1"),
        };
        if motion == Motion::Rotary {
            rotary
        } else {
            linear
        }
    }
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spec {
    /// Name in the model file and in the JSON.
    pub name: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// Values that physics allows.
    pub bounds: (f64, f64),
}

impl Spec {
    /// A parameter of any sign and size.
    pub(super) const fn new(name: &'static str, quantity: Quantity) -> Self {
        Self::within(name, quantity, (f64::NEG_INFINITY, f64::INFINITY))
    }

    /// A parameter within bounds.
    pub(super) const fn within(name: &'static str, quantity: Quantity, bounds: (f64, f64)) -> Self {
        Self {
            name,
            quantity,
            bounds,
        }
    }
}
