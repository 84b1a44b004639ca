//! In fixed point nothing overflows silently: at any parameters and inputs, results keep their sign and bounds.

use bristle_core::Scalar;
use bristle_core::friction::{
    Curve, Dynamic, Friction, LuGre, ModifiedLuGre, Motion, Planar, Static, Stribeck,
};
use bristle_core::scalar::Q16;

const EXTREMES: [Q16; 7] = [
    Q16::MIN,
    Q16::from_bits(-70_000),
    Q16::from_bits(-1),
    Q16::from_bits(0),
    Q16::from_bits(1),
    Q16::from_bits(65_536),
    Q16::MAX,
];

/// Every choice of `N` parameters from nearly zero, one and the largest value.
fn parameters<const N: usize>() -> impl Iterator<Item = [Q16; N]> {
    let choices = [Q16::from_bits(1), Q16::ONE, Q16::MAX];
    (0..choices.len().pow(N as u32)).map(move |code| {
        std::array::from_fn(|k| choices[code / choices.len().pow(k as u32) % choices.len()])
    })
}

fn assert_without_state(law: impl Friction<Q16> + Copy) {
    for v in EXTREMES {
        let force = law.sliding(v);
        assert!(
            v.sign() == Q16::ZERO || force.sign() != -v.sign(),
            "{v:?}: {force:?}"
        );
        for active in EXTREMES {
            let planar = Planar(law).sliding([v, active]);
            assert!(
                [v, active]
                    .into_iter()
                    .zip(planar)
                    .all(|(v, f)| f == Q16::ZERO || f.sign() == v.sign())
            );
            let held = law.reaction(Q16::ZERO, active);
            assert!(held.abs() <= law.break_away() && held.sign() == active.sign());
        }
    }
}

fn assert_bristles(law: &impl Dynamic<Q16>) {
    for v in EXTREMES {
        let saturation = law.level(v) / law.stiffness();
        for z in EXTREMES {
            for dt in [Q16::from_bits(1), Q16::ONE, Q16::MAX] {
                let step = law.step(z, v, dt);
                let (low, high) = (z.min(-saturation), z.max(saturation));
                assert!(
                    step.deflection >= low && step.deflection <= high,
                    "{step:?}"
                );
                let steady = law.steady(v);
                assert!(v.sign() == Q16::ZERO || steady.sign() != -v.sign());
            }
        }
    }
}

#[test]
fn laws_without_state_keep_sign_and_level() {
    for [coulomb, excess, viscous, stribeck_velocity] in parameters() {
        let static_level = coulomb + excess;
        for curve in [Curve::Exponential, Curve::Rational] {
            assert_without_state(Stribeck {
                coulomb,
                viscous,
                static_level,
                stribeck_velocity,
                curve,
            });
        }
        assert_without_state(Static {
            coulomb,
            viscous,
            static_level,
            stribeck_velocity,
        });
    }
}

#[test]
fn laws_with_bristles_stay_between_the_start_and_the_steady_state() {
    for [
        coulomb,
        excess,
        stribeck_velocity,
        bristle_stiffness,
        bristle_damping,
    ] in parameters()
    {
        let (viscous, static_level) = (Q16::ONE, coulomb + excess);
        assert_bristles(&LuGre {
            coulomb,
            viscous,
            static_level,
            stribeck_velocity,
            bristle_stiffness,
            bristle_damping,
        });
        assert_bristles(&ModifiedLuGre {
            coulomb,
            viscous,
            static_level,
            stribeck_velocity,
            bristle_stiffness,
            bristle_damping,
        });
    }
}

#[test]
fn an_axis_that_sticks_in_fixed_point_does_not_creep() {
    let s = Q16::from_f64;
    let law = Static {
        coulomb: s(0.5),
        viscous: s(0.1),
        static_level: s(0.75),
        stribeck_velocity: s(0.3),
    };
    let rest = Motion {
        position: Q16::ONE,
        velocity: Q16::ZERO,
    };
    let mut motion = rest;
    for k in 0..1000 {
        let force = |k: i32| s(0.749 * f64::from(k).sin());
        motion = motion.step(&law, s(0.2), [force(k), force(k + 1)], s(0.125));
        assert_eq!(motion, rest);
    }
}
