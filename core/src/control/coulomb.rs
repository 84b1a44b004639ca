//! The Coulomb level, estimated while the axis runs.

use serde::{Deserialize, Serialize};

use crate::Scalar;

/// What the nonlinear observer of the Coulomb level may do.
///
/// Friedland and Park (1992) estimate the level `a` of `J·v̇ = τ − a·sgn v` by `â = ζ − k·J·G(|v|)` with
/// `ζ̇ = k·g(|v|)·(τ − â·sgn v)·sgn v` and `g = G′`, so that the error obeys `d(a − â)/dt = −k·g(|v|)·(a − â)`: it decays
/// wherever the axis moves, whatever the motion. They take `G = |v|^μ`. Here `g(w) = min(w/w₀, 1)`: `μ = 2` below the
/// speed `w₀`, where the sign of `v` is in doubt, and `μ = 1` above, where the rate is `k` and no more.
///
/// # Stability
/// The step is that of the increment `ζ̇` with the mean slope `ḡ` of `G` between two samples, so that the error decays
/// by exactly `1 − k·h·ḡ`: never oscillating if `0 < k·h ≤ 1`, as `ḡ ≤ 1`, and diverging only from `k·h = 2`. With a
/// velocity that comes from an observer with a double pole at `ω`, the three together have the characteristic polynomial
/// `λ³ + 2ω·λ² + ω²·λ + k·ω²`, which is stable for `0 < k < 2ω` (Routh) and well damped for `k ≤ ω/8`.
///
/// # What keeps it sane
/// A sample in which the velocity changes its sign, or stands still, teaches nothing and changes nothing. The estimate is
/// projected on `[lowest, highest]`; being its own memory, it leaves a bound at once when the data say so.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CoulombGains<T> {
    /// `k` ≥ 0, 1/s; zero switches the adaptation off.
    pub rate: T,
    /// `w₀` > 0, rad/s or m/s: below this speed learning fades.
    pub speed: T,
    /// The least level that physics allows, N·m or N.
    pub lowest: T,
    /// The largest, N·m or N.
    pub highest: T,
}

impl<T: Scalar> CoulombGains<T> {
    /// Whether the gains keep what the fields say, at a sampling period in s.
    pub fn is_valid(&self, period: T) -> bool {
        let numbers = [self.rate, self.speed, self.lowest, self.highest];
        numbers.into_iter().all(Scalar::is_finite)
            && self.rate >= T::ZERO
            && self.rate * period <= T::ONE
            && self.speed > T::ZERO
            && self.lowest >= T::ZERO
            && self.highest >= self.lowest
    }

    /// The level after a sample over which the velocity went from `before` to `after` while everything but dry friction
    /// would have changed it by `push`, and a level of 1 changes it by `brake`, all in rad/s or m/s.
    #[must_use]
    pub fn learn(&self, share: T, level: T, before: T, after: T, push: T, brake: T) -> T {
        let sign = before.sign();
        let slope = self.slope(before, after);
        if slope == T::ZERO || sign != after.sign() {
            return level;
        }
        // What friction has taken of the speed, against what the level says it takes.
        let taken = (push - (after - before)) * sign;
        let next = level + share * slope * (taken / brake - level);
        self.projected(next, level)
    }

    /// A level within bounds; a number that is none leaves the old one.
    fn projected(&self, next: T, level: T) -> T {
        if !next.is_finite() {
            level
        } else if next < self.lowest {
            self.lowest
        } else if next > self.highest {
            self.highest
        } else {
            next
        }
    }

    /// `ḡ` between two velocities of the same sign.
    fn slope(&self, before: T, after: T) -> T {
        let weight = |v: T| {
            let w = v.abs();
            if w < self.speed {
                w / self.speed
            } else {
                T::ONE
            }
        };
        (weight(before) + weight(after)).half()
    }
}

#[cfg(test)]
mod tests {
    use super::CoulombGains;
    use crate::scalar::{Q16, Scalar};

    const PERIOD: f64 = 1e-3;
    const INERTIA: f64 = 0.1;

    fn gains<T: Scalar>(rate: f64) -> CoulombGains<T> {
        CoulombGains {
            rate: T::from_f64(rate),
            speed: T::from_f64(0.1),
            lowest: T::from_f64(0.05),
            highest: T::from_f64(2.0),
        }
    }

    /// The level after `n` samples of an axis with the true level 0.5 that drives to and fro by exact sampled motion.
    fn learned<T: Scalar>(rate: f64, start: f64, n: u32) -> f64 {
        let gains = gains::<T>(rate);
        let (mut level, mut v) = (T::from_f64(start), 0.0_f64);
        for k in 0..n {
            let torque = if k % 400 < 200 { 1.0 } else { -1.0 };
            let push = torque * PERIOD / INERTIA;
            let free = v + push;
            let brake = PERIOD / INERTIA;
            let after = free - free.clamp(-0.5 * brake, 0.5 * brake);
            level = gains.learn(
                T::from_f64(rate * PERIOD),
                level,
                T::from_f64(v),
                T::from_f64(after),
                T::from_f64(push),
                T::from_f64(brake),
            );
            v = after;
        }
        level.to_f64()
    }

    #[test]
    fn converges_at_its_rate_from_both_sides() {
        for start in [0.1, 1.5] {
            // Over a second at 10 1/s, the speed being above 0.1 rad/s nearly always, no more than e^(−8) is left.
            let error = learned::<f64>(10.0, start, 1000) - 0.5;
            assert!(error.abs() < 3.4e-4, "{error}");
            assert!((learned::<f32>(10.0, start, 1000) - 0.5).abs() < 1e-3);
            // Increments of half a unit in the last place are lost: the estimate stops 1/(k·h) units away, and push and
            // brake are rounded to 2⁻¹⁷ of about 0.01.
            assert!(
                (learned::<Q16>(10.0, start, 2000) - 0.5).abs() < 100.0 * 2f64.powi(-16) + 1e-3
            );
        }
    }

    #[test]
    fn the_stated_condition_is_the_border() {
        // In steady motion the error is multiplied by 1 − k·h in each sample: k·h = 1.9 still decays, k·h = 2.1 grows
        // until it runs into the bounds.
        let at = |product: f64| {
            let learn = |level, _| gains(1.0).learn(product, level, 1.0, 1.0, 0.005, 0.01);
            (0..300).fold(0.51, learn)
        };
        assert!((at(1.0) - 0.5).abs() < 1e-12 && (at(1.9) - 0.5).abs() < 1e-12);
        assert!((at(2.1) - 0.5).abs() > 0.1);
        assert!(gains::<f64>(1000.0).is_valid(PERIOD) && !gains::<f64>(1001.0).is_valid(PERIOD));
    }

    #[test]
    fn without_motion_nothing_is_learned() {
        let gains = gains::<f32>(10.0);
        let mut level = 0.4_f32;
        for k in 0..100_000 {
            // Pushed at rest, and thrown from one direction into the other.
            level = gains.learn(0.01, level, 0.0, 0.0, 5.0, 0.01);
            let v = if k % 2 == 0 { 0.5 } else { -0.5 };
            level = gains.learn(0.01, level, v, -v, 5.0, 0.01);
        }
        assert_eq!(level, 0.4);
    }

    #[test]
    fn never_leaves_its_bounds_and_leaves_a_bound_at_once() {
        let gains = gains::<f64>(10.0);
        let mut level = 0.4;
        for _ in 0..100_000 {
            level = gains.learn(0.01, level, 1.0, 1.0, 1.0, 0.01);
            assert!(level <= 2.0);
        }
        assert_eq!(level, 2.0);
        // Not wound up: one sample that says less, and it is less.
        level = gains.learn(0.01, level, 1.0, 1.0, 0.0, 0.01);
        assert!(level < 1.99);
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(gains.learn(0.01, 0.4, 1.0, 1.0, bad, 0.01), 0.4);
        }
    }
}
