//! Time stamps: their unit, lost samples, jitter.

use std::ops::RangeInclusive;

use super::stamps::{BETTER, Intervals, roughness};
use super::{Warning, rms};
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

pub(super) fn check(recording: &Recording, track: &Track) -> Vec<Warning> {
    let stamps = recording.stamps.as_ref().unwrap_or(&recording.t);
    let intervals = Intervals::of(stamps);
    let mut warnings = Vec::new();
    warnings.extend(unit(intervals.median));
    warnings.extend(lost(&intervals));
    warnings.extend(if recording.stamps.is_some() {
        Some(put_right(&intervals))
    } else {
        uneven(recording, track, &intervals)
    });
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

fn lost(intervals: &Intervals) -> Option<Warning> {
    let Intervals { all, median, .. } = intervals;
    let long = all.iter().filter(|dt| **dt > intervals.long());
    let long = long.map(|dt| dt / median);
    let lost: f64 = long.clone().map(|r| r.round() - 1.0).sum();
    let longest = long.clone().fold(0.0, f64::max);
    let share = lost / (lost + all.len() as f64);
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
fn uneven(recording: &Recording, track: &Track, intervals: &Intervals) -> Option<Warning> {
    let jitter = intervals.jitter;
    let slip = jitter * intervals.median * rms(track.v.iter().copied());
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
            "{}; the likely cause: {cause}. {}.",
            scatter(intervals),
            capitalised(next)
        ),
    ))
}

/// What there is to know of stamps that even time was taken for.
fn put_right(intervals: &Intervals) -> Warning {
    Warning::weak(
        "timing-jitter",
        format!(
            "{}, but the motion is smoother over even time than over the stamps: the samples were even and the stamps are not, as when the host stamps them instead of the drive. Even time was taken in their place; let the drive stamp the samples.",
            scatter(intervals)
        ),
    )
}

fn scatter(intervals: &Intervals) -> String {
    format!(
        "The sampling interval of {} scatters by {} (RMS; at most {})",
        quantity(1e3 * intervals.median, "ms"),
        percent(intervals.jitter, None),
        whole_percent(intervals.largest),
    )
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
    use crate::check::stamps::Intervals;

    #[test]
    fn milliseconds_as_seconds_are_named() {
        assert!(unit(1e-3).is_none());
        assert!(unit(1.0).unwrap().text.contains("t[ms]"));
        assert!(unit(1000.0).unwrap().text.contains("t[us]"));
        assert!(unit(1e-7).unwrap().text.contains("t[s]"));
    }

    #[test]
    fn a_missing_sample_in_ten_thousand_is_no_matter_and_a_gap_is() {
        let paused = |pause: f64| {
            let late = |k| if k > 5 { pause } else { 0.0 };
            let t: Vec<f64> = (0..10_000).map(|k| 1e-3 * f64::from(k) + late(k)).collect();
            lost(&Intervals::of(&t))
        };
        assert!(paused(0.0).is_none());
        assert!(paused(1e-3).is_none());
        let text = paused(7e-3).unwrap().text;
        assert!(
            text.starts_with("7 samples") && text.contains("8.00 ms"),
            "{text}"
        );
    }
}
