//! Linear least squares over whitened rows, with cross-validation by blocks that take turns.

use nalgebra::{DMatrix, DVector};

/// The score of a linear fit.
#[derive(Clone, Debug)]
pub struct Score {
    /// Coefficients.
    pub beta: DVector<f64>,
    /// Sum of squared whitened residuals over all training rows.
    pub chi2: f64,
    /// Sum of squared whitened residuals of each block of rows, predicted by a fit to the other folds.
    pub by_block: Vec<f64>,
    /// Sum over the blocks.
    pub cross_validated: f64,
    /// Coefficients of the fits to all folds but one.
    folds: Vec<DVector<f64>>,
}

impl Score {
    /// With all squared errors multiplied by a factor.
    #[must_use]
    pub fn times(mut self, factor: f64) -> Self {
        self.chi2 *= factor;
        self.cross_validated *= factor;
        self.by_block.iter_mut().for_each(|e| *e *= factor);
        self
    }

    /// Standard error of a coefficient, misfit and all, by the jackknife over the folds (Efron and Stein, Annals of Statistics
    /// 9, 1981).
    pub fn jackknife(&self, coefficient: usize) -> f64 {
        let values = self.folds.iter().map(|beta| beta[coefficient]);
        let count = self.folds.len() as f64;
        let mean = values.clone().sum::<f64>() / count;
        let squares: f64 = values.map(|value| (value - mean).powi(2)).sum();
        ((count - 1.0) / count * squares).sqrt()
    }
}

/// Number of folds of a cross-validation.
pub const FOLDS: usize = 5;

/// `XᵀX`, `Xᵀy` and `yᵀy` of some rows.
#[derive(Clone)]
struct Gram {
    xx: DMatrix<f64>,
    xy: DVector<f64>,
    yy: f64,
}

impl Gram {
    fn zero(n: usize) -> Self {
        Self {
            xx: DMatrix::zeros(n, n),
            xy: DVector::zeros(n),
            yy: 0.0,
        }
    }

    /// With zeros for more columns after its own.
    fn grown(&self, n: usize) -> Self {
        let had = self.xy.len();
        let mut grown = Self {
            yy: self.yy,
            ..Self::zero(n)
        };
        grown.xx.view_mut((0, 0), (had, had)).copy_from(&self.xx);
        grown.xy.rows_mut(0, had).copy_from(&self.xy);
        grown
    }

    /// Norm of each column.
    fn scale(&self) -> Vec<f64> {
        self.xx
            .diagonal()
            .iter()
            .map(|d| d.sqrt().max(1e-150))
            .collect()
    }

    /// Minimiser; a ridge (plus rounding), relative to the norms in `scale`, keeps dependent columns harmless.
    fn solve(&self, ridge: f64, scale: &[f64]) -> Option<DVector<f64>> {
        let n = self.xy.len();
        let mut scaled = DMatrix::from_fn(n, n, |i, j| self.xx[(i, j)] / (scale[i] * scale[j]));
        for i in 0..n {
            scaled[(i, i)] += 1e-12 + ridge;
        }
        let right = DVector::from_fn(n, |i, _| self.xy[i] / scale[i]);
        let solution = scaled.cholesky()?.solve(&right);
        Some(DVector::from_fn(n, |i, _| solution[i] / scale[i]))
    }

    fn residual(&self, beta: &DVector<f64>) -> f64 {
        (self.yy - 2.0 * beta.dot(&self.xy) + beta.dot(&(&self.xx * beta))).max(0.0)
    }
}

/// Products of a response and columns with each other over each block of rows.
///
/// `blocks[k]` is the block of row `k`, `None` for rows that no fit may see.
#[derive(Clone)]
pub struct Products {
    grams: Vec<Gram>,
    sizes: Vec<usize>,
}

impl Products {
    /// Of some columns; `None` if no row has a block.
    pub fn new(response: &[f64], columns: &[&[f64]], blocks: &[Option<usize>]) -> Option<Self> {
        let count = blocks.iter().flatten().max()? + 1;
        let mut empty = Self {
            grams: vec![Gram::zero(0); count],
            sizes: vec![0; count],
        };
        for (y, block) in response.iter().zip(blocks) {
            let Some(block) = *block else { continue };
            empty.sizes[block] += 1;
            empty.grams[block].yy += y * y;
        }
        Some(empty.with(response, columns, blocks))
    }

    /// The same with more columns: those it has come first in `columns`.
    #[must_use]
    pub fn with(&self, response: &[f64], columns: &[&[f64]], blocks: &[Option<usize>]) -> Self {
        let n = columns.len();
        let had = self.grams.first().map_or(n, |gram| gram.xy.len());
        let mut grams: Vec<Gram> = self.grams.iter().map(|gram| gram.grown(n)).collect();
        let mut first = 0;
        for run in blocks.chunk_by(|a, b| a == b) {
            let rows = first..first + run.len();
            first = rows.end;
            let Some(block) = run[0] else { continue };
            let gram = &mut grams[block];
            let x: Vec<&[f64]> = columns.iter().map(|c| &c[rows.clone()]).collect();
            for j in had..n {
                let column = &mut gram.xx.as_mut_slice()[j * n..=j * n + j];
                add_products(column, &x[..=j], x[j]);
                add_products(
                    &mut gram.xy.as_mut_slice()[j..=j],
                    &[&response[rows.clone()]],
                    x[j],
                );
            }
        }
        let lower = |gram: &mut Gram| gram.xx.fill_lower_triangle_with_upper_triangle();
        grams.iter_mut().for_each(lower);
        Self {
            grams,
            sizes: self.sizes.clone(),
        }
    }

    /// Fits `response ≈ columns·β` and scores it.
    ///
    /// `errors` names a column that carries noise of a known energy (over all rows): it is taken off the normal equations,
    /// which removes the attenuation that it would cause (Fuller, Measurement Error Models, 1987, sec. 2.2).
    ///
    /// Blocks are dealt out in turn to [`FOLDS`] folds. Returns `None` when the columns do not determine β.
    pub fn score(mut self, ridge: f64, errors: Option<(usize, f64)>) -> Option<Score> {
        let rows = self.sizes.iter().sum::<usize>() as f64;
        if let Some((column, energy)) = errors {
            for (gram, size) in self.grams.iter_mut().zip(&self.sizes) {
                gram.xx[(column, column)] -= *size as f64 / rows * energy;
            }
        }
        let (grams, count) = (&self.grams, self.grams.len());
        let n = grams.first()?.xy.len();
        let sum = |grams: &mut dyn Iterator<Item = &Gram>| {
            grams.fold(Gram::zero(n), |mut sum, gram| {
                sum.xx += &gram.xx;
                sum.xy += &gram.xy;
                sum.yy += gram.yy;
                sum
            })
        };
        let total = sum(&mut grams.iter());
        // Columns keep the norms of all rows: one that vanishes outside a fold must not blow up rounding errors.
        let scale = total.scale();
        let beta = total.solve(ridge, &scale)?;
        let mut by_block = vec![0.0; count];
        let mut folds = Vec::with_capacity(FOLDS);
        for fold in 0..FOLDS.min(count) {
            let own = sum(&mut grams.iter().skip(fold).step_by(FOLDS));
            let others = Gram {
                xx: &total.xx - &own.xx,
                xy: &total.xy - &own.xy,
                yy: 0.0,
            };
            let beta = others.solve(ridge, &scale)?;
            for block in (fold..count).step_by(FOLDS) {
                by_block[block] = grams[block].residual(&beta);
            }
            folds.push(beta);
        }
        let by_block: Vec<f64> = (by_block.into_iter().zip(&self.sizes))
            .filter_map(|(error, size)| (*size > 0).then_some(error))
            .collect();
        Some(Score {
            chi2: total.residual(&beta),
            beta,
            cross_validated: by_block.iter().sum(),
            by_block,
            folds,
        })
    }
}

/// Fits `response ≈ columns·β` over the rows that have a block: see [`Products::score`].
pub fn score(
    response: &[f64],
    columns: &[&[f64]],
    blocks: &[Option<usize>],
    ridge: f64,
    errors: Option<(usize, f64)>,
) -> Option<Score> {
    Products::new(response, columns, blocks)?.score(ridge, errors)
}

/// Scalar product of two slices of equal length.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let length = a.len();
    let view = nalgebra::DVectorView::from_slice;
    view(a, length).dot(&view(b, length))
}

/// The same of one slice with several columns that lie side by side, each summed in the order in which [`dot`] sums.
pub fn dots<const N: usize>(a: &[f64], columns: &[[f64; N]]) -> [f64; N] {
    let mut sums = [[0.0; N]; 8];
    let (eights, others) = (a.chunks_exact(8), columns.chunks_exact(8));
    let tail = eights.remainder().iter().zip(others.remainder());
    for (a, columns) in eights.zip(others) {
        for (sum, (a, row)) in sums.iter_mut().zip(a.iter().zip(columns)) {
            (0..N).for_each(|k| sum[k] += a * row[k]);
        }
    }
    std::array::from_fn(|k| {
        let sum = (0..4).fold(0.0, |sum, i| sum + (sums[i][k] + sums[i + 4][k]));
        tail.clone().fold(sum, |sum, (a, row)| sum + a * row[k])
    })
}

/// Adds the scalar products of several columns with one, row by row: in that order whatever they are cut into.
fn add_products(sums: &mut [f64], columns: &[&[f64]], by: &[f64]) {
    let (fours, rest) = sums.as_chunks_mut();
    let (columns, other_columns) = columns.as_chunks();
    for (sums, columns) in fours.iter_mut().zip(columns) {
        add_side_by_side::<4>(sums, columns, by);
    }
    let (pairs, rest) = rest.as_chunks_mut();
    let (columns, other_columns) = other_columns.as_chunks();
    for (sums, columns) in pairs.iter_mut().zip(columns) {
        add_side_by_side::<2>(sums, columns, by);
    }
    for (sum, column) in rest.iter_mut().zip(other_columns) {
        *sum = column.iter().zip(by).fold(*sum, |sum, (x, y)| sum + x * y);
    }
}

/// Each sum waits for its row before, and several wait together.
fn add_side_by_side<const N: usize>(sums: &mut [f64; N], columns: &[&[f64]; N], by: &[f64]) {
    let columns = columns.map(|column| &column[..by.len()]);
    let mut all = *sums;
    for (row, y) in by.iter().enumerate() {
        (0..N).for_each(|k| all[k] += columns[k][row] * y);
    }
    *sums = all;
}

/// `response − columns·β` of every row, over as many columns as β has entries.
pub fn residual(response: &[f64], columns: &[&[f64]], beta: &DVector<f64>) -> Vec<f64> {
    let mut residual = response.to_vec();
    for (column, beta) in columns.iter().zip(beta.iter()) {
        let rows = residual.iter_mut().zip(*column);
        rows.for_each(|(r, x)| *r -= beta * x);
    }
    residual
}

#[cfg(test)]
mod tests {
    use super::{FOLDS, dot, dots, score};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const ROWS: usize = 4000;

    /// Numbers of variance one, a column for each seed.
    fn noise(seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let amplitude = 3f64.sqrt();
        (0..ROWS)
            .map(|_| rng.random_range(-amplitude..amplitude))
            .collect()
    }

    fn blocks() -> Vec<Option<usize>> {
        (0..ROWS).map(|k| Some(k / 100)).collect()
    }

    #[test]
    fn noise_in_a_regressor_attenuates_and_its_known_energy_corrects() {
        let (truth, error) = (noise(1), noise(2));
        let response: Vec<f64> = truth.iter().map(|x| 2.0 * x).collect();
        let seen: Vec<f64> = truth.iter().zip(&error).map(|(x, e)| x + 0.5 * e).collect();
        let slope = |errors| {
            let fit = score(&response, &[&seen], &blocks(), 0.0, errors).unwrap();
            fit.beta[0]
        };
        // Attenuation by 1/(1 + 0.25); the scatter of the estimate is about 1/√4000.
        assert!((slope(None) - 1.6).abs() < 0.05);
        assert!((slope(Some((0, 0.25 * ROWS as f64))) - 2.0).abs() < 0.08);
    }

    #[test]
    fn cross_validation_punishes_what_does_not_belong() {
        let (x, y) = (noise(3), noise(4));
        let response: Vec<f64> = x.iter().zip(&y).map(|(x, e)| x + e).collect();
        let useless: Vec<Vec<f64>> = (10..40).map(noise).collect();
        let mut columns: Vec<&[f64]> = vec![&x];
        let small = score(&response, &columns, &blocks(), 0.0, None).unwrap();
        columns.extend(useless.iter().map(Vec::as_slice));
        let large = score(&response, &columns, &blocks(), 0.0, None).unwrap();
        assert!(large.chi2 < small.chi2 && large.cross_validated > small.cross_validated);
    }

    /// One block per fold is plain leave-one-fold-out, refitted by hand; blocks without rows are none.
    #[test]
    fn every_block_is_predicted_by_the_other_folds() {
        let (x, y) = (noise(6), noise(7));
        let gaps = |k: usize| (k / 100 != 7).then_some(k / 100);
        let blocks: Vec<Option<usize>> = (0..ROWS).map(gaps).collect();
        let scored = score(&y, &[&x], &blocks, 0.0, None).unwrap();
        assert_eq!(scored.by_block.len(), ROWS / 100 - 1);
        let of = |keep: &dyn Fn(usize) -> bool| {
            let rows = (0..ROWS).filter(|&k| gaps(k).is_some_and(keep));
            rows.fold((0.0, 0.0), |(xx, xy), k| {
                (xx + x[k] * x[k], xy + x[k] * y[k])
            })
        };
        // Block 12 is of fold 2.
        let (xx, xy) = of(&|block| block % FOLDS != 2);
        let error: f64 = (1200..1300).map(|k| (y[k] - xy / xx * x[k]).powi(2)).sum();
        // Block 7 is missing before it.
        assert!((scored.by_block[11] - error).abs() < 1e-9 * error);
    }

    /// To the last bit, so that what is computed side by side is what was computed alone.
    #[test]
    fn scalar_products_side_by_side_are_those_alone() {
        let (a, b, c) = (noise(8), noise(9), noise(10));
        let pairs: Vec<[f64; 2]> = b.iter().zip(&c).map(|(b, c)| [*b, *c]).collect();
        for n in 0..50 {
            let alone = [dot(&a[..n], &b[..n]), dot(&a[..n], &c[..n])];
            assert_eq!(dots(&a[..n], &pairs[..n]), alone);
        }
    }

    #[test]
    fn columns_that_do_not_determine_the_fit_are_refused() {
        let x = noise(5);
        assert!(score(&x, &[&vec![0.0; ROWS]], &vec![None; ROWS], 0.0, None).is_none());
    }
}
