//! The three experiments of the source, on many plants: each with and without adaptation of friction.
//!
//! One experiment, one file. A plant is drawn from a seed, its friction changes under way, and every way to control it runs on
//! the same plant with the same disturbance.

mod commission;
mod dc_motor;
mod finish;
mod mass_spring;
#[cfg(unix)]
mod on_board;
mod srv02;
mod summary;

#[cfg(unix)]
pub use on_board::on_board;
pub use summary::{Claim, Spread, Summary, Verdict};

use bristle_core::control::Parameters;
use clap::ValueEnum;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use crate::error::Result;
use crate::identify::{Options, identify};
use crate::model::{Model, Parameter, Status};
use crate::recording::Recording;
use crate::servo::{Make, OnHost, Sample, Servo, Step};

/// Which experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Experiment {
    /// Angular position of the Quanser SRV02 with an on-line Coulomb estimator
    Srv02,
    /// Angular velocity of a DC motor with simplified Dahl friction, adapted by DBI off-line
    DcMotor,
    /// A mass on a spring with friction, tuned by its own identification
    MassSpring,
}

/// One way to control a plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Way {
    /// The controller alone.
    Classic,
    /// With friction as it was identified before it changed.
    OffLine,
    /// With its level learned by the nonlinear observer.
    Observer,
    /// With its level learned from rows of the weak form.
    Rows,
    /// With friction identified again by DBI after it changed.
    Reidentified,
    /// With all gains computed anew, and nothing done about friction: what tuning alone is worth.
    Tuned,
    /// The same with the friction that was identified.
    SelfTuned,
}

impl Way {
    /// What a person reads.
    pub fn name(self) -> &'static str {
        match self {
            Self::Classic => "without",
            Self::OffLine => "identified before",
            Self::Observer => "learned by the observer",
            Self::Rows => "learned from weak-form rows",
            Self::Reidentified => "identified again by DBI",
            Self::Tuned => "tuned again, friction left alone",
            Self::SelfTuned => "identified and tuned again",
        }
    }
}

/// What one way achieved on one plant.
#[derive(Clone, Debug, Serialize)]
pub struct Merit {
    /// Which way.
    pub way: Way,
    /// RMS tracking error where the way has had its time since the change of friction, rad, rad/s or m.
    pub rms: f64,
    /// The largest there.
    pub peak: f64,
    /// RMS over all tracking, changes and all.
    pub rms_throughout: f64,
    /// RMS of the command while tracking, V or N.
    pub effort: f64,
    /// Answer to a step of the set point.
    pub step: Option<Step>,
    /// Error by the encoder at standstill, counts.
    pub standstill: Option<f64>,
    /// Way of the axis in the last second of the standstill, counts: more than one is hunting.
    pub travel: Option<f64>,
    /// Longest time from a change of friction until the level stays within 10 % of the truth, s; none if it never does.
    pub convergence: Option<f64>,
}

/// One plant under every way.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// Number of the plant, from 0.
    pub plant: u64,
    /// Coulomb level before and after each change, N·m or N.
    pub levels: Vec<f64>,
    /// What DBI said of the level, each time it was asked: the estimate over the truth, and its status.
    pub identified: Vec<(f64, String)>,
    /// What each way achieved.
    pub merits: Vec<Merit>,
}

/// A run for drawing.
pub struct Shown {
    /// Which way.
    pub way: Way,
    /// Its samples.
    pub samples: Vec<Sample>,
}

impl Shown {
    fn of(way: Way, servo: &Servo<'_>) -> Self {
        Self {
            way,
            samples: servo.samples().to_vec(),
        }
    }
}

/// A run under the firmware beside that on the host.
#[derive(Clone, Debug, Serialize)]
pub struct OnBoard {
    /// Which way.
    pub way: Way,
    /// Control periods.
    pub periods: usize,
    /// In how many of them counts, command and Coulomb level are the same bits.
    pub equal: usize,
    /// Sets of parameters that the running board took.
    pub sets: usize,
    /// What the firmware achieved.
    pub firmware: Merit,
    /// What the host achieved.
    pub host: Merit,
}

/// All plants of an experiment.
pub struct Campaign {
    /// Which experiment.
    pub experiment: Experiment,
    /// What its plants were drawn from.
    pub seed: u64,
    /// The number of the plant whose runs these are.
    pub drawn: u64,
    /// Sampling period, s.
    pub period: f64,
    /// rad or m to an encoder count.
    pub count: f64,
    /// Instants at which friction changes, s.
    pub changes: Vec<f64>,
    /// When tracking ends, and over which times a way is judged.
    pub judged: Vec<[f64; 2]>,
    /// Every plant.
    pub trials: Vec<Trial>,
    /// The runs of that plant.
    pub shown: Vec<Shown>,
    /// That plant's true levels over time, one to a sample.
    pub truth: Vec<f64>,
}

/// What a plant makes of an experiment.
struct Played {
    trial: Trial,
    shown: Vec<Shown>,
    truth: Vec<f64>,
}

/// The true Coulomb level at every sample up to `end`, of a plant whose levels follow one another at `changes`, s.
fn levels_over(levels: &[f64], changes: &[f64], end: f64, period: f64) -> Vec<f64> {
    let past = |t: f64| changes.iter().filter(|&&change| t >= change - 1e-9).count();
    let samples = (end / period).round() as usize;
    (0..samples)
        .map(|k| levels[past(k as f64 * period)])
        .collect()
}

/// Draws a plant and runs it under every way, by what is made to control it.
type Play = fn(u64, ChaCha8Rng, &mut dyn Make) -> Result<Played>;

/// What all plants of an experiment have in common.
struct Layout {
    period: f64,
    count: f64,
    changes: Vec<f64>,
    judged: Vec<[f64; 2]>,
}

impl Experiment {
    fn parts(self) -> (Layout, Play) {
        match self {
            Self::Srv02 => (srv02::layout(), srv02::play),
            Self::DcMotor => (dc_motor::layout(), dc_motor::play),
            Self::MassSpring => (mass_spring::layout(), mass_spring::play),
        }
    }

    /// One plant of those drawn from `seed`.
    fn play(self, plant: u64, seed: u64, make: &mut dyn Make) -> Result<Played> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(plant);
        self.parts().1(plant, rng, make)
    }
}

/// Runs an experiment on `plants` plants drawn from `seed`, on all cores, and keeps the runs of the one with the number
/// `drawn`.
pub fn run(experiment: Experiment, plants: u64, seed: u64, drawn: u64) -> Result<Campaign> {
    let layout = experiment.parts().0;
    let played: Vec<(Trial, Option<Played>)> = (0..plants)
        .into_par_iter()
        .map(|plant| {
            let played = experiment.play(plant, seed, &mut OnHost)?;
            // Only one is drawn; the samples of all would fill the memory.
            Ok((played.trial.clone(), (plant == drawn).then_some(played)))
        })
        .collect::<Result<_>>()?;
    let mut trials = Vec::new();
    let (mut shown, mut truth) = (Vec::new(), Vec::new());
    for (trial, kept) in played {
        trials.push(trial);
        if let Some(kept) = kept {
            (shown, truth) = (kept.shown, kept.truth);
        }
    }
    Ok(Campaign {
        experiment,
        seed,
        drawn,
        period: layout.period,
        count: layout.count,
        changes: layout.changes,
        judged: layout.judged,
        trials,
        shown,
        truth,
    })
}

/// Samples between instants.
fn between(samples: &[Sample], [from, to]: [f64; 2], period: f64) -> &[Sample] {
    let at = |t: f64| ((t / period).round() as usize).min(samples.len());
    &samples[at(from)..at(to)]
}

/// Tracking errors over the judged times and throughout, and the effort; the rest is left to the experiment.
fn tracked(way: Way, samples: &[Sample], layout: &Layout, end: f64) -> Merit {
    let judged: Vec<Sample> = layout
        .judged
        .iter()
        .flat_map(|&times| between(samples, times, layout.period).to_vec())
        .collect();
    let all = between(samples, [0.0, end], layout.period);
    let effort: f64 = all.iter().map(|s| f64::from(s.act.command).powi(2)).sum();
    Merit {
        way,
        rms: crate::servo::rms(&judged),
        peak: crate::servo::peak(&judged),
        rms_throughout: crate::servo::rms(all),
        effort: (effort / all.len() as f64).sqrt(),
        step: None,
        standstill: None,
        travel: None,
        convergence: None,
    }
}

/// How near to the truth a level has converged.
const NEAR: f64 = 0.1;

/// The longest time from the start or a change until the level stays near the truth until the next change.
fn convergence(samples: &[Sample], truth: &[f64], layout: &Layout, end: f64) -> Option<f64> {
    let mut instants = vec![0.0];
    instants.extend(&layout.changes);
    instants.push(end);
    let mut longest = 0.0_f64;
    for pair in instants.windows(2) {
        let at = |t: f64| ((t / layout.period).round() as usize).min(samples.len());
        let stretch = at(pair[0])..at(pair[1]);
        let off = |k: usize| (f64::from(samples[k].act.coulomb) / truth[k] - 1.0).abs() > NEAR;
        let last = stretch.clone().rev().find(|&k| off(k));
        if last == Some(stretch.end - 1) {
            return None;
        }
        let since = last.map_or(0, |k| k + 1 - stretch.start);
        longest = longest.max(since as f64 * layout.period);
    }
    Some(longest)
}

/// What DBI finds for a model on a recording: the model with values, if all that was asked for is told from zero.
fn found(recording: &Recording, model: &Model) -> Option<Model> {
    let (_, identified) =
        identify(std::slice::from_ref(recording), model, Options::default()).ok()?;
    Some(identified.model)
}

/// Whether an estimate may be put to use: the status `s` of the source.
fn usable(parameter: &Parameter) -> bool {
    matches!(
        parameter.status,
        Status::Given | Status::Identified | Status::WeaklyExcited
    ) && parameter.value.is_some_and(|value| value > 0.0)
}

/// An estimate over the truth, and its status, for the record.
fn said(parameter: &Parameter, truth: f64) -> (f64, String) {
    (
        parameter.value.unwrap_or(f64::NAN) / truth,
        parameter.status.to_string(),
    )
}

/// Without compensation and adaptation: the same gains otherwise.
fn classic(parameters: &Parameters<f64>) -> Parameters<f64> {
    let mut classic = *parameters;
    classic.compensation.method = bristle_core::control::Method::Off;
    classic.adaptation.method = bristle_core::control::Learning::Off;
    classic
}
