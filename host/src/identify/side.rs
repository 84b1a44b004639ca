//! The side of the equation of motion whose error is minimised.

use std::sync::Arc;

use super::GENERIC_RIDGE;
use crate::dictionary::Dictionary;
use crate::error::Result;
use crate::linear;
use crate::model::{Causality, Model};
use crate::problem::{Problem, Response};
use crate::scan::Inertias;
use crate::system::System;

/// The side of the equation whose error to minimise.
///
/// A disturbance torque must be independent of the regressors. It is independent of `u` where `u` is imposed, and of
/// the motion where the motion is. The wrong side attenuates: too large an inertia with acceleration as the response
/// (of a motion that a stiff loop imposes), too small a one with force. Where both sides agree, acceleration it is,
/// which keeps encoder noise out of the regressors; where they differ by more than [`DISAGREEMENT`], little of the
/// torque goes into acceleration, so the motion is next to imposed. A baseline that leaves much out disturbs alike,
/// hence the second comparison, with the tolerance of a rough model.
///
/// Also gives the inertias that the two sides, with all generic functions in, leave room for.
pub(super) fn choose_response(
    problem: &mut Problem,
    model: &Model,
    dictionary: &Dictionary,
    blocks: &[Option<usize>],
) -> Result<(Response, Option<Inertias>)> {
    const DISAGREEMENT: f64 = 1.1;
    const ROUGH_DISAGREEMENT: f64 = 2.0;
    if model.causality == Causality::Inverse {
        return Ok((Response::Force, None));
    }
    if model.parameters()[model.moving_inertia()].known {
        return Ok((Response::Acceleration, None));
    }
    let generic = |keep: &dyn Fn(&str) -> bool| -> Vec<Arc<Vec<f64>>> {
        dictionary
            .groups(problem)
            .into_iter()
            .filter(|g| keep(g.coordinate))
            .flat_map(|g| g.columns)
            .collect()
    };
    let all = generic(&|coordinate| !coordinate.starts_with("input"));
    let position = generic(&|coordinate| coordinate == "position");
    let mut inertia = |response: Response, generic: &[Arc<Vec<f64>>]| -> Result<Option<Told>> {
        problem.response = response;
        let system = System::new(problem, model)?;
        let columns = system.columns_and(generic.iter().map(|c| c.as_slice()));
        let score = linear::score(&system.response, &columns, blocks, GENERIC_RIDGE, None);
        // The inertia, or its inverse, is the first unknown of the system.
        Ok(score.map(|s| Told::new(response, s.beta[0], TWO_SIDED * s.jackknife(0))))
    };
    let mut by_both_sides = |generic: &[Arc<Vec<f64>>]| -> Result<(Option<Told>, Option<Told>)> {
        Ok((
            inertia(Response::Acceleration, generic)?,
            inertia(Response::Force, generic)?,
        ))
    };
    let (full, plain) = (by_both_sides(&all)?, by_both_sides(&[])?);
    let positive = |told: Option<Told>| told.filter(|told| told.value > 0.0);
    // A short recording may carry functions of position, gravity and springs among them, but not the whole dictionary. Where
    // the force side fails, so little of the torque accelerates that the other side's inertia, too large, is all there is.
    let least = positive(full.1)
        .or(positive(by_both_sides(&position)?.1))
        .or(positive(plain.1))
        .or(positive(full.0))
        .or(full.1.and_then(Told::small))
        .or(plain.1.and_then(Told::small));
    let most = positive(full.0);
    let inertias = least.map(|least| Inertias {
        least: least.least,
        fallback: least.value,
        most: most.map_or(f64::INFINITY, |most| most.most.max(least.most)),
    });
    let disagree = |sides: (Option<Told>, Option<Told>), tolerance: f64| match sides {
        (Some(Told { value: a, .. }), Some(Told { value: f, .. })) => {
            !(a > 0.0 && a < tolerance * f)
        }
        _ => false,
    };
    if disagree(full, DISAGREEMENT) || disagree(plain, ROUGH_DISAGREEMENT) {
        return Ok((Response::Force, inertias));
    }
    Ok((Response::Acceleration, inertias))
}

/// An inertia as one side of the equation tells it.
#[derive(Clone, Copy)]
struct Told {
    value: f64,
    /// What it may be at least and at most.
    least: f64,
    most: f64,
}

impl Told {
    /// An inertia that is too small to tell: one that came out negative by no more than it may err by lies between nothing and the
    /// most that it may be, of which half is taken. `None` if it is negative for certain.
    fn small(self) -> Option<Self> {
        (self.most > 0.0).then_some(Self {
            value: 0.5 * self.most,
            least: f64::MIN_POSITIVE,
            ..self
        })
    }

    /// By the coefficient of the acceleration, or of the drive, with what it may err by.
    fn new(response: Response, coefficient: f64, error: f64) -> Self {
        let (low, high) = (coefficient - error, coefficient + error);
        let positive = |x: f64| x.max(f64::MIN_POSITIVE);
        if response == Response::Force {
            return Self {
                value: coefficient,
                least: positive(low),
                most: high,
            };
        }
        Self {
            value: 1.0 / coefficient,
            least: positive(high).recip(),
            most: positive(low).recip(),
        }
    }
}

/// Student's t with the four degrees of freedom of five folds, 95 % on two sides.
const TWO_SIDED: f64 = 2.78;
