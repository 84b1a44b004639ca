//! How an axis moves, which decides its units.

/// How an axis moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// rad and N·m.
    Rotary,
    /// m and N.
    Linear,
}

impl Motion {
    /// rad or m to a turn or a metre, which encoder counts and periods are counted by.
    pub fn turn(self) -> f64 {
        match self {
            Self::Rotary => std::f64::consts::TAU,
            Self::Linear => 1.0,
        }
    }

    /// The word in the model file.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Rotary => "rotary",
            Self::Linear => "linear",
        }
    }
}
