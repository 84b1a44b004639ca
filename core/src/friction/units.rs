//! Units in which a law is evaluated.

use core::fmt;

use super::{CoulombViscous, Dahl, LuGre, ModifiedLuGre, Static, Stribeck};
use crate::Scalar;

/// The force, position and velocity that the numbers of a scaled law count as 1.
///
/// A floating-point law needs none of this. In fixed point a law is built once in units where its numbers lie
/// around 1, and from there on the control path sees scaled numbers only: force over `force`, deflection over
/// `position`, velocity over `velocity`, and time over the [`Units::time`] that follows from those two. A good
/// choice is the static level for the force, the deflection at break-away `Fs/σ0` for the position, and for the
/// velocity one that makes the sampling period about one unit of time, `position/period`. Then velocities are
/// resolved to 2⁻¹⁶ break-away deflections a sample and reach up to 2¹⁵ of them.
///
/// ```
/// use bristle_core::friction::{Dahl, Dynamic, Units};
/// use bristle_core::scalar::{Q16, Scalar};
/// let law = Dahl { coulomb: 0.2, viscous: 0.01, bristle_stiffness: 400.0 };
/// let units = Units { force: 0.2, position: 0.2 / 400.0, velocity: 0.5 };
/// let scaled: Dahl<Q16> = law.scaled(&units)?;
/// let (z, v) = (Q16::from_f64(0.0003 / units.position), Q16::from_f64(0.4 / units.velocity));
/// let force = scaled.force(z, v).to_f64() * units.force;
/// assert!((force - law.force(0.0003, 0.4)).abs() < 1e-4 * units.force);
/// # Ok::<(), bristle_core::friction::OutOfRange>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// In N·m or N.
    pub force: f64,
    /// In rad or m.
    pub position: f64,
    /// In rad/s or m/s.
    pub velocity: f64,
}

/// A parameter that the number type cannot hold to 1 % in the chosen units: choose others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// The name of the parameter.
    pub parameter: &'static str,
    /// Its value in the chosen units.
    pub scaled: f64,
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { parameter, scaled } = self;
        write!(
            f,
            "{parameter} is {scaled} in the chosen units, which this number type cannot hold to 1 %"
        )
    }
}

impl core::error::Error for OutOfRange {}

impl Units {
    /// The time that counts as 1, in seconds.
    pub fn time(&self) -> f64 {
        self.position / self.velocity
    }

    pub(crate) fn scale<S: Scalar>(
        parameter: &'static str,
        value: f64,
        unit: f64,
    ) -> Result<S, OutOfRange> {
        let scaled = value / unit;
        let held = S::from_f64(scaled);
        if (held.to_f64() - scaled).abs() <= 0.01 * scaled.abs() {
            Ok(held)
        } else {
            Err(OutOfRange { parameter, scaled })
        }
    }

    fn level<S: Scalar>(&self, name: &'static str, value: f64) -> Result<S, OutOfRange> {
        Self::scale(name, value, self.force)
    }

    fn viscous<S: Scalar>(&self, name: &'static str, value: f64) -> Result<S, OutOfRange> {
        Self::scale(name, value, self.force / self.velocity)
    }

    /// The stiffness, provided that the deflection it gives under `coulomb` is resolved, too.
    fn stiffness<S: Scalar>(&self, value: f64, coulomb: f64) -> Result<S, OutOfRange> {
        Self::scale::<S>(
            "coulomb / bristle_stiffness",
            coulomb / value,
            self.position,
        )?;
        Self::scale("bristle_stiffness", value, self.force / self.position)
    }
}

impl CoulombViscous<f64> {
    /// The law in `units`.
    pub fn scaled<S: Scalar>(&self, units: &Units) -> Result<CoulombViscous<S>, OutOfRange> {
        Ok(CoulombViscous {
            coulomb: units.level("coulomb", self.coulomb)?,
            viscous: units.viscous("viscous", self.viscous)?,
        })
    }
}

impl Stribeck<f64> {
    /// The law in `units`.
    pub fn scaled<S: Scalar>(&self, units: &Units) -> Result<Stribeck<S>, OutOfRange> {
        Ok(Stribeck {
            coulomb: units.level("coulomb", self.coulomb)?,
            viscous: units.viscous("viscous", self.viscous)?,
            static_level: units.level("static", self.static_level)?,
            stribeck_velocity: Units::scale(
                "stribeck_velocity",
                self.stribeck_velocity,
                units.velocity,
            )?,
            curve: self.curve,
        })
    }
}

impl Static<f64> {
    /// The law in `units`.
    pub fn scaled<S: Scalar>(&self, units: &Units) -> Result<Static<S>, OutOfRange> {
        Ok(Static {
            coulomb: units.level("coulomb", self.coulomb)?,
            viscous: units.viscous("viscous", self.viscous)?,
            static_level: units.level("static", self.static_level)?,
            stribeck_velocity: Units::scale(
                "stribeck_velocity",
                self.stribeck_velocity,
                units.velocity,
            )?,
        })
    }
}

impl Dahl<f64> {
    /// The law in `units`.
    pub fn scaled<S: Scalar>(&self, units: &Units) -> Result<Dahl<S>, OutOfRange> {
        Ok(Dahl {
            coulomb: units.level("coulomb", self.coulomb)?,
            viscous: units.viscous("viscous", self.viscous)?,
            bristle_stiffness: units.stiffness(self.bristle_stiffness, self.coulomb)?,
        })
    }
}

/// The two laws that differ only in their curve have the same parameters.
macro_rules! scaled_lugre {
    ($($law:ident),*) => {$(
        impl $law<f64> {
            /// The law in `units`.
            pub fn scaled<S: Scalar>(&self, units: &Units) -> Result<$law<S>, OutOfRange> {
                Ok($law {
                    coulomb: units.level("coulomb", self.coulomb)?,
                    viscous: units.viscous("viscous", self.viscous)?,
                    static_level: units.level("static", self.static_level)?,
                    stribeck_velocity: Units::scale("stribeck_velocity", self.stribeck_velocity, units.velocity)?,
                    bristle_stiffness: units.stiffness(self.bristle_stiffness, self.coulomb)?,
                    bristle_damping: units.viscous("bristle_damping", self.bristle_damping)?,
                })
            }
        }
    )*};
}

scaled_lugre!(LuGre, ModifiedLuGre);

#[cfg(test)]
mod tests {
    use super::{LuGre, OutOfRange, Units};
    use crate::friction::Dynamic;
    use crate::scalar::{Q16, Scalar};

    const LAW: LuGre<f64> = LuGre {
        coulomb: 0.2,
        viscous: 0.01,
        static_level: 0.3,
        stribeck_velocity: 0.05,
        bristle_stiffness: 1500.0,
        bristle_damping: 0.6,
    };

    /// As the doc of [`Units`] recommends, at 10 kHz.
    const UNITS: Units = Units {
        force: 0.3,
        position: 0.3 / 1500.0,
        velocity: 0.3 / 1500.0 / 1e-4,
    };

    #[test]
    fn a_scaled_law_is_the_same_law() {
        let scaled: LuGre<f64> = LAW.scaled(&UNITS).unwrap();
        let (z, v, dt) = (1.1e-4, -0.3, 2.5e-4);
        let step = LAW.step(z, v, dt);
        let found = scaled.step(z / UNITS.position, v / UNITS.velocity, dt / UNITS.time());
        assert!(
            (found.deflection * UNITS.position - step.deflection).abs() < 1e-15 * UNITS.position
        );
        assert!((found.force * UNITS.force - step.force).abs() < 1e-14);
    }

    #[test]
    fn recommended_units_suit_fixed_point() {
        let scaled: LuGre<Q16> = LAW.scaled(&UNITS).unwrap();
        assert!((UNITS.time() - 1e-4).abs() < 1e-18);
        assert!(scaled.static_level == Q16::ONE && scaled.bristle_stiffness == Q16::ONE);
    }

    #[test]
    fn units_that_lose_a_parameter_are_refused_by_its_name() {
        let refused = |units: Units| {
            LAW.scaled::<Q16>(&units)
                .map_err(|OutOfRange { parameter, .. }| parameter)
        };
        assert_eq!(
            refused(Units {
                force: 1e4,
                ..UNITS
            }),
            Err("coulomb")
        );
        assert_eq!(
            refused(Units {
                force: 1e-7,
                ..UNITS
            }),
            Err("coulomb")
        );
        assert_eq!(
            refused(Units {
                velocity: 1e5,
                ..UNITS
            }),
            Err("stribeck_velocity")
        );
        assert_eq!(
            refused(Units {
                position: 10.0,
                ..UNITS
            }),
            Err("coulomb / bristle_stiffness")
        );
        // In SI units the stiffness fits, but the deflections, 1e-4 rad, are a few units of the last place.
        let si = Units {
            force: 1.0,
            position: 1.0,
            velocity: 1.0,
        };
        assert_eq!(refused(si), Err("coulomb / bristle_stiffness"));
        assert!(LAW.scaled::<f32>(&si).is_ok());
    }
}
