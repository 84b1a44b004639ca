//! Bristles with a rational Stribeck curve.

use super::{Curve, Dynamic};
use crate::Scalar;

/// `ż = v − σ0·|v|/g(v)·z`, `F = σ0·z + σ1·ż + Fv·v`, `g(v) = Fc + (Fs − Fc)/(1 + (v/vs)²)`.
///
/// [`LuGre`](super::LuGre) with the curve of Hess and Soom (1990): no exponential in `g`, and
/// `g(v)·(vs² + v²)` is polynomial in the parameters, which makes them identifiable by linear algebra.
///
/// ```
/// use bristle_core::friction::{Dynamic, ModifiedLuGre};
/// let law = ModifiedLuGre {
///     coulomb: 1.0, viscous: 0.0, static_level: 1.5,
///     stribeck_velocity: 0.5, bristle_stiffness: 1e5, bristle_damping: 300.0,
/// };
/// assert_eq!(law.steady(0.5), 1.25); // half of the excess is left at v = vs
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModifiedLuGre<S> {
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

impl<S: Scalar> Dynamic<S> for ModifiedLuGre<S> {
    fn level(&self, velocity: S) -> S {
        let decay = Curve::Rational.decay(velocity / self.stribeck_velocity);
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
