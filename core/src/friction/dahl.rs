//! Bristles without Stribeck effect.

use super::Dynamic;
use crate::Scalar;

/// `ż = v − (σ0/Fc)·|v|·z`, `F = σ0·z + Fv·v` (Dahl 1968 with exponent 1).
///
/// ```
/// use bristle_core::friction::{Dahl, Dynamic};
/// let law = Dahl { coulomb: 0.25, viscous: 0.5, bristle_stiffness: 100.0 };
/// assert_eq!(law.steady(-2.0), -1.25);
/// assert_eq!(law.force(0.001, 0.0), 0.1); // presliding: a spring
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dahl<S> {
    /// Coulomb level `Fc` > 0, in N·m or N.
    pub coulomb: S,
    /// Viscous coefficient `Fv`, in N·m·s/rad or N·s/m.
    pub viscous: S,
    /// Bristle stiffness `σ0` > 0, in N·m/rad or N/m.
    pub bristle_stiffness: S,
}

impl<S: Scalar> Dynamic<S> for Dahl<S> {
    fn level(&self, _: S) -> S {
        self.coulomb
    }

    fn stiffness(&self) -> S {
        self.bristle_stiffness
    }

    fn damping(&self) -> S {
        S::ZERO
    }

    fn viscosity(&self) -> S {
        self.viscous
    }
}
