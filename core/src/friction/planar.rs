//! A contact that can slide in any direction of a plane.

use super::Friction;
use crate::Scalar;

/// A law without state on an isotropic contact: the reaction is a vector that opposes the velocity.
///
/// `r = F(|v|)·v/|v|` while sliding. At rest `r = a`, the sum of the other forces, while `|a|` is at most the
/// break-away level; beyond it `r` keeps the direction of `a` and has the break-away level as magnitude, so
/// that motion starts along `a`. `N = 2` for a plane; `N = 1` is the scalar law.
///
/// ```
/// use bristle_core::friction::{CoulombViscous, Planar};
/// let contact = Planar(CoulombViscous { coulomb: 2.0, viscous: 0.0 });
/// assert_eq!(contact.reaction([3.0, 4.0], [9.0, 9.0]), [1.2, 1.6]); // opposes v, whatever else acts
/// assert_eq!(contact.reaction([0.0, 0.0], [1.5, -1.0]), [1.5, -1.0]); // sticks
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planar<L>(pub L);

impl<L> Planar<L> {
    /// Friction while sliding, in N; zero at rest.
    pub fn sliding<S: Scalar, const N: usize>(&self, velocity: [S; N]) -> [S; N]
    where
        L: Friction<S>,
    {
        match unit(velocity) {
            Some((speed, direction)) => scaled(direction, self.0.sliding(speed)),
            None => velocity,
        }
    }

    /// The reaction to `active`, the sum of all other forces in the plane.
    pub fn reaction<S: Scalar, const N: usize>(&self, velocity: [S; N], active: [S; N]) -> [S; N]
    where
        L: Friction<S>,
    {
        if velocity.iter().any(|v| *v != S::ZERO) {
            return self.sliding(velocity);
        }
        match unit(active) {
            Some((magnitude, direction)) if magnitude > self.0.break_away() => {
                scaled(direction, self.0.break_away())
            }
            _ => active,
        }
    }
}

/// Magnitude and direction of a vector that is not zero.
fn unit<S: Scalar, const N: usize>(vector: [S; N]) -> Option<(S, [S; N])> {
    let norm = vector.into_iter().fold(S::ZERO, S::hypot);
    (norm != S::ZERO).then(|| (norm, vector.map(|x| x / norm)))
}

fn scaled<S: Scalar, const N: usize>(direction: [S; N], magnitude: S) -> [S; N] {
    direction.map(|x| magnitude * x)
}

#[cfg(test)]
mod tests {
    use super::Planar;
    use crate::friction::{Friction, Static};
    use std::vec::Vec;

    const LAW: Static<f64> = Static {
        coulomb: 0.8,
        viscous: 0.05,
        static_level: 1.3,
        stribeck_velocity: 0.2,
    };

    fn directions() -> Vec<[f64; 2]> {
        (0..64)
            .map(|k| (f64::from(k) * 0.1).sin_cos())
            .map(|(sine, cosine)| [cosine, sine])
            .collect()
    }

    fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
        a[0] * b[0] + a[1] * b[1]
    }

    #[test]
    fn the_reaction_opposes_the_velocity_and_nothing_else() {
        for d in directions() {
            for speed in [1e-200, 1e-3, 1.0, 1e200] {
                let r = Planar(LAW).sliding(d.map(|x| speed * x));
                let force = LAW.sliding(speed);
                assert!((dot(r, d) - force).abs() < 1e-14 * force);
                assert!((r[0] * d[1] - r[1] * d[0]).abs() < 1e-14 * force);
            }
        }
    }

    #[test]
    fn at_rest_it_balances_any_force_up_to_the_static_level_in_every_direction() {
        for d in directions() {
            let held = d.map(|x| 1.299 * x);
            assert_eq!(Planar(LAW).reaction([0.0; 2], held), held);
            let r = Planar(LAW).reaction([0.0; 2], d.map(|x| 5.0 * x));
            assert!((dot(r, d) - 1.3).abs() < 1e-14 && (dot(r, r).sqrt() - 1.3).abs() < 1e-14);
        }
    }

    #[test]
    fn on_a_line_it_is_the_scalar_law() {
        for k in -50..=50 {
            let v = f64::from(k) * 0.03;
            assert_eq!(Planar(LAW).reaction([v], [0.7]), [LAW.reaction(v, 0.7)]);
        }
    }
}
