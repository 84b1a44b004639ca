//! Joint refinement of all unknown parameters on the whitened rows, and their standard errors.

use nalgebra::{DMatrix, DVector};

use crate::model::Model;
use crate::noise::Noise;
use crate::problem::Problem;
use crate::system::{inadmissible, residual};

/// Most Gauss-Newton steps; from a weak-form start three or four settle it.
const STEPS: usize = 12;

/// Refines all unknown parameters together by Gauss-Newton on the whitened training rows, within their bounds, and
/// gives each its standard error. Returns χ².
pub fn refine(problem: &Problem, model: &mut Model, noise: &Noise, folds: &[Option<usize>]) -> f64 {
    let evaluate = |model: &Model| counted(problem, model, noise, folds);
    let objective = Objective {
        evaluate: &evaluate,
        encoder_energy: noise.encoder_energy,
    };
    let mut current = evaluate(model);
    for _ in 0..STEPS {
        let Some(step) = objective.gauss_newton(model, &current) else {
            break;
        };
        let before = objective.value(model, &current);
        let Some((next, after)) = objective.line_search(model, &step, before) else {
            break;
        };
        *model = next;
        current = after;
        let now = objective.value(model, &current);
        if before - now < 1e-6 * now {
            break;
        }
    }
    standard_errors(model, &current, &evaluate, folds);
    objective.value(model, &current)
}

/// The whitened residual of the rows that have a fold.
fn counted(
    problem: &Problem,
    model: &Model,
    noise: &Noise,
    folds: &[Option<usize>],
) -> DVector<f64> {
    let whitened = noise.whiten(&residual(problem, model));
    let counted = whitened.iter().zip(folds).filter(|(_, f)| f.is_some());
    DVector::from_iterator(folds.iter().flatten().count(), counted.map(|(r, _)| *r))
}

/// The sum of squared whitened residuals, less what encoder noise in the acceleration regressor adds to it: `J²·E`.
struct Objective<'a, F> {
    evaluate: &'a F,
    encoder_energy: f64,
}

impl<F: Fn(&Model) -> DVector<f64>> Objective<'_, F> {
    fn value(&self, model: &Model, residual: &DVector<f64>) -> f64 {
        less_encoder(residual.norm_squared(), model, self.encoder_energy)
    }

    fn gauss_newton(&self, model: &Model, residual: &DVector<f64>) -> Option<Vec<(usize, f64)>> {
        let jacobian = jacobian(model, &free_parameters(model), self.evaluate);
        Normal::new(&jacobian, residual, &[], self.encoder_energy).step(model)
    }

    /// Halves the step until it lowers the objective; bounds are kept by projection.
    fn line_search(
        &self,
        model: &Model,
        step: &[(usize, f64)],
        before: f64,
    ) -> Option<(Model, DVector<f64>)> {
        let mut length = 1.0;
        for _ in 0..6 {
            if let Some(next) = moved(model, step, length) {
                let after = (self.evaluate)(&next);
                if self.value(&next, &after) < before {
                    return Some((next, after));
                }
            }
            length *= 0.5;
        }
        None
    }
}

/// The sum of squares without what encoder noise in the acceleration regressor adds to it.
fn less_encoder(squares: f64, model: &Model, energy: f64) -> f64 {
    squares - model.inertia.value.unwrap_or(0.0).powi(2) * energy
}

/// The model some share of a step on, its bounds kept by projection; `None` where that is not physical.
pub fn moved(model: &Model, step: &[(usize, f64)], share: f64) -> Option<Model> {
    let mut next = model.clone();
    for &(k, s) in step {
        next.move_to(k, next.parameters()[k].value.unwrap_or(0.0) + share * s);
    }
    is_physical(&next).then_some(next)
}

/// Position of the inertia among [`Model::parameters`].
const INERTIA: usize = 0;

/// No negative inertia, and coefficients that physics allows.
fn is_physical(model: &Model) -> bool {
    model.inertia.value.is_none_or(|j| j >= 0.0) && inadmissible(model).is_none()
}

/// Indices of the parameters that a fit may move.
pub fn free_parameters(model: &Model) -> Vec<usize> {
    let parameters = model.parameters();
    (0..parameters.len())
        .filter(|&k| !parameters[k].known && parameters[k].value.is_some() && !model.is_whole(k))
        .collect()
}

fn jacobian(
    model: &Model,
    free: &[usize],
    evaluate: &impl Fn(&Model) -> DVector<f64>,
) -> DMatrix<f64> {
    let columns: Vec<DVector<f64>> = free
        .iter()
        .map(|&k| {
            let value = model.parameters()[k].value.unwrap_or(0.0);
            // Central differences: the truncation error falls with the square of this relative step.
            let h = 1e-4 * value.abs().max(1e-6);
            let moved = |to: f64| {
                let mut moved = model.clone();
                moved.parameters_mut()[k].value = Some(to);
                evaluate(&moved)
            };
            (moved(value + h) - moved(value - h)) / (2.0 * h)
        })
        .collect();
    if columns.is_empty() {
        DMatrix::zeros(0, 0)
    } else {
        DMatrix::from_columns(&columns)
    }
}

/// Gives every estimated parameter its standard error; see [`Normal::errors`].
fn standard_errors(
    model: &mut Model,
    residual: &DVector<f64>,
    evaluate: &impl Fn(&Model) -> DVector<f64>,
    folds: &[Option<usize>],
) {
    let jacobian = jacobian(model, &free_parameters(model), evaluate);
    let clusters = clusters(folds);
    if let Some(errors) = Normal::new(&jacobian, residual, &clusters, 0.0).errors() {
        put_errors(model, &errors);
    }
}

/// Writes the standard errors of the free parameters into a model.
pub fn put_errors(model: &mut Model, errors: &[f64]) {
    let free = free_parameters(model);
    let whole: Vec<bool> = (0..model.parameters().len())
        .map(|k| model.is_whole(k))
        .collect();
    let mut parameters = model.parameters_mut();
    for (parameter, _) in parameters
        .iter_mut()
        .zip(whole)
        .filter(|(p, whole)| *whole && !p.known)
    {
        parameter.se = Some(0.0);
    }
    for (&k, &se) in free.iter().zip(errors) {
        parameters[k].se = Some(se);
    }
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
    encoder_energy: f64,
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
        }
    }

    /// Of one set of rows; `clusters[k]` is the cluster of row `k`, none of them for a step without errors.
    fn new(
        jacobian: &DMatrix<f64>,
        residual: &DVector<f64>,
        clusters: &[usize],
        encoder_energy: f64,
    ) -> Self {
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
            encoder_energy,
        }
    }

    /// Of the rows of a problem that have a cluster, at the present values of a model.
    pub fn of(problem: &Problem, model: &Model, noise: &Noise, clusters: &[Option<usize>]) -> Self {
        let evaluate = |model: &Model| counted(problem, model, noise, clusters);
        let jacobian = jacobian(model, &free_parameters(model), &evaluate);
        let clusters: Vec<usize> = clusters.iter().copied().flatten().collect();
        Self::new(&jacobian, &evaluate(model), &clusters, noise.encoder_energy)
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
    }

    /// Rows that were summed.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// χ², less what encoder noise in the acceleration regressor adds to it.
    pub fn objective(&self, model: &Model) -> f64 {
        less_encoder(self.squares, model, self.encoder_energy)
    }

    /// The Gauss-Newton step of each free parameter; `None` if the rows do not determine it.
    pub fn step(&self, model: &Model) -> Option<Vec<(usize, f64)>> {
        let free = free_parameters(model);
        if free.is_empty() || self.rows == 0 {
            return None;
        }
        let (mut normal, scale) = self.scaled();
        let mut gradient = self.gradient.clone();
        if free[0] == INERTIA {
            normal[(0, 0)] -= self.encoder_energy / (scale[0] * scale[0]);
            gradient[0] -= self.encoder_energy * model.inertia.value.unwrap_or(0.0);
        }
        let right = DVector::from_fn(gradient.len(), |i, _| -gradient[i] / scale[i]);
        let step = normal.cholesky()?.solve(&right);
        let unscaled = |(i, k): (usize, usize)| (k, step[i] / scale[i]);
        Some(free.into_iter().enumerate().map(unscaled).collect())
    }

    /// Standard errors of the free parameters from `(JᵀJ)⁻¹·(Σ over clusters of gradient outer products)·(JᵀJ)⁻¹`: the
    /// clusters stay independent even where the model or the noise covariance is not exact (Liang and Zeger 1986). The
    /// larger of this and the model-based error counts.
    pub fn errors(&self) -> Option<Vec<f64>> {
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
        let error = |j: usize| {
            let variance = (sigma2 * inverse[(j, j)]).max(sandwich[(j, j)]);
            variance.max(0.0).sqrt() / scale[j]
        };
        Some((0..free).map(error).collect())
    }

    /// `JᵀJ` with unit diagonal, and the column norms that were divided out.
    fn scaled(&self) -> (DMatrix<f64>, Vec<f64>) {
        let norm = |d: &f64| d.sqrt().max(1e-150);
        let scale: Vec<f64> = self.products.diagonal().iter().map(norm).collect();
        let n = scale.len();
        let mut normal =
            DMatrix::from_fn(n, n, |i, j| self.products[(i, j)] / (scale[i] * scale[j]));
        (0..n).for_each(|i| normal[(i, i)] += 1e-12);
        (normal, scale)
    }
}

/// Consecutive training rows of one fold form a cluster.
fn clusters(folds: &[Option<usize>]) -> Vec<usize> {
    let mut cluster = 0;
    let mut last = None;
    let mut clusters = Vec::new();
    for fold in folds {
        if last.is_some() && last != Some(*fold) {
            cluster += usize::from(fold.is_some());
        }
        if fold.is_some() {
            clusters.push(cluster);
            last = Some(*fold);
        }
    }
    clusters
}
