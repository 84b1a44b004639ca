//! Friction with exact sticking and an exponential fall from the static level.

use super::Friction;
use crate::Scalar;

/// `F(v) = [Fc + (Fs − Fc)·e^(−|v|/vs) + Fv·|v|]·sgn v`; at rest the reaction balances the other forces up to `Fs`.
///
/// This is the static law of the source (eq. 11 and 12), `[F̂c + Fv·|v| + B·(e^(−β·|v|) − 1)]·sgn v`, in the names
/// used everywhere else: its `F̂c` is the level at `v = 0` and so our `Fs`, its `B` is `Fs − Fc` and its `β` is
/// `1/vs`. Sticking meets its *smooth sticky condition*: the largest reaction at rest is the limit of the sliding
/// force at `v → 0`, so a contact that lets go does so without a jump of force, and at `|a| ≤ Fs` the reaction is
/// exactly the active force `a`, which leaves the velocity exactly zero. (The extended abstract prints
/// `max{Fc, |a|}` in eq. 11; inside the sticking area the physical reaction has the magnitude of `a`.)
///
/// ```
/// use bristle_core::friction::{Friction, Static};
/// let law = Static { coulomb: 0.25, viscous: 0.5, static_level: 0.375, stribeck_velocity: 0.1 };
/// assert_eq!(law.reaction(0.0, -0.3), -0.3); // sticks: the forces cancel exactly
/// assert_eq!(law.reaction(0.0, 9.0), 0.375); // breaks away
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Static<S> {
    /// Coulomb level `Fc` ≥ 0, reached at high speed, in N·m or N.
    pub coulomb: S,
    /// Viscous coefficient `Fv`, in N·m·s/rad or N·s/m.
    pub viscous: S,
    /// Static level `Fs` ≥ `Fc`, in N·m or N.
    pub static_level: S,
    /// Velocity `vs` > 0 at which 1/e of the excess over `Fc` is left, in rad/s or m/s.
    pub stribeck_velocity: S,
}

impl<S: Scalar> Friction<S> for Static<S> {
    fn sliding(&self, velocity: S) -> S {
        let speed = velocity.abs();
        let decay = S::ONE - (speed / self.stribeck_velocity).relax().0;
        let level = self.coulomb + (self.static_level - self.coulomb) * decay;
        level * velocity.sign() + self.viscous * velocity
    }

    fn break_away(&self) -> S {
        self.static_level
    }
}
