//! How much a candidate would tell.

use nalgebra::DMatrix;

use super::candidates::Candidate;
use crate::axis::Axis;
use crate::error::Result;
use crate::fit::HORIZON;
use crate::model::Model;
use crate::simulate::{self, State};

/// What predictions are compared in.
pub(super) struct Judge {
    /// Position, or velocity where only that is measured.
    pub positions: bool,
    /// RMS error of predictions over windows of 1 s.
    pub noise: f64,
}

/// A step for differences, in standard errors; a parameter without an error moves by a tenth.
const STEP: f64 = 0.5;

impl Judge {
    /// Smallest, over the rivals, of the RMS difference of the predictions in standard deviations.
    pub fn discrimination(
        &self,
        model: &Model,
        rivals: &[Model],
        candidate: &Candidate,
    ) -> Result<f64> {
        let own = self.own(model, candidate)?;
        let mut least = f64::INFINITY;
        for rival in rivals {
            let other = self.responses(rival, candidate)?;
            let squares = own.iter().zip(&other).map(|(a, b)| (a - b).powi(2));
            let rms = (squares.sum::<f64>() / own.len() as f64).sqrt();
            least = least.min(rms / self.noise);
        }
        Ok(least)
    }

    /// By which factor the standard error of a parameter falls, if errors are independent so far and the errors of
    /// predictions within a window are one.
    pub fn improvement(&self, model: &Model, target: usize, candidate: &Candidate) -> Result<f64> {
        let free = free(model);
        let own = self.own(model, candidate)?;
        let windows = (candidate.t[candidate.t.len() - 1] / HORIZON).max(1.0);
        let weight = (windows / own.len() as f64).sqrt() / self.noise;
        let mut sensitivities = DMatrix::zeros(own.len(), free.len());
        for (column, &k) in free.iter().enumerate() {
            let (value, se) = uncertain(model, k);
            let mut moved = model.clone();
            moved.move_to(k, value + STEP * se);
            let step = moved.parameters()[k].value.unwrap_or_default() - value;
            if step == 0.0 {
                continue;
            }
            let other = self.responses(&moved, candidate)?;
            for (row, (a, b)) in own.iter().zip(&other).enumerate() {
                // In units of the standard error so far.
                sensitivities[(row, column)] = weight * (b - a) / (step / se);
            }
        }
        let information =
            sensitivities.tr_mul(&sensitivities) + DMatrix::identity(free.len(), free.len());
        let at = free.iter().position(|k| *k == target).unwrap_or_default();
        Ok(information
            .try_inverse()
            .map_or(0.0, |inverse| 1.0 / inverse[(at, at)].sqrt()))
    }

    /// Responses of the model that the candidate was made with. From any of its states a run goes on as it did, where they are
    /// all that the axis remembers.
    fn own(&self, model: &Model, candidate: &Candidate) -> Result<Vec<f64>> {
        if Axis::new(model)?.remembers_more() {
            return self.responses(model, candidate);
        }
        Ok(candidate.states.iter().map(|s| self.seen(s)).collect())
    }

    fn seen(&self, state: &State) -> f64 {
        if self.positions { state.q } else { state.v }
    }

    /// Responses over windows of 1 s, each from the state that the candidate reaches there.
    fn responses(&self, model: &Model, candidate: &Candidate) -> Result<Vec<f64>> {
        let axis = Axis::new(model)?;
        let recording = candidate.recording();
        let mut responses = Vec::with_capacity(candidate.t.len());
        let mut first = 0;
        while first < candidate.t.len() {
            let horizon = candidate.t[first] + HORIZON - 1e-9;
            let end = candidate.t.partition_point(|t| *t < horizon).max(first + 1);
            let from = candidate.states[first];
            let states = simulate::run_axis(&axis, &recording, first, end - 1, from);
            responses.extend(states.iter().map(|s| self.seen(s)));
            first = end;
        }
        Ok(responses)
    }
}

/// Parameters that are estimated and can be moved a little.
fn free(model: &Model) -> Vec<usize> {
    let movable = |k: &usize| !model.parameters()[*k].known && !model.is_whole(*k);
    (0..model.parameters().len()).filter(movable).collect()
}

/// Value and standard error; a tenth of the value where the error has no bound.
fn uncertain(model: &Model, k: usize) -> (f64, f64) {
    let parameter = model.parameters()[k];
    let value = parameter.value.unwrap_or_default();
    let fallback = (0.1 * value.abs()).max(1e-6);
    let se = parameter.se.filter(|se| se.is_finite() && *se > 0.0);
    (value, se.unwrap_or(fallback))
}

/// The estimated parameter with the largest error as a share of its value.
pub(super) fn least_certain(model: &Model) -> Option<usize> {
    let share = |k: &usize| {
        let (value, se) = uncertain(model, *k);
        let bounded = model.parameters()[*k].se.is_some_and(f64::is_finite);
        if bounded {
            se / value.abs().max(f64::MIN_POSITIVE)
        } else {
            f64::INFINITY
        }
    };
    free(model)
        .into_iter()
        .max_by(|a, b| share(a).total_cmp(&share(b)))
}
