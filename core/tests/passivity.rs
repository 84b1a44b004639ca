//! No law gives back more energy than its bristles store, under the conditions that the doc of [`Dynamic`] states.

use bristle_core::friction::{Dahl, Dynamic, LuGre, ModifiedLuGre};
use proptest::prelude::*;

/// A failing case is printed in full, so none is kept in a file.
fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Energy drawn from a contact, in excess of the change of what its bristles store, over `steps` of velocity and
/// duration from deflection zero; with the scale of its rounding errors.
fn dissipated(law: &impl Dynamic<f64>, steps: &[(f64, f64)]) -> (f64, f64) {
    let (mut z, mut work, mut scale) = (0.0, 0.0, 0.0);
    for (velocity, dt) in steps {
        let step = law.step(z, *velocity, *dt);
        work += step.force * velocity * dt;
        // A force is the difference of terms as large as these.
        let terms = law.level(*velocity) + law.damping() * velocity.abs() + step.force.abs();
        scale += terms * velocity.abs() * dt;
        z = step.deflection;
    }
    (work - 0.5 * law.stiffness() * z * z, scale)
}

/// Some twenty operations lie between the velocity and the work of a step, each with an error of half an epsilon on
/// terms of at most three times the scale.
fn tolerance(scale: f64) -> f64 {
    32.0 * f64::EPSILON * scale
}

prop_compose! {
    /// A law whose bristle damping is up to 20 times what one at rest would need for critical damping of 1 kg.
    fn lugre()(
        static_level in -3.0..3.0_f64,
        share in 0.1..1.0_f64,
        viscous in 0.0..2.0_f64,
        stribeck_velocity in -4.0..2.0_f64,
        bristle_stiffness in 0.0..7.0_f64,
        bristle_damping in 0.0..40.0_f64,
    ) -> LuGre<f64> {
        let [static_level, stribeck_velocity, bristle_stiffness] =
            [static_level, stribeck_velocity, bristle_stiffness].map(|x: f64| 10_f64.powf(x));
        LuGre {
            coulomb: share * static_level,
            viscous,
            static_level,
            stribeck_velocity,
            bristle_stiffness,
            bristle_damping: bristle_damping * bristle_stiffness.sqrt(),
        }
    }
}

prop_compose! {
    /// Velocities and durations from far below what moves a bristle to a thousand times what turns it over.
    fn steps()(steps in prop::collection::vec((-8.0..3.0_f64, any::<bool>(), -6.0..0.0_f64), 1..200)) -> Vec<(f64, f64)> {
        let velocity = |(speed, forward, _)| 10_f64.powf(speed) * if forward { 1.0 } else { -1.0 };
        steps.into_iter().map(|step| (velocity(step), 10_f64.powf(step.2))).collect()
    }
}

fn modified(law: &LuGre<f64>) -> ModifiedLuGre<f64> {
    ModifiedLuGre {
        coulomb: law.coulomb,
        viscous: law.viscous,
        static_level: law.static_level,
        stribeck_velocity: law.stribeck_velocity,
        bristle_stiffness: law.bristle_stiffness,
        bristle_damping: law.bristle_damping,
    }
}

/// The velocity nearest to the given one at which the law is dissipative in every state.
fn slow_enough(law: &impl Dynamic<f64>, velocity: f64) -> f64 {
    let limit =
        |v: f64| 4.0 * law.level(v) * (law.damping() + law.viscosity()) / law.damping().powi(2);
    // The level falls with the speed, so a speed below the limit of a larger one is below its own.
    velocity.abs().min(limit(velocity)).copysign(velocity)
}

fn assert_dissipative(law: &impl Dynamic<f64>, steps: &[(f64, f64)]) -> Result<(), TestCaseError> {
    let (dissipated, scale) = dissipated(law, steps);
    prop_assert!(
        dissipated >= -tolerance(scale),
        "{:e} of {:e}",
        dissipated,
        scale
    );
    Ok(())
}

/// What `assert_dissipative` asserts, at velocities that are slow enough.
fn assert_slowly_dissipative(
    law: &impl Dynamic<f64>,
    steps: &[(f64, f64)],
) -> Result<(), TestCaseError> {
    let slow: Vec<_> = steps
        .iter()
        .map(|(v, dt)| (slow_enough(law, *v), *dt))
        .collect();
    assert_dissipative(law, &slow)
}

fn assert_bounded(law: &impl Dynamic<f64>, steps: &[(f64, f64)]) -> Result<(), TestCaseError> {
    let largest = law.level(0.0) / law.stiffness();
    let mut z = 0.0;
    for (velocity, dt) in steps {
        z = law.advance(z, *velocity, *dt);
        // Between z and z_ss but for the rounding of two sums and a product, which the next step contracts.
        prop_assert!(
            z.abs() <= largest * (1.0 + 4.0 * f64::EPSILON),
            "{z:e} of {largest:e}"
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(1_000))]

    #[test]
    fn without_bristle_damping_every_law_is_dissipative(law in lugre(), steps in steps()) {
        let law = LuGre { bristle_damping: 0.0, ..law };
        assert_dissipative(&law, &steps)?;
        assert_dissipative(&modified(&law), &steps)?;
        let LuGre { coulomb, viscous, bristle_stiffness, .. } = law;
        assert_dissipative(&Dahl { coulomb, viscous, bristle_stiffness }, &steps)?;
    }

    #[test]
    fn slow_motion_is_dissipative_whatever_the_damping(law in lugre(), steps in steps()) {
        assert_slowly_dissipative(&law, &steps)?;
        assert_slowly_dissipative(&modified(&law), &steps)?;
    }

    #[test]
    fn enough_viscous_friction_makes_any_motion_dissipative(law in lugre(), steps in steps()) {
        let needed = law.bristle_damping * (law.static_level / law.coulomb - 1.0);
        let law = LuGre { viscous: needed, ..law };
        assert_dissipative(&law, &steps)?;
        assert_dissipative(&modified(&law), &steps)?;
    }

    #[test]
    fn deflections_stay_below_break_away(law in lugre(), steps in steps()) {
        assert_bounded(&law, &steps)?;
        assert_bounded(&modified(&law), &steps)?;
    }
}

#[test]
fn too_little_viscous_friction_lets_a_cycle_gain_energy() {
    // Slow sliding raises the deflection to Fs/σ0; a fast stroke lets it fall to Fc/σ0, where σ1·ż pushes along. The
    // stroke gains σ1·v·(Fs − Fc)/σ0, and the viscous friction takes a part of it.
    let law = LuGre {
        coulomb: 1.0,
        viscous: 0.0,
        static_level: 1.5,
        stribeck_velocity: 0.01,
        bristle_stiffness: 1e4,
        bristle_damping: 100.0,
    };
    let cycle = [(1e-5, 1e3), (10.0, 1e-5)];
    let energy = |law: &LuGre<f64>| {
        let start = dissipated(law, &cycle[..1]).0;
        dissipated(law, &cycle).0 - start
    };
    assert!(energy(&law) < 0.0);
    assert!(
        energy(&LuGre {
            viscous: 50.0,
            ..law
        }) > 0.0
    );
}
