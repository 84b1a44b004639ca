//! How much torque noise the predictor reckons with: the one parameter of its gains, found by likelihood.
//!
//! Torque noise `σw` over a sample `T` and reading noise `σy` make the tracking index `Λ = σw·T²/(J·σy)` (Kalata 1984), and
//! the stationary filter of the free double integrator has the natural frequency `√Λ/T`: readings older than that say little.
//! For given parameters `Λ` minimises the concentrated `−2·ln L`. The common scale of all innovations is free.

use std::cell::RefCell;
use std::f64::consts::TAU;

use argmin::core::{CostFunction, Executor};
use argmin::solver::brent::BrentOpt;
use nalgebra::DVector;

use super::chart::Chart;
use super::objective::{deviance, filter};
use super::predictor::{Pass, Weighing};
use super::sequence::Sequence;
use crate::error::{Error, Result};
use crate::model::Model;

/// Range of the filter's natural frequency that is searched, Hz: from memory of seconds to the band in which an axis is
/// a rigid body and its drive an ideal one. Where readings are so good that likelihood would ask for more, what one-step
/// predictions get wrong is what the model leaves out above that band, current loops and resonances.
const BAND: (f64, f64) = (0.05, 7.0);
/// Relative precision of the tracking index: the likelihood is flat around its maximum.
const PRECISION: f64 = 0.3;
/// What corrects predictions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    /// Each reading, under the likeliest torque noise.
    Readings,
    /// Each reading of a window, as far as the state at its start is uncertain.
    Starts,
    /// Nothing: free runs from measured states.
    Nothing,
}

/// The search for the share of torque noise.
pub struct Share<'a> {
    chart: &'a Chart,
    sequences: &'a [Sequence<'a>],
    /// Torque noise over reading noise at a tracking index of one.
    unit: f64,
    /// Integrations between torque and reading, so that the tracking index is `(2π·f·T)` to this power.
    order: i32,
    /// What corrects predictions.
    pub correction: Correction,
    /// The share found last.
    pub value: f64,
    /// Passes over all recordings so far.
    pub evaluations: usize,
}

impl<'a> Share<'a> {
    /// Nothing found yet.
    pub fn new(
        chart: &'a Chart,
        sequences: &'a [Sequence<'a>],
        model: &Model,
        correction: Correction,
    ) -> Self {
        let period = sequences[0].period;
        let inertia = model.inertia.value.unwrap_or(1.0);
        let order = if sequences[0].sees[0] == 1.0 { 2 } else { 1 };
        Self {
            chart,
            sequences,
            unit: inertia / period.powi(order),
            order,
            correction,
            value: 0.0,
            evaluations: 0,
        }
    }

    /// Predictions, with the most likely share of torque noise where that corrects them.
    pub fn filter(&mut self, at: &DVector<f64>) -> Result<Vec<Pass>> {
        if self.correction == Correction::Readings {
            let index = |f: f64| f64::from(self.order) * (TAU * f * self.sequences[0].period).ln();
            let (mut low, mut high) = (index(BAND.0), index(BAND.1));
            if self.value > 0.0 {
                let last = (self.value / self.unit).ln();
                (low, high) = (low.max(last - 2.5), high.min(last + 2.5));
            }
            let likelihood = Likelihood {
                share: self,
                at,
                count: RefCell::new(0),
            };
            let solver = BrentOpt::new(low, high).set_tolerance(0.0, PRECISION);
            let run = Executor::new(&likelihood, solver)
                .configure(|s| s.max_iters(20))
                .run();
            let best = run.ok().and_then(|r| r.state.best_param);
            let index =
                best.ok_or_else(|| Error::Internal("no share of torque noise found".to_owned()))?;
            let count = *likelihood.count.borrow();
            self.evaluations += count;
            self.value = index.exp() * self.unit;
        }
        self.evaluations += 1;
        let weighing = match self.correction {
            Correction::Nothing => Weighing::Free,
            Correction::Readings | Correction::Starts => Weighing::Filter(self.value),
        };
        filter(self.chart, self.sequences, at, weighing)
    }
}

struct Likelihood<'a, 'b> {
    share: &'b Share<'a>,
    at: &'b DVector<f64>,
    count: RefCell<usize>,
}

impl CostFunction for &Likelihood<'_, '_> {
    type Param = f64;
    type Output = f64;
    fn cost(&self, index: &f64) -> std::result::Result<f64, argmin::core::Error> {
        *self.count.borrow_mut() += 1;
        let share = index.exp() * self.share.unit;
        Ok(deviance(&filter(
            self.share.chart,
            self.share.sequences,
            self.at,
            Weighing::Filter(share),
        )?))
    }
}
