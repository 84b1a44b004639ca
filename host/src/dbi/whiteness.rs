//! Whether what the fit leaves is noise: the autocorrelation of its residual, before and after whitening.

use serde::Serialize;

use crate::identify::Workbench;
use crate::model::Model;
use crate::problem::Problem;
use crate::system;
use crate::weak::Part;

/// Lags that are looked at, hops: the overlap of windows (8 hops), the reach of the whitening (24), and a third more.
const LAGS: usize = 32;

/// Autocorrelations of the residual over the training rows, by lags in hops from 0.
#[derive(Clone, Debug, Serialize)]
pub struct Whiteness {
    /// Of the residual in its own standard deviations.
    pub before: Vec<f64>,
    /// After whitening.
    pub after: Vec<f64>,
    /// 95 % of white noise lie within ± this at any one lag: `1.96/√N` (Bartlett, 1946).
    pub band: f64,
    /// Lags beyond the band before whitening, of those after lag 0.
    pub outside_before: usize,
    /// The same after whitening.
    pub outside_after: usize,
}

impl Whiteness {
    /// Of the residual that a model leaves.
    pub fn new(bench: &Workbench, model: &Model) -> Self {
        let problem = &bench.problem;
        let residual = system::residual(problem, model);
        let scaled: Vec<f64> = residual
            .iter()
            .zip(&bench.noise.sigma)
            .map(|(r, s)| r / s)
            .collect();
        let band = 1.96 / (problem.count(Part::Train) as f64).sqrt();
        let before = autocorrelation(problem, &scaled);
        let after = autocorrelation(problem, &bench.noise.whiten(&residual));
        let outside = |r: &[f64]| r[1..].iter().filter(|r| r.abs() > band).count();
        Self {
            outside_before: outside(&before),
            outside_after: outside(&after),
            before,
            after,
            band,
        }
    }
}

/// Over pairs of training rows of one recording that many hops apart; the divisor is the same for all lags.
fn autocorrelation(problem: &Problem, z: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0; LAGS + 1];
    for (i, row) in problem.rows.iter().enumerate() {
        if row.part != Part::Train {
            continue;
        }
        let hop = problem.windows[row.track].hop;
        for (j, other) in problem.rows.iter().enumerate().skip(i) {
            let lag = other.centre.wrapping_sub(row.centre) / hop;
            if other.track != row.track || other.part != row.part || lag > LAGS {
                break;
            }
            sums[lag] += z[i] * z[j];
        }
    }
    let power = sums[0].max(f64::MIN_POSITIVE);
    sums.iter().map(|s| s / power).collect()
}
