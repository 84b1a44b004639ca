//! One effect tried on top of a model.

use crate::effects::{Effect, Survey};
use crate::error::Result;
use crate::identify::Workbench;
use crate::linear::Score;
use crate::model::Model;
use crate::problem::Direction;
use crate::system::System;

/// The best that an effect can do on top of a model.
#[derive(Clone)]
pub(super) struct Trial {
    pub effect: &'static dyn Effect,
    /// Best value of the inner parameter; 0 where there is none.
    pub inner: f64,
    /// Fall of the Bayesian information criterion, the search over the inner parameter paid for.
    pub delta_bic: f64,
    /// How much the cross-validated squared error falls.
    pub gain: Gain,
}

/// A model with numbers, its whitened system and its score: what candidates are compared with.
pub(super) struct Base<'a> {
    bench: &'a Workbench,
    model: &'a Model,
    system: System,
    pub score: Score,
    survey: Survey,
    direction: Direction,
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

/// Steps of golden-section refinement between the grid neighbours of the best inner value: a factor of 0.618 each.
const GOLDEN_STEPS: usize = 10;

impl<'a> Base<'a> {
    pub fn new(bench: &'a Workbench, model: &'a Model) -> Result<Option<Self>> {
        let system = System::new(&bench.problem, model)?.whitened(&bench.noise);
        let Some(score) = system.score(&bench.folds) else {
            return Ok(None);
        };
        Ok(Some(Self {
            bench,
            model,
            system,
            score,
            survey: bench.problem.survey(model),
            direction: bench.problem.direction(model),
        }))
    }

    /// Number of training rows.
    pub fn rows(&self) -> f64 {
        self.bench.folds.iter().flatten().count() as f64
    }

    /// Tries an effect over its whole grid; `None` if no value of its parameters is physical.
    pub fn attempt(&self, effect: &'static dyn Effect) -> Result<Option<Trial>> {
        let grid = effect.grid(&self.survey);
        let mut best: Option<(usize, Score)> = None;
        for (k, &inner) in grid.iter().enumerate() {
            let Some(score) = self.with(effect, inner)? else {
                continue;
            };
            if best.as_ref().is_none_or(|(_, b)| score.chi2 < b.chi2) {
                best = Some((k, score));
            }
        }
        let Some((k, mut score)) = best else {
            return Ok(None);
        };
        let mut inner = grid[k];
        let whole = effect
            .inner()
            .is_some_and(|k| effect.parameters()[k].quantity.is_whole(self.model.motion));
        if grid.len() > 1 && !whole {
            let bracket = (grid[k.max(1) - 1], grid[(k + 1).min(grid.len() - 1)]);
            (inner, score) = self.refine(effect, bracket, (inner, score))?;
        }
        let parameters = (effect.width()
            + usize::from(effect.inner().is_some())
            + usize::from(effect.shape().is_some())) as f64;
        let penalty = parameters * self.rows().ln() + 2.0 * (grid.len() as f64).ln();
        Ok(Some(Trial {
            effect,
            inner,
            delta_bic: self.score.chi2 - score.chi2 - penalty,
            gain: Gain::of(&self.score, &score),
        }))
    }

    /// Cross-validated gain of generic columns on top of the model.
    pub fn generic_gain(&self, columns: &[Vec<f64>]) -> Gain {
        let all: Vec<&[f64]> = self
            .system
            .columns
            .iter()
            .chain(columns)
            .map(Vec::as_slice)
            .collect();
        crate::linear::score(
            &self.system.response,
            &all,
            &self.bench.folds,
            GENERIC_RIDGE,
            self.system.errors(),
        )
        .map_or(Gain::default(), |s| Gain::of(&self.score, &s))
    }

    /// The strongest line in the spectrum of the residual over time, as two columns.
    ///
    /// Frequencies are half a resolution cell apart, up to where the windows pass a tenth of the amplitude.
    pub fn spectral_line(&self) -> Vec<Vec<f64>> {
        let mut residual = self.system.response.clone();
        for (column, beta) in self.system.columns.iter().zip(self.score.beta.iter()) {
            residual
                .iter_mut()
                .zip(column)
                .for_each(|(r, c)| *r -= beta * c);
        }
        let problem = &self.bench.problem;
        let times: Vec<f64> = problem.rows.iter().map(|&row| problem.time(row)).collect();
        let (start, end) = times
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| {
                (a.min(*t), b.max(*t))
            });
        let step = 0.5 / (end - start).max(f64::MIN_POSITIVE);
        let most = ((0.8 / self.survey.half_width) / step) as usize;
        let pair = |hertz: f64| {
            let wave = |f: fn(f64) -> f64| {
                let rows: Vec<f64> = times
                    .iter()
                    .map(|t| f(std::f64::consts::TAU * hertz * (t - start)))
                    .collect();
                self.bench.noise.whiten(&rows)
            };
            vec![wave(f64::sin), wave(f64::cos)]
        };
        let power = |columns: &[Vec<f64>]| {
            let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            crate::linear::score(&residual, &columns, &self.bench.folds, GENERIC_RIDGE, None)
                .map_or(f64::INFINITY, |s| s.chi2)
        };
        // The lowest frequencies are drifts, which the functions of time describe.
        let frequencies = (4..most.max(5)).map(|k| k as f64 * step);
        let best = frequencies
            .map(|f| (power(&pair(f)), f))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(Vec::new, |(_, f)| pair(f))
    }

    fn with(&self, effect: &'static dyn Effect, inner: f64) -> Result<Option<Score>> {
        let mut model = self.model.with_effect(effect);
        if let (Some(k), Some(term)) = (effect.inner(), model.terms.last_mut()) {
            term.parameters[k].value = Some(inner);
        }
        let shape = effect.shape().map_or(0.0, |(_, start)| start);
        if let (Some((k, start)), Some(term)) = (effect.shape(), model.terms.last_mut()) {
            term.parameters[k].value = Some(start);
        }
        let system = if effect.width() == 0 {
            System::new(&self.bench.problem, &model)?.whitened(&self.bench.noise)
        } else {
            let columns = self
                .bench
                .problem
                .effect(effect, [inner, shape], &self.direction);
            self.system.extended(self.model.terms.len(), &columns, |c| {
                self.bench.noise.whiten(c)
            })
        };
        let score = system.score(&self.bench.folds);
        Ok(score.filter(|s| system.decode(&s.beta, &mut model)))
    }

    fn refine(
        &self,
        effect: &'static dyn Effect,
        bracket: (f64, f64),
        start: (f64, Score),
    ) -> Result<(f64, Score)> {
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let (mut low, mut high) = bracket;
        let mut best = start;
        for _ in 0..GOLDEN_STEPS {
            let (left, right) = (high - golden * (high - low), low + golden * (high - low));
            let (at_left, at_right) = (self.with(effect, left)?, self.with(effect, right)?);
            let chi2 = |s: &Option<Score>| s.as_ref().map_or(f64::INFINITY, |s| s.chi2);
            let toward_left = chi2(&at_left) < chi2(&at_right);
            if toward_left {
                high = right;
            } else {
                low = left;
            }
            let (inner, score) = if toward_left {
                (left, at_left)
            } else {
                (right, at_right)
            };
            if let Some(score) = score.filter(|s| s.chi2 < best.1.chi2) {
                best = (inner, score);
            }
        }
        Ok(best)
    }
}

/// Relative ridge on the generic columns: neighbouring hats nearly add up to columns of the model.
const GENERIC_RIDGE: f64 = 1e-5;
