//! Several reactions at once satisfy the conditions of sticking and sliding in any mechanism.

use bristle_core::Scalar;
use bristle_core::friction::{Contacts, Reactions, Static};
use proptest::prelude::*;

const COORDINATES: usize = 3;
const CONTACTS: usize = 4;

type Mechanism = Contacts<f64, COORDINATES, CONTACTS>;
type Found = Reactions<f64, COORDINATES, CONTACTS>;

/// What is given: the factor of an inverse mass matrix, directions, levels, velocities and forces. There are more
/// contacts than coordinates, so that some are redundant whenever most are at rest.
#[derive(Clone, Debug)]
struct Case {
    factor: [[f64; COORDINATES]; COORDINATES],
    directions: [[f64; COORDINATES]; CONTACTS],
    levels: [f64; CONTACTS],
    velocity: [f64; CONTACTS],
    active: [f64; COORDINATES],
}

prop_compose! {
    fn case()(
        factor in prop::array::uniform3(prop::array::uniform3(-1.0..1.0_f64)),
        directions in prop::array::uniform4(prop::array::uniform3(-1.0..1.0_f64)),
        levels in prop::array::uniform4(0.01..2.0_f64),
        velocity in prop::array::uniform4(prop_oneof![3 => Just(0.0), 1 => -1.0..1.0_f64]),
        active in prop::array::uniform3(-4.0..4.0_f64),
    ) -> Case {
        Case { factor, directions, levels, velocity, active }
    }
}

impl Case {
    /// `A·Aᵀ + 1/10`, which is positive definite.
    fn inverse_mass(&self) -> [[f64; COORDINATES]; COORDINATES] {
        let entry = |i: usize, j: usize| {
            let product: f64 = (0..COORDINATES)
                .map(|k| self.factor[i][k] * self.factor[j][k])
                .sum();
            product + if i == j { 0.1 } else { 0.0 }
        };
        std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
    }

    fn laws(&self) -> [Static<f64>; CONTACTS] {
        self.levels.map(|level| Static {
            coulomb: 0.6 * level,
            viscous: 0.1,
            static_level: level,
            stribeck_velocity: 0.2,
        })
    }

    fn react(&self, active: &[f64; COORDINATES]) -> (Mechanism, Found) {
        let mechanism = Contacts::new(self.inverse_mass(), self.directions);
        (
            mechanism,
            mechanism.react(&self.laws(), &self.velocity, active),
        )
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_contact_either_sticks_within_its_level_or_opposes_its_motion(case in case()) {
        let (mechanism, found) = case.react(&case.active);
        let acceleration = mechanism.velocities(&found.acceleration);
        for i in 0..CONTACTS {
            let (level, reaction) = (case.levels[i], found.reaction[i]);
            if case.velocity[i] != 0.0 {
                prop_assert!(!found.sticks[i] && reaction * case.velocity[i] > 0.0);
            } else if found.sticks[i] {
                prop_assert!(reaction.abs() <= level * (1.0 + 1e-12), "{:?}", found);
                prop_assert!(acceleration[i].abs() < 1e-11, "{:?}", found);
            } else {
                prop_assert!(reaction.abs() == level);
                prop_assert!(reaction * acceleration[i] >= -1e-11, "{:?}", found);
            }
        }
    }

    #[test]
    fn accelerations_do_not_depend_on_the_order_of_the_contacts(case in case()) {
        // They are unique, although redundant reactions are not.
        let mut reversed = case.clone();
        reversed.directions.reverse();
        reversed.levels.reverse();
        reversed.velocity.reverse();
        let (a, b) = (case.react(&case.active).1, reversed.react(&case.active).1);
        for k in 0..COORDINATES {
            prop_assert!((a.acceleration[k] - b.acceleration[k]).abs() < 1e-10, "{:?} {:?}", a, b);
        }
    }

    #[test]
    fn accelerations_depend_continuously_on_the_forces(case in case(), direction in prop::array::uniform3(-1.0..1.0_f64)) {
        // Between sticking and breaking away nothing jumps: √M·a is what is left of √M⁻¹·f after its projection on a
        // convex set, the reactions, and such a rest never changes more than what is projected. So
        // |Δa| ≤ |M⁻¹|·|Δf|, and |M⁻¹| is at most its trace without the tenths, 9, and one of them.
        let active: [f64; COORDINATES] = std::array::from_fn(|k| case.active[k] + 1e-3 * direction[k]);
        let (a, b) = (case.react(&case.active).1, case.react(&active).1);
        let norm = |x: [f64; COORDINATES]| x.into_iter().fold(0.0, |n: f64, x| Scalar::hypot(n, x));
        let change = norm(std::array::from_fn(|k| a.acceleration[k] - b.acceleration[k]));
        prop_assert!(change <= 9.1 * 1e-3 * norm(direction) + 1e-10, "{:?} {:?}", a, b);
    }
}
