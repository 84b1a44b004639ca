//! How much encoder noise biases a linear form: simulation and extrapolation.
//!
//! Noise of the encoder's size is added to the recordings once more and everything is done again. To first order in the
//! variance of the noise, an estimate moves by as much as the noise that is in the recordings has moved it already
//! (J. R. Cook and L. A. Stefanski, J. Am. Stat. Assoc. 89, 1994).

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::{Form, solve};
use crate::identify::Workbench;
use crate::model::Model;
use crate::problem::{Problem, Response};
use crate::recording::Recording;
use crate::system;
use crate::weak::{Balance, Track};

/// Sets of noise that are added; their scatter tells how well the shift is known.
const DRAWS: u64 = 4;

/// Tracks of the recordings, and of the recordings with more noise.
pub struct NoiseDraws {
    clean: Vec<Track>,
    noisy: Vec<Vec<Track>>,
}

/// How much one parameter moves when the variance of encoder noise doubles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shift {
    /// Mean over the draws.
    pub mean: f64,
    /// Standard error of the mean.
    pub se: f64,
}

impl NoiseDraws {
    /// Prepares the tracks as those of a workbench with this balance were.
    pub fn new(recordings: &[Recording], model: &Model, balance: Option<Balance>) -> Self {
        let clean = Problem::tracks(recordings, model.motion, balance);
        let noisy = (0..DRAWS).map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let recordings = recordings.iter().zip(&clean);
            let noisier: Vec<Recording> =
                recordings.map(|(r, t)| noisier(r, t, &mut rng)).collect();
            Problem::tracks(&noisier, model.motion, balance)
        });
        Self {
            noisy: noisy.collect(),
            clean,
        }
    }

    /// The shift of every physical parameter of a form under the windows of a workbench; `None` where a draw leaves the
    /// products undetermined.
    pub fn shifts(&self, form: &dyn Form, bench: &Workbench, model: &Model) -> Option<Vec<Shift>> {
        let reaches: Vec<usize> = bench.problem.windows.iter().map(|w| w.reach).collect();
        let estimate = |tracks: &[Track]| {
            let problem = Problem::new(
                tracks.to_vec(),
                &reaches,
                model.motion,
                Response::Acceleration,
            );
            solve(form, &problem, &system::blocks(&problem), model).map(|s| s.physical)
        };
        let clean = estimate(&self.clean)?;
        let noisy: Vec<Vec<f64>> = self
            .noisy
            .iter()
            .map(|t| estimate(t))
            .collect::<Option<_>>()?;
        let count = noisy.len() as f64;
        let shift = |(k, clean): (usize, &f64)| {
            let moved: Vec<f64> = noisy.iter().map(|p| p[k] - clean).collect();
            let mean = moved.iter().sum::<f64>() / count;
            let variance = moved.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0);
            Shift {
                mean,
                se: (variance / count).sqrt(),
            }
        };
        Some(clean.iter().enumerate().map(shift).collect())
    }
}

/// The recording with as much white noise again as its encoder has.
fn noisier(recording: &Recording, track: &Track, rng: &mut ChaCha8Rng) -> Recording {
    // Uniform on ±√3 has unit variance.
    let amplitude = 3f64.sqrt() * track.sensor_noise();
    let mut add = |x: &f64| x + amplitude * rng.random_range(-1.0..=1.0);
    let mut noisier = recording.clone();
    match (&mut noisier.q, &mut noisier.v) {
        (Some(q), _) => q.iter_mut().for_each(|x| *x = add(x)),
        (None, Some(v)) => v.iter_mut().for_each(|x| *x = add(x)),
        (None, None) => {}
    }
    noisier
}
