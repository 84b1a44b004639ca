//! What a predictor works through: the training part of a recording, reading by reading.

use nalgebra::{Matrix3, RowVector3, Vector3};

use crate::axis::Axis;
use crate::fit;
use crate::recording::Recording;
use crate::simulate::State;
use crate::step::Memory;
use crate::weak::Track;

/// A pause between samples longer than this many intervals is a gap that nothing is predicted across.
const GAP: f64 = 5.0;

/// Noise of a reading that counts as none, over the RMS speed.
const SMALLEST: f64 = 1e-12;

/// The training part of one recording.
pub struct Sequence<'a> {
    pub recording: &'a Recording,
    track: &'a Track,
    /// What was measured, sample by sample.
    pub readings: &'a [f64],
    /// What a reading sees of `(q, v, z)`.
    pub sees: RowVector3<f64>,
    /// Variance of each reading's noise over that of a single one.
    pub repeats: Vec<f64>,
    /// Whether prediction starts anew at a sample.
    pub restarts: Vec<bool>,
    /// Standard deviation of the noise of a single reading, in its own unit.
    pub noise: f64,
    /// Usual interval between samples, s.
    pub period: f64,
    /// RMS of the smoothed velocity.
    pub speed: f64,
}

impl<'a> Sequence<'a> {
    /// The training part of a recording, restarted every `horizon` seconds and after gaps.
    pub fn new(recording: &'a Recording, track: &'a Track, horizon: f64) -> Self {
        let count = (track.training_share() * recording.len() as f64) as usize;
        let positions = recording.q.is_some();
        let readings = &recording.measured()[..count];
        let power = track.v.iter().map(|v| v * v).sum::<f64>() / track.v.len() as f64;
        Self {
            recording,
            track,
            readings,
            sees: if positions {
                RowVector3::new(1.0, 0.0, 0.0)
            } else {
                RowVector3::new(0.0, 1.0, 0.0)
            },
            repeats: repeats(readings),
            restarts: restarts(&recording.t[..count], GAP * track.period, horizon),
            noise: track.sensor_noise().max(SMALLEST * power.sqrt()),
            period: track.period,
            speed: power.sqrt(),
        }
    }

    /// The measured state at a sample, and the covariance of its error over the variance of a single reading.
    pub fn begin(&self, sample: usize, axis: &Axis) -> (State, Matrix3<f64>) {
        let state = fit::measured_state(self.recording, self.track, sample);
        let variance = (self.noise * self.noise).max(f64::MIN_POSITIVE);
        // Unless it slides steadily nobody knows how far the bristles are bent.
        let bent = axis
            .contact
            .bristles()
            .map_or(0.0, |law| law.level(0.0) / law.stiffness());
        let spread = Vector3::new(
            self.track.position_noise.powi(2) * self.repeats[sample],
            self.track.velocity_noise.powi(2),
            if state.v == 0.0 {
                bent * bent
            } else {
                0.01 * bent * bent
            },
        );
        (state, Matrix3::from_diagonal(&(spread / variance)))
    }

    /// What a mechanism remembers when an encoder sees it so.
    pub fn at_ease(axis: &Axis, state: State) -> Vector3<f64> {
        vector(&Memory::at_ease(axis, state))
    }
}

/// State of an axis as a vector.
pub fn vector(memory: &Memory<2>) -> Vector3<f64> {
    Vector3::new(memory.x[0], memory.x[1], memory.z)
}

/// How often each reading occurs in a row.
///
/// An encoder that shows the same count for n samples has said one thing, not n: the errors of those samples are the
/// same error. Each is given n times the variance, so that together they weigh as much as one. Readings with noise of
/// their own never repeat.
fn repeats(readings: &[f64]) -> Vec<f64> {
    readings
        .chunk_by(|a, b| a == b)
        .flat_map(|run| std::iter::repeat_n(run.len() as f64, run.len()))
        .collect()
}

fn restarts(t: &[f64], gap: f64, horizon: f64) -> Vec<bool> {
    let mut next = f64::NEG_INFINITY;
    (0..t.len())
        .map(|k| {
            let again = t[k] >= next - 1e-9 || (k > 0 && t[k] - t[k - 1] > gap);
            if again {
                next = t[k] + horizon;
            }
            again
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{repeats, restarts};

    #[test]
    fn readings_that_repeat_weigh_as_one() {
        let weights = repeats(&[1.0, 1.0, 1.0, 2.0, 1.5, 1.5]);
        assert_eq!(weights, [3.0, 3.0, 3.0, 1.0, 2.0, 2.0]);
        assert!((weights.iter().map(|w| 1.0 / w).sum::<f64>() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn prediction_starts_anew_after_gaps_and_horizons() {
        let t = [0.0, 0.1, 0.2, 0.3, 1.3, 1.4];
        let starts = restarts(&t, 0.5, 0.2);
        assert_eq!(starts, [true, false, true, false, true, false]);
        assert_eq!(
            restarts(&t, 0.5, f64::INFINITY),
            [true, false, false, false, true, false]
        );
    }
}
