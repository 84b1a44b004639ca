//! A model as a system of weak-form equations: the linear problem and the residual.
//!
//! One equation, `J·F2[q] = k·Fu[u] − Σ c·B`, solved for one of two responses ([`Response`]):
//! - acceleration, `F2[q] = (k·Fu[u] − Σ c·B)/J`: encoder noise stays out of the regressors, and a disturbance torque is
//!   independent of an imposed `u`;
//! - force, `k·Fu[u] = J·F2[q] + Σ c·B`: a disturbance torque is independent of an imposed motion. Here encoder noise in
//!   the regressor `F2[q]` would bias `J`; its known energy is subtracted from the normal equations.

use nalgebra::DVector;

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
        let direction = problem.direction(model);
        let mut known = vec![0.0; problem.rows.len()];
        let mut resisting: Vec<(Unknown, Column)> = Vec::new();
        for (parameter, unknown, column) in [
            (
                &model.coulomb,
                Unknown::Coulomb,
                problem.coulomb(&direction),
            ),
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
            let columns = problem.effect(term.effect, inner, &direction);
            for (k, column) in columns.into_iter().enumerate() {
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
            let named = term.effect.named(inner, coefficients, coulomb);
            let scanned = term.effect.inner();
            for (k, (parameter, value)) in term.parameters.iter_mut().zip(named).enumerate() {
                if !parameter.known && Some(k) != scanned {
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
    let direction = problem.direction(model);
    let mut torque = scaled(&problem.input(delay(model)), value(&model.gain));
    add(
        &mut torque,
        -value(&model.coulomb),
        &problem.coulomb(&direction),
    );
    add(&mut torque, -value(&model.viscous), &problem.velocity());
    for term in &model.terms {
        let (inner, coefficients) = term.effect.linear(&values(term), value(&model.coulomb));
        let columns = problem.effect(term.effect, inner, &direction);
        for (column, c) in columns.iter().zip(coefficients) {
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

/// The first estimated term whose coefficients physics does not allow.
pub fn inadmissible(model: &Model) -> Option<usize> {
    let coulomb = model.coulomb.value.unwrap_or(0.0);
    let allowed = |t: &Term| t.effect.admissible(&t.effect.linear(&values(t), coulomb).1);
    model
        .terms
        .iter()
        .position(|t| t.parameters.iter().any(|p| !p.known) && !allowed(t))
}
