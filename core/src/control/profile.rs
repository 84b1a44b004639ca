//! Set points from one place to another, with limited velocity, acceleration and jerk.

use serde::{Deserialize, Serialize};

use super::{Position, SetPoint};
use crate::Scalar;

/// What a move may not exceed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits<T> {
    /// rad/s or m/s.
    pub velocity: T,
    /// rad/s² or m/s².
    pub acceleration: T,
    /// rad/s³ or m/s³.
    pub jerk: T,
}

impl<T: Scalar> Limits<T> {
    /// Whether all are positive and finite.
    pub fn is_valid(&self) -> bool {
        let limits = [self.velocity, self.acceleration, self.jerk];
        limits.into_iter().all(|x| x.is_finite() && x > T::ZERO)
    }
}

/// A move from rest to rest, as fast as its limits allow.
///
/// The velocity rises along an S of two parabolas, `rise` seconds of jerk with constant acceleration between them if
/// there is time, is constant for a while, and falls as it rose. With the peaks `A` and `V` of acceleration and velocity,
/// `V = A·(ramp − rise)` and the way is `V·(ramp + cruise)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile<T> {
    start: Position<T>,
    /// rad or m with a sign, and counts to one of them.
    way: T,
    per_count: T,
    /// Duration of a jerk, of the whole way up to speed, and at that speed, s.
    rise: T,
    ramp: T,
    cruise: T,
    jerk: T,
    /// Samples so far, and the sampling period.
    samples: i32,
    period: T,
}

impl<T: Scalar> Profile<T> {
    /// A move between two positions on an encoder with `count` rad or m to a count, sampled every `period` seconds; `None`
    /// if the limits are not valid. Not for the control path: it takes roots and divisions.
    pub fn new(
        from: Position<T>,
        to: Position<T>,
        count: T,
        limits: &Limits<T>,
        period: T,
    ) -> Option<Self> {
        let valid = limits.is_valid() && count > T::ZERO && period > T::ZERO;
        let way = to.minus(from) * count;
        if !valid || !way.is_finite() {
            return None;
        }
        let (rise, ramp, cruise) = times(way.abs(), limits);
        // Rounding the way to the times it takes: what is moved along is the way itself.
        let shape = rise * (ramp - rise) * (ramp + cruise);
        let jerk = if shape > T::ZERO {
            way / shape
        } else {
            T::ZERO
        };
        Some(Self {
            start: from,
            way,
            per_count: T::ONE / count,
            rise,
            ramp,
            cruise,
            jerk,
            samples: 0,
            period,
        })
    }

    /// How long it takes, s.
    pub fn duration(&self) -> T {
        self.ramp + self.cruise + self.ramp
    }

    /// The set point of this sample; at its end, again and again.
    pub fn step(&mut self) -> SetPoint<T> {
        let time = self.time();
        let over = self.is_over();
        if !over {
            self.samples = self.samples.saturating_add(1);
        }
        let (way, velocity, acceleration) = if over {
            (self.way, T::ZERO, T::ZERO)
        } else {
            self.at(time)
        };
        SetPoint::Position {
            position: self.start.moved(way * self.per_count),
            velocity,
            acceleration,
        }
    }

    /// Whether the set point has arrived.
    pub fn is_over(&self) -> bool {
        // So that it ends even where a number is none.
        let running = self.time() < self.duration();
        !running
    }

    /// Time since the start, s; in two parts, as fixed point cannot count all samples of a long move.
    fn time(&self) -> T {
        let (thousands, rest) = (self.samples >> 10, self.samples & 1023);
        T::from_i32(thousands) * (self.period * T::from_i32(1024)) + T::from_i32(rest) * self.period
    }

    /// Way, velocity and acceleration at an instant of the move.
    fn at(&self, time: T) -> (T, T, T) {
        let left = self.duration() - time;
        if time < self.ramp {
            self.rising(time)
        } else if left < self.ramp {
            let (way, velocity, acceleration) = self.rising(left);
            (self.way - way, velocity, -acceleration)
        } else {
            let (way, velocity, _) = self.rising(self.ramp);
            (way + velocity * (time - self.ramp), velocity, T::ZERO)
        }
    }

    /// The same on the way up to speed.
    fn rising(&self, time: T) -> (T, T, T) {
        let (jerk, rise) = (self.jerk, self.rise);
        let flat = self.ramp - rise - rise;
        let parabola = |t: T| jerk * t * t.half();
        let most = jerk * rise;
        if time < rise {
            (
                parabola(time) * time / T::from_i32(3),
                parabola(time),
                jerk * time,
            )
        } else if time <= rise + flat {
            let t = time - rise;
            let begun = parabola(rise);
            (
                begun * rise / T::from_i32(3) + begun * t + most * t * t.half(),
                begun + most * t,
                most,
            )
        } else {
            // Backwards from the end of the ramp, where half of `V·ramp` is covered.
            let t = self.ramp - time;
            let speed = most * (self.ramp - rise);
            let way = speed * self.ramp.half() - speed * t + parabola(t) * t / T::from_i32(3);
            (way, speed - parabola(t), jerk * t)
        }
    }
}

/// Durations of a jerk, of a ramp and of the cruise.
fn times<T: Scalar>(way: T, limits: &Limits<T>) -> (T, T, T) {
    let Limits {
        velocity,
        acceleration,
        jerk,
    } = *limits;
    // Up to full speed.
    let rise = acceleration / jerk;
    let gentle = velocity < acceleration * rise;
    let (rise, ramp) = if gentle {
        let rise = (velocity / jerk).sqrt();
        (rise, rise + rise)
    } else {
        (rise, rise + velocity / acceleration)
    };
    if way >= velocity * ramp {
        return (rise, ramp, way / velocity - ramp);
    }
    // Too short for that: up to full acceleration, `way = A·(ramp − rise)·ramp`, …
    let rise = acceleration / jerk;
    let ramp = rise.half() + (rise.half() * rise.half() + way / acceleration).sqrt();
    if !gentle && ramp >= rise + rise {
        return (rise, ramp, T::ZERO);
    }
    // … or not even that: `way = 2·jerk·rise³`.
    let rise = cube_root((way / jerk).half());
    (rise, rise + rise, T::ZERO)
}

/// The cube root of a number that is not negative, by Newton's method from above, where it falls monotonically.
fn cube_root<T: Scalar>(x: T) -> T {
    let three = T::from_i32(3);
    let mut root = if x > T::ONE { x } else { T::ONE };
    for _ in 0..200 {
        let next = (root + root + x / (root * root)) / three;
        if next < root {
            root = next;
        } else {
            break;
        }
    }
    root
}

#[cfg(test)]
mod tests {
    use super::{Limits, Profile, cube_root};
    use crate::control::{Position, SetPoint};
    use crate::scalar::{Q16, Scalar};

    const COUNT: f64 = 0.01;
    const PERIOD: f64 = 1.0 / 1024.0;

    /// Position in counts from the start, velocity and acceleration of each sample.
    fn walk<T: Scalar>(way: f64, limits: [f64; 3]) -> std::vec::Vec<[f64; 3]> {
        let [velocity, acceleration, jerk] = limits.map(T::from_f64);
        let limits = Limits {
            velocity,
            acceleration,
            jerk,
        };
        let from = Position::at(-70_000);
        let to = from.moved(T::from_f64(way));
        let mut profile =
            Profile::new(from, to, T::from_f64(COUNT), &limits, T::from_f64(PERIOD)).unwrap();
        let mut out = std::vec::Vec::new();
        while !profile.is_over() {
            assert!(out.len() < 100_000);
            out.push(profile.step());
        }
        out.push(profile.step());
        assert_eq!(profile.step(), profile.step());
        let numbers = |set_point: &SetPoint<T>| match *set_point {
            SetPoint::Position {
                position,
                velocity,
                acceleration,
            } => [position.minus(from), velocity, acceleration].map(Scalar::to_f64),
            _ => unreachable!("a profile gives positions"),
        };
        out.iter().map(numbers).collect()
    }

    fn check<T: Scalar>(tolerance: f64) {
        // Long and short ways, gentle and hard limits: every branch of the plan.
        for way in [3000.0, -400.0, 30.0, -2.5, 0.0] {
            for limits in [[2.0, 8.0, 100.0], [2.0, 8.0, 20.0], [0.5, 8.0, 50.0]] {
                let walk = walk::<T>(way, limits);
                let last = walk[walk.len() - 1];
                assert!(
                    (last[0] - way).abs() < tolerance / COUNT && last[1] == 0.0 && last[2] == 0.0
                );
                for pair in walk.windows(2) {
                    let [[q, v, a], [q2, v2, a2]] = [pair[0], pair[1]];
                    assert!(v2.abs() <= limits[0] + tolerance && a2.abs() <= limits[1] + tolerance);
                    assert!(
                        (a2 - a).abs() <= limits[2] * PERIOD * 1.001 + tolerance,
                        "{a} {a2} {limits:?} {way}"
                    );
                    // Each is the rate of the one before, by the trapezoidal rule.
                    let moved = 0.5 * (v + v2) * PERIOD;
                    assert!(
                        ((q2 - q) * COUNT - moved).abs() < limits[2] * PERIOD.powi(3) + tolerance
                    );
                    assert!(
                        (v2 - v - 0.5 * (a + a2) * PERIOD).abs()
                            < limits[2] * PERIOD.powi(2) + tolerance
                    );
                }
            }
        }
    }

    #[test]
    fn every_move_keeps_its_limits_and_ends_where_it_should() {
        check::<f64>(1e-9);
        // Ways of 30 rad and speeds of a few rad/s, rounded to 2⁻²⁴ some ten times.
        check::<f32>(4e-5);
        check::<Q16>(0.02);
    }

    #[test]
    fn a_long_move_takes_the_time_that_its_limits_ask_for() {
        // 30 rad at 2 rad/s: 15 s, and a ramp of A/J + V/A = 0.33 s more.
        let samples = walk::<f64>(3000.0, [2.0, 8.0, 100.0]).len() as f64;
        assert!((samples * PERIOD - 15.33).abs() < 3.0 * PERIOD);
    }

    #[test]
    fn limits_that_are_none_make_no_move() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let limits = Limits {
                velocity: 1.0,
                acceleration: bad,
                jerk: 1.0,
            };
            assert_eq!(
                Profile::new(Position::at(0), Position::at(5), 1.0, &limits, 1.0),
                None
            );
        }
    }

    #[test]
    fn cube_roots_are_roots() {
        for x in [0.0, 1e-6, 0.3, 1.0, 27.0, 1e6] {
            assert!(
                (cube_root(x) - libm::cbrt(x)).abs() < 1e-9 * (1.0 + x),
                "{x}"
            );
        }
    }
}
