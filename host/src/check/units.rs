//! Units and signs that the columns themselves betray.

use std::f64::consts::{PI, TAU};

use super::{Warning, rms};
use crate::format::{quantity, significant};
use crate::model::Model;
use crate::motion::Motion;
use crate::recording::Recording;
use crate::weak::Track;

/// Fastest that an axis is believed to move: 95,000 turns a minute, and twice the fastest linear motors.
const FASTEST: (f64, f64) = (1e4, 20.0);
/// Position and velocity that are one motion differ by noise and by filters of a few samples only.
const SAME: f64 = 0.9;
/// A ratio within this share of one is a matter of calibration.
const CALIBRATION: f64 = 0.1;
/// A ratio this close to a factor between units is that factor.
const MATCH: f64 = 0.05;

pub(super) fn check(recording: &Recording, track: &Track, model: &Model) -> Vec<Warning> {
    let mut warnings = Vec::new();
    warnings.extend(input(recording, model));
    if let Some(q) = &recording.q {
        warnings.extend(counts(q));
        warnings.extend(wrapped(q, model.motion));
        if let Some(v) = &recording.v {
            warnings.extend(velocity(&recording.t, q, v));
        }
    }
    if warnings.is_empty() {
        warnings.extend(speed(track, model));
    }
    warnings
}

/// The unit of `u` in the header against what the model file says that `u` is.
fn input(recording: &Recording, model: &Model) -> Option<Warning> {
    let unit = recording.input_unit.as_deref()?;
    let plain: String = unit.chars().filter(|c| c.is_alphabetic()).collect();
    let measured = match plain.as_str() {
        "Nm" | "mNm" | "kNm" | "Ncm" => "torque",
        "N" | "mN" | "kN" => "force",
        "V" | "mV" => "voltage",
        "A" | "mA" => "current",
        _ => return None,
    };
    (measured != model.input).then(|| {
        Warning::suspect(
            "input-unit",
            format!(
                "The header gives u in {unit}, a {measured}, and the model file says plant.input = \"{}\": correct whichever is wrong, and plant.gain with it.",
                model.input
            ),
        )
    })
}

/// Whole numbers that go up and down by one are counts.
fn counts(q: &[f64]) -> Option<Warning> {
    let (low, high) = range(q);
    let single = q.windows(2).any(|w| (w[1] - w[0]).abs() == 1.0);
    let whole = q.iter().all(|q| q.fract() == 0.0);
    (whole && single && high - low >= 20.0).then(|| {
        Warning::suspect(
            "position-counts",
            format!(
                "All positions are whole numbers, from {low} to {high}: they are probably encoder counts. Convert them to rad or m, or give them a unit in the header."
            ),
        )
    })
}

/// A step across nearly the whole range between small ones is an encoder that starts again.
fn wrapped(q: &[f64], motion: Motion) -> Option<Warning> {
    let (low, high) = range(q);
    let whole = high - low;
    let steps: Vec<f64> = q.windows(2).map(|w| w[1] - w[0]).collect();
    let wraps: Vec<f64> = steps
        .windows(3)
        .filter(|s| s[1].abs() > 0.8 * whole && s[0].abs().max(s[2].abs()) < 0.2 * whole)
        .map(|s| (s[1] - 0.5 * (s[0] + s[2])).abs())
        .collect();
    let period = wraps.iter().sum::<f64>() / wraps.len().max(1) as f64;
    let units = [
        (TAU, "one turn in rad"),
        (PI, "half a turn in rad"),
        (360.0, "one turn in degrees"),
        (180.0, "half a turn in degrees"),
        (1.0, "one turn in turns"),
    ];
    let named = units
        .iter()
        .find(|(p, _)| motion == Motion::Rotary && (period / p - 1.0).abs() < MATCH)
        .map_or(String::new(), |(_, name)| format!(", {name}"));
    (!wraps.is_empty()).then(|| {
        Warning::suspect(
            "position-wraps",
            format!(
                "q jumps by {}{named}, {} times from one sample to the next: the encoder starts again there. Unwrap the position before it is logged, or add the period at each jump.",
                significant(period, 3),
                wraps.len()
            ),
        )
    })
}

/// What turns the rate of change of `q` into `v`, and what that betrays.
const RATIOS: [(f64, &str); 9] = [
    (TAU, "q is in turns, or v in rad/s and q not in rad"),
    (1.0 / TAU, "v is in turns/s"),
    (60.0 / TAU, "v is in rpm"),
    (TAU / 60.0, "v is in rad/s and its header says rpm"),
    (180.0 / PI, "v is in deg/s and q in rad"),
    (PI / 180.0, "q is in degrees and v in rad/s"),
    (360.0, "v is in deg/s and q in turns"),
    (60.0, "v is per minute and q not"),
    (1.0 / 60.0, "v is per second and its header says per minute"),
];

/// Recorded velocity against the rate of change of the recorded position.
fn velocity(t: &[f64], q: &[f64], v: &[f64]) -> Option<Warning> {
    if v.iter().all(|x| *x == v[0]) {
        return Some(Warning::weak(
            "stuck-channel",
            format!(
                "v is {} throughout while q moves: the channel is not connected. The fit uses q, so nothing is lost.",
                v[0]
            ),
        ));
    }
    // Changes over blocks of samples: noise of either column averages out, and short delays between them do not matter.
    let block = (t.len() / 200).clamp(2, 50);
    let (mut qq, mut qv, mut vv) = (0.0, 0.0, 0.0);
    for from in (0..t.len() - block).step_by(block) {
        let change = q[from + block] - q[from];
        let integral: f64 = (from..from + block)
            .map(|k| 0.5 * (v[k] + v[k + 1]) * (t[k + 1] - t[k]))
            .sum();
        qq += change * change;
        qv += change * integral;
        vv += integral * integral;
    }
    let correlation = qv / (qq * vv).sqrt().max(f64::MIN_POSITIVE);
    if correlation.abs() < SAME {
        return None;
    }
    let ratio = (vv / qq).sqrt();
    let near = |factor: f64| (ratio / factor - 1.0).abs() < MATCH;
    let power = 10f64.powf(ratio.log10().round());
    let cause = if (ratio - 1.0).abs() < CALIBRATION {
        String::new()
    } else if let Some((_, name)) = RATIOS.iter().find(|(factor, _)| near(*factor)) {
        format!(", as if {name}")
    } else if near(power) {
        ", a power of ten: one of the units has another prefix than its header says".to_owned()
    } else {
        ": perhaps they stand on either side of a gear".to_owned()
    };
    let opposite = correlation < 0.0;
    if cause.is_empty() && !opposite {
        return None;
    }
    let sign = match (opposite, cause.is_empty()) {
        (true, true) => "v has the opposite sign of the rate of change of q".to_owned(),
        (true, false) => format!(
            "v is −{} times the rate of change of q{cause}",
            significant(ratio, 3)
        ),
        _ => format!(
            "v is {} times the rate of change of q{cause}",
            significant(ratio, 3)
        ),
    };
    Some(Warning::suspect(
        "velocity-unit",
        format!(
            "The column {sign}. The fit uses q alone; make sure that it is the one in rad or m and counts in the direction of u."
        ),
    ))
}

/// Speeds that no axis reaches.
fn speed(track: &Track, model: &Model) -> Option<Warning> {
    let survey = track.survey(model.motion, 0.0);
    let (fastest, unit, likely) = match model.motion {
        Motion::Rotary => (FASTEST.0, "rad/s", "degrees or encoder counts"),
        Motion::Linear => (FASTEST.1, "m/s", "mm or encoder counts"),
    };
    (survey.top_speed > fastest).then(|| {
        Warning::suspect(
            "position-unit",
            format!(
                "The axis would move at {} (RMS {}), faster than any: the position is probably in {likely}. Give its unit in the header, as in {}.",
                quantity(survey.top_speed, unit),
                significant(rms(track.v.iter().copied()), 3),
                if model.motion == Motion::Rotary { "q[deg]" } else { "q[mm]" }
            ),
        )
    })
}

fn range(x: &[f64]) -> (f64, f64) {
    x.iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
            (low.min(x), high.max(x))
        })
}

#[cfg(test)]
mod tests {
    use super::{counts, velocity, wrapped};
    use crate::motion::Motion;

    fn motion() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let t: Vec<f64> = (0..5000).map(|k| f64::from(k) * 1e-3).collect();
        let q = t.iter().map(|t| (3.0 * t).sin() + 4.0 * t).collect();
        let v = t.iter().map(|t| 3.0 * (3.0 * t).cos() + 4.0).collect();
        (t, q, v)
    }

    #[test]
    fn velocities_in_other_units_are_named() {
        let (t, q, v) = motion();
        let with = |factor: f64| {
            let v: Vec<f64> = v.iter().map(|v| factor * v).collect();
            velocity(&t, &q, &v).map(|w| w.text)
        };
        assert_eq!(with(1.0), None);
        assert_eq!(with(1.05), None);
        for (factor, word) in [
            (60.0 / std::f64::consts::TAU, "rpm"),
            (180.0 / std::f64::consts::PI, "deg/s"),
            (1000.0, "power of ten"),
            (-1.0, "opposite sign"),
            (3.7, "gear"),
        ] {
            let text = with(factor).unwrap_or_default();
            assert!(text.contains(word), "{factor}: {text}");
        }
        assert!(with(0.0).unwrap().contains("throughout"));
    }

    #[test]
    fn a_wrapping_encoder_and_counts_are_seen() {
        let (_, q, _) = motion();
        assert!(wrapped(&q, Motion::Rotary).is_none() && counts(&q).is_none());
        let turns: Vec<f64> = q
            .iter()
            .map(|q| q.rem_euclid(std::f64::consts::TAU))
            .collect();
        let text = wrapped(&turns, Motion::Rotary).unwrap().text;
        assert!(text.contains("one turn in rad, 3 times"), "{text}");
        let counted: Vec<f64> = q.iter().map(|q| (q * 652.0).floor()).collect();
        assert!(counts(&counted).is_some());
    }
}
