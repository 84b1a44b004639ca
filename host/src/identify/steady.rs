//! Noise that the readings of a held input have and the axis knows nothing of.
//!
//! A current that is measured flickers though the drive holds it. What flickers is no torque: free runs that it drives wander, and
//! whatever cuts or weakens the input seems to explain something. So it is held against the motion. With `n` what the readings of a
//! constant input differ from their mean, `J·q̈ + F = k·(u − share·n)`: where the `share`, estimated beside model and generic
//! functions, is certainly nearer to one than to none, the axis has not followed `n`, and the mean takes the place of the readings.

use std::collections::HashMap;
use std::ops::Range;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Options, Workbench, with_starts};
use crate::effects::Path;
use crate::error::Result;
use crate::model::{Causality, Model, Parameter};
use crate::recording::Recording;
use crate::weak::roughness;
use crate::{refine, uncertainty};

/// Standard deviations of the noise within which readings are those of one level.
const LEVEL: f64 = 6.0;
/// Readings of one level at least: fewer say little of their mean.
const FEWEST: usize = 5;
/// How much more the readings of a level may scatter than from one to the next: those of an input that drifts scatter more.
const SCATTER: f64 = 1.5;
/// Standard errors that make it certain.
const CERTAIN: f64 = 3.0;

/// The recordings, with the mean of each level in the place of the readings of an input that is held if the axis has not followed the noise
/// of these.
pub fn steadied(
    recordings: Vec<Recording>,
    model: &Model,
    options: Options,
) -> Result<Vec<Recording>> {
    if model.causality == Causality::Inverse {
        return Ok(recordings);
    }
    let means: Vec<Vec<f64>> = recordings.iter().map(|r| levels(&r.u)).collect();
    if !recordings
        .iter()
        .zip(&means)
        .all(|(r, means)| held(&r.u, means))
    {
        return Ok(recordings);
    }
    let bench = Workbench::new(&recordings, model, options)?;
    let [share, error] = bench.unfollowed(model)?;
    if share - CERTAIN * error <= 0.5 {
        return Ok(recordings);
    }
    let steady = |(recording, means): (Recording, Vec<f64>)| Recording {
        u: means,
        readings: Some(recording.u),
        ..recording
    };
    Ok(recordings.into_iter().zip(means).map(steady).collect())
}

/// Whether most readings are those of levels, and the levels are more than what flickers about them: a controller that feeds back a
/// noisy speed drives with noise about a level of next to nothing.
fn held(u: &[f64], means: &[f64]) -> bool {
    let moved = u.iter().zip(means).filter(|(u, mean)| u != mean).count();
    let flicker: f64 = u
        .iter()
        .zip(means)
        .map(|(u, mean)| (u - mean).powi(2))
        .sum();
    let level: f64 = means.iter().map(|mean| mean * mean).sum();
    2 * moved > u.len() && flicker < level
}

/// Adds what the levels that were taken for readings err by to the errors of all that is told in units of the input: of `N` readings with
/// noise `σ`, `σ/√N` over the RMS of the input.
pub(super) fn add_levels(model: &mut Model, recordings: &[Recording]) {
    let share = |recording: &Recording| {
        let noise = recording.noise_taken_off()?;
        Some(noise / (recording.len() as f64).sqrt())
    };
    let share = recordings.iter().filter_map(share).fold(0.0, f64::max);
    if share == 0.0 {
        return;
    }
    for k in refine::free_parameters(model) {
        if model.is_linear(k) {
            let parameter = &mut *model.parameters_mut().swap_remove(k);
            let off = share * parameter.value.unwrap_or_default();
            uncertainty::add(parameter, off);
        }
    }
}

/// What the levels that were taken for readings may err by, for each sample, drawn once for each level: of `N` readings with
/// noise `σ`, `σ/√N`. `None` where none were.
pub(super) fn errors_of_levels(recording: &Recording, seed: u64) -> Option<Vec<f64>> {
    let readings = recording.readings.as_ref()?.iter().zip(&recording.u);
    // By its bits: readings of one level have the very same one in their place.
    let mut levels: HashMap<u64, (f64, f64)> = HashMap::new();
    for (reading, level) in readings.filter(|(reading, level)| reading != level) {
        let (count, squares) = levels.entry(level.to_bits()).or_default();
        *count += 1.0;
        *squares += (reading - level).powi(2);
    }
    let drawn = |(level, (count, squares)): (u64, (f64, f64))| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ level);
        let unit = 3f64.sqrt() * rng.random_range(-1.0..=1.0);
        (level, squares.sqrt() / count * unit)
    };
    let errors: HashMap<u64, f64> = levels.into_iter().map(drawn).collect();
    let error = |level: &f64| errors.get(&level.to_bits()).copied().unwrap_or_default();
    Some(recording.u.iter().map(error).collect())
}

/// A signal with the mean of each stretch in the place of the readings of one level, and the mean of all of those that are alike.
fn levels(u: &[f64]) -> Vec<f64> {
    let noise = roughness(u);
    let mut stretches: Vec<Level> = Vec::new();
    let mut from = 0;
    for readings in u.chunk_by(|a, b| (b - a).abs() <= LEVEL * noise) {
        let to = from + readings.len();
        stretches.extend(Level::of(from..to, readings, noise));
        from = to;
    }
    stretches.sort_by(|a, b| a.mean.total_cmp(&b.mean));
    let mut steady = u.to_vec();
    let apart = |a: &Level, b: &Level| (b.mean - a.mean).powi(2) / (a.variance + b.variance);
    for alike in stretches.chunk_by(|a, b| apart(a, b) <= CERTAIN * CERTAIN) {
        let weight = |level: &Level| 1.0 / level.variance;
        let weights: f64 = alike.iter().map(weight).sum();
        let mean = alike.iter().map(|l| weight(l) * l.mean).sum::<f64>() / weights;
        let chi2: f64 = (alike.iter().map(|l| weight(l) * (l.mean - mean).powi(2))).sum();
        let freedom = (alike.len() - 1) as f64;
        // Levels that lie close by chance are as many as they are.
        let one = chi2 <= freedom + CERTAIN * (2.0 * freedom).sqrt();
        for level in alike {
            steady[level.at.clone()].fill(if one { mean } else { level.mean });
        }
    }
    steady
}

/// Readings of an input that is held.
struct Level {
    at: Range<usize>,
    mean: f64,
    /// Of the mean.
    variance: f64,
}

impl Level {
    /// `None` where there are too few, or they scatter by more than noise.
    fn of(at: Range<usize>, readings: &[f64], noise: f64) -> Option<Self> {
        let count = readings.len() as f64;
        let mean = readings.iter().sum::<f64>() / count;
        let scatter = readings.iter().map(|u| (u - mean).powi(2)).sum::<f64>() / count;
        let held = readings.len() >= FEWEST && scatter.sqrt() <= SCATTER * noise;
        (held && noise > 0.0).then(|| Self {
            at,
            mean,
            variance: noise * noise / count,
        })
    }
}

impl Workbench {
    /// The share of the noise of a held input that the axis does not follow, with its standard error.
    fn unfollowed(&self, model: &Model) -> Result<[f64; 2]> {
        let problem = &self.problem;
        let mut noise = Vec::with_capacity(problem.rows.len());
        for (track, windows) in problem.tracks.iter().zip(&problem.windows) {
            let u = track.input(&Path::default());
            let n: Vec<f64> = u.iter().zip(levels(&u)).map(|(u, mean)| u - mean).collect();
            noise.extend(windows.hold(track, &n));
        }
        let mut model = with_starts(problem, model);
        // One that is given wrongly would say more of the share than the noise does.
        if model.gain.known {
            let moving = model.moving_inertia();
            *model.parameters_mut().swap_remove(moving) = Parameter::unknown();
        }
        let groups = self.dictionary.groups(problem);
        // The input is one of these.
        let others = groups.iter().filter(|g| !g.coordinate.starts_with("input"));
        let others = others.flat_map(|g| &g.columns).map(|c| c.as_slice());
        let columns = std::iter::once(noise.as_slice()).chain(others);
        let Some((system, score)) = self.solved_beside(&mut model, columns)? else {
            return Ok([0.0, f64::INFINITY]);
        };
        let at = system.columns.len();
        let per = system.per_input(&model);
        Ok([score.beta[at] / per, (score.jackknife(at) / per).abs()])
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{held, levels};

    /// Of a drive of two levels each has one mean, of many each its own; what drifts, or is not held, stays as it is.
    #[test]
    fn readings_of_a_level_become_its_mean() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noisy = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let noise = |k| of(k) + 0.01 * rng.random_range(-1.7..1.7);
            (0..4000).map(noise).collect()
        };
        let two = |k: usize| {
            if (k / 50).is_multiple_of(2) {
                1.0
            } else {
                -1.0
            }
        };
        let many = |k: usize| (k / 50) as f64 * 0.1;
        let off = |u: &[f64], of: &dyn Fn(usize) -> f64| {
            let off = levels(u)
                .into_iter()
                .enumerate()
                .map(|(k, u)| (u - of(k)).abs());
            off.fold(0.0, f64::max)
        };
        assert!(off(&noisy(&two), &two) < 1e-3);
        assert!(off(&noisy(&many), &many) < 6e-3);
        let readings = noisy(&two);
        assert!(held(&readings, &levels(&readings)));
        let drifts = noisy(&|k| 1e-3 * k as f64);
        assert_eq!(levels(&drifts), drifts);
        let fed_back = noisy(&|_| 1e-3);
        assert!(!held(&fed_back, &levels(&fed_back)));
        let sine = |k: usize| (0.1 * k as f64).sin();
        let smooth: Vec<f64> = (0..4000).map(sine).collect();
        assert_eq!(levels(&smooth), smooth);
    }
}
