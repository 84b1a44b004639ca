//! A model as a system of weak-form equations: the linear problem, the residual, and the joint refinement.
//!
//! One equation, `J·F2[q] = k·Fu[u] − Σ c·B`, solved for one of two responses ([`Response`]):
//! - acceleration, `F2[q] = (k·Fu[u] − Σ c·B)/J`: encoder noise stays out of the regressors, and a disturbance torque is
//!   independent of an imposed `u`;
//! - force, `k·Fu[u] = J·F2[q] + Σ c·B`: a disturbance torque is independent of an imposed motion. Here encoder noise in
//!   the regressor `F2[q]` would bias `J`; its known energy is subtracted from the normal equations.

use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::linear::{self, Score};
use crate::model::{Causality, Model, Term};
use crate::noise::Noise;
use crate::problem::{Column, Problem, Response};
use crate::weak::Part;

/// What a coefficient of the linear problem stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unknown {
    InverseInertia,
    Inertia,
    Gain,
    Coulomb,
    Viscous,
    Coefficient { term: usize, index: usize },
}

/// The linear weak-form problem of a model whose inner parameters are given.
#[derive(Clone)]
pub struct System {
    /// Response of every row.
    pub response: Vec<f64>,
    /// One column for each unknown.
    pub columns: Vec<Vec<f64>>,
    unknowns: Vec<Unknown>,
    /// What a resisting torque is multiplied by to become a column.
    resisting: f64,
    /// A column that carries encoder noise, and the energy of that noise over the training rows.
    errors: Option<(usize, f64)>,
}

/// Folds of the training rows: blocks of this many seconds are dealt out in turn.
const BLOCK: f64 = 1.2;
/// Number of folds.
const FOLDS: usize = 5;

/// The cross-validation fold of every training row; `None` for held-out rows.
pub fn folds(problem: &Problem) -> Vec<Option<usize>> {
    let fold = |row: &crate::problem::Row| {
        let track = &problem.tracks[row.track];
        // Short recordings are cut into smaller blocks, so that every fold has its share of each.
        let training = crate::weak::TRAIN_SHARE * track.q.len() as f64 * track.period;
        let block = BLOCK.min(training / (2 * FOLDS) as f64);
        let time = row.centre as f64 * track.period;
        (row.part == Part::Train).then(|| (time / block) as usize % FOLDS)
    };
    problem.rows.iter().map(fold).collect()
}

/// Delay of the input in a model whose parameters have values.
pub fn delay(model: &Model) -> f64 {
    model.terms.iter().map(|t| t.effect.delay(&values(t))).sum()
}

/// Values of a term's parameters; unknown ones count as zero.
pub fn values(term: &Term) -> Vec<f64> {
    term.parameters
        .iter()
        .map(|p| p.value.unwrap_or(0.0))
        .collect()
}

fn add(sum: &mut [f64], factor: f64, column: &[f64]) {
    sum.iter_mut()
        .zip(column)
        .for_each(|(s, c)| *s += factor * c);
}

fn scaled(column: &[f64], factor: f64) -> Vec<f64> {
    column.iter().map(|c| factor * c).collect()
}

impl System {
    /// Sets up the problem. Inner parameters must have values.
    pub fn new(problem: &Problem, model: &Model) -> Result<Self> {
        check_scale(model)?;
        let known_value = |p: &crate::model::Parameter| if p.known { p.value } else { None };
        let inertia = known_value(&model.inertia);
        let gain = known_value(&model.gain);
        let input = problem.input(delay(model));
        let mut known = vec![0.0; problem.rows.len()];
        let mut resisting: Vec<(Unknown, Column)> = Vec::new();
        for (parameter, unknown, column) in [
            (&model.coulomb, Unknown::Coulomb, problem.coulomb()),
            (&model.viscous, Unknown::Viscous, problem.velocity()),
        ] {
            match known_value(parameter) {
                Some(value) => add(&mut known, value, &column),
                None => resisting.push((unknown, column)),
            }
        }
        for (index, term) in model.terms.iter().enumerate() {
            let (inner, coefficients) = term
                .effect
                .linear(&values(term), model.coulomb.value.unwrap_or(0.0));
            let fixed = term.parameters.iter().all(|p| p.known);
            for (k, column) in problem.effect(term.effect, inner).into_iter().enumerate() {
                if fixed {
                    add(&mut known, coefficients[k], &column);
                } else {
                    resisting.push((
                        Unknown::Coefficient {
                            term: index,
                            index: k,
                        },
                        column,
                    ));
                }
            }
        }
        Ok(match problem.response {
            Response::Acceleration => {
                Self::acceleration(problem, inertia, gain, &input, &known, resisting)
            }
            Response::Force => Self::force(
                problem,
                inertia,
                gain.unwrap_or(1.0),
                &input,
                &known,
                resisting,
            ),
        })
    }

    fn acceleration(
        problem: &Problem,
        inertia: Option<f64>,
        gain: Option<f64>,
        input: &[f64],
        known: &[f64],
        resisting: Vec<(Unknown, Column)>,
    ) -> Self {
        let scale = 1.0 / inertia.unwrap_or(1.0);
        let mut response = problem.acceleration.to_vec();
        let mut columns = Vec::new();
        let mut unknowns = Vec::new();
        match (inertia, gain) {
            (None, _) => {
                let mut drive = scaled(input, gain.unwrap_or(1.0));
                add(&mut drive, -1.0, known);
                columns.push(drive);
                unknowns.push(Unknown::InverseInertia);
            }
            (Some(_), Some(gain)) => {
                add(&mut response, -gain * scale, input);
                add(&mut response, scale, known);
            }
            (Some(_), None) => {
                add(&mut response, scale, known);
                columns.push(scaled(input, scale));
                unknowns.push(Unknown::Gain);
            }
        }
        for (unknown, column) in resisting {
            columns.push(scaled(&column, -scale));
            unknowns.push(unknown);
        }
        Self {
            response,
            columns,
            unknowns,
            resisting: -scale,
            errors: None,
        }
    }

    fn force(
        problem: &Problem,
        inertia: Option<f64>,
        gain: f64,
        input: &[f64],
        known: &[f64],
        resisting: Vec<(Unknown, Column)>,
    ) -> Self {
        let mut response = scaled(input, gain);
        add(&mut response, -1.0, known);
        let mut columns = Vec::new();
        let mut unknowns = Vec::new();
        match inertia {
            Some(inertia) => add(&mut response, -inertia, &problem.acceleration),
            None => {
                columns.push(problem.acceleration.to_vec());
                unknowns.push(Unknown::Inertia);
            }
        }
        for (unknown, column) in resisting {
            columns.push(column.to_vec());
            unknowns.push(unknown);
        }
        Self {
            response,
            columns,
            unknowns,
            resisting: 1.0,
            errors: None,
        }
    }

    /// The same system with response and columns whitened.
    #[must_use]
    pub fn whitened(&self, noise: &Noise) -> Self {
        Self {
            response: noise.whiten(&self.response),
            columns: self.columns.iter().map(|c| noise.whiten(c)).collect(),
            errors: self
                .unknowns
                .iter()
                .position(|u| *u == Unknown::Inertia)
                .map(|k| (k, noise.encoder_energy)),
            ..self.clone()
        }
    }

    /// The system with the columns of one more term, the last of a model; `whiten` is applied to the new columns.
    #[must_use]
    pub fn extended(
        &self,
        term: usize,
        columns: &[Column],
        whiten: impl Fn(&[f64]) -> Vec<f64>,
    ) -> Self {
        let mut system = self.clone();
        for (index, column) in columns.iter().enumerate() {
            system.columns.push(whiten(&scaled(column, self.resisting)));
            system.unknowns.push(Unknown::Coefficient { term, index });
        }
        system
    }

    /// A column that carries encoder noise, and the energy of that noise.
    pub fn errors(&self) -> Option<(usize, f64)> {
        self.errors
    }

    /// Fits the system over the rows that have a fold.
    pub fn score(&self, folds: &[Option<usize>]) -> Option<Score> {
        let columns: Vec<&[f64]> = self.columns.iter().map(Vec::as_slice).collect();
        linear::score(&self.response, &columns, folds, 0.0, self.errors)
    }

    /// Writes the physical parameters that a linear solution stands for into the model; known ones stay.
    ///
    /// Returns whether physics allows the coefficients of every effect.
    pub fn decode(&self, beta: &DVector<f64>, model: &mut Model) -> bool {
        let mut scale = 1.0;
        let mut coefficients: Vec<Vec<f64>> = model
            .terms
            .iter()
            .map(|t| vec![0.0; t.effect.width()])
            .collect();
        let (mut coulomb, mut viscous) = (model.coulomb.value, model.viscous.value);
        for (unknown, &value) in self.unknowns.iter().zip(beta.iter()) {
            match *unknown {
                Unknown::InverseInertia => {
                    scale = 1.0 / value;
                    model.inertia.value = Some(scale);
                }
                Unknown::Inertia => model.inertia.value = Some(value),
                Unknown::Gain => model.gain.value = Some(value),
                Unknown::Coulomb => coulomb = Some(value * scale),
                Unknown::Viscous => viscous = Some(value * scale),
                Unknown::Coefficient { term, index } => coefficients[term][index] = value * scale,
            }
        }
        (model.coulomb.value, model.viscous.value) = (coulomb, viscous);
        let coulomb = coulomb.unwrap_or(0.0);
        let mut admissible = scale > 0.0;
        for (term, coefficients) in model.terms.iter_mut().zip(&coefficients) {
            if term.parameters.iter().all(|p| p.known) {
                continue;
            }
            admissible &= term.effect.admissible(coefficients);
            let (inner, _) = term.effect.linear(&values(term), coulomb);
            for (parameter, value) in
                term.parameters
                    .iter_mut()
                    .zip(term.effect.named(inner, coefficients, coulomb))
            {
                if !parameter.known {
                    parameter.value = Some(value);
                }
            }
        }
        admissible
    }
}

/// The linear problem needs a scale: either inertia or gain must be known.
fn check_scale(model: &Model) -> Result<()> {
    if !model.gain.known && !model.inertia.known {
        return Err(Error::NotIdentifiable(
            "plant.gain and plant.inertia are both unknown: they scale together with every friction parameter, so no recording can tell them apart; give one of them (gain = 1.0 gives everything in units of u)".to_owned(),
        ));
    }
    if model.causality == Causality::Inverse && !model.gain.known {
        return Err(Error::NotIdentifiable(
            "plant.gain is unknown in an inverse recording: the measured force sets the scale of all parameters; give the gain (1.0 if u is a force)".to_owned(),
        ));
    }
    Ok(())
}

/// The weak-form residual of a model whose parameters all have values, on the side of the problem's response.
pub fn residual(problem: &Problem, model: &Model) -> Vec<f64> {
    let value = |p: &crate::model::Parameter| p.value.unwrap_or(0.0);
    let mut torque = scaled(&problem.input(delay(model)), value(&model.gain));
    add(&mut torque, -value(&model.coulomb), &problem.coulomb());
    add(&mut torque, -value(&model.viscous), &problem.velocity());
    for term in &model.terms {
        let (inner, coefficients) = term.effect.linear(&values(term), value(&model.coulomb));
        for (column, c) in problem.effect(term.effect, inner).iter().zip(coefficients) {
            add(&mut torque, -c, column);
        }
    }
    let inertia = value(&model.inertia);
    match problem.response {
        Response::Acceleration => {
            let mut residual = problem.acceleration.to_vec();
            add(&mut residual, -1.0 / inertia, &torque);
            residual
        }
        Response::Force => {
            add(&mut torque, -inertia, &problem.acceleration);
            torque
        }
    }
}

/// Factor from the unit of [`residual`] to a torque or force that drives the axis beyond the model.
pub fn torque_scale(problem: &Problem, model: &Model) -> f64 {
    match problem.response {
        Response::Acceleration => model.inertia.value.unwrap_or(1.0),
        Response::Force => -1.0,
    }
}

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
        residual.norm_squared() - model.inertia.value.unwrap_or(0.0).powi(2) * self.encoder_energy
    }

    fn gauss_newton(&self, model: &Model, residual: &DVector<f64>) -> Option<Vec<(usize, f64)>> {
        let free = free_parameters(model);
        let jacobian = jacobian(model, &free, self.evaluate);
        if jacobian.ncols() == 0 {
            return None;
        }
        let (mut normal, scale) = normal_matrix(&jacobian);
        let mut gradient = jacobian.tr_mul(residual);
        if free[0] == INERTIA {
            normal[(0, 0)] -= self.encoder_energy / (scale[0] * scale[0]);
            gradient[0] -= self.encoder_energy * model.inertia.value.unwrap_or(0.0);
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

/// Position of the inertia among [`Model::parameters`].
const INERTIA: usize = 0;

/// No negative inertia, and coefficients that physics allows.
fn is_physical(model: &Model) -> bool {
    model.inertia.value.is_none_or(|j| j >= 0.0) && inadmissible(model).is_none()
}

/// The first estimated term whose coefficients physics does not allow.
pub fn inadmissible(model: &Model) -> Option<usize> {
    let coulomb = model.coulomb.value.unwrap_or(0.0);
    let allowed = |t: &Term| t.effect.admissible(&t.effect.linear(&values(t), coulomb).1);
    model
        .terms
        .iter()
        .position(|t| t.parameters.iter().any(|p| !p.known) && !allowed(t))
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

/// `JᵀJ` with unit diagonal, and the column norms that were divided out.
fn normal_matrix(jacobian: &DMatrix<f64>) -> (DMatrix<f64>, Vec<f64>) {
    let scale: Vec<f64> = jacobian
        .column_iter()
        .map(|c| c.norm().max(1e-150))
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
        parameters[k].se = Some(variance.max(0.0).sqrt() / scale[j]);
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
