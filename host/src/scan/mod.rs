//! The search for the inner parameters of one more effect on top of a model.

mod interval;
mod line;
mod memo;

use std::borrow::Cow;
use std::sync::OnceLock;

use rayon::prelude::*;

use crate::effects::{Effect, Inner, Search, Seat, Survey};
use crate::error::Result;
use crate::linear::{self, Products, Score};
use crate::model::{Model, Term};
use crate::noise::Noise;
use crate::problem::{Column, Problem};
use crate::projection::Projection;
use crate::system::{self, System};
use crate::weak::Part;
pub use interval::tell_later_ends;
pub use memo::Memo;

/// What the recordings give, whatever the model.
#[derive(Clone, Copy)]
pub struct Setting<'a> {
    /// Their weak form.
    pub problem: &'a Problem,
    /// Noise of the rows.
    pub noise: &'a Noise,
    /// Block of every training row: see [`linear::score`].
    pub blocks: &'a [Option<usize>],
    /// Room for the inertia, where it is known.
    pub inertias: Option<Inertias>,
    /// Hz from which on lines are sought.
    pub slowest: f64,
    /// What was found before, on these rows and with this noise.
    pub memo: &'a Memo,
}

/// A model with numbers, its whitened system and its score: what one more term is measured against.
pub struct Ground<'a> {
    setting: Setting<'a>,
    model: Cow<'a, Model>,
    raw: System,
    /// The whitened system of the model.
    pub system: System,
    products: Products,
    /// Its score.
    pub score: Score,
    /// What the recordings cover.
    pub survey: Survey,
    /// The same without the fall of its friction law: see [`Ground::with`].
    level: OnceLock<Option<Box<Ground<'a>>>>,
    /// Whether the friction law may come out as physics does not allow.
    lenient: bool,
}

/// The inertias that a recording leaves room for, whatever acts on the axis besides.
#[derive(Clone, Copy, Debug)]
pub struct Inertias {
    /// The force side's, which noise in the acceleration can only make too small, less what it may err by.
    pub least: f64,
    /// What a model falls back to that leaves so much out that its own inertia would be negative: the force side's.
    pub fallback: f64,
    /// The acceleration side's, which noise in the torque can only make too large, and what it may err by; infinite if the
    /// motion does not follow the drive.
    pub most: f64,
}

/// The best that a term can do.
#[derive(Clone)]
pub struct Found {
    /// Its inner parameters.
    pub inner: Inner,
    /// The score of the model with it.
    pub score: Score,
    /// How many values of the inner parameters were compared.
    pub tried: usize,
}

/// How many times what a term gains on a grid it may gain between its places, with room: half a resolution cell apart, a line loses
/// a fifth in the middle between two. What does not pay even so is not sought closer.
const CLOSER: f64 = 2.0;
/// Steps of golden-section refinement between the neighbours of the best value: a factor of 0.618 each.
const GOLDEN_STEPS: usize = 10;
/// Times that two inner parameters are refined by turns.
const TURNS: usize = 2;
/// Times that the error of a sensor is told anew where the axis stands without what it was told to be: where that settles, each
/// leaves the share of it that the error is of a radian.
const STRAIGHTENED: usize = 4;
/// Places on a grid that are scored side by side.
const BATCH: usize = 16;
/// Places on a grid from which on it is large.
const MANY: usize = 64;
/// What a gain may be larger than computed, as a factor that leaves room for much more than rounding.
const ROUNDING: f64 = 1.01;
/// An inertia beyond what a recording leaves room for by more than this factor is a sign that a term took its place.
const IMPLAUSIBLE: f64 = 3.0;

/// A model with a level that bristles can yield at: see [`Problem::levelled`].
fn with_level<'m>(problem: &Problem, model: &'m Model) -> Cow<'m, Model> {
    if model.level_at_rest() > 0.0 {
        return Cow::Borrowed(model);
    }
    Cow::Owned(problem.levelled(model.clone()))
}

impl<'a> Ground<'a> {
    /// Sets up the ground; `None` if the recording does not determine the model.
    pub fn new(setting: Setting<'a>, model: Cow<'a, Model>) -> Result<Option<Self>> {
        let raw = System::new(setting.problem, &model)?;
        let system = raw.whitened(setting.noise);
        let products = system.products(setting.blocks);
        let scored = products.and_then(|p| Some((system.score_of(p.clone(), 0.0)?, p)));
        Ok(scored.map(|(score, products)| Self {
            setting,
            raw,
            system,
            products,
            score,
            survey: setting.problem.survey(&with_level(setting.problem, &model)),
            model,
            level: OnceLock::new(),
            lenient: false,
        }))
    }

    /// The same where the friction law may come out as physics does not allow: one that was fitted to what is left out has bent to
    /// it, and once that is in, its inner parameters are wrong.
    #[must_use]
    pub fn leniently(self) -> Self {
        Self {
            lenient: true,
            ..self
        }
    }

    /// The noise that rows are weighed by.
    pub fn noise(&self) -> &Noise {
        self.setting.noise
    }

    /// Whether it is [`Ground::leniently`] so.
    pub fn lenient(&self) -> bool {
        self.lenient
    }

    /// The best that a term can do, its unknown inner parameters free within their bounds; `None` if no value of its
    /// parameters is physical.
    pub fn best(&self, term: &Term) -> Result<Option<Found>> {
        self.sought(term, true)
    }

    /// The same of a term that is tried: what would not pay is not sought closer than on a grid.
    pub fn attempt(&self, term: &Term) -> Result<Option<Found>> {
        self.sought(term, false)
    }

    fn sought(&self, term: &Term, closely: bool) -> Result<Option<Found>> {
        if let Some(plain) = term.effect.found_as() {
            let plain = Term {
                effect: plain,
                parameters: term.parameters[..plain.parameters().len()].to_vec(),
                in_law: term.in_law,
            };
            let shows = |found: &Found| term.effect.shows(found.inner, &self.survey);
            let Some(found) = self.sought(&plain, closely)?.filter(shows) else {
                return Ok(None);
            };
            let score = self.with(term, found.inner)?;
            return Ok(score.map(|score| Found { score, ..found }));
        }
        let search = || match term.effect.search() {
            Search::Grid => self.on_grid(term, closely),
            Search::Interval => self.in_time(term),
            Search::Line => self.on_line(term),
        };
        if self.lenient {
            return search();
        }
        let memo = self.setting.memo;
        memo.recall(&self.model, term, closely, search)
    }

    /// What a term costs by the Bayesian information criterion: its parameters, and the search among so many values of the inner ones.
    pub fn price(&self, effect: &dyn Effect, tried: usize) -> f64 {
        let rows = self.setting.blocks.iter().flatten().count() as f64;
        effect.parameters().len() as f64 * rows.ln() + 2.0 * (tried as f64).ln()
    }

    fn on_grid(&self, term: &Term, closely: bool) -> Result<Option<Found>> {
        let (grid, shapes) = (
            term.effect.grid(&self.survey),
            term.effect.shapes(&self.survey),
        );
        let each = |&shape: &f64| (grid.iter().enumerate()).map(move |(k, &x)| (k, [x, shape]));
        let tried: Vec<(usize, Inner)> = shapes.iter().flat_map(each).collect();
        shapes
            .iter()
            .for_each(|&shape| self.prepare(term, &grid, shape));
        let scores = self.scores(term, &tried)?;
        let mut best: Option<(usize, Found)> = None;
        for (&(k, inner), score) in tried.iter().zip(scores) {
            let Some(score) = score else { continue };
            if best.as_ref().is_none_or(|(_, b)| score.chi2 < b.score.chi2) {
                let found = Found {
                    inner,
                    score,
                    tried: tried.len(),
                };
                best = Some((k, found));
            }
        }
        let Some((k, mut found)) = best else {
            return Ok(None);
        };
        let most = CLOSER * (self.score.chi2 - found.score.chi2);
        if !closely && most < self.price(term.effect, found.tried) {
            return Ok(Some(found));
        }
        let whole = term.effect.inner().is_some_and(|k| {
            let quantity = term.effect.parameters()[k].quantity;
            quantity.is_whole(self.survey.motion)
        });
        let around =
            |k: usize, grid: &[f64]| (grid[k.max(1) - 1], grid[(k + 1).min(grid.len() - 1)]);
        if grid.len() > 1 && !whole {
            self.refine(term, 0, around(k, &grid), &mut found)?;
        }
        let shape = shapes.iter().position(|&shape| shape == found.inner[1]);
        if let Some(shape) = shape.filter(|_| shapes.len() > 1) {
            // Each depends on the other.
            for _ in 0..TURNS {
                self.refine(term, 1, around(shape, &shapes), &mut found)?;
                self.refine(term, 0, around(k, &grid), &mut found)?;
            }
        }
        Ok(Some(found))
    }

    /// The scores of a term on a grid, of those at least that may be the best.
    fn scores(&self, term: &Term, tried: &[(usize, Inner)]) -> Result<Vec<Option<Score>>> {
        let mut scores = vec![None; tried.len()];
        let mut best = f64::INFINITY;
        for batch in self.ranked(term, tried).chunks(BATCH) {
            if batch[0].0 > best {
                break;
            }
            let with = |&(_, at): &(f64, usize)| self.with(term, tried[at].1);
            let found: Vec<Option<Score>> = batch.par_iter().map(with).collect::<Result<_>>()?;
            for (&(_, at), score) in batch.iter().zip(found) {
                best = score.as_ref().map_or(best, |s| best.min(s.chi2));
                scores[at] = score;
            }
        }
        Ok(scores)
    }

    /// The places on a grid with the least χ² that a term may leave there, the best first: on a large one by the gain of its
    /// columns, which no bound on their coefficients and no law without its fall exceeds. It costs less than a score. Where that
    /// is not so, as noise in a regressor is taken off or bristles bend otherwise under another law, any may be the best.
    fn ranked(&self, term: &Term, tried: &[(usize, Inner)]) -> Vec<(f64, usize)> {
        let bounded = self.system.errors().is_none() && self.model.bristle_term().is_none();
        let width = term.effect.width();
        if tried.len() < MANY || width == 0 || !bounded {
            return (0..tried.len()).map(|at| (0.0, at)).collect();
        }
        let projection = self.projection();
        let scale = ROUNDING * self.system.emphasis().powi(2);
        let least = |(at, &(_, inner)): (usize, &(usize, Inner))| {
            let gain = projection.gain(&self.columns(&self.model_with(term, inner)));
            (self.score.chi2 - scale * gain, at)
        };
        let mut ranked: Vec<(f64, usize)> = tried.par_iter().enumerate().map(least).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked
    }

    /// Has the columns of a term ready over a whole grid of its scanned parameter, where they cost less together.
    fn prepare(&self, term: &Term, grid: &[f64], second: f64) {
        let inner = |&first: &f64| {
            let mut term = term.clone();
            set_inner(&mut term, [first, second]);
            let values = system::values(&term);
            term.effect.linear(&values, self.model.scale()).0
        };
        let inners: Vec<Inner> = grid.iter().map(inner).collect();
        let problem = self.setting.problem.training();
        let (direction, path) = (problem.direction(&self.model), system::path(&self.model));
        problem.waves(term.effect, &inners, &direction, &path);
    }

    /// Where a term can move the whitened residual of the training rows to: its columns, or, of a term that changes the way of
    /// the input, by how much it moves the residual alone. `None` if the recording does not determine the model with it.
    pub fn directions(&self, term: &Term, inner: Inner) -> Result<Option<Vec<Vec<f64>>>> {
        let model = self.model_with(term, inner);
        if term.effect.width() > 0 {
            return Ok(Some(self.columns(&model)));
        }
        let system = self.anew(&model)?;
        Ok(system.score(self.setting.blocks).map(|score| {
            let residual = |system: &System, beta| {
                linear::residual(&system.response, &system.columns_and([]), beta)
            };
            let before = residual(&self.system, &self.score.beta);
            let after = residual(&system, &score.beta);
            vec![before.iter().zip(after).map(|(b, a)| b - a).collect()]
        }))
    }

    /// The fit of the model over the training rows.
    pub fn projection(&self) -> Projection {
        let seen: Vec<bool> = self
            .setting
            .problem
            .rows
            .iter()
            .map(|row| row.part == Part::Train)
            .collect();
        Projection::new(&self.system.response, &self.system.columns, &seen)
    }

    /// The model with a term; inner parameters that the term leaves open get the given values, within its bounds. Bristles bend
    /// as they do under the level that they have: a static level that is open is that one.
    fn model_with(&self, term: &Term, inner: Inner) -> Model {
        let mut model = if term.bends() {
            with_level(self.setting.problem, &self.model).into_owned()
        } else {
            Model::clone(&self.model)
        };
        let mut term = term.clone();
        set_inner(&mut term, inner);
        model.begin_fall(&mut term);
        model.terms.push(term);
        model
    }

    fn columns(&self, model: &Model) -> Vec<Vec<f64>> {
        let columns = self.raw_columns(model);
        self.setting
            .noise
            .whiten_training(columns.iter().map(|c| c.as_slice()))
    }

    /// The columns of the last term of a model over the training rows.
    fn raw_columns(&self, model: &Model) -> Vec<Column> {
        let term = model.terms.last();
        term.map_or_else(Vec::new, |term| {
            system::columns(self.setting.problem.training(), model, term)
        })
    }

    /// The whitened system of a model with another way of the input, over the training rows.
    fn anew(&self, model: &Model) -> Result<System> {
        let raw = System::new(self.setting.problem.training(), model)?;
        let before = [&self.raw, &self.system];
        Ok(raw.whitened_as(before, self.setting.noise, self.setting.blocks))
    }

    /// The system with the last term of a model besides.
    fn extended(&self, model: &Model) -> System {
        let columns = self.raw_columns(model);
        self.system.extended(model, &columns, self.setting.noise)
    }

    /// The score of the model with a term, if physics allows the coefficients that it comes out with: if need be without the
    /// fall of its friction law, which may have bent to what the term explains.
    fn with(&self, term: &Term, inner: Inner) -> Result<Option<Score>> {
        let mut model = self.model_with(term, inner);
        let (mut system, mut score);
        if term.effect.width() == 0 {
            if system::path(&model).gap.width > 0.0 {
                // What a gap keeps back follows from the numbers of the model, which without it are far from the truth.
                let first = self.anew(&model)?;
                if let Some(score) = first.score(self.setting.blocks) {
                    first.decode(&score.beta, &mut model);
                }
            }
            system = self.anew(&model)?;
            score = system.score(self.setting.blocks);
        } else {
            system = self.extended(&model);
            score = self.scored(&system);
            if term.effect.seat() == Seat::Sensor {
                (system, score) = self.straightened(model.clone(), (system, score));
            }
        }
        let Some(score) = score else { return Ok(None) };
        let admissible = system.decode(&score.beta, &mut model);
        if admissible || self.lenient && system::inadmissible_beside_law(&model).is_none() {
            let score = self.emphasised(score, &system, &model);
            return Ok(self.plausible(&model).then_some(score));
        }
        match system::inadmissible(&model).map(|k| self.without_fall(k)) {
            Some(level) => level?.map_or(Ok(None), |level| level.with(term, inner)),
            None => Ok(None),
        }
    }

    /// The system and the score of a model whose last term is the error of a sensor, told anew where the axis stands without what
    /// it was told to be, as long as that lowers χ².
    fn straightened(
        &self,
        mut model: Model,
        (mut system, mut score): (System, Option<Score>),
    ) -> (System, Option<Score>) {
        for _ in 0..STRAIGHTENED {
            let Some(before) = &score else { break };
            if !system.decode(&before.beta, &mut model) {
                break;
            }
            let next = self.extended(&model);
            let anew = self.scored(&next);
            let better =
                |s: &Score| s.chi2 < before.chi2 && next.decode(&s.beta, &mut model.clone());
            let Some(anew) = anew.filter(better) else {
                break;
            };
            (system, score) = (next, Some(anew));
        }
        (system, score)
    }

    /// A score of a system with the emphasis of the model that it led to, whose gain may ripple as it did not before.
    fn emphasised(&self, score: Score, system: &System, model: &Model) -> Score {
        if !model.terms.iter().any(system::ripples) {
            return score;
        }
        let emphasis = system::emphasis(self.setting.problem.training(), model);
        score.times((emphasis / system.emphasis()).powi(2))
    }

    /// The ground without a term if that is the fall of its friction law and not given.
    fn without_fall(&self, term: usize) -> Result<Option<&Self>> {
        let fall = |t: &Term| t.in_law && t.falls() && t.parameters.iter().any(|p| !p.known);
        if !self.model.terms.get(term).is_some_and(fall) {
            return Ok(None);
        }
        if self.level.get().is_none() {
            let mut model = Model::clone(&self.model);
            model.terms.remove(term);
            let level = Self::new(self.setting, Cow::Owned(model))?;
            // Another thread may have been faster, with the same.
            let _ = self.level.set(level.map(Box::new));
        }
        Ok(self.level.get().and_then(Option::as_deref))
    }

    /// The score of the system with further columns after its own.
    fn scored(&self, extended: &System) -> Option<Score> {
        extended.score_of(self.products_with(&extended.columns_and([])), 0.0)
    }

    /// The products of the model's columns with others, which come after them in `columns`.
    pub fn products_with(&self, columns: &[&[f64]]) -> Products {
        let response = &self.system.response;
        self.products.with(response, columns, self.setting.blocks)
    }

    /// Length of the training part, s.
    pub fn training(&self) -> f64 {
        self.setting.problem.training_share() * self.survey.duration
    }

    /// Share of the input that a gap keeps from the load, if a term is one: see [`system::lost`].
    pub fn lost(&self, term: &Term, inner: Inner) -> Option<f64> {
        system::lost(self.setting.problem, &self.model_with(term, inner))
    }

    /// Whether a term left the inertia what it was, within reason: one next to proportional to the drive can take the
    /// place of all acceleration.
    fn plausible(&self, model: &Model) -> bool {
        let inertia = |model: &Model| model.parameters()[model.moving_inertia()].clone();
        let (now, before) = (inertia(model), inertia(&self.model));
        let (Some(Inertias { least, most, .. }), Some(value)) = (self.setting.inertias, now.value)
        else {
            return true;
        };
        let off = |value: f64| (value / value.clamp(least, most)).ln().abs();
        now.known
            || off(value) <= IMPLAUSIBLE.ln()
            || before.value.is_some_and(|before| off(value) <= off(before))
    }

    /// Golden-section search for one inner parameter within a bracket, from what was found so far.
    fn refine(
        &self,
        term: &Term,
        which: usize,
        (mut low, mut high): (f64, f64),
        best: &mut Found,
    ) -> Result<()> {
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let at = |value: f64, best: &Found| -> Result<(Inner, Option<Score>)> {
            let mut inner = best.inner;
            inner[which] = value;
            Ok((inner, self.with(term, inner)?))
        };
        let chi2 = |s: &Option<Score>| s.as_ref().map_or(f64::INFINITY, |s| s.chi2);
        let points =
            |low: f64, high: f64| [high - golden * (high - low), low + golden * (high - low)];
        let [mut left, mut right] = {
            let [l, r] = points(low, high);
            [at(l, best)?, at(r, best)?]
        };
        for _ in 0..GOLDEN_STEPS {
            let better = if chi2(&left.1) < chi2(&right.1) {
                high = right.0[which];
                let next = at(points(low, high)[0], best)?;
                right = std::mem::replace(&mut left, next);
                &right
            } else {
                low = left.0[which];
                let next = at(points(low, high)[1], best)?;
                left = std::mem::replace(&mut right, next);
                &left
            };
            if let Some(score) = better.1.as_ref().filter(|s| s.chi2 < best.score.chi2) {
                (best.inner, best.score) = (better.0, score.clone());
            }
        }
        Ok(())
    }
}

/// Gives the inner parameters that a term leaves open values, within its bounds.
pub fn set_inner(term: &mut Term, inner: Inner) {
    let second = term.effect.shape();
    for (at, value) in [term.effect.inner(), second].into_iter().zip(inner) {
        if let Some(parameter) = at.map(|k| &mut term.parameters[k])
            && !parameter.known
        {
            parameter.value = Some(parameter.clamp(value));
        }
    }
}

/// An effect of which nothing is known.
pub fn open(effect: &'static dyn Effect) -> Term {
    Term {
        effect,
        parameters: vec![crate::model::Parameter::unknown(); effect.parameters().len()],
        in_law: false,
    }
}
