//! Figures of merit of a run.

use serde::Serialize;

use super::{Aim, Sample};

/// Tracking error of a sample: of the position, or of the velocity where that is asked for.
pub(crate) fn error(sample: &Sample) -> f64 {
    match sample.aim {
        Aim::Position { q, .. } => q - sample.truth.q,
        Aim::Velocity { v, .. } => v - sample.truth.v,
    }
}

/// RMS tracking error.
pub fn rms(samples: &[Sample]) -> f64 {
    let sum: f64 = samples.iter().map(|s| error(s).powi(2)).sum();
    (sum / samples.len() as f64).sqrt()
}

/// Largest tracking error.
pub fn peak(samples: &[Sample]) -> f64 {
    samples.iter().map(|s| error(s).abs()).fold(0.0, f64::max)
}

/// The answer to a step of the set point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Step {
    /// From 10 to 90 % of the step, s.
    pub rise: f64,
    /// Until the error stays within 2 % of the step, s.
    pub settling: f64,
    /// Beyond the set point, as a share of the step.
    pub overshoot: f64,
}

/// Share of a step within which it has settled.
const SETTLED: f64 = 0.02;

/// The answer to a step of position that begins with these samples; times that are not reached are the whole.
pub fn step(samples: &[Sample], period: f64) -> Step {
    let size = samples.first().map_or(0.0, error);
    let done = |s: &Sample| 1.0 - error(s) / size;
    let whole = samples.len();
    let reaches = |share: f64| {
        samples
            .iter()
            .position(|s| done(s) >= share)
            .unwrap_or(whole)
    };
    let outside = samples
        .iter()
        .rposition(|s| (1.0 - done(s)).abs() > SETTLED);
    let most = samples.iter().map(done).fold(0.0, f64::max);
    Step {
        rise: (reaches(0.9) - reaches(0.1)) as f64 * period,
        settling: outside.map_or(0, |k| k + 1) as f64 * period,
        overshoot: (most - 1.0).max(0.0),
    }
}

/// Error in counts at the end of a standstill, by the encoder, and by how many counts the axis still moved over it: more
/// than one is hunting.
pub fn settled(samples: &[Sample], count: f64) -> (f64, f64) {
    let Some(last) = samples.last() else {
        return (0.0, 0.0);
    };
    let Aim::Position { q, .. } = last.aim else {
        return (0.0, 0.0);
    };
    let off = |s: &Sample| (f64::from(s.counts) - (q / count).floor()).abs();
    let travel = samples
        .windows(2)
        .map(|w| (w[1].truth.q - w[0].truth.q).abs());
    let worst = samples.iter().map(off).fold(0.0, f64::max);
    (worst, travel.sum::<f64>() / count)
}

#[cfg(test)]
mod tests {
    use super::{peak, rms, settled, step};
    use crate::servo::{Act, Aim, Sample};
    use crate::step::State;

    fn sample(aim: f64, q: f64) -> Sample {
        let act = Act {
            command: 0.0,
            coulomb: 0.0,
        };
        Sample {
            aim: Aim::Position {
                q: aim,
                v: 0.0,
                a: 0.0,
            },
            truth: State { q, v: 0.0 },
            counts: (q / 0.1).floor() as i32,
            act,
        }
    }

    #[test]
    fn errors_are_those_of_their_definition() {
        let samples = [sample(1.0, 0.0), sample(1.0, 1.5), sample(1.0, 1.0)];
        assert!((rms(&samples) - (1.25_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert_eq!(peak(&samples), 1.0);
    }

    #[test]
    fn a_first_order_answer_has_its_known_times() {
        // 1 − e^(−t/τ): 10 to 90 % takes τ·ln 9, 2 % is reached after τ·ln 50.
        let samples: Vec<_> = (0..1000)
            .map(|k| sample(2.0, 2.0 * (1.0 - (-f64::from(k) * 0.01).exp())))
            .collect();
        let found = step(&samples, 0.001);
        assert!((found.rise - 0.1 * 9f64.ln()).abs() < 0.002, "{found:?}");
        assert!((found.settling - 0.1 * 50f64.ln()).abs() < 0.002);
        assert!(found.overshoot < 1e-12);
    }

    #[test]
    fn standstill_counts_what_is_off_and_what_moves() {
        let still = [sample(1.0, 0.87); 5];
        assert_eq!(settled(&still, 0.1), (2.0, 0.0));
        let hunting = [sample(1.0, 0.95), sample(1.0, 1.15), sample(1.0, 0.95)];
        let (_, travel) = settled(&hunting, 0.1);
        assert!((travel - 4.0).abs() < 1e-9);
    }
}
