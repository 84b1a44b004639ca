//! Even time in the place of stamps that do not tell when the samples were taken.

use std::ops::Range;

use super::{quantile, rms};
use crate::recording::Recording;

/// Samples on either side over which stamps are averaged: what a thousand of them say of one instant errs by a thirtieth of
/// their jitter, and no clock drifts within so few.
const REACH: usize = 500;
/// A missing sample doubles the interval: from this many times the usual one on, some are missing, unless …
const MISSING: f64 = 1.5;
/// … jitter makes such intervals, which deviate by at most so many times their RMS.
const FAR: f64 = 5.0;
/// One time is better than another if the motion is rougher over the other by more than `1 / BETTER`.
pub(super) const BETTER: f64 = 0.8;

/// A recording over even time where that is evidently when its samples were taken: a timer takes them, but something later
/// stamps them, as a host does. The stamps are kept as [`Recording::stamps`].
///
/// The instant of sample `k` is then `k T + mean(t_j - j T)` over the samples `j` around it that none are missing between, with
/// `T` the slope of the straight line through all of them, s.
pub fn evened(recording: Recording) -> Recording {
    let intervals = Intervals::of(&recording.t);
    let latest = recording.t.iter().fold(0.0_f64, |m, t| m.max(t.abs()));
    // Even to the last digit.
    if intervals.jitter * intervals.median <= f64::EPSILON * latest {
        return recording;
    }
    let (by_stamps, evenly) = roughness(&recording.t, recording.measured());
    if evenly >= BETTER * by_stamps {
        return recording;
    }
    let even = even(&recording.t);
    if even.windows(2).any(|w| w[1] <= w[0]) {
        return recording;
    }
    Recording {
        stamps: Some(recording.t),
        t: even,
        ..recording
    }
}

/// How far apart stamps lie.
pub(super) struct Intervals {
    /// All of them, s.
    pub all: Vec<f64>,
    /// The usual one, s.
    pub median: f64,
    /// By which share of it others deviate, RMS.
    pub jitter: f64,
    /// The same at most.
    pub largest: f64,
}

impl Intervals {
    pub fn of(t: &[f64]) -> Self {
        let all: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
        let median = quantile(all.clone(), 0.5);
        let usual = all.iter().filter(|dt| **dt < MISSING * median);
        let deviations: Vec<f64> = usual.map(|dt| dt / median - 1.0).collect();
        Self {
            jitter: rms(deviations.iter().copied()),
            largest: deviations.iter().fold(0.0, |m, d| m.max(d.abs())),
            all,
            median,
        }
    }

    /// An interval, s, that is longer hides missing samples.
    pub fn long(&self) -> f64 {
        (1.0 + FAR * self.jitter).max(MISSING) * self.median
    }
}

fn even(t: &[f64]) -> Vec<f64> {
    let long = Intervals::of(t).long();
    t.chunk_by(|a, b| b - a <= long).flat_map(smooth).collect()
}

/// Stamps without missing samples between them, each as those around say.
fn smooth(t: &[f64]) -> Vec<f64> {
    let period = slope(t);
    let late = |k: usize| t[k] - t[0] - k as f64 * period;
    let mut sums = vec![0.0];
    sums.extend((0..t.len()).scan(0.0, |sum, k| {
        *sum += late(k);
        Some(*sum)
    }));
    let mean = |range: Range<usize>| (sums[range.end] - sums[range.start]) / range.len() as f64;
    let around = |k: usize| k.saturating_sub(REACH)..(k + REACH + 1).min(t.len());
    let instant = |k: usize| t[0] + k as f64 * period + mean(around(k));
    (0..t.len()).map(instant).collect()
}

/// The slope of the straight line through numbers over their count, by least squares.
fn slope(x: &[f64]) -> f64 {
    let middle = (x.len() - 1) as f64 / 2.0;
    let moments = (x.iter().enumerate()).fold((0.0, 0.0), |(xk, kk), (k, x_k)| {
        let k = k as f64 - middle;
        (xk + k * (x_k - x[0]), kk + k * k)
    });
    moments.0 / moments.1.max(f64::MIN_POSITIVE)
}

/// Distance of a sample from the line through its neighbours, with time by the stamps and by the count: the RMS of all but the
/// largest tenth, so that reversals and gaps do not decide, and neither do the many zeros of an encoder.
pub(super) fn roughness(t: &[f64], x: &[f64]) -> (f64, f64) {
    let distance = |share: &dyn Fn(usize) -> f64| {
        let inner = (1..x.len() - 1).map(|k| {
            let line = x[k - 1] + (x[k + 1] - x[k - 1]) * share(k);
            (x[k] - line).abs()
        });
        let mut distances: Vec<f64> = inner.collect();
        distances.sort_by(f64::total_cmp);
        distances.truncate(distances.len() * 9 / 10);
        rms(distances.into_iter())
    };
    let by_stamps = distance(&|k| (t[k] - t[k - 1]) / (t[k + 1] - t[k - 1]));
    (by_stamps, distance(&|_| 0.5))
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::evened;
    use crate::recording::Recording;

    /// A sine that was sampled at some instants, with stamps of its own.
    fn recording(sampled: &[f64], stamps: Vec<f64>) -> Recording {
        Recording {
            path: "made.csv".into(),
            u: sampled.iter().map(|t| (3.0 * t).cos()).collect(),
            q: Some(sampled.iter().map(|t| (3.0 * t).sin()).collect()),
            t: stamps,
            ..Recording::default()
        }
    }

    /// 3000 samples at 1 kHz with a hole after the second thousand, and the same with jitter of 10 % of an interval.
    fn times() -> (Vec<f64>, Vec<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let counts = (0..3000).map(|k| if k < 2000 { k } else { k + 40 });
        let even: Vec<f64> = counts.map(|k| 1e-3 * f64::from(k)).collect();
        let jittery = even.iter().map(|t| t + 1e-4 * rng.random_range(-1.7..1.7));
        (even.clone(), jittery.collect())
    }

    #[test]
    fn stamps_that_jitter_give_way_to_even_time_and_the_hole_stays() {
        let (even, jittery) = times();
        let evened = evened(recording(&even, jittery.clone()));
        assert_eq!(evened.stamps.as_ref(), Some(&jittery));
        let worst = evened.t.iter().zip(&even).map(|(a, b)| (a - b).abs());
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 2e-5, "{worst}");
    }

    /// A count a sample lies on a straight line over the count, and but for rounding over even stamps.
    #[test]
    fn rounding_is_no_jitter() {
        let stamps = (0..3000).map(|k| 1000.0 + 1e-3 * f64::from(k));
        let even: Vec<f64> = stamps.collect();
        let mut steady = recording(&even, even.clone());
        steady.q = Some((0..3000).map(|k| f64::from(k) / 1_048_576.0).collect());
        assert!(evened(steady).stamps.is_none());
    }

    #[test]
    fn stamps_that_tell_the_truth_stay() {
        let (even, jittery) = times();
        assert!(
            evened(recording(&jittery, jittery.clone()))
                .stamps
                .is_none()
        );
        assert!(evened(recording(&even, even.clone())).stamps.is_none());
    }
}
