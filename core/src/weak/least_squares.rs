//! Least squares by rows, in constant memory.

use crate::Scalar;

/// The problem has no unique solution: a column is zero or depends on the columns before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Singular {
    /// Index of the column that the rows do not determine.
    pub column: usize,
}

/// Accumulates rows `xᵀ·β ≈ y` into the triangular factor of a QR decomposition.
///
/// Each row is rotated into the factor by Givens rotations (Gentleman 1973), which keeps the conditioning of
/// the rows themselves; normal equations would square it. Storage is lent by the caller: a packed upper
/// triangle over the `n` unknowns and the response, [`LeastSquares::storage`] scalars, zeroed by
/// [`LeastSquares::new`].
///
/// ```
/// use bristle_core::weak::LeastSquares;
/// let mut storage = [0.0_f64; LeastSquares::<f64>::storage(2)];
/// let mut fit = LeastSquares::new(2, &mut storage);
/// for x in 0..10 {
///     fit.push(&mut [1.0, f64::from(x), 3.0 + 0.5 * f64::from(x)]);
/// }
/// let mut beta = [0.0; 2];
/// fit.solve(&mut beta).unwrap();
/// assert!((beta[0] - 3.0).abs() < 1e-12 && (beta[1] - 0.5).abs() < 1e-12);
/// ```
#[derive(Debug)]
pub struct LeastSquares<'a, S> {
    unknowns: usize,
    factor: &'a mut [S],
}

impl<'a, S: Scalar> LeastSquares<'a, S> {
    /// Scalars of storage that `unknowns` unknowns need.
    pub const fn storage(unknowns: usize) -> usize {
        (unknowns + 1) * (unknowns + 2) / 2
    }

    /// An empty problem in `storage`, of which the first [`LeastSquares::storage`] scalars are used.
    pub fn new(unknowns: usize, storage: &'a mut [S]) -> Self {
        storage.fill(S::ZERO);
        Self {
            unknowns,
            factor: storage,
        }
    }

    /// Takes in one row: the `n` regressors followed by the response. The row is used as scratch space.
    pub fn push(&mut self, row: &mut [S]) {
        let width = self.unknowns + 1;
        for i in 0..width {
            let b = row[i];
            if b == S::ZERO {
                continue;
            }
            let diagonal = self.index(i, i);
            let a = self.factor[diagonal];
            let radius = a.hypot(b);
            let (cosine, sine) = (a / radius, b / radius);
            let tail = &mut self.factor[diagonal..diagonal + width - i];
            for (f, x) in tail.iter_mut().zip(&mut row[i..width]) {
                let (old, new) = (*f, *x);
                *f = cosine * old + sine * new;
                *x = cosine * new - sine * old;
            }
        }
    }

    /// Writes the minimiser of the squared error into `beta` (length `n`).
    pub fn solve(&self, beta: &mut [S]) -> Result<(), Singular> {
        self.check()?;
        for i in (0..self.unknowns).rev() {
            let mut sum = self.factor[self.index(i, self.unknowns)];
            for (j, b) in beta.iter().enumerate().take(self.unknowns).skip(i + 1) {
                sum -= self.factor[self.index(i, j)] * *b;
            }
            beta[i] = sum / self.factor[self.index(i, i)];
        }
        Ok(())
    }

    /// The sum of squared residuals at the minimiser.
    pub fn residual_sum(&self) -> S {
        let rho = self.factor[self.index(self.unknowns, self.unknowns)];
        rho * rho
    }

    /// Writes `(XᵀX)⁻¹`, row by row, into `inverse` (length `n²`): the covariance of β for unit noise.
    pub fn inverse_gram(&self, inverse: &mut [S]) -> Result<(), Singular> {
        self.check()?;
        let n = self.unknowns;
        // First R⁻¹ in place of the upper triangle of `inverse`, column by column, …
        for j in 0..n {
            for i in (0..n).rev() {
                let mut sum = if i == j { S::ONE } else { S::ZERO };
                for k in i + 1..n {
                    sum -= self.factor[self.index(i, k)] * inverse[k * n + j];
                }
                inverse[i * n + j] = if i > j {
                    S::ZERO
                } else {
                    sum / self.factor[self.index(i, i)]
                };
            }
        }
        // … then R⁻¹·R⁻ᵀ: entry (i, j) needs only columns ≥ max(i, j), so it may overwrite as it goes.
        for i in 0..n {
            for j in i..n {
                let mut sum = S::ZERO;
                for k in j..n {
                    sum += inverse[i * n + k] * inverse[j * n + k];
                }
                inverse[i * n + j] = sum;
            }
        }
        for i in 0..n {
            for j in 0..i {
                inverse[i * n + j] = inverse[j * n + i];
            }
        }
        Ok(())
    }

    /// A column counts as dependent when rotation left less of it than rounding can account for.
    fn check(&self) -> Result<(), Singular> {
        let tolerance = S::from_f64(256.0) * S::EPSILON;
        for j in 0..self.unknowns {
            let mut norm = S::ZERO;
            for i in 0..=j {
                norm += self.factor[self.index(i, j)].abs();
            }
            if self.factor[self.index(j, j)].abs() <= tolerance * norm {
                return Err(Singular { column: j });
            }
        }
        Ok(())
    }

    /// Position of entry (i, j ≥ i) in the packed triangle of `unknowns + 1` columns.
    fn index(&self, i: usize, j: usize) -> usize {
        let width = self.unknowns + 1;
        i * width - i * i.wrapping_sub(1) / 2 + j - i
    }
}

#[cfg(test)]
mod tests {
    use super::{LeastSquares, Singular};
    use std::vec::Vec;

    fn rows() -> Vec<[f64; 4]> {
        (0..40)
            .map(|k| {
                let t = f64::from(k) * 0.1;
                [
                    1.0,
                    t,
                    (3.0 * t).sin(),
                    2.0 - t + 0.7 * (3.0 * t).sin() + 0.01 * (17.0 * t).cos(),
                ]
            })
            .collect()
    }

    #[test]
    fn solution_satisfies_the_normal_equations() {
        let mut storage = [0.0; LeastSquares::<f64>::storage(3)];
        let mut fit = LeastSquares::new(3, &mut storage);
        for mut row in rows() {
            fit.push(&mut row);
        }
        let mut beta = [0.0; 3];
        fit.solve(&mut beta).unwrap();
        let residual = |r: &[f64; 4]| r[3] - r[0] * beta[0] - r[1] * beta[1] - r[2] * beta[2];
        for j in 0..3 {
            let gradient: f64 = rows().iter().map(|r| r[j] * residual(r)).sum();
            assert!(gradient.abs() < 1e-12);
        }
        let sum: f64 = rows().iter().map(|r| residual(r).powi(2)).sum();
        assert!((fit.residual_sum() - sum).abs() < 1e-12);
    }

    #[test]
    fn inverse_gram_inverts_the_gram_matrix() {
        let mut storage = [0.0; LeastSquares::<f64>::storage(3)];
        let mut fit = LeastSquares::new(3, &mut storage);
        for mut row in rows() {
            fit.push(&mut row);
        }
        let mut inverse = [0.0; 9];
        fit.inverse_gram(&mut inverse).unwrap();
        for i in 0..3 {
            for j in 0..3 {
                let entry: f64 = (0..3)
                    .map(|k| rows().iter().map(|r| r[i] * r[k]).sum::<f64>() * inverse[k * 3 + j])
                    .sum();
                let identity = if i == j { 1.0 } else { 0.0 };
                assert!((entry - identity).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn names_the_dependent_column() {
        let mut storage = [0.0; LeastSquares::<f64>::storage(3)];
        let mut fit = LeastSquares::new(3, &mut storage);
        for k in 0..20 {
            let x = f64::from(k);
            fit.push(&mut [1.0, x, 2.0 * x + 1.0, x]);
        }
        assert_eq!(fit.solve(&mut [0.0; 3]), Err(Singular { column: 2 }));
    }
}
