//! Standard errors of the error figures, from the scatter between the free-run windows.
//!
//! The figures are functions of sums over windows, and the windows start afresh from measured states, so the
//! jackknife over windows applies (Efron and Stein 1981): with θ₋ᵢ the figure without window i of m,
//! `se² = (m − 1)/m · Σ (θ₋ᵢ − mean θ₋)²`.

use super::subject::{Prediction, Subject};

/// Sums of squares over one window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Block {
    before: f64,
    after: f64,
    signal: f64,
    count: f64,
}

/// Standard errors of one model's errors in one part of the recordings; `None` with fewer than [`FEWEST`] windows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Scatter {
    /// Of the nrmse.
    pub nrmse: Option<f64>,
    /// Of the RMS error.
    pub rmse: Option<f64>,
}

/// Standard errors of the figures of one part of the recordings.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    /// Of the baseline's.
    pub before: Scatter,
    /// Of the final model's.
    pub after: Scatter,
    /// Of their ratio.
    pub factor: Option<f64>,
}

impl Block {
    /// The windows of a prediction that lie in the held-out part, or those in the training part.
    pub fn of(prediction: &Prediction, held_out: bool, inverse: bool) -> Vec<Self> {
        let windows = prediction.windows.iter();
        windows
            .filter(|w| (w.start >= prediction.boundary) == held_out)
            .map(|window| {
                let measured = &prediction.measured[window.clone()];
                let origin = if inverse { 0.0 } else { measured[0] };
                let error = |predicted: &[f64]| prediction.squared_error(predicted, window);
                Self {
                    before: prediction.before.as_deref().map_or(0.0, error),
                    after: error(&prediction.after),
                    signal: measured.iter().map(|x| (x - origin).powi(2)).sum(),
                    count: measured.len() as f64,
                }
            })
            .collect()
    }

    /// This and `sign` times another.
    fn plus(self, sign: f64, other: Self) -> Self {
        Self {
            before: self.before + sign * other.before,
            after: self.after + sign * other.after,
            signal: self.signal + sign * other.signal,
            count: self.count + sign * other.count,
        }
    }
}

impl Spread {
    /// The jackknife over windows.
    pub fn of(blocks: &[Block]) -> Self {
        let scatter = |error: &dyn Fn(&Block) -> f64| Scatter {
            nrmse: jackknife(blocks, &|s| (error(s) / s.signal).sqrt()),
            rmse: jackknife(blocks, &|s| (error(s) / s.count).sqrt()),
        };
        Self {
            before: scatter(&|s| s.before),
            after: scatter(&|s| s.after),
            factor: jackknife(blocks, &|s| (s.before / s.after).sqrt()),
        }
    }
}

/// Standard errors of the error figures of both parts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spreads {
    /// Of the first part of each recording.
    pub train: Spread,
    /// Of the rest.
    pub held_out: Spread,
}

impl Spreads {
    /// From the predictions of all recordings.
    pub fn of(subject: &Subject, predictions: &[Prediction]) -> Self {
        let part = |held_out: bool| {
            let blocks: Vec<Block> = predictions
                .iter()
                .flat_map(|p| Block::of(p, held_out, subject.inverse()))
                .collect();
            Spread::of(&blocks)
        };
        Self {
            train: part(false),
            held_out: part(true),
        }
    }
}

/// Windows that a standard error needs.
pub(super) const FEWEST: usize = 3;

fn jackknife(blocks: &[Block], figure: &dyn Fn(&Block) -> f64) -> Option<f64> {
    if blocks.len() < FEWEST {
        return None;
    }
    let add = |sum: Block, block: &Block| sum.plus(1.0, *block);
    let all = blocks.iter().fold(Block::default(), add);
    let without: Vec<f64> = blocks.iter().map(|b| figure(&all.plus(-1.0, *b))).collect();
    let m = without.len() as f64;
    let mean = without.iter().sum::<f64>() / m;
    let squares: f64 = without.iter().map(|x| (x - mean).powi(2)).sum();
    Some(((m - 1.0) / m * squares).sqrt()).filter(|se| se.is_finite())
}

#[cfg(test)]
mod tests {
    use super::{Block, jackknife};

    #[test]
    fn the_jackknife_of_a_mean_is_the_standard_error_of_the_mean() {
        // Values 1, 2, 3, 4 with count 1 each: sd² = 5/3, so se = √(5/3/4).
        let block = |after: f64| Block {
            after,
            count: 1.0,
            ..Block::default()
        };
        let blocks = [1.0, 2.0, 3.0, 4.0].map(block);
        let se = jackknife(&blocks, &|s| s.after / s.count).unwrap();
        assert!((se - (5.0_f64 / 12.0).sqrt()).abs() < 1e-12, "{se}");
        assert!(jackknife(&blocks[..2], &|s| s.after).is_none());
    }
}
