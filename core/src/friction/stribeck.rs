//! Friction that falls from a static level as sliding speeds up.

use serde::{Deserialize, Serialize};

use super::Friction;
use crate::Scalar;

/// How the static part decays with `x = v/vs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Curve {
    /// `e^(−x²)` (Armstrong-Hélouvry 1991; the curve of the `LuGre` model, Canudas de Wit et al. 1995, eq. 4).
    Exponential,
    /// `1/(1 + x²)` (Hess and Soom 1990): no exponential on the target, and `F·(vs² + v²)` is polynomial in
    /// the parameters, which makes them identifiable by linear algebra.
    Rational,
}

impl Curve {
    /// The decay at velocity ratio `x = v/vs`: 1 at rest, 0 at high speed.
    #[inline(always)]
    pub fn decay<S: Scalar>(self, x: S) -> S {
        match self {
            Self::Exponential => gaussian(x),
            Self::Rational => S::ONE.plus_product(x, x).reciprocal(),
        }
    }
}

/// `e^(−x²)`. Apart, as a rational curve is not to pay for its registers.
#[inline(never)]
fn gaussian<S: Scalar>(x: S) -> S {
    S::ONE - (x * x).relax().0
}

/// `F(v) = [Fc + (Fs − Fc)·d(v/vs)]·sgn v + Fv·v` with the decay `d` of [`Curve`].
///
/// ```
/// use bristle_core::friction::{Curve, Friction, Stribeck};
/// let law = Stribeck {
///     coulomb: 0.2, viscous: 0.0, static_level: 0.3, stribeck_velocity: 0.1, curve: Curve::Rational,
/// };
/// assert_eq!(law.sliding(0.1), 0.25); // half of the excess is left at v = vs
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stribeck<S> {
    /// Coulomb level `Fc` ≥ 0, in N·m or N.
    pub coulomb: S,
    /// Viscous coefficient `Fv`, in N·m·s/rad or N·s/m.
    pub viscous: S,
    /// Static level `Fs` ≥ `Fc`, in N·m or N.
    pub static_level: S,
    /// Stribeck velocity `vs` > 0, in rad/s or m/s.
    pub stribeck_velocity: S,
    /// Shape of the decay.
    pub curve: Curve,
}

impl<S: Scalar> Stribeck<S> {
    /// The Stribeck curve `g(v) = Fc + (Fs − Fc)·d(v/vs)`, without sign and viscous part.
    pub fn level(&self, velocity: S) -> S {
        let decay = self.curve.decay(velocity / self.stribeck_velocity);
        self.coulomb + (self.static_level - self.coulomb) * decay
    }
}

impl<S: Scalar> Friction<S> for Stribeck<S> {
    fn sliding(&self, velocity: S) -> S {
        self.level(velocity) * velocity.sign() + self.viscous * velocity
    }

    fn break_away(&self) -> S {
        self.static_level
    }
}

#[cfg(test)]
mod tests {
    use super::{Curve, Friction, Stribeck};

    fn law(curve: Curve) -> Stribeck<f64> {
        Stribeck {
            coulomb: 0.2,
            viscous: 0.01,
            static_level: 0.35,
            stribeck_velocity: 0.4,
            curve,
        }
    }

    #[test]
    fn falls_monotonically_from_static_to_coulomb() {
        for curve in [Curve::Exponential, Curve::Rational] {
            let law = law(curve);
            assert!((law.level(0.0) - 0.35).abs() < 1e-15);
            assert!((law.level(400.0) - 0.2).abs() < 1e-6);
            let levels: std::vec::Vec<f64> =
                (0..100).map(|k| law.level(f64::from(k) * 0.05)).collect();
            assert!(levels.windows(2).all(|w| w[1] <= w[0]));
        }
    }

    #[test]
    fn the_rational_curve_is_polynomial_in_its_parameters() {
        // (vs² + v²)·g = Fc·v² + Fs·vs²: the identity that linear identification rests on.
        let law = law(Curve::Rational);
        for k in 0..50 {
            let v = f64::from(k) * 0.07;
            let left = (0.16 + v * v) * law.level(v);
            assert!((left - (0.2 * v * v + 0.35 * 0.16)).abs() < 1e-14);
        }
    }

    #[test]
    fn single_precision_stays_within_its_rounding_envelope() {
        // x² takes 2 operations and a rounded vs, and the decay amplifies its error by x²; the relaxation adds 17
        // roundings of a value ≤ 1 and its difference from 1 another; level and force take 5 more operations and as
        // many rounded constants on values ≤ Fs + Fv·v. Each rounding is at most 2^-24 relative.
        let double = law(Curve::Exponential);
        let single = Stribeck {
            coulomb: 0.2_f32,
            viscous: 0.01,
            static_level: 0.35,
            stribeck_velocity: 0.4,
            curve: Curve::Exponential,
        };
        for k in 1..60 {
            let v = f64::from(k) * 0.04;
            let x2 = (v / 0.4) * (v / 0.4);
            let decay = (-x2).exp();
            let envelope =
                2f64.powi(-24) * (0.15 * (5.0 * x2 * decay + 18.0) + 10.0 * double.sliding(v));
            let error = (f64::from(single.sliding(v as f32)) - double.sliding(v)).abs();
            assert!(error <= envelope, "v = {v}: {error:e} > {envelope:e}");
        }
    }

    #[test]
    fn break_away_is_the_static_level() {
        assert!(law(Curve::Rational).reaction(0.0, 0.3) == 0.3);
        assert!(law(Curve::Rational).reaction(0.0, 0.5) == 0.35);
    }
}
