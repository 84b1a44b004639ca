//! A friction law as it travels over the link.

use serde::{Deserialize, Serialize};

use crate::friction::{CoulombViscous, Curve, Friction, Stribeck};

/// The laws of [`crate::friction`] that a board can be told to run, in its own precision.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Law {
    /// Coulomb and viscous friction.
    CoulombViscous(#[serde(with = "CoulombViscousOnTheWire")] CoulombViscous<f32>),
    /// Friction that falls from a static level, with either curve.
    Stribeck(#[serde(with = "StribeckOnTheWire")] Stribeck<f32>),
}

impl Law {
    /// Whether every parameter is finite and in the range that its field documents.
    ///
    /// Checked once when a law is put in force, so that the evaluation itself needs no checks: with finite
    /// velocities, no valid law produces a NaN.
    pub fn is_valid(&self) -> bool {
        let non_negative = |x: f32| x.is_finite() && x >= 0.0;
        match *self {
            Self::CoulombViscous(law) => non_negative(law.coulomb) && non_negative(law.viscous),
            Self::Stribeck(law) => {
                non_negative(law.coulomb)
                    && non_negative(law.viscous)
                    && law.static_level.is_finite()
                    && law.static_level >= law.coulomb
                    && law.stribeck_velocity.is_finite()
                    && law.stribeck_velocity > 0.0
            }
        }
    }
}

impl Friction<f32> for Law {
    fn sliding(&self, velocity: f32) -> f32 {
        match self {
            Self::CoulombViscous(law) => law.sliding(velocity),
            Self::Stribeck(law) => law.sliding(velocity),
        }
    }

    fn break_away(&self) -> f32 {
        match self {
            Self::CoulombViscous(law) => law.break_away(),
            Self::Stribeck(law) => law.break_away(),
        }
    }
}

// The encoding of the laws is fixed here and not by a derive beside them, so that a change to a law's type cannot
// silently change the protocol: it stops compiling until the matter is looked at.

#[derive(Serialize, Deserialize)]
#[serde(remote = "CoulombViscous::<f32>")]
struct CoulombViscousOnTheWire {
    coulomb: f32,
    viscous: f32,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Stribeck::<f32>")]
struct StribeckOnTheWire {
    coulomb: f32,
    viscous: f32,
    static_level: f32,
    stribeck_velocity: f32,
    #[serde(with = "CurveOnTheWire")]
    curve: Curve,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Curve")]
enum CurveOnTheWire {
    Exponential,
    Rational,
}

#[cfg(test)]
mod tests {
    use super::Law;
    use crate::friction::{CoulombViscous, Curve, Friction, Stribeck};

    #[test]
    fn the_bytes_of_version_1_stay_as_they_are() {
        let law = Law::Stribeck(Stribeck {
            coulomb: 1.0,
            viscous: 2.0,
            static_level: 3.0,
            stribeck_velocity: 4.0,
            curve: Curve::Rational,
        });
        let mut buffer = [0; 32];
        let bytes = postcard::to_slice(&law, &mut buffer).unwrap();
        // Variant 1, four little-endian floats in the order of the fields, curve 1.
        let expected = [
            1, 0, 0, 0x80, 0x3F, 0, 0, 0, 0x40, 0, 0, 0x40, 0x40, 0, 0, 0x80, 0x40, 1,
        ];
        assert_eq!(bytes, expected);
    }

    #[test]
    fn no_valid_law_turns_a_finite_velocity_into_nan() {
        let extremes = [0.0, f32::from_bits(1), f32::MIN_POSITIVE, 1.0, f32::MAX];
        for curve in [Curve::Exponential, Curve::Rational] {
            for bits in 0..5_usize.pow(4) {
                let pick = |k: u32| extremes[bits / 5_usize.pow(k) % 5];
                let law = Law::Stribeck(Stribeck {
                    coulomb: pick(0),
                    viscous: pick(1),
                    static_level: pick(2),
                    stribeck_velocity: pick(3),
                    curve,
                });
                for v in extremes.into_iter().filter(|_| law.is_valid()) {
                    assert!(!law.sliding(v).is_nan() && !law.sliding(-v).is_nan());
                }
            }
        }
    }

    #[test]
    fn parameters_out_of_range_are_invalid() {
        let coulomb_viscous =
            |coulomb, viscous| Law::CoulombViscous(CoulombViscous { coulomb, viscous }).is_valid();
        assert!(coulomb_viscous(0.0, 0.0));
        for bad in [-1.0, f32::NAN, f32::INFINITY] {
            assert!(!coulomb_viscous(bad, 0.0) && !coulomb_viscous(0.0, bad));
        }
    }
}
