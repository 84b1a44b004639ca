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
    /// The word in the model file.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Rotary => "rotary",
            Self::Linear => "linear",
        }
    }
}
