//! Time stamps: their unit, lost samples, jitter.

use std::ops::RangeInclusive;

use super::{Warning, quantile, rms};
use crate::format::{percent, quantity, whole_percent};
use crate::recording::Recording;
use crate::weak::Track;

/// Rates of drives and loggers, Hz: below, friction is over before the next sample; above, no encoder follows.
const RATES: RangeInclusive<f64> = 10.0..=1e6;
/// Share of lost samples from which on it is a habit of the logger.
const LOST: f64 = 1e-3;
/// The weak form leaves windows over longer pauses out, in intervals.
const GAP: f64 = 5.0;
/// Timing within this share of an interval counts as even throughout.
const EVEN: f64 = 0.02;
/// Jitter beyond this, even if the stamps tell the truth, leaves holes as large as samples.
const WILD: f64 = 0.3;
/// One description of the samples is better than another if it leaves this much less.
const BETTER: f64 = 0.8;

pub(super) fn check(recording: &Recording, track: &Track) -> Vec<Warning> {
    let t = &recording.t;
    let intervals: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let median = quantile(intervals.clone(), 0.5);
    let usual = intervals.iter().filter(|dt| **dt < 1.5 * median);
    let deviations: Vec<f64> = usual.map(|dt| dt / median - 1.0).collect();
    let jitter = rms(deviations.iter().copied());
    let mut warnings = Vec::new();
    warnings.extend(unit(median));
    warnings.extend(lost(&intervals, median, jitter));
    let largest = deviations.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
    warnings.extend(uneven(recording, track, (median, jitter, largest)));
    warnings
}

fn unit(median: f64) -> Option<Warning> {
    let rate = 1.0 / median;
    if RATES.contains(&rate) {
        return None;
    }
    let scales = [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
    let mut fitting = scales.iter().filter(|(_, s)| RATES.contains(&(rate / s)));
    let what = match fitting.next() {
        Some((unit, _)) => {
            format!("they are probably in {unit}: name the column t[{unit}], or divide them")
        }
        None if rate < *RATES.start() => {
            "record at 10 Hz or more, or check what the time column holds".to_owned()
        }
        None => {
            "they are probably in s although the header says ms, us or ns: name the column t[s]"
                .to_owned()
        }
    };
    Some(Warning::suspect(
        "time-unit",
        format!(
            "The time stamps lie {} apart, a rate of {}, which no drive is logged at; {what}.",
            quantity(median, "s"),
            quantity(rate, "Hz")
        ),
    ))
}

fn lost(intervals: &[f64], median: f64, jitter: f64) -> Option<Warning> {
    // A missing sample doubles the interval; jitter alone must not look like it.
    let double = (1.0 + 5.0 * jitter).max(1.5);
    let long = intervals
        .iter()
        .map(|dt| dt / median)
        .filter(|r| *r > double);
    let lost: f64 = long.clone().map(|r| r.round() - 1.0).sum();
    let longest = long.clone().fold(0.0, f64::max);
    let share = lost / (lost + intervals.len() as f64);
    if share < LOST && longest <= GAP {
        return None;
    }
    let gap = if longest > GAP {
        " Windows over the gaps are left out."
    } else {
        ""
    };
    Some(Warning::weak(
        "lost-samples",
        format!(
            "{lost:.0} samples ({}) are missing in {} gaps of up to {}: the logger or the link dropped them.{gap} Log to memory first, or at a lower rate.",
            percent(share, None),
            long.count(),
            quantity(1e3 * longest * median, "ms")
        ),
    ))
}

/// Jitter of the stamps adds position errors of speed times jitter; jitter of the sampling that the stamps tell of does
/// no harm. Positions lie on a smooth curve over the right one of both times.
fn uneven(
    recording: &Recording,
    track: &Track,
    (median, jitter, largest): (f64, f64, f64),
) -> Option<Warning> {
    let slip = jitter * median * rms(track.v.iter().copied());
    if jitter <= EVEN || (slip <= track.position_noise && jitter <= WILD) {
        return None;
    }
    let (by_stamps, evenly) = roughness(&recording.t, recording.measured());
    if by_stamps < BETTER * evenly && jitter <= WILD {
        return None;
    }
    let (cause, next) = if evenly < BETTER * by_stamps {
        (
            "the motion is smoother over even time than over the stamps, so the samples were even and the stamps are not: a stamp taken by the host instead of by the drive",
            "replace the stamps by even ones, or let the drive stamp the samples",
        )
    } else {
        (
            "sampling by a task without real-time priority",
            "sample from a timer or in the control task",
        )
    };
    Some(Warning::suspect(
        "timing-jitter",
        format!(
            "The sampling interval of {} scatters by {} (RMS; at most {}); the likely cause: {cause}. {}.",
            quantity(1e3 * median, "ms"),
            percent(jitter, None),
            whole_percent(largest),
            capitalised(next)
        ),
    ))
}

/// Median distance of a sample from the line through its neighbours, with time by the stamps and by the count.
fn roughness(t: &[f64], x: &[f64]) -> (f64, f64) {
    let distance = |share: &dyn Fn(usize) -> f64| {
        let inner = (1..x.len() - 1).map(|k| {
            let line = x[k - 1] + (x[k + 1] - x[k - 1]) * share(k);
            (x[k] - line).abs()
        });
        rms_of_most(inner.collect())
    };
    let by_stamps = distance(&|k| (t[k] - t[k - 1]) / (t[k + 1] - t[k - 1]));
    (by_stamps, distance(&|_| 0.5))
}

/// RMS of all but the largest tenth: reversals and gaps do not decide, and neither do the many zeros of an encoder.
fn rms_of_most(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.truncate(values.len() * 9 / 10);
    rms(values.into_iter())
}

fn capitalised(clause: &str) -> String {
    let mut letters = clause.chars();
    letters
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::{lost, unit};

    #[test]
    fn milliseconds_as_seconds_are_named() {
        assert!(unit(1e-3).is_none());
        assert!(unit(1.0).unwrap().text.contains("t[ms]"));
        assert!(unit(1000.0).unwrap().text.contains("t[us]"));
        assert!(unit(1e-7).unwrap().text.contains("t[s]"));
    }

    #[test]
    fn a_missing_sample_in_ten_thousand_is_no_matter_and_a_gap_is() {
        let mut intervals = vec![1e-3; 10_000];
        assert!(lost(&intervals, 1e-3, 0.0).is_none());
        intervals[5] = 2e-3;
        assert!(lost(&intervals, 1e-3, 0.0).is_none());
        intervals[5] = 8e-3;
        let text = lost(&intervals, 1e-3, 0.0).unwrap().text;
        assert!(
            text.starts_with("7 samples") && text.contains("8.00 ms"),
            "{text}"
        );
    }
}
