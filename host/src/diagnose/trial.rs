//! One effect tried on top of a model.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::confirm::HeldOut;
use super::leftover;
use super::select::{CERTAIN, FLOOR, SOUGHT};
use crate::effects::{self, Effect, Inner, Search};
use crate::error::Result;
use crate::identify::Workbench;
use crate::linear::{self, Score};
use crate::model::{Model, Term};
use crate::noise::Noise;
use crate::scan::{self, Ground};
use crate::system;

/// The best that an effect can do on top of a model.
#[derive(Clone)]
pub(super) struct Trial {
    pub effect: &'static dyn Effect,
    /// Best values of the inner parameters; 0 where there is none.
    pub inner: Inner,
    /// Fall of the Bayesian information criterion, the search over the inner parameter paid for.
    pub delta_bic: f64,
    /// What was paid for parameters and search.
    pub price: f64,
    /// How much the cross-validated squared error falls.
    pub gain: Gain,
    /// Whether its gain is no chance of a few blocks.
    pub certain: bool,
    /// Whether the friction law has to be sought anew with it.
    pub reopens: bool,
}

impl Trial {
    /// Whether it takes that share off the squared error and BIC falls so far.
    pub fn reaches(&self, share: f64, delta_bic: f64) -> bool {
        self.gain.share >= share && self.delta_bic >= delta_bic
    }
}

/// A model with numbers, its whitened system and its score: what candidates are compared with.
pub(super) struct Base<'a> {
    pub bench: &'a Workbench,
    pub ground: Ground<'a>,
    /// See [`least_t`].
    pub least_t: f64,
}

/// How much the cross-validated squared error falls.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gain {
    /// As a share of the error before.
    pub share: f64,
    /// Mean fall in a block over its standard error, Student's t with one degree of freedom less than blocks.
    pub t: f64,
    /// The same of the logarithm of the error of a block, which blocks of very different errors count for alike.
    pub relative_t: f64,
}

impl Gain {
    pub fn of(before: &Score, after: &Score) -> Self {
        let blocks = before.by_block.iter().zip(&after.by_block);
        let falls: Vec<f64> = blocks.clone().map(|(b, a)| b - a).collect();
        let size = |error: &f64| error.max(f64::MIN_POSITIVE).ln();
        let ratios: Vec<f64> = blocks.map(|(b, a)| size(b) - size(a)).collect();
        Self {
            share: 1.0 - after.cross_validated / before.cross_validated,
            t: students_t(&falls),
            relative_t: students_t(&ratios),
        }
    }

    /// Whether it takes most of the error away, and from every block its share, be it that some have more than others: no
    /// chance, though it may be more than one kind of physics does. A name asks for more, unless what
    /// is named is rare.
    fn clear(&self, least_t: f64) -> bool {
        self.share >= MOST && self.relative_t >= least_t
    }
}

/// Student's t of a mean.
pub(super) fn students_t(x: &[f64]) -> f64 {
    let count = x.len() as f64;
    let mean = x.iter().sum::<f64>() / count;
    let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    mean / (variance / count).sqrt().max(f64::MIN_POSITIVE)
}

/// Whether a gap keeps less of the input from the load than what artefacts of sampling leave: it acts where the drive reverses, as
/// they do. Little of it is no sign that it does little: the blow at its end gives back what test functions have missed.
pub(super) fn negligible(bench: &Workbench, lost: f64) -> bool {
    lost < leftover::smallest(bench)
}

/// What generic functions do on top of a model.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Generic {
    /// Share of the cross-validated squared error that they take away.
    pub gain: f64,
    /// Whether that is enough, and no chance.
    pub certain: bool,
}

impl<'a> Base<'a> {
    pub fn new(bench: &'a Workbench, model: &'a Model) -> Result<Option<Self>> {
        Self::under(bench, model, &bench.noise)
    }

    /// The same with rows that are weighed by another noise, for [`Base::generic`] alone.
    pub fn under(bench: &'a Workbench, model: &'a Model, noise: &'a Noise) -> Result<Option<Self>> {
        let ground = bench.ground_under(model, noise)?;
        Ok(ground.map(|ground| Self {
            least_t: least_t(bench, ground.score.by_block.len()),
            bench,
            ground,
        }))
    }

    /// The same where the friction law may come out as physics does not allow: such trials say what may be in its place at best.
    #[must_use]
    pub fn leniently(self) -> Self {
        Self {
            ground: self.ground.leniently(),
            ..self
        }
    }

    /// The trial of an effect with the evidence of a model that has it, fitted in full.
    pub fn fitted(&self, trial: &Trial, model: &Model) -> Result<Option<Trial>> {
        let Some(with) = Base::new(self.bench, model)? else {
            return Ok(None);
        };
        let (before, after) = (self.score(), with.score());
        let gain = Gain::of(before, after);
        let term = model
            .terms
            .iter()
            .find(|t| effects::same_form(t.effect, trial.effect));
        let inner = term.map(|t| t.effect.linear(&system::values(t), model.scale()).0);
        Ok(Some(Trial {
            inner: inner.unwrap_or(trial.inner),
            delta_bic: before.chi2 - after.chi2 - trial.price,
            gain,
            certain: gain.t >= self.least_t,
            ..trial.clone()
        }))
    }

    /// The score of the model.
    pub fn score(&self) -> &Score {
        &self.ground.score
    }

    /// Number of training rows.
    pub fn rows(&self) -> f64 {
        self.bench.training_rows()
    }

    /// Tries an effect with all values of its inner parameters; `None` if none of its parameters is physical.
    pub fn attempt(&self, effect: &'static dyn Effect) -> Result<Option<Trial>> {
        self.attempt_as(&scan::open(effect))
    }

    /// The same with those values that the term leaves open.
    pub fn attempt_as(&self, term: &Term) -> Result<Option<Trial>> {
        let effect = term.effect;
        let Some(found) = self.ground.attempt(term)? else {
            return Ok(None);
        };
        let lost = self.ground.lost(term, found.inner);
        if lost.is_some_and(|lost| negligible(self.bench, lost)) {
            return Ok(None);
        }
        let price = self.ground.price(effect, found.tried);
        let before = &self.ground.score;
        let gain = Gain::of(before, &found.score);
        Ok(Some(Trial {
            effect,
            inner: found.inner,
            delta_bic: before.chi2 - found.score.chi2 - price,
            price,
            gain,
            certain: gain.t >= self.least_t
                || self.is_rare(effect, found.inner) && gain.clear(self.least_t),
            reopens: self.ground.lenient(),
        }))
    }

    /// Whether an effect gives some blocks of time much more of their error than others by its nature: it acts where the axis
    /// creeps, or for a while. That while lasts two blocks at least, which lie in two folds: what begins and ends within one is
    /// told by no other, and any blip passes for a load.
    fn is_rare(&self, effect: &dyn Effect, [on, off]: Inner) -> bool {
        let training = self.ground.training();
        let lasts = || off.min(training) - on >= 2.0 * system::block_length(training);
        effect.nuisance() || effect.search() == Search::Interval && lasts()
    }

    /// Columns under the noise that the rows are weighed by.
    pub fn whiten<'c>(&self, columns: impl IntoIterator<Item = &'c [f64]>) -> Vec<Vec<f64>> {
        self.ground.noise().whiten_all(columns)
    }

    /// What generic columns gain on top of the model.
    pub fn generic(&self, columns: &[Vec<f64>]) -> Generic {
        let system = &self.ground.system;
        let all = system.columns_and(columns.iter().map(Vec::as_slice));
        let fitted = system.score_of(self.ground.products_with(&all), GENERIC_RIDGE);
        let Some(with) = fitted else {
            return Generic::default();
        };
        let without = &self.ground.score;
        let gain = Gain::of(without, &with);
        // All blocks show it, or, if it is too rare for that, the held-out part does.
        let shows_again = || {
            let residual = |beta| linear::residual(&system.response, &all, beta);
            let (with, without) = (residual(&with.beta), residual(&without.beta));
            HeldOut::between(self.bench, &with, &without).shows_again()
        };
        Generic {
            gain: gain.share,
            certain: gain.share >= FLOOR
                && (gain.t >= self.least_t || gain.clear(self.least_t) || shows_again()),
        }
    }

    /// What the rows shortly before and after say of each row, if a torque times `carrier` comes and goes in spells, as a
    /// column.
    pub fn spells(&self, carrier: &[f64], residual: &[f64]) -> Vec<Vec<f64>> {
        vec![self.bench.noise.whiten(&self.nearby(carrier, residual))]
    }

    /// For each row the carrier times the mean of the residual along it over the rows shortly before and after, without those
    /// whose windows overlap, so that it has no noise in common with the row.
    fn nearby(&self, carrier: &[f64], residual: &[f64]) -> Vec<f64> {
        let problem = &self.bench.problem;
        let widths: Vec<f64> = problem.half_widths().collect();
        let count = problem.rows.len();
        let near = |k: usize, j: usize| {
            let (row, other) = (problem.rows[k], problem.rows[j]);
            let gap = APART * widths[row.track];
            let apart = (problem.time(row) - problem.time(other)).abs();
            (row.track == other.track && row.part == other.part && apart <= gap + SPELL)
                .then_some(apart > gap)
        };
        let told = |k: usize| {
            let forwards = (k + 1..count).map_while(|j| Some((j, near(k, j)?)));
            let backwards = (0..k).rev().map_while(|j| Some((j, near(k, j)?)));
            let (mut along, mut energy) = (0.0, 0.0);
            for (j, _) in forwards.chain(backwards).filter(|(_, counts)| *counts) {
                along += carrier[j] * residual[j];
                energy += carrier[j] * carrier[j];
            }
            let mean = if energy > 0.0 { along / energy } else { 0.0 };
            carrier[k] * mean
        };
        (0..count).map(told).collect()
    }

    /// What the rows shortly before and after say of each row, if a torque times `carrier` comes and goes, when noise is not
    /// whitened, which takes such a torque for noise of its own kind. Certain is what takes off the residual, which is `size` of
    /// the drive, as much as effects that are looked for, in all blocks or, if it is too rare for that, in the held-out part
    /// as well.
    pub fn wanders(&self, carrier: &[f64], residual: &[f64], size: f64) -> Generic {
        let sigma = &self.bench.noise.sigma;
        let over = |x: &[f64]| -> Vec<f64> { x.iter().zip(sigma).map(|(x, s)| x / s).collect() };
        let (z, carrier) = (over(residual), over(carrier));
        let told = self.nearby(&carrier, &z);
        let blocks = || {
            let rows = self.bench.blocks.iter().zip(z.iter().zip(&told));
            rows.filter_map(|(block, (z, told))| Some(((*block)?, *z, *told)))
        };
        let sum = |f: fn(f64, f64) -> f64| blocks().map(|(_, z, told)| f(z, told)).sum::<f64>();
        let slope = sum(|z, told| z * told) / sum(|_, told| told * told).max(f64::MIN_POSITIVE);
        if slope <= 0.0 {
            return Generic::default();
        }
        let rest: Vec<f64> = z.iter().zip(&told).map(|(z, t)| z - slope * t).collect();
        let count = self.bench.blocks.iter().flatten().max();
        let mut falls = vec![0.0; count.map_or(0, |last| last + 1)];
        for (block, (z, rest)) in self.bench.blocks.iter().zip(z.iter().zip(&rest)) {
            if let Some(block) = *block {
                falls[block] += z * z - rest * rest;
            }
        }
        let gain = falls.iter().sum::<f64>() / sum(|z, _| z * z);
        let shows_again = || HeldOut::between(self.bench, &rest, &z).shows_again();
        Generic {
            gain,
            certain: gain.sqrt() * size >= SOUGHT
                && (students_t(&falls) >= self.least_t || shows_again()),
        }
    }

    /// The strongest line in the spectrum of the residual over time, or of what there is of it along a carrier, as two columns.
    pub fn spectral_line(&self, carrier: Option<&[f64]>) -> Vec<Vec<f64>> {
        let ground = &self.ground;
        let hertz = ground.strongest_line(&ground.frequencies(), carrier);
        hertz.map_or_else(Vec::new, |f| ground.line(f, carrier))
    }
}

/// The t from which on a gain in so many blocks is no chance of a few of them.
///
/// Blocks of a short recording are short themselves and share much of their windows with their neighbours, so that what fits
/// those by chance fits them, too: the best of a whole catalogue is then to be told from chance by t alone, whose level all
/// effects share (Šidák, Journal of the American Statistical Association 62, 1967). Elsewhere what is too small to matter,
/// [`FLOOR`], keeps chance out.
fn least_t(bench: &Workbench, blocks: usize) -> f64 {
    let short = system::shortened(&bench.problem);
    let t = StudentsT::new(0.0, 1.0, blocks as f64 - 1.0).ok();
    let level = (1.0 - FALSE_ALARMS).powf(1.0 / effects::ALL.len() as f64);
    t.filter(|_| short)
        .map_or(CERTAIN, |t| t.inverse_cdf(level))
}

/// Share of the squared error from which on it is most of it.
const MOST: f64 = 0.5;
/// Share of clean short recordings in which chance may name anything.
const FALSE_ALARMS: f64 = 0.05;
/// Span on either side from which the residual of a row is told, s: shorter spells are noise, longer ones are seen in it.
const SPELL: f64 = 0.5;
/// Half-widths of windows from which on two rows have no noise in common: the windows themselves reach over two of them,
/// coloured torque noise a little further.
const APART: f64 = 3.0;
/// Relative ridge on the generic columns: neighbouring hats nearly add up to columns of the model.
const GENERIC_RIDGE: f64 = 1e-5;
