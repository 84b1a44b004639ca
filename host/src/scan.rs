//! The search for the inner parameters of one more effect on top of a model.

use nalgebra::Complex;

use crate::effects::{Effect, Inner, Search, Survey};
use crate::error::Result;
use crate::linear::Score;
use crate::model::{Model, Term};
use crate::noise::Noise;
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
        Ok(system.score(blocks).map(|score| Self {
            problem,
            noise,
            blocks,
            model,
            inertias,
            slowest,
            system,
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
        let mut best: Option<(usize, Found)> = None;
        for (k, &first) in grid.iter().enumerate() {
            let score = self.with(term, [first, second])?;
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
        let system = self
            .system
            .extended(&model, &columns, |c| self.noise.whiten(c));
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
        let projection = self.projection();
        let (&first, &second) = (frequencies.first()?, frequencies.get(1)?);
        // From one frequency to the next every row turns by the same angle: a product in place of a sine and a cosine.
        let turns = self.phasors(second - first);
        let mut phasors = self.phasors(first);
        let gains = frequencies.iter().map(|&hertz| {
            let gain = projection.gain(&self.whitened(&phasors));
            for (phasor, turn) in phasors.iter_mut().zip(&turns) {
                *phasor *= turn;
            }
            (gain, hertz)
        });
        gains.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, f)| f)
    }

    /// Whitened sine and cosine in time, by their values at the centres of the windows.
    pub fn line(&self, hertz: f64) -> Vec<Vec<f64>> {
        self.whitened(&self.phasors(hertz))
    }

    /// `e^(iωt)` at the centres of the windows.
    fn phasors(&self, hertz: f64) -> Vec<Complex<f64>> {
        let at = |row: &crate::problem::Row| {
            let time = row.centre as f64 * self.problem.tracks[row.track].period;
            Complex::cis(std::f64::consts::TAU * hertz * time)
        };
        self.problem.rows.iter().map(at).collect()
    }

    fn whitened(&self, phasors: &[Complex<f64>]) -> Vec<Vec<f64>> {
        let part = |of: fn(&Complex<f64>) -> f64| {
            let column: Vec<f64> = phasors.iter().map(of).collect();
            self.noise.whiten(&column)
        };
        vec![part(|z| z.im), part(|z| z.re)]
    }

    fn projection(&self) -> Projection {
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
        columns.iter().map(|c| self.noise.whiten(c)).collect()
    }

    /// The score of the model with a term, if physics allows the coefficients that it comes out with.
    fn with(&self, term: &Term, inner: Inner) -> Result<Option<Score>> {
        let mut model = self.model_with(term, inner);
        let system = if term.effect.width() == 0 {
            System::new(self.problem, &model)?.whitened(self.noise)
        } else {
            let columns =
                system::columns(self.problem, &model, &model.terms[model.terms.len() - 1]);
            self.system
                .extended(&model, &columns, |c| self.noise.whiten(c))
        };
        let score = system.score(self.blocks);
        Ok(score.filter(|s| system.decode(&s.beta, &mut model) && self.plausible(&model)))
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
