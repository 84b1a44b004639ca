//! Joint refinement of all unknown parameters on the whitened rows, and their standard errors.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::model::Model;
use crate::noise::Noise;
use crate::normal::{Normal, less_encoder};
use crate::problem::Problem;
use crate::system::{emphasis, inadmissible, residual};
use crate::uncertainty;

/// Most Gauss-Newton steps; from a weak-form start three or four settle it.
const STEPS: usize = 12;

/// How often a step is halved until it lowers the objective.
const HALVINGS: i32 = 6;

/// What a refinement ends with.
pub struct Refined {
    /// χ².
    pub chi2: f64,
    /// The term that all steps would leave with coefficients which physics does not allow, if that is why it ended.
    pub stopped_by: Option<usize>,
}

/// Refines all unknown parameters together by Gauss-Newton on the whitened training rows, within their bounds, and
/// gives each its standard error.
pub fn refine(
    problem: &Problem,
    model: &mut Model,
    noise: &Noise,
    blocks: &[Option<usize>],
) -> Refined {
    descend(model, noise, blocks, &|model| {
        counted(problem, model, noise, blocks)
    })
    .1
}

/// The same on rows that are known to be off by so much: what they would be without is fitted. Returns the normal equations
/// at the estimates.
pub fn refine_beside(
    offset: &[f64],
    problem: &Problem,
    model: &mut Model,
    noise: &Noise,
    blocks: &[Option<usize>],
) -> Normal {
    let offset = in_blocks(&noise.whiten(offset), blocks);
    descend(model, noise, blocks, &|model| {
        counted(problem, model, noise, blocks) - &offset
    })
    .0
}

/// What rows make of errors in them.
pub struct Answer {
    /// The step of the free parameters that the errors call for, less what encoder noise in the acceleration regressor adds.
    pub step: DVector<f64>,
    /// Its covariance, by the scatter of the gradients of clusters of rows.
    pub covariance: DMatrix<f64>,
    /// `(JᵀJ)⁻¹·Jᵀe` of other errors, a column each.
    pub follows: DMatrix<f64>,
}

/// What rows make of the first of some errors in them, and of all others. `None` if the rows do not determine it.
pub fn answer(
    errors: &[Vec<f64>],
    problem: &Problem,
    model: &Model,
    noise: &Noise,
    blocks: &[Option<usize>],
) -> Option<Answer> {
    let free = free_parameters(model);
    let jacobian = jacobian(model, &free, &|model: &Model| {
        counted(problem, model, noise, blocks)
    });
    let whitened = errors.iter().map(|e| in_blocks(&noise.whiten(e), blocks));
    let whitened: Vec<DVector<f64>> = whitened.collect();
    let (first, others) = whitened.split_first()?;
    let mut normal = Normal::new(&jacobian, first, &clusters(blocks));
    normal.encoder_energy = noise.encoder_energy;
    let step = normal.step(model, &free)?.into_iter().map(|(_, s)| s);
    let right = jacobian.tr_mul(&DMatrix::from_columns(others));
    let (_, sandwich, scale) = normal.covariances()?;
    Some(Answer {
        step: DVector::from_iterator(free.len(), step),
        covariance: DMatrix::from_fn(free.len(), free.len(), |i, j| {
            sandwich[(i, j)] / (scale[i] * scale[j])
        }),
        follows: normal.solve(model, &free, &right)?,
    })
}

/// How the residual of every row moves with each free parameter.
pub fn sensitivities(problem: &Problem, model: &Model) -> Vec<Vec<f64>> {
    let evaluate = |model: &Model| DVector::from_vec(residual(problem, model));
    let free = free_parameters(model).into_iter();
    free.map(|k| derivative(model, k, &evaluate).as_slice().to_vec())
        .collect()
}

/// The normal equations at the estimates, and how it ended.
fn descend(
    model: &mut Model,
    noise: &Noise,
    blocks: &[Option<usize>],
    evaluate: &(impl Fn(&Model) -> DVector<f64> + Sync),
) -> (Normal, Refined) {
    let objective = Objective {
        evaluate,
        encoder_energy: noise.encoder_energy,
    };
    let mut current = evaluate(model);
    let mut stopped_by = None;
    for _ in 0..STEPS {
        let Some(step) = objective.gauss_newton(model, &current) else {
            break;
        };
        let before = objective.value(model, &current);
        let Some((next, after)) = objective.line_search(model, &step, before) else {
            stopped_by = inadmissible(&stepped(model, &step, 0.5_f64.powi(HALVINGS - 1)));
            break;
        };
        *model = next;
        current = after;
        let now = objective.value(model, &current);
        if before - now < 1e-6 * now {
            break;
        }
    }
    let clusters = clusters(blocks);
    let normal = sums(model, &current, &clusters, evaluate);
    uncertainty::assess(model, &free_parameters(model), &normal);
    let chi2 = objective.value(model, &current);
    (normal, Refined { chi2, stopped_by })
}

/// Normal equations of the rows of a problem that have a cluster, at the present values of a model.
pub fn normal(
    problem: &Problem,
    model: &Model,
    noise: &Noise,
    clusters: &[Option<usize>],
) -> Normal {
    let evaluate = |model: &Model| counted(problem, model, noise, clusters);
    let numbers: Vec<usize> = clusters.iter().copied().flatten().collect();
    let mut normal = sums(model, &evaluate(model), &numbers, &evaluate);
    normal.encoder_energy = noise.encoder_energy;
    normal
}

/// What each cluster of rows adds to the estimates: `(JᵀJ)⁻¹·g`, `g` being the cluster's share of `Jᵀr`. One row for each
/// free parameter, one column for each cluster; `None` if the rows do not determine the estimates.
pub fn influences(
    problem: &Problem,
    model: &Model,
    noise: &Noise,
    clusters: &[Option<usize>],
) -> Option<DMatrix<f64>> {
    let evaluate = |model: &Model| counted(problem, model, noise, clusters);
    let (residual, free) = (evaluate(model), free_parameters(model));
    let jacobian = jacobian(model, &free, &evaluate);
    let count = clusters.iter().flatten().max()? + 1;
    let mut shares = DMatrix::<f64>::zeros(free.len(), count);
    for (row, &cluster) in clusters.iter().flatten().enumerate() {
        for j in 0..jacobian.ncols() {
            shares[(j, cluster)] += jacobian[(row, j)] * residual[row];
        }
    }
    // Columns of unit norm, as parameters differ in size by orders of magnitude.
    let scale = jacobian.column_iter().map(|c| 1.0 / c.norm());
    let scale = DMatrix::from_diagonal(&DVector::from_iterator(free.len(), scale));
    let unit = &jacobian * &scale;
    let inverse = (unit.tr_mul(&unit)).try_inverse()?;
    Some(&scale * inverse * &scale * shares)
}

fn sums(
    model: &Model,
    residual: &DVector<f64>,
    clusters: &[usize],
    evaluate: &(impl Fn(&Model) -> DVector<f64> + Sync),
) -> Normal {
    let jacobian = jacobian(model, &free_parameters(model), evaluate);
    let drive = derivative(model, GAIN, evaluate) * model.gain.value.unwrap_or(1.0);
    let mut normal = Normal::new(&jacobian, residual, clusters);
    normal.drive_squares = drive.norm_squared();
    normal
}

/// The whitened residual of the rows that have a block, with the [`emphasis`] of the model.
fn counted(
    problem: &Problem,
    model: &Model,
    noise: &Noise,
    blocks: &[Option<usize>],
) -> DVector<f64> {
    let problem = problem.training();
    let whitened = noise.whiten_training([residual(problem, model).as_slice()]);
    in_blocks(&whitened.concat(), blocks) * emphasis(problem, model)
}

/// The χ² of a model as it is, which is what [`refine`] lowers.
pub fn chi2(problem: &Problem, model: &Model, noise: &Noise, blocks: &[Option<usize>]) -> f64 {
    let residual = counted(problem, model, noise, blocks);
    less_encoder(residual.norm_squared(), model, noise.encoder_energy)
}

/// The rows that have a block, of values one for each row.
fn in_blocks(rows: &[f64], blocks: &[Option<usize>]) -> DVector<f64> {
    let counted = rows.iter().zip(blocks).filter(|(_, f)| f.is_some());
    DVector::from_iterator(blocks.iter().flatten().count(), counted.map(|(r, _)| *r))
}

/// The sum of squared whitened residuals, less what encoder noise in the acceleration regressor adds to it: `J²·E`.
struct Objective<'a, F> {
    evaluate: &'a F,
    encoder_energy: f64,
}

impl<F: Fn(&Model) -> DVector<f64> + Sync> Objective<'_, F> {
    fn value(&self, model: &Model, residual: &DVector<f64>) -> f64 {
        less_encoder(residual.norm_squared(), model, self.encoder_energy)
    }

    fn gauss_newton(&self, model: &Model, residual: &DVector<f64>) -> Option<Vec<(usize, f64)>> {
        let free = free_parameters(model);
        let jacobian = jacobian(model, &free, self.evaluate);
        let mut normal = Normal::new(&jacobian, residual, &[]);
        normal.encoder_energy = self.encoder_energy;
        normal.step(model, &free)
    }

    /// Halves the step until it lowers the objective; bounds are kept by projection.
    fn line_search(
        &self,
        model: &Model,
        step: &[(usize, f64)],
        before: f64,
    ) -> Option<(Model, DVector<f64>)> {
        let mut length = 1.0;
        for _ in 0..HALVINGS {
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

/// The model some share of a step on, its bounds kept by projection; `None` where that is not physical.
pub fn moved(model: &Model, step: &[(usize, f64)], share: f64) -> Option<Model> {
    Some(stepped(model, step, share)).filter(is_physical)
}

fn stepped(model: &Model, step: &[(usize, f64)], share: f64) -> Model {
    let mut next = model.clone();
    for &(k, s) in step {
        next.move_to(k, next.parameters()[k].value.unwrap_or(0.0) + share * s);
    }
    next
}

/// Position of the gain among [`Model::parameters`].
const GAIN: usize = 1;

/// No negative inertia, and coefficients that physics allows.
fn is_physical(model: &Model) -> bool {
    model.parameters()[model.moving_inertia()]
        .value
        .is_none_or(|j| j >= 0.0)
        && inadmissible(model).is_none()
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
    evaluate: &(impl Fn(&Model) -> DVector<f64> + Sync),
) -> DMatrix<f64> {
    let columns: Vec<_> = free
        .par_iter()
        .map(|&k| derivative(model, k, evaluate))
        .collect();
    if columns.is_empty() {
        DMatrix::zeros(evaluate(model).len(), 0)
    } else {
        DMatrix::from_columns(&columns)
    }
}

/// How the residual moves with parameter `k`.
fn derivative(model: &Model, k: usize, evaluate: &impl Fn(&Model) -> DVector<f64>) -> DVector<f64> {
    let value = model.parameters()[k].value.unwrap_or(0.0);
    // Central differences: the truncation error falls with the square of this relative step.
    let h = 1e-4 * value.abs().max(1e-6);
    let moved = |to: f64| {
        let mut moved = model.clone();
        moved.parameters_mut()[k].value = Some(to);
        evaluate(&moved)
    };
    (moved(value + h) - moved(value - h)) / (2.0 * h)
}

/// Consecutive training rows of one block form a cluster.
pub fn clusters(blocks: &[Option<usize>]) -> Vec<usize> {
    let mut cluster = 0;
    let mut last = None;
    let mut clusters = Vec::new();
    for block in blocks {
        if last.is_some() && last != Some(*block) {
            cluster += usize::from(block.is_some());
        }
        if block.is_some() {
            clusters.push(cluster);
            last = Some(*block);
        }
    }
    clusters
}
