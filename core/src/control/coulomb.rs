//! The Coulomb level, estimated while the axis runs.

use serde::{Deserialize, Serialize};

use crate::Scalar;

/// How the Coulomb level is learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Learning {
    /// Not at all.
    Off,
    /// By the nonlinear observer of Friedland and Park.
    Observer,
    /// By recursive least squares on rows of the weak form, which learns a constant offset besides.
    Rows,
}

/// What may be learned while the axis runs, and how fast.
///
/// # The nonlinear observer
/// Friedland and Park (1992) estimate the level `a` of `J·v̇ = τ − a·sgn v` by `â = ζ − k·J·G(|v|)` with
/// `ζ̇ = k·g(|v|)·(τ − â·sgn v)·sgn v` and `g = G′`, so that the error obeys `d(a − â)/dt = −k·g(|v|)·(a − â)`: it decays
/// wherever the axis moves, whatever the motion. They take `G = |v|^μ`. Here `g(w) = min(w/w₀, 1)`: `μ = 2` below the
/// speed `w₀`, where the sign of `v` is in doubt, and `μ = 1` above, where the rate is `k` and no more.
///
/// The step is that of the increment `ζ̇` with the mean slope `ḡ` of `G` between two samples, so that the error decays
/// by exactly `1 − k·h·ḡ`: never oscillating if `0 < k·h ≤ 1`, as `ḡ ≤ 1`, and diverging only from `k·h = 2`. With a
/// velocity that comes from an observer with a double pole at `ω`, the three together have the characteristic polynomial
/// `λ³ + 2ω·λ² + ω²·λ + k·ω²`, which is stable for `0 < k < 2ω` (Routh) and well damped for `k ≤ ω/8`.
///
/// # Rows
/// A window of test function φ turns `J·v̇ = τ − Fc·s − o`, while the axis slides in the direction `s`, into the row
/// `∫τφ − J·∫q φ̈ = Fc·s + o`: nothing measured is differentiated. Recursive least squares over such rows, of windows that
/// overlap by half, keep their covariance `P` between zero and a prior `P₀` to which a share returns after each row. The
/// gain of a row stays between 0 and 1 then: stable without a condition.
///
/// # What keeps it sane
/// A sample in which the velocity changes its sign or stands still, and a window with one, teach nothing and change
/// nothing. The estimate is projected on `[lowest, highest]`; being its own memory, it leaves a bound at once when the
/// data say so.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Adaptation<T> {
    /// How.
    pub method: Learning,
    /// Below this speed > 0 the observer's learning fades (`w₀`), and rows do not count; rad/s or m/s.
    pub speed: T,
    /// The least level ≥ 0 that physics allows, N·m or N.
    pub lowest: T,
    /// The largest, N·m or N; no offset exceeds it either.
    pub highest: T,
    /// Of the observer: `k` ≥ 0, 1/s.
    pub rate: T,
    /// Of rows: the width > 0 of a window, s.
    pub window: T,
    /// Of rows: the share `1 − λ` of the prior that returns after each, 0 to 1.
    pub forgotten: T,
    /// Of rows: how large an offset is expected beside the Coulomb level, 0 to 1; zero for none.
    pub offset: T,
}

impl<T: Scalar> Adaptation<T> {
    /// Whether the numbers keep what the fields say, and `k·h ≤ 1` at a sampling period `h` in s.
    pub fn is_valid(&self, period: T) -> bool {
        let finite = [
            self.speed,
            self.lowest,
            self.highest,
            self.rate,
            self.window,
        ];
        let share = |x: T| x >= T::ZERO && x <= T::ONE;
        finite.into_iter().all(Scalar::is_finite)
            && self.rate >= T::ZERO
            && self.rate * period <= T::ONE
            && self.speed > T::ZERO
            && self.lowest >= T::ZERO
            && self.highest >= self.lowest
            && self.window > T::ZERO
            && share(self.forgotten)
            && share(self.offset)
    }

    /// The level after a sample, by the nonlinear observer at `rates`.
    #[must_use]
    #[inline(always)]
    pub(super) fn observed(&self, rates: &Rates<T>, level: T, slid: Slid<T>) -> T {
        let Slid {
            before,
            after,
            drive,
            excess,
        } = slid;
        let along = if before > T::ZERO && after > T::ZERO {
            drive
        } else if before < T::ZERO && after < T::ZERO {
            -drive
        } else {
            return level;
        };
        // The mean slope of G between both, which is quadratic and then straight.
        let weight = |speed: T| {
            let share = speed * rates.per_speed;
            if share < T::ONE { share } else { T::ONE }
        };
        let (before, after) = (before.abs(), after.abs());
        let slope = (weight(before) + weight(after)).half();
        // What friction has taken but for the excess, against what the level says it takes.
        let taken = (along - excess).plus_product(rates.per_kick, before - after);
        self.projected(
            level.plus_product(rates.share * slope, taken - level),
            level,
        )
    }

    /// A level and an offset within bounds.
    pub(super) fn bounded(&self, next: [T; 2], last: [T; 2]) -> [T; 2] {
        let offset = next[1].clamp_symmetric(self.highest);
        let offset = if offset.is_finite() { offset } else { last[1] };
        [self.projected(next[0], last[0]), offset]
    }

    /// A level within bounds; a number that is none leaves the old one.
    #[inline]
    fn projected(&self, next: T, level: T) -> T {
        if next >= self.lowest && next <= self.highest {
            next
        } else if !next.is_finite() {
            level
        } else if next < self.lowest {
            self.lowest
        } else {
            self.highest
        }
    }
}

/// What has acted on an axis over a sample, and what became of its velocity.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slid<T> {
    /// Velocity at the start, rad/s or m/s.
    pub before: T,
    /// And at the end.
    pub after: T,
    /// Everything known but dry friction, N·m or N.
    pub drive: T,
    /// What dry friction has beyond the Coulomb level, N·m or N.
    pub excess: T,
}

/// What the nonlinear observer multiplies with, computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rates<T> {
    /// `k·h`.
    share: T,
    /// `1/w₀`.
    per_speed: T,
    /// Torque that gives a velocity of 1 in a sample, `J/h`.
    per_kick: T,
}

impl<T: Scalar> Rates<T> {
    pub fn new(adaptation: &Adaptation<T>, period: T, inertia: T) -> Self {
        Self {
            share: adaptation.rate * period,
            per_speed: T::ONE / adaptation.speed,
            per_kick: inertia / period,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Adaptation, Learning, Rates, Slid};
    use crate::scalar::{Q16, Scalar};

    const PERIOD: f64 = 1e-3;
    const INERTIA: f64 = 0.1;

    fn adaptation<T: Scalar>(rate: f64) -> Adaptation<T> {
        Adaptation {
            method: Learning::Observer,
            rate: T::from_f64(rate),
            speed: T::from_f64(0.1),
            lowest: T::from_f64(0.05),
            highest: T::from_f64(2.0),
            window: T::from_f64(0.1),
            forgotten: T::ZERO,
            offset: T::ZERO,
        }
    }

    fn rates<T: Scalar>(rate: f64) -> Rates<T> {
        Rates {
            share: T::from_f64(rate * PERIOD),
            per_speed: T::from_f64(10.0),
            per_kick: T::from_f64(INERTIA / PERIOD),
        }
    }

    /// A sample under a torque; nothing but the Coulomb level is friction.
    fn slid<T: Scalar>(before: f64, after: f64, drive: f64) -> Slid<T> {
        Slid {
            before: T::from_f64(before),
            after: T::from_f64(after),
            drive: T::from_f64(drive),
            excess: T::ZERO,
        }
    }

    /// The level after `n` samples of an axis with the true level 0.5 that drives to and fro by exact sampled motion.
    fn learned<T: Scalar>(rate: f64, start: f64, n: u32) -> f64 {
        let (adaptation, rates) = (adaptation::<T>(rate), rates(rate));
        let (mut level, mut v) = (T::from_f64(start), 0.0_f64);
        for k in 0..n {
            let torque = if k % 400 < 200 { 1.0 } else { -1.0 };
            let push = torque * PERIOD / INERTIA;
            let free = v + push;
            let brake = PERIOD / INERTIA;
            let after = free - free.clamp(-0.5 * brake, 0.5 * brake);
            level = adaptation.observed(&rates, level, slid(v, after, torque));
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
            // The velocities, rounded to 2⁻¹⁷ each, make 100 times that of torque, which the rate averages over 100
            // samples; and increments below half a unit are lost, 1/(k·h) units before the end.
            assert!((learned::<Q16>(10.0, start, 2000) - 0.5).abs() < 200.0 * 2f64.powi(-16));
        }
    }

    #[test]
    fn the_stated_condition_is_the_border() {
        // In steady motion the error is multiplied by 1 − k·h in each sample: k·h = 1.9 still decays, k·h = 2.1 grows
        // until it runs into the bounds.
        let at = |product: f64| {
            let rates = rates(product / PERIOD);
            let learn = |level, _| adaptation(1.0).observed(&rates, level, slid(1.0, 1.0, 0.5));
            (0..300).fold(0.51, learn)
        };
        assert!((at(1.0) - 0.5).abs() < 1e-12 && (at(1.9) - 0.5).abs() < 1e-12);
        assert!((at(2.1) - 0.5).abs() > 0.1);
        assert!(adaptation::<f64>(1000.0).is_valid(PERIOD));
        assert!(!adaptation::<f64>(1001.0).is_valid(PERIOD));
    }

    #[test]
    fn without_motion_nothing_is_learned() {
        let (adaptation, rates) = (adaptation::<f32>(10.0), rates(10.0));
        let mut level = 0.4_f32;
        for k in 0..100_000 {
            // Pushed at rest, and thrown from one direction into the other.
            level = adaptation.observed(&rates, level, slid(0.0, 0.0, 500.0));
            let v = if k % 2 == 0 { 0.5 } else { -0.5 };
            level = adaptation.observed(&rates, level, slid(v, -v, 500.0));
        }
        assert_eq!(level, 0.4);
    }

    #[test]
    fn never_leaves_its_bounds_and_leaves_a_bound_at_once() {
        let (adaptation, rates) = (adaptation::<f64>(10.0), rates(10.0));
        let mut level = 0.4;
        for _ in 0..100_000 {
            level = adaptation.observed(&rates, level, slid(1.0, 1.0, 100.0));
            assert!(level <= 2.0);
        }
        assert_eq!(level, 2.0);
        // Not wound up: one sample that says less, and it is less.
        level = adaptation.observed(&rates, level, slid(1.0, 1.0, 0.0));
        assert!(level < 1.99);
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(adaptation.observed(&rates, 0.4, slid(1.0, 1.0, bad)), 0.4);
            assert_eq!(adaptation.bounded([bad, bad], [0.4, 0.1])[0], 0.4);
        }
        assert_eq!(adaptation.bounded([9.0, -9.0], [0.4, 0.1]), [2.0, -2.0]);
    }
}
