//! One effect tried on top of a model.

use super::select::CERTAIN;
use crate::effects::{Effect, Inner};
use crate::error::Result;
use crate::identify::Workbench;
use crate::linear::Score;
use crate::model::Model;
use crate::scan::{self, Ground};

/// The best that an effect can do on top of a model.
#[derive(Clone)]
pub(super) struct Trial {
    pub effect: &'static dyn Effect,
    /// Best values of the inner parameters; 0 where there is none.
    pub inner: Inner,
    /// Fall of the Bayesian information criterion, the search over the inner parameter paid for.
    pub delta_bic: f64,
    /// How much the cross-validated squared error falls.
    pub gain: Gain,
}

impl Trial {
    /// Whether its gain is no chance of a few folds.
    pub fn certain(&self) -> bool {
        self.gain.t >= CERTAIN
    }

    /// Whether it takes that share off the squared error and BIC falls so far.
    pub fn reaches(&self, share: f64, delta_bic: f64) -> bool {
        self.gain.share >= share && self.delta_bic >= delta_bic
    }
}

/// A model with numbers, its whitened system and its score: what candidates are compared with.
pub(super) struct Base<'a> {
    bench: &'a Workbench,
    ground: Ground<'a>,
}

/// How much the cross-validated squared error falls.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gain {
    /// As a share of the error before.
    pub share: f64,
    /// Mean fall in a fold over its standard error, Student's t with one degree of freedom less than folds.
    pub t: f64,
}

impl Gain {
    fn of(before: &Score, after: &Score) -> Self {
        let falls = before
            .by_fold
            .iter()
            .zip(&after.by_fold)
            .map(|(b, a)| b - a);
        let count = before.by_fold.len() as f64;
        let mean = falls.clone().sum::<f64>() / count;
        let variance = falls.map(|f| (f - mean).powi(2)).sum::<f64>() / (count - 1.0);
        Self {
            share: 1.0 - after.cross_validated / before.cross_validated,
            t: mean / (variance / count).sqrt().max(f64::MIN_POSITIVE),
        }
    }
}

impl<'a> Base<'a> {
    pub fn new(bench: &'a Workbench, model: &'a Model) -> Result<Option<Self>> {
        let ground = bench.ground(model)?;
        Ok(ground.map(|ground| Self { bench, ground }))
    }

    /// The score of the model.
    pub fn score(&self) -> &Score {
        &self.ground.score
    }

    /// Number of training rows.
    pub fn rows(&self) -> f64 {
        self.bench.folds.iter().flatten().count() as f64
    }

    /// Tries an effect with all values of its inner parameters; `None` if none of its parameters is physical.
    pub fn attempt(&self, effect: &'static dyn Effect) -> Result<Option<Trial>> {
        let Some(found) = self.ground.best(&scan::open(effect))? else {
            return Ok(None);
        };
        let parameters = effect.parameters().len() as f64;
        let penalty = parameters * self.rows().ln() + 2.0 * (found.tried as f64).ln();
        let before = &self.ground.score;
        Ok(Some(Trial {
            effect,
            inner: found.inner,
            delta_bic: before.chi2 - found.score.chi2 - penalty,
            gain: Gain::of(before, &found.score),
        }))
    }

    /// Cross-validated gain of generic columns on top of the model.
    pub fn generic_gain(&self, columns: &[Vec<f64>]) -> Gain {
        let all: Vec<&[f64]> = self
            .ground
            .system
            .columns
            .iter()
            .chain(columns)
            .map(Vec::as_slice)
            .collect();
        crate::linear::score(
            &self.ground.system.response,
            &all,
            &self.bench.folds,
            GENERIC_RIDGE,
            self.ground.system.errors(),
        )
        .map_or(Gain::default(), |s| Gain::of(&self.ground.score, &s))
    }

    /// The strongest line in the spectrum of the residual over time, as two columns.
    pub fn spectral_line(&self) -> Vec<Vec<f64>> {
        let ground = &self.ground;
        let hertz = ground.strongest_line(&ground.frequencies(SLOWEST_LINE));
        hertz.map_or_else(Vec::new, |f| ground.line(f))
    }
}

/// Periods within the recording from which on a line is one: the functions of time describe slower ones.
const SLOWEST_LINE: usize = 2;
/// Relative ridge on the generic columns: neighbouring hats nearly add up to columns of the model.
const GENERIC_RIDGE: f64 = 1e-5;
