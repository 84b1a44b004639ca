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

/// What the level has beyond the Coulomb level, prepared for the control path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Excess<T> {
    /// At rest.
    most: T,
    /// One over the Stribeck velocity.
    per_stribeck: T,
    /// None where there is no excess.
    curve: Option<Curve>,
}

impl<T: Scalar> Excess<T> {
    pub fn new(friction: &Friction<T>) -> Self {
        let most = friction.static_level - friction.coulomb;
        Self {
            most,
            per_stribeck: T::ONE / friction.stribeck_velocity,
            curve: (most != T::ZERO).then_some(friction.curve),
        }
    }

    /// At a velocity.
    #[inline(always)]
    pub fn at(&self, velocity: T) -> T {
        self.curve.map_or(T::ZERO, |curve| {
            self.most * curve.decay(velocity * self.per_stribeck)
        })
    }
}

/// A law at the Coulomb level of the moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law<'a, T> {
    pub friction: &'a Friction<T>,
    /// Its Coulomb level now.
    pub coulomb: T,
    pub excess: &'a Excess<T>,
}

impl<T: Scalar> Dynamic<T> for Law<'_, T> {
    #[inline(always)]
    fn level(&self, velocity: T) -> T {
        // Bristles without a level would bend for ever.
        let level = self.coulomb + self.excess.at(velocity);
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
