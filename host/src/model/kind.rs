//! Plants that a model file can choose, and the constants that plants and friction laws have beyond an axis's own.

use super::{Causality, Law, Model, Motion, Parameter};

/// What `plant.kind` says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// One inertia with friction.
    #[default]
    Axis,
    /// An axis that a spring holds.
    MassSpring,
    /// A motor with armature resistance and inductance.
    DcMotor,
    /// The same behind a gear.
    GearedServo,
    /// The drive, axle and wheel of rolling stock on a rail.
    WheelSlip,
}

/// A constant that is given rather than fitted: its name in the file and what it is when left out.
pub(super) struct Spec {
    pub name: &'static str,
    pub default: Default,
}

/// What a constant is when it is left out.
#[derive(Clone, Copy)]
pub(super) enum Default {
    /// Unknown, and positive when given.
    Unknown,
    /// This number; not negative when given.
    Number(f64),
    /// The same as another constant of its section.
    SameAs(&'static str),
}

/// A constant of a model, under its dotted key.
#[derive(Clone, Debug, PartialEq)]
pub struct Constant {
    /// `plant.resistance`, for example.
    pub key: String,
    /// Its value, if known.
    pub parameter: Parameter,
}

const fn unknown(name: &'static str) -> Spec {
    let default = Default::Unknown;
    Spec { name, default }
}

const fn number(name: &'static str, number: f64) -> Spec {
    let default = Default::Number(number);
    Spec { name, default }
}

impl Kind {
    /// Words of the model file.
    pub(super) const WORDS: [&str; 5] = [
        "axis",
        "mass-spring",
        "dc-motor",
        "geared-servo",
        "wheel-slip",
    ];

    pub(super) fn from_word(word: &str) -> Self {
        match word {
            "mass-spring" => Self::MassSpring,
            "dc-motor" => Self::DcMotor,
            "geared-servo" => Self::GearedServo,
            "wheel-slip" => Self::WheelSlip,
            _ => Self::Axis,
        }
    }

    /// The word in the model file.
    pub fn as_str(self) -> &'static str {
        Self::WORDS[self as usize]
    }

    /// Whether the input is the voltage at a motor's terminals.
    pub fn is_electric(self) -> bool {
        matches!(self, Self::DcMotor | Self::GearedServo)
    }

    /// What a plant of this kind cannot have, if anything: the key and a message.
    pub(super) fn unsuited(self, motion: Motion, input: &str) -> Option<(&'static str, String)> {
        let (key, what) = if self.is_electric() && motion != Motion::Rotary {
            ("plant.motion", "turns; write motion = \"rotary\"")
        } else if self.is_electric() && input != "voltage" {
            let what = "is driven by the voltage at its terminals; write input = \"voltage\"";
            ("plant.input", what)
        } else if self == Self::WheelSlip && motion != Motion::Linear {
            let what = "counts everything at the rim of the wheel, in m, N and kg; write motion = \"linear\"";
            ("plant.motion", what)
        } else {
            return None;
        };
        Some((key, format!("plant.kind = {:?} {what}", self.as_str())))
    }

    pub(super) fn constants(self) -> &'static [Spec] {
        const BACK_EMF: Spec = Spec {
            name: "back_emf",
            default: Default::SameAs("torque_constant"),
        };
        match self {
            Self::Axis => {
                const {
                    &[
                        number("back_emf", 0.0),
                        number("electrical_time_constant", 0.0),
                    ]
                }
            }
            Self::MassSpring => const { &[unknown("stiffness")] },
            Self::DcMotor => {
                const {
                    &[
                        unknown("resistance"),
                        unknown("inductance"),
                        unknown("torque_constant"),
                        BACK_EMF,
                    ]
                }
            }
            Self::GearedServo => {
                const {
                    &[
                        unknown("resistance"),
                        unknown("inductance"),
                        unknown("torque_constant"),
                        BACK_EMF,
                        unknown("motor_inertia"),
                        unknown("gear_ratio"),
                        number("gear_efficiency", 1.0),
                        number("motor_efficiency", 1.0),
                    ]
                }
            }
            Self::WheelSlip => {
                const {
                    &[
                        unknown("wheel_mass"),
                        unknown("vehicle_mass"),
                        unknown("axle_stiffness"),
                        number("axle_damping", 0.0),
                        number("vehicle_drag", 0.0),
                    ]
                }
            }
        }
    }
}

impl Law {
    /// Words of the model file.
    pub(super) const WORDS: [&str; 6] = [
        "coulomb-viscous",
        "stribeck",
        "static",
        "dahl",
        "lugre",
        "modified-lugre",
    ];

    pub(super) fn from_word(word: &str) -> Self {
        match word {
            "stribeck" => Self::Stribeck,
            "static" => Self::Static,
            "dahl" => Self::Dahl,
            "lugre" => Self::LuGre,
            "modified-lugre" => Self::ModifiedLuGre,
            _ => Self::CoulombViscous,
        }
    }

    /// The word in the model file.
    pub fn as_str(self) -> &'static str {
        Self::WORDS[self as usize]
    }
}

impl Model {
    /// The value of a constant such as `plant.resistance`; NaN if it has none, which [`Model::first_unknown`] tells.
    pub fn constant(&self, key: &str) -> f64 {
        let found = self.constants.iter().find(|c| c.key == key);
        found.and_then(|c| c.parameter.value).unwrap_or(f64::NAN)
    }

    /// What velocity takes off the input of an axis, in the unit of `u` per rad/s or m/s: the back-EMF of a motor under
    /// voltage.
    pub fn back_emf(&self) -> f64 {
        match self.kind {
            Kind::Axis => self.constant("plant.back_emf"),
            _ => 0.0,
        }
    }

    /// Time constant `L/R` of the winding of an axis that a voltage drives, s. An imposed motion drives none.
    pub fn winding_lag(&self) -> f64 {
        match (self.kind, self.causality) {
            (Kind::Axis, Causality::Forward) => self.constant("plant.electrical_time_constant"),
            _ => 0.0,
        }
    }

    /// What of this model can be simulated but not fitted, if anything, a plant beyond an axis: its
    /// key and a message.
    pub fn unfittable(&self) -> Option<(&'static str, String)> {
        if self.kind == Kind::Axis {
            return None;
        }
        let what = format!(
            "plant.kind = {:?} can be simulated but not fitted; fit an axis (or a dc-motor) to its recording, without kind and the constants that belong to it",
            self.kind.as_str()
        );
        Some(("plant.kind", what))
    }

    /// What of an axis is left open although no fit estimates it, if anything: its key and a message.
    pub(super) fn not_estimated(&self) -> Option<(&'static str, String)> {
        const WHAT: [(&str, &str); 2] = [
            (
                "plant.back_emf",
                "slows the axis as viscous friction does, and no recording tells one from the other; write its number, or leave it out, and viscous friction holds both",
            ),
            (
                "plant.electrical_time_constant",
                "is not estimated; write L/R in s, or leave it out, and a diagnosis names the lag if it shows",
            ),
        ];
        let open = |(key, _): &(&str, &str)| self.constant(key).is_nan();
        let (key, what) = WHAT.into_iter().find(open)?;
        Some((key, format!("{key} {what}")))
    }
}
