//! What a controller knows about dry and viscous friction.

use serde::{Deserialize, Serialize};

use crate::Scalar;
use crate::friction::{Curve, Dynamic};

/// Parameters of any law of [`crate::friction`] that a controller compensates.
///
/// Coulomb-viscous friction has `static_level = coulomb`; Dahl's law has no damping besides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Friction<T> {
    /// Coulomb level `Fc` ≥ 0, N·m or N.
    pub coulomb: T,
    /// Viscous coefficient `Fv` ≥ 0, N·m·s/rad or N·s/m.
    pub viscous: T,
    /// Static level `Fs` ≥ `Fc`, N·m or N.
    pub static_level: T,
    /// Stribeck velocity `vs` > 0, rad/s or m/s.
    pub stribeck_velocity: T,
    /// Shape of the Stribeck curve.
    pub curve: Curve,
    /// Bristle stiffness `σ0` > 0, N·m/rad or N/m; of no meaning without an observer of bristles.
    pub bristle_stiffness: T,
    /// Bristle damping `σ1` ≥ 0, N·m·s/rad or N·s/m.
    pub bristle_damping: T,
}

impl<T: Scalar> Friction<T> {
    /// Whether every parameter is finite and in the range that its field says.
    pub fn is_valid(&self) -> bool {
        let non_negative = [self.coulomb, self.viscous, self.bristle_damping];
        let positive = [self.stribeck_velocity, self.bristle_stiffness];
        non_negative
            .into_iter()
            .all(|x| x.is_finite() && x >= T::ZERO)
            && positive.into_iter().all(|x| x.is_finite() && x > T::ZERO)
            && self.static_level.is_finite()
            && self.static_level >= self.coulomb
    }
}

/// A law at the Coulomb level of the moment.
pub(super) struct Law<'a, T> {
    pub friction: &'a Friction<T>,
    /// Its Coulomb level now.
    pub coulomb: T,
    /// One over its Stribeck velocity.
    pub per_stribeck: T,
}

impl<T: Scalar> Law<'_, T> {
    /// What the level has at this velocity beyond the Coulomb level.
    pub fn excess(&self, velocity: T) -> T {
        let most = self.friction.static_level - self.friction.coulomb;
        if most == T::ZERO {
            return T::ZERO;
        }
        most * self.friction.curve.decay(velocity * self.per_stribeck)
    }
}

impl<T: Scalar> Dynamic<T> for Law<'_, T> {
    fn level(&self, velocity: T) -> T {
        // Bristles without a level would bend for ever.
        let level = self.coulomb + self.excess(velocity);
        if level > T::EPSILON {
            level
        } else {
            T::EPSILON
        }
    }
    fn stiffness(&self) -> T {
        self.friction.bristle_stiffness
    }
    fn damping(&self) -> T {
        self.friction.bristle_damping
    }
    fn viscosity(&self) -> T {
        self.friction.viscous
    }
}
