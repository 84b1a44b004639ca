//! The noise of weak-form rows: coloured by the overlap of windows, larger around reversals.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::linear;
use crate::problem::{Problem, Response};
use crate::weak::Part;

/// Correlation reaches over this many hops: the overlap of two windows (8 hops) and coloured torque noise beyond.
const REACH: usize = 24;
/// Residuals beyond this many standard deviations are pulled in before covariances are estimated.
const WINSOR: f64 = 4.0;

/// Turns rows with coloured noise into rows with independent noise of unit variance.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Standard deviation of each row.
    pub sigma: Vec<f64>,
    /// Energy of the encoder noise in the whitened column `∫q φ̈` over the training rows, where that column is a
    /// regressor; 0 where it is the response.
    pub encoder_energy: f64,
    /// What holds for other rows of the same axis, too.
    pub law: Law,
    /// Weight of each row after whitening: below one for outliers.
    weight: Vec<f64>,
    blocks: Vec<Block>,
}

/// The noise of an axis, apart from the rows that it was estimated on.
#[derive(Clone, Debug)]
pub struct Law {
    /// `σ₀²`.
    floor: f64,
    /// `κ`.
    reversal: f64,
    /// Autocorrelation over hops.
    correlation: Vec<f64>,
}

/// Consecutive rows with what whitens each: a banded Cholesky factor `L` of their correlation.
#[derive(Clone, Debug)]
struct Block {
    start: usize,
    part: Part,
    lines: Vec<Line>,
}

/// A row `i` of `L`, divided by its diagonal.
#[derive(Clone, Debug)]
struct Line {
    /// `1/Lᵢᵢ`.
    scale: f64,
    /// `Lᵢⱼ/Lᵢᵢ` for the last rows `j < i`, in their order.
    past: Vec<f64>,
}

impl Line {
    /// Of `(i, i)`, `(i, i − 1)` and so on.
    fn new(entries: &[f64]) -> Self {
        Self {
            scale: 1.0 / entries[0],
            past: entries[1..].iter().rev().map(|x| x / entries[0]).collect(),
        }
    }
}

impl Noise {
    /// Estimates the noise from the training residuals of a fit with `unknowns` parameters that follows all there
    /// is to follow.
    ///
    /// The standard deviation of row `k` is modelled as `σ² = σ₀² + κ·ρₖ²`, where `ρₖ²` sums the squared weights of
    /// reversals under its window: an error in the instant of a reversal is an impulse of `2·Fc·δt` there.
    pub fn estimate(
        problem: &Problem,
        residual: &[f64],
        unknowns: usize,
        seen: &[Option<usize>],
    ) -> Self {
        let reversals = reversal_weights(problem);
        let (floor, reversal) = variances(problem, residual, &reversals, unknowns);
        let mut law = Law {
            floor,
            reversal,
            correlation: Vec::new(),
        };
        let limit = |z: f64| z.clamp(-WINSOR, WINSOR);
        let z: Vec<f64> = residual
            .iter()
            .zip(law.sigma(&reversals))
            .map(|(r, s)| limit(r / s))
            .collect();
        law.correlation = correlation(problem, &z);
        law.on(problem, residual, seen)
    }

    /// Sends draws of noise like the encoder's through the same windows and the same whitening.
    fn measure_encoder_energy(&self, problem: &Problem, seen: &[Option<usize>]) -> f64 {
        const DRAWS: usize = 4;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut energy = 0.0;
        for _ in 0..DRAWS {
            let rows = problem.stack(|track, windows| {
                // Uniform on ±√3 has unit variance.
                let noise = track.noise(|| rng.random_range(-3f64.sqrt()..=3f64.sqrt()));
                windows.acceleration(&noise)
            });
            let z = self.whiten(&rows);
            energy += z
                .iter()
                .zip(seen)
                .filter(|(_, f)| f.is_some())
                .map(|(z, _)| z * z)
                .sum::<f64>();
        }
        energy / DRAWS as f64
    }

    /// The same without what neighbouring rows have in common.
    #[must_use]
    pub fn without_colour(&self) -> Self {
        let plain = || Line::new(&[1.0]);
        let bare = |block: &Block| Block {
            lines: block.lines.iter().map(|_| plain()).collect(),
            ..*block
        };
        Self {
            weight: vec![1.0; self.weight.len()],
            blocks: self.blocks.iter().map(bare).collect(),
            ..self.clone()
        }
    }

    /// Whitened values, one for each row.
    pub fn whiten(&self, rows: &[f64]) -> Vec<f64> {
        let [whitened] = self.side_by_side([rows], &|_| true);
        whitened
    }

    /// The same of several columns: the same values in less time.
    pub fn whiten_all<'a>(&self, columns: impl IntoIterator<Item = &'a [f64]>) -> Vec<Vec<f64>> {
        self.in_pairs(columns, &|_| true)
    }

    /// The same with zeros in the rows of the held-out part, of which a fit sees nothing.
    pub fn whiten_training<'a>(
        &self,
        columns: impl IntoIterator<Item = &'a [f64]>,
    ) -> Vec<Vec<f64>> {
        self.in_pairs(columns, &|part| part == Part::Train)
    }

    fn in_pairs<'a>(
        &self,
        columns: impl IntoIterator<Item = &'a [f64]>,
        wanted: &dyn Fn(Part) -> bool,
    ) -> Vec<Vec<f64>> {
        let columns: Vec<&[f64]> = columns.into_iter().collect();
        let (pairs, rest) = columns.as_chunks();
        let pairs = pairs
            .iter()
            .map(|pair| self.side_by_side::<2>(*pair, wanted));
        let rest = rest.iter().flat_map(|c| self.side_by_side([*c], wanted));
        pairs.flatten().chain(rest).collect()
    }

    /// Each row waits for the one before it, and columns wait together.
    fn side_by_side<const N: usize>(
        &self,
        columns: [&[f64]; N],
        wanted: &dyn Fn(Part) -> bool,
    ) -> [Vec<f64>; N] {
        let mut out = vec![[0.0; N]; columns[0].len()];
        for block in self.blocks.iter().filter(|block| wanted(block.part)) {
            for (i, line) in block.lines.iter().enumerate() {
                let at = block.start + i;
                let past = linear::dots(&line.past, &out[at - line.past.len()..at]);
                let row = |k: usize| columns[k][at] / self.sigma[at] * line.scale - past[k];
                out[at] = std::array::from_fn(row);
            }
        }
        let rows = || out.iter().zip(&self.weight);
        std::array::from_fn(|k| rows().map(|(x, w)| x[k] * w).collect())
    }
}

impl Law {
    /// The noise of the rows of a problem. `residual` tells which of them are outliers; rows without a block are there for
    /// the whitening of others alone.
    pub fn on(&self, problem: &Problem, residual: &[f64], seen: &[Option<usize>]) -> Noise {
        let sigma = self.sigma(&reversal_weights(problem));
        let mut noise = Noise {
            weight: vec![1.0; sigma.len()],
            sigma,
            blocks: blocks(problem, &self.correlation),
            encoder_energy: 0.0,
            law: self.clone(),
        };
        noise.weight = noise
            .whiten(residual)
            .iter()
            .map(|z| (WINSOR / z.abs()).min(1.0))
            .collect();
        if problem.response == Response::Force {
            noise.encoder_energy = noise.measure_encoder_energy(problem, seen);
        }
        noise
    }

    /// Variance of rows far from reversals.
    pub fn floor(&self) -> f64 {
        self.floor
    }

    /// The residual of those rows of a problem that are beyond four standard deviations, outliers to every fit; 0 in the others.
    pub fn outliers(&self, problem: &Problem, residual: &[f64]) -> Vec<f64> {
        let sigma = self.sigma(&reversal_weights(problem));
        let rows = residual.iter().zip(sigma);
        rows.map(|(r, s)| if r.abs() > WINSOR * s { *r } else { 0.0 })
            .collect()
    }

    fn sigma(&self, reversals: &[f64]) -> Vec<f64> {
        let sigma = |r: &f64| (self.floor + self.reversal * r).sqrt().max(1e-300);
        reversals.iter().map(sigma).collect()
    }
}

/// For each row the sum of squared test-function weights at the reversals under its window.
fn reversal_weights(problem: &Problem) -> Vec<f64> {
    problem.stack(|track, windows| {
        let crossings: Vec<f64> = track
            .cells
            .iter()
            .map(|c| if c.s.abs() < 1.0 { 1.0 } else { 0.0 })
            .collect();
        windows
            .hold(track, &crossings)
            .iter()
            .map(|w| w * w)
            .collect()
    })
}

/// `σ₀²` and `κ`.
fn variances(
    problem: &Problem,
    residual: &[f64],
    reversals: &[f64],
    unknowns: usize,
) -> (f64, f64) {
    let seen: Vec<usize> = (0..residual.len())
        .filter(|&k| problem.rows[k].part == Part::Train)
        .collect();
    let mut sizes: Vec<f64> = seen.iter().map(|&k| residual[k].abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let scale = (sizes[sizes.len() / 2] / 0.6745).max(1e-300);
    let train = seen.len() as f64;
    let freedom = train / (train - unknowns as f64).max(0.2 * train);
    let square = |k: usize| freedom * residual[k].abs().min(WINSOR * scale).powi(2);
    let mean_over = |rows: &[usize], f: &dyn Fn(usize) -> f64| {
        rows.iter().map(|&k| f(k)).sum::<f64>() / rows.len() as f64
    };
    let typical = mean_over(&seen, &|k| reversals[k]);
    // Rows whose windows hold no more than a tenth of the typical reversal weight set the floor.
    let (far, near): (Vec<usize>, Vec<usize>) =
        seen.iter().partition(|&&k| reversals[k] <= 0.1 * typical);
    if far.len().min(near.len()) < 30 {
        return (mean_over(&seen, &square), 0.0);
    }
    let floor = mean_over(&far, &square);
    let kappa =
        ((mean_over(&near, &square) - floor) / mean_over(&near, &|k| reversals[k])).max(0.0);
    (floor, kappa)
}

/// Autocorrelation over hops, tapered (Bartlett) so that it is positive definite.
fn correlation(problem: &Problem, z: &[f64]) -> Vec<f64> {
    let mut sums = [0.0; REACH + 1];
    for (i, row) in problem
        .rows
        .iter()
        .enumerate()
        .filter(|(_, row)| row.part == Part::Train)
    {
        let hop = problem.windows[row.track].hop;
        for j in i..problem.rows.len() {
            let other = problem.rows[j];
            let lag = (other.centre.wrapping_sub(row.centre)) / hop;
            if other.track != row.track || other.part != row.part || lag > REACH {
                break;
            }
            sums[lag] += z[i] * z[j];
        }
    }
    // The biased estimate (one divisor for all lags) is positive definite by itself; the taper keeps it so.
    let power = sums[0].max(1e-300);
    sums.iter()
        .enumerate()
        .map(|(lag, s)| s / power * (1.0 - lag as f64 / (REACH + 1) as f64))
        .collect()
}

fn blocks(problem: &Problem, correlation: &[f64]) -> Vec<Block> {
    // `factor[i][d]` is entry `(i, i − d)`.
    let mut blocks: Vec<(usize, Vec<Vec<f64>>)> = Vec::new();
    for (i, row) in problem.rows.iter().enumerate() {
        let fresh = i == 0 || {
            let before = problem.rows[i - 1];
            before.track != row.track || before.part != row.part
        };
        if fresh {
            blocks.push((i, Vec::new()));
        }
        let (start, factor) = blocks.last_mut().expect("the first row opens a block");
        let hop = problem.windows[row.track].hop;
        let local = i - *start;
        let depth = (1..=local)
            .take_while(|d| (row.centre - problem.rows[i - d].centre) / hop <= REACH)
            .count();
        let mut line = vec![0.0; depth + 1];
        for d in (0..=depth).rev() {
            let lag = (row.centre - problem.rows[i - d].centre) / hop;
            let mut sum = correlation[lag];
            // Entry (i, i − d) of L·Lᵀ: columns shared by both lines.
            let other = if d == 0 {
                None
            } else {
                Some(&factor[local - d])
            };
            for e in d + 1..=depth {
                let right = match other {
                    None => line[e],
                    Some(f) => f.get(e - d).copied().unwrap_or(0.0),
                };
                sum -= line[e] * right;
            }
            line[d] = match other {
                None => sum.max(1e-4).sqrt(),
                Some(f) => sum / f[0],
            };
        }
        factor.push(line);
    }
    let lines = |factor: Vec<Vec<f64>>| factor.iter().map(|line| Line::new(line)).collect();
    let block = |(start, factor)| Block {
        start,
        part: problem.rows[start].part,
        lines: lines(factor),
    };
    blocks.into_iter().map(block).collect()
}
