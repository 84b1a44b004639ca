//! Velocity from positions by local cubic regression (Savitzky and Golay 1964).

use std::ops::Range;

use nalgebra::DMatrix;

use super::acceleration::energy;

/// Derivative filter over `2·half + 1` samples; exact for cubics, also at the ends of the recording.
pub(super) struct Differentiator {
    half: usize,
    /// Row `j`: weights for the derivative at sample `j` of the window, per sampling interval.
    weights: DMatrix<f64>,
    /// Row `j`: weights for the value at sample `j`.
    values: DMatrix<f64>,
}

impl Differentiator {
    pub(super) fn new(half: usize) -> Self {
        let n = 2 * half + 1;
        // Scaled abscissa keeps the normal equations well conditioned.
        let x = |k: usize| (k as f64 - half as f64) / half as f64;
        let design = DMatrix::from_fn(n, 4, |row, power| x(row).powi(power as i32));
        let gram = design
            .tr_mul(&design)
            .cholesky()
            .expect("distinct abscissae make a definite Gram matrix");
        let fit = gram.solve(&design.transpose());
        let slopes = DMatrix::from_fn(n, 4, |row, power| match power {
            0 => 0.0,
            p => p as f64 * x(row).powi(p as i32 - 1) / half as f64,
        });
        Self {
            half,
            weights: slopes * &fit,
            values: design * fit,
        }
    }

    /// Samples on either side of a window's centre.
    pub(super) fn half(&self) -> usize {
        self.half
    }

    /// Standard deviation of the derivative at the window's centre for unit white noise on the samples.
    pub(super) fn noise_gain(&self) -> f64 {
        self.weights.row(self.half).norm()
    }

    /// The same at the first sample of a recording, whose window lies to one side.
    pub(super) fn noise_gain_at_end(&self) -> f64 {
        self.weights.row(0).norm()
    }

    /// The same as in the middle for samples that are running sums of unit white noise.
    pub(super) fn summed_noise_gain(&self) -> f64 {
        energy(self.weights.row(self.half).iter(), true).sqrt()
    }

    /// Derivative of `x` per sampling interval, at every sample.
    pub(super) fn apply(&self, x: &[f64]) -> Vec<f64> {
        (0..x.len())
            .map(|i| self.at(&self.weights, x, i).0)
            .collect()
    }

    /// Variance of the noise on some samples as the filter sees it: what the local cubics leave, per degree of freedom.
    pub(super) fn variance(&self, x: &[f64], samples: Range<usize>) -> f64 {
        let (mut squares, mut freedom) = (0.0, 0.0);
        for i in samples {
            let (value, leverage) = self.at(&self.values, x, i);
            squares += (x[i] - value).powi(2);
            freedom += 1.0 - leverage;
        }
        squares / freedom
    }

    /// What the weights make of the window around sample `i`, and the weight of that sample itself.
    fn at(&self, weights: &DMatrix<f64>, x: &[f64], i: usize) -> (f64, f64) {
        let n = weights.ncols();
        let start = i.saturating_sub(self.half).min(x.len() - n);
        let row = weights.row(i - start);
        let sum = row.iter().zip(&x[start..]).map(|(w, x)| w * x).sum();
        (sum, row[i - start])
    }
}

#[cfg(test)]
mod tests {
    use super::Differentiator;

    #[test]
    fn is_exact_for_cubics_everywhere() {
        let x: Vec<f64> = (0..40)
            .map(|k| f64::from(k) * 0.1)
            .map(|t| t * t * t - 2.0 * t)
            .collect();
        for (k, d) in Differentiator::new(5).apply(&x).iter().enumerate() {
            let t = k as f64 * 0.1;
            assert!((d / 0.1 - (3.0 * t * t - 2.0)).abs() < 1e-9);
        }
    }

    #[test]
    fn running_sums_pass_their_mean_slope() {
        // Half-width one: the central difference (x₂ − x₀)/2 of sums holds two of the summands, half each.
        let gain = Differentiator::new(2).summed_noise_gain();
        let x: Vec<f64> = (0..5).map(f64::from).collect();
        assert!((Differentiator::new(2).apply(&x)[2] - 1.0).abs() < 1e-12);
        // Weights of the summands add up to one, so their norm lies between 1/√4 and 1.
        assert!((0.5..1.0).contains(&gain), "{gain}");
    }

    #[test]
    fn wider_windows_let_less_noise_through() {
        // For a cubic fit the gain falls as half^(-3/2): a factor of two in width gives 2^1.5 in noise.
        let ratio = Differentiator::new(10).noise_gain() / Differentiator::new(20).noise_gain();
        assert!((ratio - 2f64.powf(1.5)).abs() < 0.25);
    }
}
