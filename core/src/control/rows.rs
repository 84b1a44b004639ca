//! The Coulomb level by least squares on rows of the weak form.

use super::{Adaptation, Position};
use crate::Scalar;
use crate::weak::Kernel;

/// Samples on either side of the centre of a window.
const REACH: usize = 16;
/// Samples that a window has intervals between.
const INTERVALS: usize = 2 * REACH;
/// Intervals without a count after which an axis stands: a quarter of a window.
const PAUSE: i32 = REACH as i32 / 2;

/// The weights of a window, in units of half of one: those of every set of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Weights<T> {
    acceleration: [T; INTERVALS + 1],
    hold: [T; INTERVALS],
}

impl<T: Scalar> Weights<T> {
    pub fn new() -> Self {
        // In units of half a window all weights lie around 1.
        let kernel = Kernel::new(REACH, T::ONE / T::from_i32(REACH as i32));
        let mut acceleration = [T::ZERO; INTERVALS + 1];
        let mut hold = [T::ZERO; INTERVALS];
        kernel.acceleration(&mut acceleration);
        // Where a window starts must not matter: rounding leaves a rest, which goes to the middle.
        let rest = acceleration.iter().fold(T::ZERO, |sum, &w| sum + w);
        if let Some(middle) = acceleration.get_mut(REACH) {
            *middle -= rest;
        }
        kernel.hold(&mut hold);
        Self { acceleration, hold }
    }
}

/// Windows over an axis and the gains of the recursion, computed once when parameters are put in force.
///
/// A window of test function φ turns `J·v̇ = τ − Fc·s − o`, in which the axis slides in the direction `s` all the time
/// and `τ` is everything known, into one row `∫τφ − J·∫q φ̈ = Fc·s + o`: nothing measured is differentiated. Windows
/// overlap by half. Recursive least squares take the row in,
/// `g = P·x/(1 + xᵀ·P·x)`, `θ ← θ + g·(y − xᵀθ)`, `P ← P − g·xᵀ·P`, with `x = (s, 1)`, `θ = (Fc, o)` and the row's noise
/// as the unit of `P`.
///
/// # Counts that beat
/// A window takes a position for several samples: their mean, as it does with torques. A single one would let the sawtooth
/// that an encoder adds beat against the windows: at nearly a count a position it turns into a slow wave, which repeats from
/// row to row where the recursion takes noise to be independent. The mean over those samples is zero for just the
/// speeds at which they would beat; it is half of them behind the torque, less than a 64th of the window. What is left
/// are speeds near a simple fraction of a count a *sample*, which no weight can tell from motion.
///
/// # Forgetting without wind-up
/// After each row, and never without one, a share of the prior comes back: `P ← P + (1 − λ)·(P₀ − P)`. As every `P` is
/// then between zero and `P₀`, the gain `xᵀ·g` stays between 0 and 1, so that a row always brings the prediction nearer
/// to what it says, whatever λ from 0 to 1: the recursion is stable without a condition, cannot burst after
/// a rest, and cannot fall asleep. A direction that is not driven keeps what it knows but for what the prior makes
/// likely: that a change of friction is a change of `Fc` rather than of `o`.
///
/// # Excitation
/// A row counts only if the encoder has moved one way, never standing still for a quarter of the window, and by as much as
/// [`Adaptation::speed`] makes in the window. The encoder and not the observer's velocity decides, which is biased
/// where the level is still wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rows<T> {
    /// Samples of the controller to one of a window.
    every: i32,
    /// One over that.
    mean: T,
    /// Torque per weighted count.
    torque_per_count: T,
    /// Counts of the least way in a window.
    least: T,
    /// `1 − λ`.
    forgotten: T,
    /// Diagonal of `P₀`.
    prior: [T; 2],
}

/// What the windows and the recursion remember.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RowState<T> {
    windows: [Window<T>; 2],
    /// Samples since the last one that the windows took.
    since: i32,
    /// Sum of torques since then.
    sum: T,
    /// What the encoder showed first since then, and the sum of what it has shown beyond that.
    first: i32,
    beyond: i32,
    /// What the encoder showed then.
    last: i32,
    /// Samples of windows since the encoder moved, and which way.
    idle: i32,
    direction: i32,
    /// `P`: the variances of `Fc` and `o`, and their covariance.
    variance: [T; 3],
}

/// A window in the making.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window<T> {
    /// Samples taken; below zero until its turn comes.
    taken: i32,
    start: Position<T>,
    torque: T,
    way: T,
    /// Direction all along, zero once that is lost.
    direction: i32,
}

impl<T: Scalar> Window<T> {
    fn new(taken: i32) -> Self {
        Self {
            taken,
            start: Position::at(0),
            torque: T::ZERO,
            way: T::ZERO,
            direction: 0,
        }
    }
}

impl<T: Scalar> RowState<T> {
    pub fn new(rows: &Rows<T>) -> Self {
        Self {
            windows: [Window::new(0), Window::new(-(REACH as i32))],
            since: 0,
            sum: T::ZERO,
            first: 0,
            beyond: 0,
            last: 0,
            idle: 0,
            direction: 0,
            variance: [rows.prior[0], rows.prior[1], T::ZERO],
        }
    }
}

impl<T> RowState<T> {
    /// Which way the encoder has been moving, where a window takes a sample; zero if it stands.
    fn direction(&mut self, counts: i32) -> i32 {
        let moved = counts.wrapping_sub(self.last).signum();
        self.last = counts;
        if moved == 0 {
            self.idle = (self.idle + 1).min(PAUSE);
        } else {
            self.idle = 0;
            self.direction = moved;
        }
        if self.idle < PAUSE { self.direction } else { 0 }
    }
}

/// What a sample shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<T> {
    pub counts: i32,
    /// Everything known that acted since the last sample, N·m or N.
    pub torque: T,
}

impl<T: Scalar> Rows<T> {
    pub fn new(adaptation: &Adaptation<T>, period: T, inertia: T, count: T) -> Self {
        let reach = T::from_i32(REACH as i32);
        let wide = adaptation.window.half() / period;
        let every = (wide / reach + T::ONE.half()).floor().max(1);
        let half_width = reach * T::from_i32(every) * period;
        let certain = T::from_i32(16);
        Self {
            every,
            mean: T::ONE / T::from_i32(every),
            torque_per_count: inertia / half_width * (count / half_width),
            least: adaptation.speed * (half_width + half_width) / count,
            forgotten: adaptation.forgotten,
            prior: [certain, certain * adaptation.offset * adaptation.offset],
        }
    }

    /// Takes a sample in; where it completes a row, the level and the offset `(Fc, o)` are brought forward.
    pub fn sample(
        &self,
        weights: &Weights<T>,
        state: &mut RowState<T>,
        seen: Seen<T>,
        theta: &mut [T; 2],
    ) {
        state.sum += seen.torque;
        if state.since == 0 {
            state.first = seen.counts;
            state.beyond = 0;
        }
        let beyond = seen.counts.wrapping_sub(state.first);
        state.beyond = state.beyond.wrapping_add(beyond);
        state.since += 1;
        if state.since < self.every {
            return;
        }
        let torque = state.sum * self.mean;
        state.sum = T::ZERO;
        state.since = 0;
        let place = Position::at(state.first).moved(T::from_i32(state.beyond) * self.mean);
        let direction = state.direction(seen.counts);
        let RowState {
            windows, variance, ..
        } = state;
        for window in windows {
            if let Some(row) = self.extend(weights, window, place, torque, direction) {
                self.learn(variance, row, theta);
            }
        }
    }

    /// Adds a sample to a window; the row `(s, y)` if that was the last one of a window that counts.
    fn extend(
        &self,
        weights: &Weights<T>,
        window: &mut Window<T>,
        place: Position<T>,
        torque: T,
        direction: i32,
    ) -> Option<(T, T)> {
        let Ok(k) = usize::try_from(window.taken) else {
            window.taken += 1;
            return None;
        };
        window.taken += 1;
        if k == 0 {
            window.start = place;
            window.direction = direction;
            return None;
        }
        if window.direction != direction {
            window.direction = 0;
        }
        let way = place.minus(window.start);
        if let (Some(&hold), Some(&acceleration)) =
            (weights.hold.get(k - 1), weights.acceleration.get(k))
        {
            window.torque += hold * torque;
            window.way += acceleration * way;
        }
        if k < INTERVALS {
            return None;
        }
        let sign = T::from_i32(window.direction);
        let force = window.torque - self.torque_per_count * window.way;
        // The next window of this turn begins where this one ends.
        *window = Window {
            start: place,
            direction,
            ..Window::new(1)
        };
        (sign != T::ZERO && way * sign >= self.least).then_some((sign, force))
    }

    /// The recursion.
    fn learn(&self, [pc, po, pco]: &mut [T; 3], (s, y): (T, T), [level, offset]: &mut [T; 2]) {
        // P·x with x = (s, 1), and xᵀ·P·x.
        let (gc, go) = (*pc * s + *pco, *pco * s + *po);
        let scale = T::ONE / (T::ONE + gc * s + go);
        let error = y - *level * s - *offset;
        *level += gc * scale * error;
        *offset += go * scale * error;
        let share = self.forgotten;
        let back = |p: T, prior: T| p + share * (prior - p);
        *pc = back(*pc - gc * gc * scale, self.prior[0]);
        *po = back(*po - go * go * scale, self.prior[1]);
        *pco = back(*pco - gc * go * scale, T::ZERO);
    }
}

#[cfg(test)]
mod tests {
    use super::{RowState, Rows, Seen, Weights};
    use crate::control::{Adaptation, Learning};
    use crate::scalar::{Q16, Scalar};

    /// Time counts in hundredths of a second and positions in milliradians, so that fixed point has numbers around 1: a
    /// millisecond and a count of 0.1 mrad are 0.1.
    const PERIOD: f64 = 1e-3;
    const COUNT: f64 = 1e-4;
    const INERTIA: f64 = 0.1;

    fn rows<T: Scalar>(forgotten: f64, offset: f64) -> Rows<T> {
        let number = T::from_f64;
        let adaptation = Adaptation {
            method: Learning::Rows,
            speed: number(1.0),
            lowest: T::ZERO,
            highest: number(2.0),
            rate: T::ZERO,
            window: number(10.0),
            forgotten: number(forgotten),
            offset: number(offset),
        };
        Rows::new(
            &adaptation,
            number(0.1),
            number(INERTIA * 1e-3 / 1e-4),
            number(0.1),
        )
    }

    /// An axis that a triangle of torque moves to and fro under a level and an offset; what is learned of both, and the
    /// variances, after each second.
    fn run<T: Scalar>(
        rows: &Rows<T>,
        seconds: u32,
        truth: impl Fn(f64) -> [f64; 2],
        one_way: bool,
    ) -> std::vec::Vec<([f64; 2], [f64; 3])> {
        let (weights, mut state) = (Weights::new(), RowState::new(rows));
        let mut theta = [T::ZERO; 2];
        let (mut q, mut v) = (0.0_f64, 0.0_f64);
        let mut out = std::vec::Vec::new();
        for k in 0..seconds * 1000 {
            let t = f64::from(k) * PERIOD;
            let [level, offset] = truth(t);
            let torque = if one_way {
                level + offset + 0.3 - v
            } else {
                1.2 * libm::sin(core::f64::consts::TAU * 0.7 * t) + offset
            };
            let free = v + (torque - offset) * PERIOD / INERTIA;
            let brake = level * PERIOD / INERTIA;
            let after = free - free.clamp(-brake, brake);
            q += 0.5 * (v + after) * PERIOD;
            v = after;
            // The torque acts until the next sample, which shows what it did.
            let seen = Seen {
                counts: Scalar::floor(q / COUNT),
                torque: T::from_f64(torque),
            };
            rows.sample(&weights, &mut state, seen, &mut theta);
            let [pc, po, pco] = state.variance.map(Scalar::to_f64);
            let prior = rows.prior.map(Scalar::to_f64);
            assert!(
                pc >= 0.0 && po >= 0.0 && pc <= prior[0] && po <= prior[1],
                "{pc} {po}"
            );
            assert!(pco * pco <= pc * po + 1e-3, "{pc} {po} {pco}");
            if k % 1000 == 999 {
                out.push((theta.map(Scalar::to_f64), [pc, po, pco]));
            }
        }
        out
    }

    fn finds_both<T: Scalar>(tolerance: f64) {
        let found = run(&rows::<T>(0.1, 0.5), 6, |_| [0.5, -0.1], false)[5].0;
        let off = (found[0] - 0.5).abs().max((found[1] + 0.1).abs());
        assert!(off < tolerance, "{found:?}");
    }

    #[test]
    fn level_and_offset_are_found_in_every_arithmetic() {
        // Rounding to counts makes noise of COUNT·0.29·J·√(Σw²)/T² = 1e-4·0.29·0.1·√34/0.048² ≈ 0.007 N·m in a row where it
        // is independent from sample to sample.
        finds_both::<f64>(0.01);
        finds_both::<f32>(0.01);
        finds_both::<Q16>(0.015);
    }

    /// The largest error of the level at a steady speed, in counts a sample, from the tenth row on.
    fn steady<T: Scalar>(speed: f64) -> f64 {
        let mut rows = rows::<T>(0.005, 0.1);
        rows.least = T::ONE;
        let (weights, mut state) = (Weights::new(), RowState::new(&rows));
        let mut theta = [T::from_f64(0.5), T::ZERO];
        let mut worst = 0.0_f64;
        for k in 0..10_000 {
            let seen = Seen {
                counts: Scalar::floor(speed * f64::from(k)),
                torque: T::from_f64(0.5),
            };
            rows.sample(&weights, &mut state, seen, &mut theta);
            if k > 600 {
                worst = worst.max((theta[0].to_f64() - 0.5).abs());
            }
        }
        worst
    }

    #[test]
    fn counts_do_not_beat_against_the_windows() {
        // A position is taken for three samples. At 0.95 counts in three the counts of every third sample repeat after 60,
        // just where a window of 96 is most sensitive: rows would be off by COUNT·J·max|φ̇| = 1e-4·0.1·2.1/0.048² ≈ 0.009 N·m,
        // of which a quarter is believed again and again. The mean leaves a 20th of that wave (its response is
        // sinc(0.95) ≈ 0.05), and the wave's third harmonic, which is as slow in single samples, leaves a ninth.
        let beating = 0.009;
        for speed in [0.95 / 3.0, 1.05 / 3.0, 1.95 / 3.0] {
            for worst in [steady::<f64>(speed), steady::<f32>(speed)] {
                assert!(worst < beating / 9.0, "{speed}: {worst}");
            }
        }
        let worst = steady::<Q16>(0.95 / 3.0);
        assert!(worst < beating / 9.0 + 0.002, "{worst}");
    }

    #[test]
    fn what_changes_is_followed_and_what_rests_is_kept() {
        let rows = rows::<f64>(0.1, 0.0);
        let seen = run(&rows, 12, |t| [if t < 6.0 { 0.3 } else { 0.6 }, 0.0], false);
        assert!((seen[5].0[0] - 0.3).abs() < 0.03 && (seen[7].0[0] - 0.6).abs() < 0.04);
        // At rest nothing changes, neither level nor covariance, however hard friction is pushed.
        let (weights, mut state) = (Weights::new(), RowState::new(&rows));
        let mut theta = [0.4, 0.0];
        let before = state.variance;
        for k in 0..100_000 {
            let torque = f64::from(k % 7);
            rows.sample(&weights, &mut state, Seen { counts: 5, torque }, &mut theta);
            assert_eq!((theta, state.variance), ([0.4, 0.0], before));
        }
        // Nor where an encoder trembles between two counts.
        for k in 0..100_000 {
            rows.sample(
                &weights,
                &mut state,
                Seen {
                    counts: k / 4 % 2,
                    torque: 3.0,
                },
                &mut theta,
            );
        }
        assert_eq!(theta, [0.4, 0.0]);
    }

    #[test]
    fn one_direction_alone_neither_bursts_nor_falls_asleep() {
        // Ten minutes of sliding one way, then a change: the covariance stays within its prior (asserted in the run), and the
        // sum that this direction shows follows.
        let rows = rows::<f64>(0.2, 0.3);
        let seen = run(
            &rows,
            600,
            |t| [if t < 590.0 { 0.3 } else { 0.5 }, 0.05],
            true,
        );
        assert!(
            (seen[588].0[0] + seen[588].0[1] - 0.35).abs() < 0.03,
            "{:?}",
            seen[588]
        );
        assert!(
            (seen[595].0[0] + seen[595].0[1] - 0.55).abs() < 0.03,
            "{:?}",
            seen[595]
        );
    }

    #[test]
    fn without_an_expected_offset_none_is_learned() {
        let found = run(&rows::<f32>(0.1, 0.0), 4, |_| [0.5, -0.1], false)[3].0;
        assert_eq!(found[1], 0.0);
        assert!((found[0] - 0.5).abs() < 0.1 + 0.02);
    }
}
