//! The simulator's own tests.

use super::plants::{Axis, NAMED, Noise, OTHERS, Recipe, Recording, State, simulate};

/// From `v0` under Coulomb friction alone, `v = v0 − c·t/J` and the axis rests for ever at
/// `q = J·v0²/(2c)`. The projection is exact but for the step in which it comes to rest, where the mean
/// speed of the step stands in for part of it: at most `h·v(h)/2 = c·h²/(2J)` of travel.
#[test]
fn coulomb_decay_matches_the_closed_form() {
    let (inertia, coulomb, v0, h) = (0.02, 0.3, 7.0, 50e-6);
    let axis = Axis::plain(inertia, coulomb, 0.0);
    let mut x = State {
        v: v0,
        ..State::default()
    };
    let stop = inertia * v0 / coulomb;
    for k in 0..(2.0 * stop / h) as usize {
        x = axis.step(&x, 0.0, 0.0, k as f64 * h, h);
    }
    let travel = 0.5 * inertia * v0 * v0 / coulomb;
    assert_eq!(x.v, 0.0);
    assert!(
        (x.q - travel).abs() < coulomb * h * h / inertia,
        "{} against {travel}",
        x.q
    );
}

/// Below the Coulomb level nothing moves, not even slowly.
#[test]
fn a_stuck_axis_does_not_creep() {
    let axis = Axis::plain(0.02, 0.3, 0.01);
    let mut x = State::default();
    for k in 0..10_000 {
        x = axis.step(&x, 0.299, 0.0, f64::from(k) * 50e-6, 50e-6);
    }
    assert_eq!((x.q, x.v), (0.0, 0.0));
}

/// With viscous and Coulomb friction `v = (v0 + c/b)·exp(−b·t/J) − c/b`; the trapezoidal rule's error
/// over a time `t` is at most `(b·h/J)²/12·(b·t/J)` of `v0 + c/b`.
#[test]
fn viscous_decay_is_second_order() {
    let (inertia, coulomb, viscous, v0, t) = (0.02, 0.1, 0.3, 10.0, 0.1);
    let axis = Axis::plain(inertia, coulomb, viscous);
    for steps in [200, 2000] {
        let h = t / f64::from(steps);
        let mut x = State {
            v: v0,
            ..State::default()
        };
        for k in 0..steps {
            x = axis.step(&x, 0.0, 0.0, f64::from(k) * h, h);
        }
        let rate = viscous / inertia;
        let level = coulomb / viscous;
        let exact = (v0 + level) * (-rate * t).exp() - level;
        let bound = (rate * h).powi(2) / 12.0 * rate * t * (v0 + level);
        assert!((x.v - exact).abs() < bound, "{} against {exact}", x.v);
    }
}

/// A short recording, to keep the tests quick.
fn short(seed: u64, id: &'static str, size: f64) -> Recording {
    simulate(&Recipe {
        duration: 12.0,
        ..Recipe::random(seed, Some(id), size, Noise::Medium)
    })
    .expect("an axis that moves")
}

#[test]
fn effects_have_the_size_asked_for() {
    for id in NAMED.into_iter().chain(OTHERS) {
        let made = short(7, id, 0.10).truth;
        let size = made.effects[0].1;
        assert!((0.08..=0.12).contains(&size) && made.met, "{id}: {size}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let bytes =
        |r: &Recording| -> Vec<u64> { r.u.iter().chain(&r.q).map(|x| x.to_bits()).collect() };
    let first = short(3, "stribeck", 0.05);
    assert_eq!(bytes(&first), bytes(&short(3, "stribeck", 0.05)));
    assert_ne!(bytes(&first), bytes(&short(4, "stribeck", 0.05)));
}
