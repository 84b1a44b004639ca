//! Coulomb and viscous friction.

use super::Friction;
use crate::Scalar;

/// `F(v) = Fc·sgn v + Fv·v`.
///
/// ```
/// use bristle_core::friction::{CoulombViscous, Friction};
/// let law = CoulombViscous { coulomb: 0.25, viscous: 0.5 };
/// assert_eq!(law.sliding(-2.0), -1.25);
/// assert_eq!(law.reaction(0.0, 0.15), 0.15); // sticks: the reaction balances the active force
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoulombViscous<S> {
    /// Coulomb level `Fc` ≥ 0, in N·m or N.
    pub coulomb: S,
    /// Viscous coefficient `Fv`, in N·m·s/rad or N·s/m.
    pub viscous: S,
}

impl<S: Scalar> Friction<S> for CoulombViscous<S> {
    fn sliding(&self, velocity: S) -> S {
        self.coulomb * velocity.sign() + self.viscous * velocity
    }

    fn break_away(&self) -> S {
        self.coulomb
    }
}

#[cfg(test)]
mod tests {
    use super::{CoulombViscous, Friction};

    const LAW: CoulombViscous<f64> = CoulombViscous {
        coulomb: 0.2,
        viscous: 0.01,
    };

    #[test]
    fn is_odd_and_dissipative() {
        for k in -100..=100 {
            let v = f64::from(k) * 0.37;
            assert!(LAW.sliding(v) == -LAW.sliding(-v));
            assert!(LAW.sliding(v) * v >= 0.0);
        }
    }

    #[test]
    fn at_rest_the_reaction_balances_up_to_break_away() {
        assert!(LAW.reaction(0.0, -0.19) == -0.19);
        assert!(LAW.reaction(0.0, 5.0) == 0.2);
    }
}
