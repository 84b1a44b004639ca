//! Signals that stop at a level.

use super::{Warning, quantile, rms};
use crate::format::{quantity, whole_percent};
use crate::model::{Causality, Model};
use crate::recording::Recording;

/// Share of the samples at an extreme value from which on it shapes the recording.
const SHARE: f64 = 0.005;
/// Separate visits to the extreme value: a single one is a level that was asked for.
const VISITS: usize = 3;
/// Samples at the extreme over samples in the hundredth of the range next to it. A sine spends 2.4 times as long in its
/// last step as in the one before; a signal cut off, far longer.
const PILED_UP: f64 = 5.0;
/// A signal of fewer levels is a sequence of steps, which has to end at its extremes.
const LEVELS: usize = 50;

pub(super) fn check(recording: &Recording, model: &Model) -> Vec<Warning> {
    let mut warnings = Vec::new();
    warnings.extend(input(recording, model));
    if model.causality == Causality::Forward {
        warnings.extend(end_stop(recording));
    }
    warnings
}

/// What a signal does at one of its extremes.
struct Extreme {
    value: f64,
    samples: Vec<usize>,
}

impl Extreme {
    fn share(&self, of: usize) -> f64 {
        self.samples.len() as f64 / of as f64
    }
}

/// The extremes that a signal is cut off at: highest, lowest.
fn cut_off(x: &[f64]) -> Vec<Extreme> {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    if sorted.len() < LEVELS {
        return Vec::new();
    }
    let (low, high) = (sorted[0], sorted[sorted.len() - 1]);
    let quantum = sorted
        .windows(2)
        .map(|w| w[1] - w[0])
        .fold(f64::INFINITY, f64::min);
    let near = (0.01 * (high - low)).max(1.5 * quantum);
    [high, low]
        .into_iter()
        .filter_map(|value| {
            let at: Vec<usize> = (0..x.len()).filter(|&k| x[k] == value).collect();
            let close = x.iter().filter(|x| (*x - value).abs() <= near).count() - at.len();
            let visits = at
                .iter()
                .enumerate()
                // A visit of one sample is a peak.
                .filter(|&(j, &k)| (j == 0 || at[j - 1] + 1 < k) && at.get(j + 1) == Some(&(k + 1)))
                .count();
            let piled_up = at.len() as f64 > PILED_UP * close as f64;
            let extreme = Extreme { value, samples: at };
            (visits >= VISITS && piled_up && extreme.share(x.len()) >= SHARE).then_some(extreme)
        })
        .collect()
}

fn input(recording: &Recording, model: &Model) -> Option<Warning> {
    let cut = cut_off(&recording.u);
    let share: f64 = cut.iter().map(|e| e.share(recording.len())).sum();
    let unit = match (model.input.as_str(), model.motion) {
        ("voltage", _) => "V",
        ("current", _) => "A",
        (_, crate::motion::Motion::Linear) => "N",
        _ => "N*m",
    };
    let levels: Vec<String> = cut.iter().map(|e| quantity(e.value, unit)).collect();
    (!cut.is_empty()).then(|| {
        Warning::weak(
            "input-saturated",
            format!(
                "u stays exactly at its extreme value ({}) for {} of the samples: a limit of the drive, or of what measures u. If u is measured, its peaks are cut off and the fit errs; lower the amplitude until they are not.",
                levels.join(" and "),
                whole_percent(share)
            ),
        )
    })
}

/// Positions that pile up at an extreme while the drive pushes beyond it harder than it mostly does.
fn end_stop(recording: &Recording) -> Option<Warning> {
    let q = recording.q.as_ref()?;
    let middle = quantile(q.clone(), 0.5);
    let usual = rms(recording.u.iter().copied());
    let stop = cut_off(q).into_iter().find(|extreme| {
        let outward = (extreme.value - middle).signum();
        let pushes = extreme.samples.iter().map(|&k| outward * recording.u[k]);
        pushes.sum::<f64>() / extreme.samples.len() as f64 > usual
    })?;
    Some(Warning::suspect(
        "end-stop",
        format!(
            "q stays exactly at {} for {} of the samples while u pushes further: the axis stands against an end stop, or the sensor is at the end of its range. Stay clear of it, or cut these parts out.",
            crate::format::significant(stop.value, 4),
            whole_percent(stop.share(q.len()))
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::cut_off;

    fn sine(n: usize) -> impl Iterator<Item = f64> {
        (0..n).map(|k| (k as f64 * 0.01).sin())
    }

    #[test]
    fn a_clipped_sine_is_cut_off_and_a_quantised_one_is_not() {
        assert!(cut_off(&sine(10_000).collect::<Vec<_>>()).is_empty());
        let quantised: Vec<f64> = sine(10_000).map(|x| (x * 100.0).round() / 100.0).collect();
        assert!(cut_off(&quantised).is_empty());
        let clipped: Vec<f64> = sine(10_000).map(|x| x.min(0.8)).collect();
        let cut = cut_off(&clipped);
        // Above 0.8 a sine spends acos(0.8)/π = 20.5 % of its time.
        assert!(cut.len() == 1 && (cut[0].share(10_000) - 0.205).abs() < 0.01);
    }

    #[test]
    fn steps_between_levels_are_not_cut_off() {
        let square: Vec<f64> = sine(10_000).map(f64::signum).collect();
        assert!(cut_off(&square).is_empty());
    }
}
