//! The search for the inner parameters of one more effect on top of a model.

use rayon::prelude::*;

use crate::effects::{Effect, Inner, Search, Survey};
use crate::error::Result;
use crate::linear::{self, Products, Score};
use crate::model::{Model, Term};
use crate::noise::Noise;
use crate::phasor;
use crate::problem::Problem;
use crate::projection::Projection;
use crate::system::{self, System};
use crate::weak::{Part, TRAIN_SHARE};

/// A model with numbers, its whitened system and its score: what one more term is measured against.
pub struct Ground<'a> {
    problem: &'a Problem,
    noise: &'a Noise,
    blocks: &'a [Option<usize>],
    model: &'a Model,
    inertias: Option<Inertias>,
    /// Hz from which on lines are sought.
    slowest: f64,
    /// The whitened system of the model.
    pub system: System,
    products: Products,
    /// Its score.
    pub score: Score,
    /// What the recordings cover.
    pub survey: Survey,
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
pub struct Found {
    /// Its inner parameters.
    pub inner: Inner,
    /// The score of the model with it.
    pub score: Score,
    /// How many values of the inner parameters were compared.
    pub tried: usize,
}

/// Steps of golden-section refinement between the neighbours of the best value: a factor of 0.618 each.
const GOLDEN_STEPS: usize = 10;
/// Blocks of time at whose borders an interval may begin and end.
const BLOCKS: usize = 64;
/// Frequencies up to this number over the half-width pass the test functions with a tenth of their amplitude.
const PASSED: f64 = 0.8;
/// An inertia beyond what a recording leaves room for by more than this factor is a sign that a term took its place.
const IMPLAUSIBLE: f64 = 3.0;
/// Resolution cells below which a line is a drift.
const SLOWEST_LINE: usize = 2;

impl<'a> Ground<'a> {
    /// Sets up the ground; `None` if the recording does not determine the model.
    pub fn new(
        problem: &'a Problem,
        noise: &'a Noise,
        blocks: &'a [Option<usize>],
        model: &'a Model,
        inertias: Option<Inertias>,
        slowest: f64,
    ) -> Result<Option<Self>> {
        let system = System::new(problem, model)?.whitened(noise);
        let products = system.products(blocks);
        let scored = products.and_then(|p| Some((system.score_of(p.clone(), 0.0)?, p)));
        Ok(scored.map(|(score, products)| Self {
            problem,
            noise,
            blocks,
            model,
            inertias,
            slowest,
            system,
            products,
            score,
            survey: problem.survey(model),
        }))
    }

    /// The best that a term can do, its unknown inner parameters free within their bounds; `None` if no value of its
    /// parameters is physical.
    pub fn best(&self, term: &Term) -> Result<Option<Found>> {
        match term.effect.search() {
            Search::Grid => self.on_grid(term),
            Search::Interval => self.in_time(term),
            Search::Line => self.on_line(term),
        }
    }

    fn on_grid(&self, term: &Term) -> Result<Option<Found>> {
        let second = term.effect.shape().map_or(0.0, |(_, start)| start);
        let grid = term.effect.grid(&self.survey);
        self.prepare(term, &grid, second);
        let scores: Vec<Option<Score>> = grid
            .par_iter()
            .map(|&first| self.with(term, [first, second]))
            .collect::<Result<_>>()?;
        let mut best: Option<(usize, Found)> = None;
        for (k, (&first, score)) in grid.iter().zip(scores).enumerate() {
            let Some(score) = score else { continue };
            if best.as_ref().is_none_or(|(_, b)| score.chi2 < b.score.chi2) {
                let found = Found {
                    inner: [first, second],
                    score,
                    tried: grid.len(),
                };
                best = Some((k, found));
            }
        }
        let Some((k, mut found)) = best else {
            return Ok(None);
        };
        let whole = term.effect.inner().is_some_and(|k| {
            let quantity = term.effect.parameters()[k].quantity;
            quantity.is_whole(self.survey.motion)
        });
        if grid.len() > 1 && !whole {
            let bracket = (grid[k.max(1) - 1], grid[(k + 1).min(grid.len() - 1)]);
            self.refine(term, 0, bracket, &mut found)?;
        }
        Ok(Some(found))
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
        let (direction, path) = (self.problem.direction(self.model), system::path(self.model));
        self.problem.waves(term.effect, &inners, &direction, &path);
    }

    /// All intervals between the borders of equal blocks of time: with the projected columns of the blocks at hand, the
    /// gain of every interval follows from cumulative sums.
    fn in_time(&self, term: &Term) -> Result<Option<Found>> {
        let end = TRAIN_SHARE * self.survey.duration;
        let border = |k: usize| end * k as f64 / BLOCKS as f64;
        let mut blocks = Vec::with_capacity(BLOCKS);
        for k in 0..BLOCKS {
            let model = self.model_with(term, [border(k), border(k + 1)]);
            blocks.extend(self.columns(&model).into_iter().next());
        }
        let (on, off) = self.projection().best_interval(&blocks);
        let forever = term.effect.shape().map_or(end, |(_, forever)| forever);
        let inner = [
            border(on),
            if off == BLOCKS { forever } else { border(off) },
        ];
        let Some(score) = self.with(term, inner)? else {
            return Ok(None);
        };
        let mut found = Found {
            inner,
            score,
            tried: BLOCKS * (BLOCKS + 1) / 2,
        };
        // Each end moves what the other is best at, so twice.
        for _ in 0..2 {
            self.refine(term, 0, (border(on.max(1) - 1), border(on + 1)), &mut found)?;
            if off < BLOCKS {
                self.refine(term, 1, (border(off - 1), border(off + 1)), &mut found)?;
            }
        }
        if off == BLOCKS {
            self.end_later(term, &mut found);
        }
        Ok(Some(found))
    }

    /// Where what is on at the end of the training part goes off in the held-out part, if it does: no past tells such an
    /// instant, so it is read off there, with everything else as the training part says.
    fn end_later(&self, term: &Term, found: &mut Found) {
        let (from, to) = (TRAIN_SHARE * self.survey.duration, self.survey.duration);
        let mut model = self.model_with(term, found.inner);
        let columns = system::columns(self.problem, &model, &model.terms[model.terms.len() - 1]);
        let system = self.system.extended(&model, &columns, self.noise);
        system.decode(&found.score.beta, &mut model);
        let error = |off: f64| -> f64 {
            let mut model = model.clone();
            if let Some(last) = model.terms.last_mut() {
                set_inner(last, [found.inner[0], off]);
            }
            let z = self.noise.whiten(&system::residual(self.problem, &model));
            let rows = z.iter().zip(&self.problem.rows);
            rows.filter(|(_, row)| row.part == Part::HeldOut)
                .map(|(z, _)| z * z)
                .sum()
        };
        let borders = (0..BLOCKS).map(|k| from + (to - from) * k as f64 / BLOCKS as f64);
        let ends = borders.map(|off| (error(off), off));
        let Some((least, off)) = ends.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return;
        };
        let price = 2.0 * (BLOCKS as f64).ln() + (self.problem.count(Part::HeldOut) as f64).ln();
        if error(found.inner[1]) - least > price {
            found.inner[1] = off;
        }
    }

    fn on_line(&self, term: &Term) -> Result<Option<Found>> {
        let frequencies = self.frequencies(SLOWEST_LINE);
        let Some(hertz) = self.strongest_line(&frequencies) else {
            return Ok(None);
        };
        let step = frequencies.get(1).map_or(hertz, |f| f - frequencies[0]);
        let inner = [hertz, 0.0];
        let Some(score) = self.with(term, inner)? else {
            return Ok(None);
        };
        let mut found = Found {
            inner,
            score,
            tried: frequencies.len(),
        };
        self.refine(term, 0, (hertz - step, hertz + step), &mut found)?;
        Ok(Some(found))
    }

    /// Frequencies half a resolution cell apart, in Hz, from that many cells on, and from where they are sought at all, up to
    /// where the windows pass little.
    pub fn frequencies(&self, slowest: usize) -> Vec<f64> {
        let seen = TRAIN_SHARE * self.survey.duration;
        let step = 0.5 / seen.max(f64::MIN_POSITIVE);
        let most = (PASSED / self.survey.half_width / step) as usize;
        let least = (2 * slowest).max((self.slowest / step).ceil() as usize);
        (least..most).map(|k| k as f64 * step).collect()
    }

    /// The frequency at which a sine and a cosine in time take most off the residual, of frequencies that are equally far
    /// apart.
    pub fn strongest_line(&self, frequencies: &[f64]) -> Option<f64> {
        frequencies.get(1)?;
        let projection = self.projection();
        let gain =
            |sin: &[f64], cos: &[f64]| projection.gain(&self.noise.whiten_training([sin, cos]));
        let gains = phasor::each(&angular(frequencies), &self.times(), gain);
        let gains = gains.into_iter().zip(frequencies);
        gains.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, f)| *f)
    }

    /// Whitened sine and cosine in time, by their values at the centres of the windows.
    pub fn line(&self, hertz: f64) -> Vec<Vec<f64>> {
        let line = |sin: &[f64], cos: &[f64]| self.noise.whiten_all([sin, cos]);
        let lines = phasor::each(&angular(&[hertz]), &self.times(), line);
        lines.into_iter().flatten().collect()
    }

    /// Times of the centres of the windows, from the first sample on.
    fn times(&self) -> Vec<f64> {
        let at =
            |row: &crate::problem::Row| row.centre as f64 * self.problem.tracks[row.track].period;
        self.problem.rows.iter().map(at).collect()
    }

    /// Where a term can move the whitened residual to: its columns, or, of a term that changes the way of the input, by how
    /// much it moves the residual alone. `None` if the recording does not determine the model with it.
    pub fn directions(&self, term: &Term, inner: Inner) -> Result<Option<Vec<Vec<f64>>>> {
        let model = self.model_with(term, inner);
        if term.effect.width() > 0 {
            return Ok(Some(self.columns(&model)));
        }
        let system = System::new(self.problem, &model)?.whitened(self.noise);
        Ok(system.score(self.blocks).map(|score| {
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
            .problem
            .rows
            .iter()
            .map(|row| row.part == Part::Train)
            .collect();
        Projection::new(&self.system.response, &self.system.columns, &seen)
    }

    /// The model with a term; inner parameters that the term leaves open get the given values, within its bounds.
    fn model_with(&self, term: &Term, inner: Inner) -> Model {
        let mut model = self.model.clone();
        let mut term = term.clone();
        set_inner(&mut term, inner);
        model.terms.push(term);
        model
    }

    fn columns(&self, model: &Model) -> Vec<Vec<f64>> {
        let Some(term) = model.terms.last() else {
            return Vec::new();
        };
        let columns = system::columns(self.problem, model, term);
        self.noise
            .whiten_training(columns.iter().map(|c| c.as_slice()))
    }

    /// The score of the model with a term, if physics allows the coefficients that it comes out with.
    fn with(&self, term: &Term, inner: Inner) -> Result<Option<Score>> {
        let mut model = self.model_with(term, inner);
        let (system, score);
        if term.effect.width() == 0 {
            system = System::new(self.problem, &model)?.whitened(self.noise);
            score = system.score(self.blocks);
        } else {
            let columns =
                system::columns(self.problem, &model, &model.terms[model.terms.len() - 1]);
            system = self.system.extended(&model, &columns, self.noise);
            score = system.score_of(self.products_with(&system.columns_and([])), 0.0);
        }
        Ok(score.filter(|s| system.decode(&s.beta, &mut model) && self.plausible(&model)))
    }

    /// The products of the model's columns with others, which come after them in `columns`.
    pub fn products_with(&self, columns: &[&[f64]]) -> Products {
        let response = &self.system.response;
        self.products.with(response, columns, self.blocks)
    }

    /// Whether a term left the inertia what it was, within reason: one next to proportional to the drive can take the
    /// place of all acceleration.
    fn plausible(&self, model: &Model) -> bool {
        let inertia = |model: &Model| model.parameters()[model.moving_inertia()].clone();
        let (now, before) = (inertia(model), inertia(self.model));
        let (Some(Inertias { least, most, .. }), Some(value)) = (self.inertias, now.value) else {
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

/// Angular frequencies.
fn angular(hertz: &[f64]) -> Vec<f64> {
    hertz.iter().map(|f| std::f64::consts::TAU * f).collect()
}

/// Gives the inner parameters that a term leaves open values, within its bounds.
pub fn set_inner(term: &mut Term, inner: Inner) {
    let second = term.effect.shape().map(|(k, _)| k);
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
