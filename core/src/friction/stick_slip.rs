//! Motion under a law without state, with the instants of sticking and slipping met exactly.

use super::Friction;
use crate::Scalar;

/// Position and velocity of an axis, in rad and rad/s or m and m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<S> {
    /// Position.
    pub position: S,
    /// Velocity; exactly zero while the axis sticks.
    pub velocity: S,
}

/// Phases of a step at most. Under a force that is linear in time an axis can stop, hold, break away and turn
/// back, but not more often than this; a saturating scalar might, and must end all the same.
const PHASES: usize = 8;

impl<S: Scalar> Motion<S> {
    /// The motion `dt` seconds later.
    ///
    /// `active` holds the sum of all other forces at the start and at the end of the step; between them it is
    /// linear in time. Friction is taken at the velocity in the middle of each phase, which is exact for Coulomb
    /// friction and of second order in `dt` otherwise. A step is cut where the velocity reaches zero and where
    /// the active force reaches the break-away level, so stops and starts do not degrade that order, and an axis
    /// that sticks has exactly zero velocity.
    #[must_use]
    pub fn step(self, law: &impl Friction<S>, inertia: S, active: [S; 2], dt: S) -> Self {
        let slope = (active[1] - active[0]) / dt;
        let (mut motion, mut time) = (self, S::ZERO);
        for _ in 0..PHASES {
            let left = dt - time;
            if left <= S::ZERO {
                break;
            }
            let phase = Phase {
                law,
                inertia,
                active: active[0] + slope * time,
                slope,
            };
            let elapsed;
            (motion, elapsed) = phase.run(motion, left);
            time += elapsed;
        }
        motion
    }
}

/// A stretch of a step in which the axis either sticks or slides one way.
struct Phase<'a, S, L> {
    law: &'a L,
    inertia: S,
    active: S,
    slope: S,
}

impl<S: Scalar, L: Friction<S>> Phase<'_, S, L> {
    /// The motion at the end of the phase, and how long it lasted.
    fn run(&self, start: Motion<S>, left: S) -> (Motion<S>, S) {
        if start.velocity != S::ZERO {
            return self.slide(start, start.velocity.sign(), left);
        }
        let excess = self.active - self.law.reaction(S::ZERO, self.active);
        if excess != S::ZERO {
            return self.slide(start, excess.sign(), left);
        }
        let Some(wait) = self.time_to_break_away().filter(|wait| *wait < left) else {
            return (start, left);
        };
        // The force is set to the level it has just reached: rounding must not leave it below.
        let direction = self.slope.sign();
        let active = self.law.break_away() * direction;
        let (motion, elapsed) = Phase { active, ..*self }.slide(start, direction, left - wait);
        (motion, wait + elapsed)
    }

    /// How long an axis at rest stays so under a force that changes.
    fn time_to_break_away(&self) -> Option<S> {
        let level = self.law.break_away() * self.slope.sign();
        (self.slope != S::ZERO).then(|| (level - self.active) / self.slope)
    }

    fn slide(&self, start: Motion<S>, direction: S, left: S) -> (Motion<S>, S) {
        let half = S::ONE / (S::ONE + S::ONE);
        let at_start = if start.velocity == S::ZERO {
            self.law.break_away() * direction
        } else {
            self.law.sliding(start.velocity)
        };
        let (first, jerk) = (
            (self.active - at_start) / self.inertia,
            self.slope / self.inertia,
        );
        // The middle of the phase, which ends early where the axis comes to rest.
        let span = time_to_rest(start.velocity, first, jerk, left).unwrap_or(left);
        let middle = start.velocity + (first + jerk * span * (half * half)) * (span * half);
        let friction = if middle.sign() == direction {
            self.law.sliding(middle)
        } else {
            at_start
        };
        let mean = (self.active - friction) / self.inertia;
        let rest = time_to_rest(start.velocity, mean, jerk, left);
        let span = rest.unwrap_or(left);
        let third = S::ONE / (S::ONE + S::ONE + S::ONE);
        let end = Motion {
            position: start.position
                + (start.velocity + (mean + jerk * span * third) * (span * half)) * span,
            velocity: match rest {
                Some(_) => S::ZERO,
                None => start.velocity + (mean + jerk * (span * half)) * span,
            },
        };
        (end, span)
    }
}

/// The first instant within `(0, dt]` at which `v + a·t + j·t²/2` is zero.
///
/// For `v ≠ 0`; written so that it is exact as `j → 0`, where it is `−v/a`. At `v = 0` motion has just begun, and
/// the instant is that of coming back to rest.
pub fn time_to_rest<S: Scalar>(velocity: S, acceleration: S, jerk: S, dt: S) -> Option<S> {
    let two = S::ONE + S::ONE;
    let time = if velocity == S::ZERO {
        let turns = acceleration.sign() * jerk < S::ZERO;
        turns.then(|| -(two * acceleration) / jerk)?
    } else {
        // With velocity taken as positive, the earlier root is the one with the larger denominator.
        let sign = velocity.sign();
        let (v, a, j) = (velocity.abs(), acceleration * sign, jerk * sign);
        let discriminant = a * a - two * j * v;
        let denominator = discriminant.sqrt() - a;
        if discriminant < S::ZERO || denominator <= S::ZERO {
            return None;
        }
        two * v / denominator
    };
    (time <= dt).then_some(time)
}

#[cfg(test)]
mod tests {
    use super::{Motion, time_to_rest};
    use crate::friction::{CoulombViscous, Static};

    const COULOMB: CoulombViscous<f64> = CoulombViscous {
        coulomb: 0.5,
        viscous: 0.0,
    };

    const AT_REST: Motion<f64> = Motion {
        position: 0.0,
        velocity: 0.0,
    };

    #[test]
    fn a_sliding_mass_stops_where_coulomb_says_at_any_step() {
        // v²/2 = (Fc/m)·x: 3 m/s under 0.5 N on 2 kg stops after 12 s at 18 m.
        for dt in [20.0, 7.0, 1.0, 0.013] {
            let mut motion = Motion {
                position: 0.0,
                velocity: 3.0,
            };
            for _ in 0..=(20.0 / dt) as usize {
                motion = motion.step(&COULOMB, 2.0, [0.0; 2], dt);
            }
            assert!(motion.velocity == 0.0);
            assert!((motion.position - 18.0).abs() < 1e-12, "{dt}: {motion:?}");
        }
    }

    #[test]
    fn break_away_happens_at_the_instant_the_force_reaches_the_level() {
        // The force 0.1·t reaches 0.5 at t = 5; from there x = 0.1·(t − 5)³/(6·m) exactly.
        for dt in [10.0, 3.7, 0.01] {
            let (mut motion, mut t) = (AT_REST, 0.0);
            while t < 10.0 {
                motion = motion.step(&COULOMB, 2.0, [0.1 * t, 0.1 * (t + dt)], dt);
                t += dt;
            }
            let expected = 0.1 * (t - 5.0).powi(3) / 12.0;
            assert!((motion.position - expected).abs() < 1e-11, "{dt}");
        }
    }

    #[test]
    fn an_axis_that_sticks_does_not_creep() {
        let law = Static {
            coulomb: 0.5,
            viscous: 0.1,
            static_level: 0.75,
            stribeck_velocity: 0.01,
        };
        let mut motion = AT_REST;
        for k in 0..10_000 {
            let force = |k: i32| 0.74 * (f64::from(k) * 0.01).sin();
            motion = motion.step(&law, 0.1, [force(k), force(k + 1)], 1e-3);
            assert_eq!(motion, AT_REST);
        }
    }

    #[test]
    fn a_thrown_axis_passes_its_turning_point_in_one_step() {
        // Thrown against 2 N with friction 0.5 N: 2.5 N on the way up, 1.5 N back.
        let start = Motion {
            position: 0.0,
            velocity: 1.0,
        };
        let end = start.step(&COULOMB, 1.0, [-2.0; 2], 1.0);
        // Up for 0.4 s to 0.2 m, down for 0.6 s at 1.5 m/s².
        assert!((end.velocity + 0.9).abs() < 1e-15);
        assert!((end.position - (0.2 - 0.27)).abs() < 1e-15);
    }

    #[test]
    fn time_to_rest_takes_the_earlier_root_and_none_outside() {
        assert_eq!(time_to_rest(1.0, -2.0, 0.0, 1.0), Some(0.5));
        assert_eq!(time_to_rest(1.0, -2.0, 0.0, 0.4), None);
        assert_eq!(time_to_rest(-1.0, 2.0, 0.0, 1.0), Some(0.5));
        assert_eq!(time_to_rest(1.0, 2.0, 0.0, 1.0), None);
        // 3 − 4·t + t² = (t − 1)·(t − 3).
        assert_eq!(time_to_rest(3.0, -4.0, 2.0, 5.0), Some(1.0));
        assert_eq!(time_to_rest(3.0, -2.0, 2.0, 5.0), None);
    }
}
