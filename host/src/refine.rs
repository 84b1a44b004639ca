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
    let evaluate = |model: &Model| -> DVector<f64> {
        let whitened = noise.whiten(&residual(problem, model));
        DVector::from_iterator(
            folds.iter().flatten().count(),
            whitened
                .iter()
                .zip(folds)
                .filter(|(_, f)| f.is_some())
                .map(|(r, _)| *r),
        )
    };
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

/// The sum of squared whitened residuals, less what encoder noise in the acceleration regressor adds to it: `J²·E`.
struct Objective<'a, F> {
    evaluate: &'a F,
    encoder_energy: f64,
}

impl<F: Fn(&Model) -> DVector<f64>> Objective<'_, F> {
    fn value(&self, model: &Model, residual: &DVector<f64>) -> f64 {
        residual.norm_squared() - inertia(model).powi(2) * self.encoder_energy
    }

    fn gauss_newton(&self, model: &Model, residual: &DVector<f64>) -> Option<Vec<(usize, f64)>> {
        let free = free_parameters(model);
        let jacobian = jacobian(model, &free, self.evaluate);
        if jacobian.ncols() == 0 {
            return None;
        }
        let (mut normal, scale) = normal_matrix(&jacobian);
        let mut gradient = jacobian.tr_mul(residual);
        if let Some(at) = free.iter().position(|&k| k == model.moving_inertia()) {
            normal[(at, at)] -= self.encoder_energy / (scale[at] * scale[at]);
            gradient[at] -= self.encoder_energy * inertia(model);
        }
        let right = DVector::from_fn(gradient.len(), |i, _| -gradient[i] / scale[i]);
        let step = normal.cholesky()?.solve(&right);
        Some(
            free.into_iter()
                .enumerate()
                .map(|(i, k)| (k, step[i] / scale[i]))
                .collect(),
        )
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
            let mut next = model.clone();
            for &(k, s) in step {
                next.move_to(k, next.parameters()[k].value.unwrap_or(0.0) + length * s);
            }
            if is_physical(&next) {
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

/// The inertia that moves, zero if it has no value.
fn inertia(model: &Model) -> f64 {
    let parameter = model.parameters()[model.moving_inertia()];
    parameter.value.unwrap_or(0.0)
}

/// No negative inertia, and coefficients that physics allows.
fn is_physical(model: &Model) -> bool {
    inertia(model) >= 0.0 && inadmissible(model).is_none()
}

/// Indices of the parameters that a fit may move.
fn free_parameters(model: &Model) -> Vec<usize> {
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

/// Norm of a column that is zero.
const NO_SCALE: f64 = 1e-150;

/// `JᵀJ` with unit diagonal, and the column norms that were divided out.
fn normal_matrix(jacobian: &DMatrix<f64>) -> (DMatrix<f64>, Vec<f64>) {
    let scale: Vec<f64> = jacobian
        .column_iter()
        .map(|c| c.norm().max(NO_SCALE))
        .collect();
    let mut normal = jacobian.tr_mul(jacobian);
    for i in 0..scale.len() {
        for j in 0..scale.len() {
            normal[(i, j)] /= scale[i] * scale[j];
        }
        normal[(i, i)] += 1e-12;
    }
    (normal, scale)
}

/// Standard errors from `(JᵀJ)⁻¹·(Σ over blocks of gradient outer products)·(JᵀJ)⁻¹`: the fold blocks stay
/// independent even where the model or the noise covariance is not exact (Liang and Zeger 1986). The larger of
/// this and the model-based error is reported.
fn standard_errors(
    model: &mut Model,
    residual: &DVector<f64>,
    evaluate: &impl Fn(&Model) -> DVector<f64>,
    folds: &[Option<usize>],
) {
    let free = free_parameters(model);
    let jacobian = jacobian(model, &free, evaluate);
    if jacobian.ncols() == 0 {
        return;
    }
    let (normal, scale) = normal_matrix(&jacobian);
    let Some(inverse) = normal.try_inverse() else {
        return;
    };
    let freedom = residual.len() as f64 / (residual.len() as f64 - free.len() as f64).max(1.0);
    let sigma2 = (residual.norm_squared() / residual.len() as f64 * freedom).max(1.0);
    let clusters = clusters(folds);
    let groups = clusters.iter().max().map_or(0, |c| c + 1);
    let mut gradients = DMatrix::<f64>::zeros(free.len(), groups.max(1));
    for (row, &cluster) in clusters.iter().enumerate() {
        for j in 0..free.len() {
            gradients[(j, cluster)] += jacobian[(row, j)] / scale[j] * residual[row];
        }
    }
    let small_sample = groups as f64 / (groups as f64 - 1.0).max(1.0);
    let sandwich = &inverse * (&gradients * gradients.transpose()) * &inverse * small_sample;
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
    for (j, &k) in free.iter().enumerate() {
        let variance = (sigma2 * inverse[(j, j)]).max(sandwich[(j, j)]);
        // What the residual does not depend on at all is not known at all.
        let known = scale[j] > NO_SCALE;
        parameters[k].se = Some(if known {
            variance.max(0.0).sqrt() / scale[j]
        } else {
            f64::INFINITY
        });
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
