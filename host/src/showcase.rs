//! The axis that the demonstrations are about.

/// The axis as it is, but for what a demonstration adds: no diagnosis ever sees this text.
pub const AXIS: &str = "[plant]
motion = \"rotary\"
inertia = 0.012
[friction]
model = \"stribeck\"
coulomb = 0.18
viscous = 0.021
static = 0.30
stribeck_velocity = 0.7
";

/// What its owner believes.
pub const BASELINE: &str = "name = \"demonstration axis\"

[plant]
motion  = \"rotary\"
input   = \"torque\"
inertia = \"?\"

[friction]
model   = \"coulomb-viscous\"
coulomb = \"?\"
viscous = \"?\"
";

/// Counts of its encoder, per turn.
pub const COUNTS: f64 = 16384.0;
/// Torque that acts on it and is not recorded, RMS, N·m.
pub const DISTURBANCE: f64 = 0.01;
