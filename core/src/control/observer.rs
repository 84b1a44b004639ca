//! Velocity from positions.

use super::Position;
use crate::Scalar;

/// Gains of a [`Observer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObserverGains<T> {
    /// Part of a count by which a count of surprise moves the position.
    position: T,
    /// rad/s or m/s by which a count of surprise changes the velocity.
    velocity: T,
    /// Counts that a velocity of 1 covers in a sample.
    counts: T,
}

impl<T: Scalar> ObserverGains<T> {
    /// Both poles of the error at `e^(−bandwidth·period)`, for a bandwidth in rad/s, a period in s and `count` rad or m to
    /// a count.
    ///
    /// With the surprise `e = q − q̄` over the prediction, `q̂ = q̄ + l₁·e` and `v̂ = v̄ + l₂·e/h`, the error goes from sample
    /// to sample by a matrix of trace `2 − l₁ − l₂` and determinant `1 − l₁`. A double eigenvalue `p` asks for
    /// `l₁ = 1 − p²`, `l₂ = (1 − p)²`.
    pub fn new(bandwidth: T, period: T, count: T) -> Self {
        let (gone, _) = (bandwidth * period).relax();
        Self {
            position: gone + gone - gone * gone,
            velocity: gone * gone * (count / period),
            counts: period / count,
        }
    }
}

/// A Luenberger observer of position and velocity that knows the forces: what the model explains comes without the
/// lag and the noise of a filter, and encoder counts only correct it.
///
/// Where the model claims motion over more than two counts and the encoder shows none, the model is wrong and the axis
/// stands: more friction holds it than the model knows. The velocity is zero then until the next count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer<T> {
    /// Estimated position.
    pub position: Position<T>,
    /// Estimated velocity, rad/s or m/s.
    pub velocity: T,
    /// What the encoder showed last.
    counts: i32,
    /// Counts that the axis should have moved since then.
    claimed: T,
}

impl<T: Scalar> Observer<T> {
    /// At rest in the middle of a count.
    pub fn at_rest(counts: i32) -> Self {
        Self {
            position: Position::at(counts).moved(T::ONE.half()),
            velocity: T::ZERO,
            counts,
            claimed: T::ZERO,
        }
    }

    /// Takes a sample: the encoder shows `counts`, and the forces since the last sample changed the velocity by
    /// `push − brake·sgn v`, where `push` is what all forces but dry friction do and `brake` ≥ 0 is what dry friction
    /// does at most. It stops an axis and does not turn it round, so that the model sticks as the axis does (the
    /// implicit step of Moreau, 1988).
    ///
    /// The encoder is taken to round down: all that it says is that the position lies within its count. Inside, there is
    /// no surprise; outside, it is the distance to the count. An axis that rests on the border of two counts sees no
    /// step there, and a steady motion no ripple. Returns by how many counts the estimated position has moved: over a
    /// while, this is free of any error that the forces make in the velocity.
    #[inline(always)]
    pub fn sample(&mut self, gains: &ObserverGains<T>, counts: i32, push: T, brake: T) -> T {
        let velocity = (self.velocity + push).beyond(brake);
        // The mean of both ends covers the way of a steady acceleration exactly.
        let way = (self.velocity + velocity).half() * gains.counts;
        if self.stands(counts, way) {
            self.velocity = T::ZERO;
            return self.correct(gains, counts, T::ZERO).0;
        }
        let (moved, surprise) = self.correct(gains, counts, way);
        self.velocity = velocity.plus_product(gains.velocity, surprise);
        moved
    }

    /// Moves the position by what is believed, and by what the encoder says to that; how far, and the surprise.
    #[inline(always)]
    fn correct(&mut self, gains: &ObserverGains<T>, counts: i32, way: T) -> (T, T) {
        // From the middle of what the encoder shows back to the prediction, which is never far.
        let middle = T::ONE.half();
        let surprise = (self.position.short_of(counts) + (middle - way)).beyond(middle);
        let moved = way.plus_product(gains.position, surprise);
        self.position = self.position.moved(moved);
        (moved, surprise)
    }

    /// Whether the encoder denies a motion that has been claimed for long enough.
    #[inline]
    fn stands(&mut self, counts: i32, way: T) -> bool {
        if counts != self.counts {
            self.counts = counts;
            self.claimed = T::ZERO;
            return false;
        }
        self.claimed += way;
        let most = T::ONE + T::ONE;
        let denied = self.claimed.abs() > most;
        if denied {
            // What stands has claimed enough; more would only have to be taken back.
            self.claimed = self.claimed.clamp_symmetric(most + T::ONE);
        }
        denied
    }
}

#[cfg(test)]
mod tests {
    use super::{Observer, ObserverGains};
    use crate::scalar::{Q16, Scalar};

    const PERIOD: f64 = 1e-3;
    const COUNT: f64 = 1e-3;

    /// The largest error of the velocity in the second half of a motion `q(t)` in rad, without any model.
    fn velocity_error<T: Scalar>(
        bandwidth: f64,
        q: impl Fn(f64) -> f64,
        v: impl Fn(f64) -> f64,
    ) -> f64 {
        // Time in samples and positions in counts, so that fixed point has numbers around 1.
        let gains = ObserverGains::new(T::from_f64(bandwidth * PERIOD), T::ONE, T::ONE);
        let mut observer = Observer::at_rest(0);
        let mut worst = 0.0_f64;
        for k in 1..4000 {
            let t = f64::from(k) * PERIOD;
            let counts = Scalar::floor(q(t) / COUNT);
            observer.sample(&gains, counts, T::ZERO, T::ZERO);
            if k > 2000 {
                worst = worst.max((observer.velocity.to_f64() * COUNT / PERIOD - v(t)).abs());
            }
        }
        worst
    }

    fn steady<T: Scalar>(tolerance: f64) {
        let error = velocity_error::<T>(100.0, |t| 3.0 * t + 0.5 * COUNT, |_| 3.0);
        assert!(error < tolerance, "{error}");
    }

    #[test]
    fn steady_motion_is_seen_without_lag() {
        // Three counts a sample exactly: nothing is left but rounding, which fixed point keeps at a unit in the last
        // place over the gain (1 − p)² = 0.009.
        steady::<f64>(1e-9);
        steady::<f32>(1e-4);
        steady::<Q16>(2f64.powi(-16) / 0.009 * COUNT / PERIOD);
    }

    #[test]
    fn a_steady_speed_shows_no_counts() {
        // Positions rounded to the middle of a count err by half of one; the transfer from position to velocity,
        // s·ω²/(s + ω)², has an impulse response of absolute area 2ω/e, and would let that much of it through. Knowing that
        // a count is an interval, the observer finds the steady speed at which no count is a surprise.
        let bandwidth = 60.0;
        let error = velocity_error::<f64>(bandwidth, |t| 0.377 * t, |_| 0.377);
        let rounding = 0.5 * COUNT * 2.0 * bandwidth / std::f64::consts::E;
        assert!(error < 0.1 * rounding, "{error} {rounding}");
    }

    #[test]
    fn a_known_acceleration_leaves_no_lag() {
        // v = 2·t, known: the model carries it. Without it the lag is 2·a/ω = 0.04 rad/s. Counts of 1e-5 rad blur a
        // velocity by less than ω·count.
        let count = 1e-5;
        let gains = ObserverGains::new(0.1_f64, 1.0, 1.0);
        let run = |known: f64| {
            let mut observer = Observer::at_rest(0);
            for k in 1..3000 {
                let t = f64::from(k) * PERIOD;
                let push = known * 2.0 * PERIOD * PERIOD / count;
                observer.sample(&gains, Scalar::floor(t * t / count), push, 0.0);
            }
            observer.velocity * count / PERIOD - 2.0 * 2.999
        };
        assert!(run(1.0).abs() < 1e-3, "{}", run(1.0));
        assert!((run(0.0) + 0.04).abs() < 2e-3 + 2e-3, "{}", run(0.0));
    }

    #[test]
    fn a_model_that_sticks_keeps_the_velocity_at_zero() {
        let gains = ObserverGains::new(0.1_f32, 1.0, 1.0);
        let mut observer = Observer::at_rest(7);
        for k in 0..1000 {
            // Pushed to and fro below the level of friction.
            let push = if k % 2 == 0 { 0.3 } else { -0.3 };
            observer.sample(&gains, 7, push, 0.31);
            assert_eq!(observer.velocity, 0.0);
        }
        observer.sample(&gains, 7, 0.4, 0.31);
        assert!(observer.velocity > 0.08);
    }
}
