//! Identification by prediction errors, from the values that the weak form gives (or any others).
//!
//! DRAFT
mod chart;
mod objective;
mod optimise;
mod predictor;
mod sequence;

use std::cell::RefCell;
use std::f64::consts::TAU;

use argmin::core::{CostFunction, Executor};
use argmin::solver::brent::BrentOpt;
use nalgebra::DVector;
use serde::Serialize;

pub use chart::Chart;
use objective::{Objective, deviance, filter};
pub use optimise::{Ended, LeastSquares, Optimiser, minimise};
use predictor::Pass;
use sequence::Sequence;

use crate::error::{Error, Result};
use crate::model::{Causality, Model};
use crate::recording::Recording;
use crate::uncertainty;
use crate::weak::Track;

/// How to go about it.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Which optimiser.
    pub optimiser: Optimiser,
    /// Length of output-error windows, s; `None` predicts one sample ahead.
    pub horizon: Option<f64>,
    /// Most iterations of the optimiser, over all rounds.
    pub most: usize,
}

/// What a minimisation did.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Iterations of the optimiser, over all rounds.
    pub iterations: usize,
    /// Rounds, each with gains of its own.
    pub rounds: usize,
    /// Runs over all recordings, those with derivatives included.
    pub evaluations: usize,
    /// `−2·ln L` over the number of readings, but for a constant, before and after.
    pub objective: Change,
    /// RMS of the prediction errors, in the unit of the measurement, before and after.
    pub prediction_rmse: Change,
    /// Standard deviation of the torque noise that the predictor reckons with, N·m or N over one sample.
    pub torque_noise: f64,
    /// Whether nothing better than the start was found, which was kept.
    pub kept_start: bool,
    /// Whether it stopped because nothing was left to gain.
    pub converged: bool,
    /// Why it stopped.
    pub reason: String,
}

/// A figure before and after.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Change {
    /// At the start.
    pub before: f64,
    /// At the end.
    pub after: f64,
}

/// Range of the filter's natural frequency that is searched, Hz: from memory of seconds to the band in which an axis is
/// a rigid body and its drive an ideal one. Where readings are so good that likelihood would ask for more, what one-step
/// predictions get wrong is what the model leaves out above that band, current loops and resonances.
const BAND: (f64, f64) = (0.05, 7.0);
/// Relative precision of the tracking index: the likelihood is flat around its maximum.
const PRECISION: f64 = 0.3;
/// Rounds at most; each finds new gains.
const ROUNDS: usize = 20;
/// A round that gains less than this many units of `−ln L` was the last.
const SETTLED: f64 = 0.05;
/// Length of the blocks that standard errors take to be independent, s.
const BLOCK: f64 = 1.2;

/// Minimises the prediction errors of a model on the training part of recordings, from its present values.
///
/// Parameters that are not `known` and have a value are estimated and get standard errors. The model stays as it was,
/// but for these, where nothing better is found.
pub fn estimate(
    recordings: &[Recording],
    tracks: &[Track],
    start: &Model,
    options: Options,
    progress: &dyn Fn(String),
) -> Result<(Model, Outcome)> {
    if start.causality == Causality::Inverse {
        return Err(Error::Usage("this recording is one of an imposed motion (plant.causality = \"inverse\"), which leaves nothing to predict; use --method dbi".to_owned()));
    }
    let horizon = options.horizon.unwrap_or(f64::INFINITY);
    let pairs = recordings.iter().zip(tracks);
    let sequences: Vec<Sequence> = pairs.map(|(r, t)| Sequence::new(r, t, horizon)).collect();
    let chart = Chart::new(start);
    if chart.len() == 0 {
        return Err(Error::Usage("every parameter of the model is known, so there is nothing to estimate; write \"?\" for those that are to be found".to_owned()));
    }
    let mut at = chart.origin();
    let mut share = Share::new(&chart, &sequences, start, options.horizon.is_some());
    let mut passes = share.filter(&at)?;
    let before = (deviance(&passes), rmse(&sequences, &passes));
    let mut best = (before.0, at.clone());
    let (mut iterations, mut rounds, mut evaluations) = (0, 0, 0);
    let (mut converged, mut reason) = (false, String::new());
    while rounds < ROUNDS && iterations < options.most {
        rounds += 1;
        let objective = Objective::new(&chart, &sequences, &passes);
        let value = |at: &DVector<f64>| objective.residuals(at).map(|r| 0.5 * r.norm_squared());
        let old = value(&at).unwrap_or(f64::INFINITY);
        let most = options.optimiser.patience().min(options.most - iterations);
        let ended = minimise(options.optimiser, &objective, &at, most);
        iterations += ended.iterations;
        evaluations += objective.evaluations();
        (converged, reason) = (ended.converged, ended.reason);
        let gained = old - value(&ended.at).unwrap_or(f64::INFINITY);
        if gained > 0.0 {
            at = ended.at;
        }
        passes = share.filter(&at)?;
        let now = deviance(&passes);
        progress(format!("round {rounds}: objective {now:.6}"));
        if now < best.0 {
            best = (now, at.clone());
        }
        if gained < SETTLED {
            break;
        }
        if rounds == ROUNDS {
            (converged, reason) = (false, "most rounds reached".to_owned());
        }
    }
    if best.1 != at {
        at = best.1;
        passes = share.filter(&at)?;
    }
    let objective = Objective::new(&chart, &sequences, &passes);
    let mut model = chart.model(&at);
    errors(&mut model, &chart, &objective, &sequences, &passes, &at)?;
    let outcome = Outcome {
        iterations,
        rounds,
        evaluations: evaluations + share.evaluations,
        objective: Change {
            before: before.0,
            after: best.0,
        },
        prediction_rmse: Change {
            before: before.1,
            after: rmse(&sequences, &passes),
        },
        torque_noise: share.value * sequences[0].noise,
        kept_start: best.0 >= before.0,
        converged,
        reason,
    };
    Ok((model, outcome))
}

fn rmse(sequences: &[Sequence], passes: &[Pass]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for (sequence, pass) in sequences.iter().zip(passes) {
        sum += pass
            .errors()
            .map(|e| (e * sequence.noise).powi(2))
            .sum::<f64>();
        count += pass.residuals.len();
    }
    (sum / f64::from(u32::try_from(count.max(1)).unwrap_or(u32::MAX))).sqrt()
}

/// Standard errors of the parameters from the derivatives of the innovations.
fn errors(
    model: &mut Model,
    chart: &Chart,
    objective: &Objective,
    sequences: &[Sequence],
    passes: &[Pass],
    at: &DVector<f64>,
) -> Result<()> {
    let Some((residuals, jacobian)) = objective.linearised(at) else {
        return Ok(());
    };
    let mut clusters = Vec::with_capacity(residuals.len());
    let mut first = 0;
    for (sequence, pass) in sequences.iter().zip(passes) {
        let t = &sequence.recording.t;
        let block = |k: usize| ((t[k] - t[0]) / BLOCK) as usize;
        clusters.extend(pass.samples.iter().map(|&k| first + block(k)));
        first = clusters.last().map_or(0, |c| c + 1);
    }
    let Some(inverse) = chart.rates(at).try_inverse() else {
        return Ok(());
    };
    let drive = drive(model, sequences, passes)?;
    let free = chart.parameters();
    uncertainty::assess(
        model,
        &free,
        &(jacobian * inverse),
        &residuals,
        &clusters,
        drive,
    );
    Ok(())
}

/// Norm of what the drive contributes to the innovations, which are linear in its gain.
fn drive(model: &Model, sequences: &[Sequence], passes: &[Pass]) -> Result<f64> {
    let mut driven = model.clone();
    for parameter in driven.parameters_mut() {
        parameter.known = true;
    }
    driven.gain.known = false;
    let chart = Chart::new(&driven);
    let at = chart.origin();
    let found = Objective::new(&chart, sequences, passes).linearised(&at);
    let (_, jacobian) =
        found.ok_or_else(|| Error::Internal("no axis at the estimate".to_owned()))?;
    // The coordinate is the logarithm of the gain.
    Ok(jacobian.norm())
}

/// The search for the share of torque noise.
struct Share<'a> {
    chart: &'a Chart,
    sequences: &'a [Sequence<'a>],
    /// Torque noise over reading noise at a tracking index of one.
    unit: f64,
    fixed: bool,
    value: f64,
    evaluations: usize,
}

impl<'a> Share<'a> {
    fn new(chart: &'a Chart, sequences: &'a [Sequence<'a>], model: &Model, fixed: bool) -> Self {
        let period = sequences[0].period;
        let inertia = model.inertia.value.unwrap_or(1.0);
        let positions = sequences[0].sees[0] == 1.0;
        Self {
            chart,
            sequences,
            unit: inertia / period / if positions { period } else { 1.0 },
            fixed,
            value: 0.0,
            evaluations: 0,
        }
    }

    /// The filter with the most likely share of torque noise.
    fn filter(&mut self, at: &DVector<f64>) -> Result<Vec<Pass>> {
        if !self.fixed {
            let index = |f: f64| 2.0 * (TAU * f * self.sequences[0].period).ln();
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
        filter(self.chart, self.sequences, at, self.value)
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
            share,
        )?))
    }
}
