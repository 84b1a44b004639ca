//! What is known in closed form about the laws with bristles.

use bristle_core::friction::{Dahl, Dynamic, LuGre, ModifiedLuGre};

const DAHL: Dahl<f64> = Dahl {
    coulomb: 0.7,
    viscous: 0.0,
    bristle_stiffness: 250.0,
};

const LUGRE: LuGre<f64> = LuGre {
    coulomb: 0.7,
    viscous: 0.4,
    static_level: 1.1,
    stribeck_velocity: 0.02,
    bristle_stiffness: 1e5,
    bristle_damping: 300.0,
};

const MODIFIED: ModifiedLuGre<f64> = ModifiedLuGre {
    coulomb: 0.7,
    viscous: 0.4,
    static_level: 1.1,
    stribeck_velocity: 0.02,
    bristle_stiffness: 1e5,
    bristle_damping: 300.0,
};

/// The laws above, for tests that treat them alike.
fn laws() -> [(&'static str, &'static dyn Dynamic<f64>); 3] {
    [
        ("dahl", &DAHL),
        ("lugre", &LUGRE),
        ("modified-lugre", &MODIFIED),
    ]
}

/// Speeds over six decades, both directions.
fn velocities() -> impl Iterator<Item = f64> {
    (-60..=60).map(|k| {
        10_f64
            .powf(f64::from(k) / 10.0 - 2.0)
            .copysign(f64::from(k % 2) - 0.5)
    })
}

#[test]
fn steady_sliding_follows_the_stribeck_curve() {
    for v in velocities() {
        let gaussian = 0.7 + 0.4 * (-(v / 0.02).powi(2)).exp();
        let rational = 0.7 + 0.4 / (1.0 + (v / 0.02).powi(2));
        let expected = [0.7, gaussian, rational];
        for ((name, law), level) in laws().into_iter().zip(expected) {
            let expected = level * v.signum() + law.viscosity() * v;
            let error = |force: f64| (force - expected).abs() / (1.0 + v.abs() * 300.0);
            assert!(error(law.steady(v)) < 1e-14, "{name} at {v}");
            // After 50 time constants nothing is left of the start.
            let slid = law.advance(0.0, v, 50.0 * level / law.stiffness() / v.abs());
            assert!(error(law.force(slid, v)) < 1e-14, "{name} at {v}");
        }
    }
}

#[test]
fn a_step_of_a_thousand_time_constants_lands_on_the_steady_state() {
    for (name, law) in laws() {
        for v in velocities() {
            let saturation = law.level(v) / law.stiffness();
            for start in [-1.0, 0.0, 0.3, 1.0] {
                let dt = 1e3 * saturation / v.abs();
                let step = law.step(start * saturation, v, dt);
                assert!((step.deflection * v.signum() / saturation - 1.0).abs() < 1e-15);
                // The start is there for a thousandth of the step.
                let transient = law.force(start * saturation, v) - law.steady(v);
                let expected = law.steady(v) + transient * 1e-3;
                assert!(
                    (step.force - expected).abs() < 1e-12 * (1.0 + transient.abs()),
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn a_step_of_no_bristle_turnover_is_a_spring() {
    for (name, law) in laws() {
        let saturation = law.level(0.0) / law.stiffness();
        for exponent in -16..-3 {
            let x = 10_f64.powi(exponent) * saturation;
            // z = ẑ·(1 − e^(−x/ẑ)) = x·(1 − x/2ẑ + …); the level at this speed is that at rest to (v/vs)² < 1e-12.
            let z = law.advance(0.0, 1e-8, x / 1e-8);
            let bound = x * (x / saturation / 2.0 + 1e-12);
            assert!((z - x).abs() <= bound, "{name}: {x:e}");
            let stiffness = law.force(z, 0.0) / x;
            assert!((stiffness / law.stiffness() - 1.0).abs() <= x / saturation + 1e-12);
        }
        assert!(
            law.advance(0.25 * saturation, 0.0, 1e9) == 0.25 * saturation,
            "{name} creeps"
        );
    }
}

#[test]
fn the_force_breaks_away_at_the_static_level() {
    // Drawn slowly, 1e-3·vs, over twenty break-away deflections in two thousand steps.
    let levels = [0.7, 1.1, 1.1];
    for ((name, law), level) in laws().into_iter().zip(levels) {
        let (v, mut z, mut largest) = (2e-5, 0.0, 0.0_f64);
        let dt = 0.01 * level / law.stiffness() / v;
        for _ in 0..2000 {
            let step = law.step(z, v, dt);
            z = step.deflection;
            largest = largest.max(step.force);
        }
        // σ1·ż and Fv·v add at most (σ1 + Fv)·v, and g(v) is below Fs by at most 0.4·1e-6.
        let above = (law.damping() + law.viscosity()) * v;
        assert!(
            largest <= level + above && largest >= level - 1e-6,
            "{name}: {largest}"
        );
    }
}

#[test]
fn the_loop_of_dahl_has_its_area_at_any_step() {
    // Between ±X the steady loop turns at ±F0, F0 = Fc·tanh(σ0·X/Fc), and encloses 4·Fc·(X − F0/σ0): integrate
    // dF/dx = σ0·(1 − F/Fc) over the way up, twice.
    for (amplitude, steps) in [(1e-4, 1), (2e-3, 1), (2e-3, 7), (0.03, 100), (1.0, 3)] {
        let corner = 0.7 * (250.0 * amplitude / 0.7_f64).tanh();
        let expected = 4.0 * 0.7 * (amplitude - corner / 250.0);
        let (v, dt) = (0.5, 2.0 * amplitude / 0.5 / f64::from(steps));
        let (mut z, mut area) = (-corner / 250.0, 0.0);
        for direction in [1.0, -1.0] {
            for _ in 0..steps {
                let step = DAHL.step(z, direction * v, dt);
                area += step.force * direction * v * dt;
                z = step.deflection;
            }
        }
        // The area is a small difference of works of up to 2·F0·X a way.
        let rounding = 1e-14 * 4.0 * corner * amplitude;
        assert!(
            (area - expected).abs() < rounding * f64::from(steps),
            "{amplitude}"
        );
        assert!((z * 250.0 + corner).abs() < 1e-13 * corner, "{amplitude}");
    }
}

#[test]
fn one_step_is_as_good_as_many() {
    // The step is exact at constant velocity, so dividing it changes nothing but rounding.
    for (name, law) in laws() {
        for v in velocities() {
            let saturation = law.level(v) / law.stiffness();
            let dt = 3.0 * saturation / v.abs();
            let whole = law.step(-0.8 * saturation, v, dt);
            let (mut z, mut impulse) = (-0.8 * saturation, 0.0);
            for _ in 0..64 {
                let part = law.step(z, v, dt / 64.0);
                impulse += part.force * dt / 64.0;
                z = part.deflection;
            }
            assert!(
                (whole.deflection - z).abs() < 1e-13 * saturation,
                "{name} at {v}"
            );
            let scale = law.force(-0.8 * saturation, v).abs() + law.level(v);
            assert!(
                (whole.force - impulse / dt).abs() < 1e-13 * scale,
                "{name} at {v}"
            );
        }
    }
}
