//! Bristles with a Stribeck curve that is a Gaussian.

use super::{Curve, Dynamic};
use crate::Scalar;

/// `ż = v − σ0·|v|/g(v)·z`, `F = σ0·z + σ1·ż + Fv·v`, `g(v) = Fc + (Fs − Fc)·e^(−(v/vs)²)`
/// (Canudas de Wit, Olsson, Åström and Lischinsky 1995, eq. 1 to 4).
///
/// ```
/// use bristle_core::friction::{Dynamic, LuGre};
/// let law = LuGre::<f64> {
///     coulomb: 1.0, viscous: 0.4, static_level: 1.5,
///     stribeck_velocity: 0.001, bristle_stiffness: 1e5, bristle_damping: 300.0,
/// };
/// // A step a thousand times longer than the bristles need: they arrive where they belong.
/// let step = law.step(0.0_f64, 0.1, 0.1);
/// assert!((step.deflection - 1e-5).abs() < 1e-15);
/// assert!(step.force * 0.1 > 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGre<S> {
    /// Coulomb level `Fc` > 0, in N·m or N.
    pub coulomb: S,
    /// Viscous coefficient `Fv`, in N·m·s/rad or N·s/m.
    pub viscous: S,
    /// Static level `Fs` ≥ `Fc`, in N·m or N.
    pub static_level: S,
    /// Stribeck velocity `vs` > 0, in rad/s or m/s.
    pub stribeck_velocity: S,
    /// Bristle stiffness `σ0` > 0, in N·m/rad or N/m.
    pub bristle_stiffness: S,
    /// Bristle damping `σ1` ≥ 0, in N·m·s/rad or N·s/m.
    pub bristle_damping: S,
}

impl<S: Scalar> Dynamic<S> for LuGre<S> {
    fn level(&self, velocity: S) -> S {
        let decay = Curve::Exponential.decay(velocity / self.stribeck_velocity);
        self.coulomb + (self.static_level - self.coulomb) * decay
    }

    fn stiffness(&self) -> S {
        self.bristle_stiffness
    }

    fn damping(&self) -> S {
        self.bristle_damping
    }

    fn viscosity(&self) -> S {
        self.viscous
    }
}
