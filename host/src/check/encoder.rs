//! Positions that say too little: coarse counts, samples that repeat, values that freeze or jump.

use super::{Warning, quantile, rms};
use crate::effects::Quantity;
use crate::format::{percent, quantity, significant, whole_percent};
use crate::model::Model;
use crate::recording::Recording;
use crate::weak::Track;

/// Velocity noise over RMS speed that the widest filter may leave: the smallest effects that are looked for are 3 % of
/// the drive, and their regressors are functions of this velocity.
const NOISY: f64 = 0.03;
/// An encoder that moves by this many counts between samples cannot read the same twice.
const CERTAIN_STEPS: f64 = 3.0;
/// Share of repeated samples, of those that cannot repeat, beyond reversals that the filter smooths over.
const REPEATS: f64 = 0.1;
/// A frozen reading lasts this many samples at least, and catches up by this many times the usual step.
const FROZEN: usize = 10;
/// A jump is a step that differs from the one before and the one after by this many times what all but one of fifty that differ
/// differ by: blows change the speed, and noise and counts stay within four times as much on real axes.
const JUMP: f64 = 10.0;
/// Id of the warning that readings of the position jump.
pub(super) const JUMPS: &str = "position-jumps";

pub(super) fn check(recording: &Recording, track: &Track, model: &Model) -> Vec<Warning> {
    let mut warnings = Vec::new();
    warnings.extend(coarse(recording, track, model));
    if let Some(q) = &recording.q {
        let unit = model.unit(Quantity::Position);
        warnings.extend(repeated(recording, q, track));
        warnings.extend(frozen(&recording.t, q).or_else(|| jumps(&recording.t, q, unit)));
    }
    warnings
}

fn coarse(recording: &Recording, track: &Track, model: &Model) -> Option<Warning> {
    let speed = rms(track.v.iter().copied());
    let noise = track.velocity_noise / speed;
    if noise <= NOISY {
        return None;
    }
    let (name, unit) = if recording.q.is_some() {
        ("position", model.unit(Quantity::Position))
    } else {
        ("velocity", model.unit(Quantity::Speed))
    };
    let step = track.quantum;
    let cause = if step > 0.0 {
        let counts = speed * track.period / step;
        let moved = if recording.q.is_some() {
            format!(
                ", and at its RMS speed the axis passes {} of them between two samples",
                significant(counts, 2)
            )
        } else {
            String::new()
        };
        format!(
            "the {name} comes in steps of {}{moved}",
            quantity(step, unit)
        )
    } else {
        format!("the measured {name} is noisy")
    };
    Some(Warning::weak(
        "coarse-encoder",
        format!(
            "The velocity is uncertain by {} of its RMS even after smoothing: {cause}. Move faster or farther, log all counts of the encoder, or use a finer one.",
            percent(noise, None)
        ),
    ))
}

/// The smoothed velocity at an instant.
fn velocity(track: &Track, t: f64) -> f64 {
    let node = (t - track.start) / track.period;
    track.v[(node.round().max(0.0) as usize).min(track.v.len() - 1)]
}

fn repeated(recording: &Recording, q: &[f64], track: &Track) -> Option<Warning> {
    let least = CERTAIN_STEPS * track.quantum;
    let slow = 0.2 * rms(track.v.iter().copied());
    let t = &recording.t;
    let moving = (1..q.len()).filter(|&k| {
        let v = velocity(track, t[k]).abs();
        v > slow && v * (t[k] - t[k - 1]) > least
    });
    let (repeats, all) = moving.fold((0_usize, 0_usize), |(repeats, all), k| {
        (repeats + usize::from(q[k] == q[k - 1]), all + 1)
    });
    let share = repeats as f64 / all.max(1) as f64;
    (share > REPEATS).then(|| {
        Warning::suspect(
            "repeated-samples",
            format!(
                "{} of the positions repeat the one before although the axis moves on: the log is faster than the sensor or the bus, each value stands for about {} rows. Log at the rate of the sensor, as repeated values shift the position in time.",
                whole_percent(share),
                significant(1.0 / (1.0 - share).max(0.01), 2)
            ),
        )
    })
}

/// A reading that stays and then catches up with the motion in a single step.
fn frozen(t: &[f64], q: &[f64]) -> Option<Warning> {
    let steps: Vec<f64> = q.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let usual = quantile(steps.clone(), 0.98);
    let mut still = 0;
    let mut found = Vec::new();
    for (k, &step) in steps.iter().enumerate() {
        if step == 0.0 {
            still += 1;
            continue;
        }
        // A gap in time explains a large step by itself.
        let usual_interval = (t[k + 1] - t[k]) < 1.5 * (t[k.max(1)] - t[k.max(1) - 1]);
        if still >= FROZEN && step > FROZEN as f64 * usual && usual_interval {
            found.push((t[k - still], t[k]));
        }
        still = 0;
    }
    let (from, to) = *found.first()?;
    Some(Warning::suspect(
        "frozen-position",
        format!(
            "q stands still {} times and then catches up within one sample, first from {} to {}: the sensor or its link stalls. Cut these parts out.",
            found.len(),
            significant(from, 5),
            quantity(to, "s")
        ),
    ))
}

/// A reading that is off the motion from one sample to the next, for a sample or for good.
fn jumps(t: &[f64], q: &[f64], unit: &str) -> Option<Warning> {
    let steps: Vec<f64> = q.windows(2).map(|w| w[1] - w[0]).collect();
    let changes = steps.windows(2).map(|w| (w[1] - w[0]).abs());
    // At rest and at an even speed there are none but of rounding.
    let rounding = steps
        .iter()
        .fold(0.0, |most: f64, step| most.max(step.abs()))
        * 1e-9;
    let changes: Vec<f64> = changes.filter(|change| *change > rounding).collect();
    if changes.is_empty() {
        return None;
    }
    let least = JUMP * quantile(changes, 0.98);
    // A gap in time explains a large step by itself: the three intervals are no longer than with half of one more.
    let usual = quantile(t.windows(2).map(|w| w[1] - w[0]).collect(), 0.5);
    let even = |k: usize| t[k + 2] - t[k - 1] < 3.5 * usual;
    let beyond = |k: usize| {
        let (before, after) = (steps[k] - steps[k - 1], steps[k] - steps[k + 1]);
        if before * after > 0.0 {
            before.abs().min(after.abs())
        } else {
            0.0
        }
    };
    let jumps: Vec<usize> = (1..steps.len().max(1) - 1)
        .filter(|&k| beyond(k) > least && even(k))
        .collect();
    let first = *jumps.first()?;
    Some(Warning::suspect(
        JUMPS,
        format!(
            "q jumps {} times by more than any motion, first by {} within one sample at {}: an encoder that loses counts, an index that sets them anew, or a bad word on the link. Cut these parts out, or mend cable and counter and record again.",
            jumps.len(),
            quantity(
                steps[first] - 0.5 * (steps[first - 1] + steps[first + 1]),
                unit
            ),
            quantity(t[first + 1], "s")
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::{frozen, jumps};

    #[test]
    fn lost_counts_are_seen_and_blows_are_not() {
        let t: Vec<f64> = (0..5000).map(|k| f64::from(k) * 1e-3).collect();
        let counts = |t: f64| (1000.0 * (2.0 * t).sin()).round() * 1e-3;
        let mut q: Vec<f64> = t.iter().map(|t| counts(*t)).collect();
        assert!(jumps(&t, &q, "rad").is_none());
        q[3000..].iter_mut().for_each(|q| *q -= 0.042);
        let text = jumps(&t, &q, "rad").unwrap().text;
        assert!(
            text.contains("1 times") && text.contains("at 3.00 s"),
            "{text}"
        );
        // A stop that the axis bounces off every second.
        let bounces: Vec<f64> = t.iter().map(|t| (t % 1.0 - 0.5).abs()).collect();
        assert!(jumps(&t, &bounces, "rad").is_none());
        // An axis that hardly ever moves.
        let hops: Vec<f64> = (0..5000).map(|k| f64::from(k / 1000)).collect();
        let smooth = |k: usize| hops[k.saturating_sub(40)..=k].iter().sum::<f64>() / 41.0;
        let hops: Vec<f64> = (0..5000).map(smooth).collect();
        assert!(jumps(&t, &hops, "rad").is_none());
    }

    #[test]
    fn a_stalled_link_is_seen() {
        let t: Vec<f64> = (0..5000).map(|k| f64::from(k) * 1e-3).collect();
        let mut q: Vec<f64> = t.iter().map(|t| (2.0 * t).sin()).collect();
        assert!(frozen(&t, &q).is_none());
        let held = q[1500];
        q[1500..1700].fill(held);
        assert!(frozen(&t, &q).unwrap().text.contains("1 times"));
    }
}
