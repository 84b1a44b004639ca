//! Normal equations: what rows say about the parameters of a model, in sums that add up over sets of rows.

use nalgebra::{DMatrix, DVector};

use crate::model::Model;

/// Norm of a column that is zero.
const NO_SCALE: f64 = 1e-150;

/// The inertia that moves, zero if it has no value.
fn inertia(model: &Model) -> f64 {
    let parameter = model.parameters()[model.moving_inertia()];
    parameter.value.unwrap_or(0.0)
}

/// The sum of squares without what encoder noise in the acceleration regressor adds to it: `J²·E`.
pub fn less_encoder(squares: f64, model: &Model, energy: f64) -> f64 {
    squares - inertia(model).powi(2) * energy
}

/// What whitened rows say about the free parameters of a model around its present values: sums over rows, so that those of
/// several sets of rows add up.
#[derive(Clone, Debug)]
pub struct Normal {
    /// `JᵀJ`.
    products: DMatrix<f64>,
    /// `Jᵀr`.
    gradient: DVector<f64>,
    /// `Σ g·gᵀ` over clusters of rows, `g` being a cluster's share of `Jᵀr`.
    scatter: DMatrix<f64>,
    /// `rᵀr`.
    squares: f64,
    /// Rows and clusters that were summed.
    rows: usize,
    clusters: usize,
    /// Energy of the encoder noise in the acceleration regressor.
    pub encoder_energy: f64,
    /// Square of the norm of what the drive contributes to the residuals.
    pub drive_squares: f64,
}

impl Normal {
    /// No rows yet, for a model with `free` free parameters.
    pub fn zero(free: usize) -> Self {
        Self {
            products: DMatrix::zeros(free, free),
            gradient: DVector::zeros(free),
            scatter: DMatrix::zeros(free, free),
            squares: 0.0,
            rows: 0,
            clusters: 0,
            encoder_energy: 0.0,
            drive_squares: 0.0,
        }
    }

    /// Of one set of rows; `clusters[k]` is the cluster of row `k`, none of them for a step without errors.
    pub fn new(jacobian: &DMatrix<f64>, residual: &DVector<f64>, clusters: &[usize]) -> Self {
        let free = jacobian.ncols();
        let count = clusters.iter().max().map_or(0, |c| c + 1);
        let mut gradients = DMatrix::<f64>::zeros(free, count);
        for (row, &cluster) in clusters.iter().enumerate() {
            for j in 0..free {
                gradients[(j, cluster)] += jacobian[(row, j)] * residual[row];
            }
        }
        Self {
            products: jacobian.tr_mul(jacobian),
            gradient: jacobian.tr_mul(residual),
            scatter: &gradients * gradients.transpose(),
            squares: residual.norm_squared(),
            rows: residual.len(),
            clusters: count,
            encoder_energy: 0.0,
            drive_squares: 0.0,
        }
    }

    /// Adds other rows.
    pub fn add(&mut self, other: &Self) {
        self.products += &other.products;
        self.gradient += &other.gradient;
        self.scatter += &other.scatter;
        self.squares += other.squares;
        self.rows += other.rows;
        self.clusters += other.clusters;
        self.encoder_energy += other.encoder_energy;
        self.drive_squares += other.drive_squares;
    }

    /// Rows that were summed.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// χ², less what encoder noise in the acceleration regressor adds to it.
    pub fn objective(&self, model: &Model) -> f64 {
        less_encoder(self.squares, model, self.encoder_energy)
    }

    /// The Gauss-Newton step of the free parameters of a model; `None` if the rows do not determine it.
    pub fn step(&self, model: &Model, free: &[usize]) -> Option<Vec<(usize, f64)>> {
        if free.is_empty() || self.rows == 0 {
            return None;
        }
        let mut gradient = self.gradient.clone();
        if let Some(at) = free.iter().position(|&k| k == model.moving_inertia()) {
            gradient[at] -= self.encoder_energy * inertia(model);
        }
        let gradient = DMatrix::from_column_slice(gradient.len(), 1, gradient.as_slice());
        let step = self.solve(model, free, &-gradient)?;
        let pair = |(i, &k): (usize, &usize)| (k, step[(i, 0)]);
        Some(free.iter().enumerate().map(pair).collect())
    }

    /// The solutions of the normal equations, less the encoder's part in them, for each column of right-hand sides; `None`
    /// if the rows do not determine them.
    pub fn solve(
        &self,
        model: &Model,
        free: &[usize],
        right: &DMatrix<f64>,
    ) -> Option<DMatrix<f64>> {
        let (mut normal, scale) = self.scaled();
        if let Some(at) = free.iter().position(|&k| k == model.moving_inertia()) {
            normal[(at, at)] -= self.encoder_energy / (scale[at] * scale[at]);
        }
        let scaled = |right: &DMatrix<f64>| {
            DMatrix::from_fn(right.nrows(), right.ncols(), |i, j| {
                right[(i, j)] / scale[i]
            })
        };
        Some(scaled(&normal.cholesky()?.solve(&scaled(right))))
    }

    /// Covariance of the free parameters by the residuals' variance and by the scatter of the clusters' gradients, both in
    /// units of the inverse column norms, which come third; `None` if the rows do not determine them.
    pub fn covariances(&self) -> Option<(DMatrix<f64>, DMatrix<f64>, Vec<f64>)> {
        let free = self.gradient.len();
        if free == 0 || self.rows == 0 {
            return None;
        }
        let (normal, scale) = self.scaled();
        let inverse = normal.try_inverse()?;
        let rows = self.rows as f64;
        let freedom = rows / (rows - free as f64).max(1.0);
        let sigma2 = (self.squares / rows * freedom).max(1.0);
        let scatter = DMatrix::from_fn(free, free, |i, j| {
            self.scatter[(i, j)] / (scale[i] * scale[j])
        });
        let clusters = self.clusters as f64;
        let small_sample = clusters / (clusters - 1.0).max(1.0);
        let sandwich = &inverse * scatter * &inverse * small_sample;
        Some((inverse * sigma2, sandwich, scale))
    }

    /// Standard errors of the free parameters: the larger of the two that [`Normal::covariances`] gives.
    pub fn errors(&self) -> Option<Vec<f64>> {
        let (plain, sandwich, scale) = self.covariances()?;
        // What the residual does not depend on at all is not known at all.
        let error = |j: usize| match plain[(j, j)].max(sandwich[(j, j)]).max(0.0).sqrt() {
            error if scale[j] > NO_SCALE => error / scale[j],
            _ => f64::INFINITY,
        };
        Some((0..scale.len()).map(error).collect())
    }

    /// Norm of what the drive contributes to the residuals.
    pub fn drive(&self) -> f64 {
        self.drive_squares.sqrt()
    }

    /// `JᵀJ` with unit diagonal, and the column norms that were divided out.
    fn scaled(&self) -> (DMatrix<f64>, Vec<f64>) {
        let norm = |d: &f64| d.sqrt().max(NO_SCALE);
        let scale: Vec<f64> = self.products.diagonal().iter().map(norm).collect();
        let n = scale.len();
        let mut normal =
            DMatrix::from_fn(n, n, |i, j| self.products[(i, j)] / (scale[i] * scale[j]));
        (0..n).for_each(|i| normal[(i, i)] += 1e-12);
        (normal, scale)
    }
}
