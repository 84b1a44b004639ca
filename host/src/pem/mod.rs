//! Identification by prediction errors, from the values that the weak form gives or any others.
//!
//! # The predictor
//! The state `x = (q, v, z)`, with the bristle deflection `z` for laws that have one, is carried from one reading to the next
//! by the step of the simulator itself, sticking and slipping included, and corrected by what the reading shows:
//! `x⁻ₖ = f(x⁺ₖ₋₁, uₖ₋₁; θ)`, `eₖ = yₖ − H·x⁻ₖ`, `x⁺ₖ = x⁻ₖ + Kₖ·eₖ`. The gains are those of an extended Kalman filter under
//! white torque noise, `P⁻ = A·P·Aᵀ + G·Gᵀ`, `s = H·P⁻·Hᵀ + r`, `K = P⁻·Hᵀ/s`, with `A = ∂f/∂x` by differences of the one step
//! and `G` what noise of one standard deviation does in it. That answers by itself what is corrected at rest: a contact
//! that sticks has `A` with a row of zeros for `v` and `G = 0`, so that it stays at rest until the drive, or noise of a
//! likely size, exceeds break-away; in presliding `A` couples `q`, `v` and `z` as the bristles do. A stationary gain, that
//! of the free double integrator, would push a resting axis and is not used.
//!
//! An encoder that repeats a count has said one thing: n equal readings have n times the variance each. Torque noise
//! is one number, found by likelihood (`share.rs`).
//!
//! # The objective
//! At given gains, half the sum of `eₖ²/sₖ` (Ljung 1999, sec. 3.2 and 7.2; Bohlin 2006; Kristensen, Madsen and
//! Jørgensen 2004). Rounds of an optimiser alternate with new gains. Far from the truth likelihood asks for much torque
//! noise, so that the predictor follows the readings and the objective has one valley; as the model gets better the noise
//! falls and the valley narrows: the homotopy of observer gains (Vyasarayani, Uchida, Carvalho and
//! `McPhee` 2011) without a schedule of its own. No trajectory runs on from an
//! error at a reversal, so that friction's discontinuities do not trap it.
//!
//! With a horizon there is no torque noise and prediction starts anew every so many seconds: the output error over windows,
//! free runs from measured states. Where noise of the sensor, and what it does to these states, makes up most of the
//! squared error that is left, the initial states are found as well, as multiple shooting does (Bock 1983), by the filter
//! recursively. Where it is the model that errs, the filter would take that for errors of the states.
//!
//! Which is better was tried with 2 % torque noise, 4096 counts a turn and 25 s at 1 kHz, standard deviation of an
//! estimate: `LuGre`'s bristle stiffness 0.5 % by innovations, 3.7 % by windows of 0.3 s and 0.6 % by windows of 1 s; inertia
//! under Coulomb friction 0.05 %, against 0.09 % by both and 0.26 % by windows of 0.1 s. Only for innovations are the standard errors honest, as torque noise makes
//! the errors within a window depend on each other. Hence the default.
//!
//! # Sensitivities
//! `∂x⁻ₖ/∂θ = A·∂x⁺ₖ₋₁/∂θ + ∂f/∂θ` and `∂x⁺ₖ/∂θ = (I − Kₖ·H)·∂x⁻ₖ/∂θ` at given gains, with derivatives of one step: differences
//! over a millisecond, which stays within one branch of the friction law but for the step in which it changes.
//!
//! # Optimisers
//! Levenberg-Marquardt, BFGS and Nelder-Mead (Nocedal and Wright 2006, ch. 10, 6 and 9), each a crate's, on coordinates
//! that are logarithms of what is positive (`chart.rs`). An optimum with a lower likelihood than the start is given up.
//!
//! # References
//! L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999. T. Bohlin, Practical Grey-box Process
//! Identification, Springer 2006. N. R. Kristensen, H. Madsen, S. B. Jørgensen, Parameter estimation in stochastic grey-box
//! models, Automatica 40, 2004. C. P. Vyasarayani, T. Uchida, A. Carvalho, J. `McPhee`,
//! Parameter identification in dynamic systems using the homotopy optimization approach, Multibody System Dynamics 26, 2011. J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006. P. R. Kalata,
//! The tracking index, IEEE Trans. Aerospace and Electronic Systems 20, 1984.

mod chart;
mod objective;
mod optimise;
mod predictor;
mod sequence;
mod share;

use nalgebra::DVector;
use serde::Serialize;

pub use chart::Chart;
use objective::{Objective, deviance};
pub use optimise::{Ended, LeastSquares, Optimiser, minimise};
use predictor::Pass;
use sequence::Sequence;
use share::{Correction, Share};

use crate::effects::Seat;
use crate::error::{Error, Result};
use crate::model::{Causality, Model, Term};
use crate::normal::Normal;
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
    if let Some(term) = start.terms.iter().find(|t| unpredicted(t)) {
        return Err(Error::Usage(format!(
            "[effects.{}] adds a hidden load or an error of the sensor, which the predictor does not follow; use --method dbi",
            term.effect.id()
        )));
    }
    let horizon = options.horizon.unwrap_or(f64::INFINITY);
    let pairs = recordings.iter().zip(tracks);
    let sequences: Vec<Sequence> = pairs.map(|(r, t)| Sequence::new(r, t, horizon)).collect();
    let chart = Chart::new(start);
    if chart.count() == 0 {
        return Err(Error::Usage("every parameter of the model is known, so there is nothing to estimate; write \"?\" for those that are to be found".to_owned()));
    }
    let correction = match options.horizon {
        None => Correction::Readings,
        Some(_) => Correction::Nothing,
    };
    let mut descent = Descent::new(&chart, &sequences, start, correction);
    let mut passes = descent.run(options, progress)?;
    if correction == Correction::Nothing && sensors_explain(&passes) {
        descent.share.correction = Correction::Starts;
        passes = descent.run(options, progress)?;
    }
    let Descent { share, at, .. } = &descent;
    let objective = Objective::new(&chart, &sequences, &passes);
    let mut model = chart.model(at);
    errors(&mut model, &chart, &objective, &sequences, &passes, at)?;
    let (before, rms) = descent.start;
    let outcome = Outcome {
        iterations: descent.iterations,
        rounds: descent.rounds,
        evaluations: descent.evaluations + share.evaluations,
        objective: Change {
            before,
            after: descent.objective,
        },
        prediction_rmse: Change {
            before: rms,
            after: rmse(&sequences, &passes),
        },
        torque_noise: share.value * sequences[0].noise,
        kept_start: descent.objective >= before,
        converged: descent.converged,
        reason: descent.reason,
    };
    Ok((model, outcome))
}

/// Whether sensors account for most of the squared errors of free runs: noise of the readings and of the states that these
/// start from.
fn sensors_explain(passes: &[Pass]) -> bool {
    let errors: f64 = passes.iter().flat_map(Pass::errors).map(|e| e * e).sum();
    let expected: f64 = passes.iter().map(|p| p.expected).sum();
    2.0 * expected > errors
}

/// Rounds of an optimiser, each with new gains.
struct Descent<'a> {
    chart: &'a Chart,
    sequences: &'a [Sequence<'a>],
    share: Share<'a>,
    /// The best coordinates so far, and the objective there.
    at: DVector<f64>,
    objective: f64,
    /// Objective and RMS error at the origin, under what corrects predictions now.
    start: (f64, f64),
    iterations: usize,
    rounds: usize,
    evaluations: usize,
    converged: bool,
    reason: String,
}

impl<'a> Descent<'a> {
    fn new(
        chart: &'a Chart,
        sequences: &'a [Sequence<'a>],
        start: &Model,
        correction: Correction,
    ) -> Self {
        Self {
            chart,
            sequences,
            share: Share::new(chart, sequences, start, correction),
            at: chart.origin(),
            objective: f64::INFINITY,
            start: (f64::INFINITY, f64::INFINITY),
            iterations: 0,
            rounds: 0,
            evaluations: 0,
            converged: false,
            reason: String::new(),
        }
    }

    /// Goes on from the best coordinates so far, or from the origin if that is better; returns the predictions at the best.
    fn run(&mut self, options: Options, progress: &dyn Fn(String)) -> Result<Vec<Pass>> {
        let origin = self.chart.origin();
        let mut passes = self.share.filter(&origin)?;
        self.start = (deviance(&passes), rmse(self.sequences, &passes));
        let mut best = (self.start.0, origin.clone());
        if self.at != origin {
            let reached = self.share.filter(&self.at)?;
            let now = deviance(&reached);
            if now < best.0 {
                (best, passes) = ((now, self.at.clone()), reached);
            }
        }
        let mut at = best.1.clone();
        for round in 1..=ROUNDS {
            if self.iterations >= options.most {
                break;
            }
            self.rounds += 1;
            let (next, gained) = self.round(options, &at, &passes);
            at = next;
            passes = self.share.filter(&at)?;
            let now = deviance(&passes);
            progress(format!("round {}: objective {now:.6}", self.rounds));
            if now < best.0 {
                best = (now, at.clone());
            }
            if gained < SETTLED {
                break;
            }
            if round == ROUNDS {
                (self.converged, self.reason) = (false, "most rounds reached".to_owned());
            }
        }
        (self.objective, self.at) = best;
        if self.at != at {
            passes = self.share.filter(&self.at)?;
        }
        Ok(passes)
    }

    /// One round at the gains of some predictions: where it leads, and what it gains.
    fn round(
        &mut self,
        options: Options,
        at: &DVector<f64>,
        passes: &[Pass],
    ) -> (DVector<f64>, f64) {
        let objective = Objective::new(self.chart, self.sequences, passes);
        let value = |at: &DVector<f64>| objective.residuals(at).map(|r| 0.5 * r.norm_squared());
        let old = value(at).unwrap_or(f64::INFINITY);
        let most = options.optimiser.patience();
        let most = most.min(options.most - self.iterations);
        let ended = minimise(options.optimiser, &objective, at, most);
        self.iterations += ended.iterations;
        self.evaluations += objective.evaluations();
        (self.converged, self.reason) = (ended.converged, ended.reason);
        let gained = old - value(&ended.at).unwrap_or(f64::INFINITY);
        let next = if gained > 0.0 {
            self.chart.within(&ended.at)
        } else {
            at.clone()
        };
        (next, gained)
    }
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
    let mut normal = Normal::new(&(jacobian * inverse), &residuals, &clusters);
    normal.drive_squares = drive * drive;
    uncertainty::assess(model, &free, &normal);
    Ok(())
}

/// Whether a term lies beyond the state that the predictor corrects.
fn unpredicted(term: &Term) -> bool {
    term.effect.seat() == Seat::Sensor || term.effect.divides()
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
