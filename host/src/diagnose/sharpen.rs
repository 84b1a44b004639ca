//! What acts faster than the windows pass, sought under narrower ones.
//!
//! The narrow windows give the parameters of what they alone see; all others are better known from the usual ones, which
//! keep the noise of the encoder out.

use rayon::prelude::*;

use super::confirm::{HeldOut, confirmed};
use super::held_out;
use super::select::{self, FLOOR, LEAST_DELTA_BIC, Scope, Selection};
use super::trial::{Base, Trial};
use crate::effects::{Effect, Quantity, Survey};
use crate::error::{Error, Result};
use crate::identify::Workbench;
use crate::model::{Model, Term};
use crate::recording::Recording;

/// Windows so many times narrower are tried: they pass up to so many times the frequency. Encoder noise in the acceleration
/// grows by its power 5/2.
const NARROWER: [f64; 2] = [2.0, 4.0];
/// A half-width that comes out closer to the usual one than this, as few samples lie under it, is no narrower.
const CLOSE: f64 = 0.75;
/// Product of frequency and half-width from which on windows take half of an amplitude away.
const DULLED: f64 = 0.5;
/// Least evidence for a line, in multiples of the usual: narrow windows hold mostly noise of the encoder, which is neither
/// normal nor quite white after whitening.
const LINE_EVIDENCE: f64 = 8.0;
/// Share of the squared error that a line must take away. The usual share guards against what reversals leave behind,
/// which is no line; this is 1 % of the RMS error.
const LINE_SHARE: f64 = 0.02;
/// What a load behind the axis must leave at most of the error of held-out free runs.
pub(super) const LOAD_LEAVES: f64 = 0.9;

/// Fast effects, with the narrow windows that show them.
pub(super) struct Fast {
    /// The workbench that they were found on.
    pub bench: Workbench,
    /// How many they are: the last of the selection.
    pub count: usize,
}

impl Fast {
    /// Settles all that a model leaves open: the fast effects under the narrow windows, the rest under the usual ones.
    pub fn settle(
        &self,
        usual: &Workbench,
        model: &Model,
        recordings: &[Recording],
    ) -> Result<Model> {
        let mut narrow = model.clone();
        self.bench.settle(&mut narrow, recordings);
        let first = model.terms.len() - self.count;
        let fast = narrow.terms.split_off(first);
        let mut all = narrow;
        for term in &fast {
            let mut given = term.clone();
            given.parameters.iter_mut().for_each(|p| p.known = true);
            all.terms.push(given);
        }
        let (mut all, _) = usual.estimate(&all)?;
        usual.settle(&mut all, recordings);
        all.terms.truncate(first);
        all.terms.extend(fast);
        Ok(all)
    }
}

/// Adds fast effects, of those that are sought, to a selection that windows of the usual width have led to.
pub(super) fn sharpened(
    scope: &Scope,
    before: &Model,
    found: Selection,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<(Selection, Option<Fast>)> {
    progress("looking closer, with narrower windows");
    let bench = scope.bench;
    let usual = bench.problem.half_width();
    let slowest = DULLED / usual;
    let fine = |narrower: f64| bench.narrowed(&found.1, usual / narrower, slowest).ok();
    let fine: Vec<Workbench> = (NARROWER.into_par_iter().filter_map(fine))
        .filter(|fine| fine.problem.half_width() <= CLOSE * usual)
        .collect();
    let closer = Closer {
        fine: &fine,
        usual: bench,
        sought: scope.sought,
        refuted: scope.refuted,
        plain: scope.plain,
        slowest,
        before,
        found: &found,
        recordings,
        progress,
    };
    for (k, windows) in fine.iter().enumerate() {
        let more = closer.more(k, windows.width.quiet())?;
        let more = more.map(|more| closer.contested(k, more)).transpose()?;
        if let Some((more, at)) = more.flatten() {
            return Ok(with_windows(more, at, fine));
        }
    }
    Ok((found, None))
}

/// The first effect of a selection that acts too fast for windows of the usual width but in slow motion, and that windows half as
/// wide do not show where it is fast.
pub(super) fn refuted(
    bench: &Workbench,
    before: &Model,
    (selected, after): &Selection,
) -> Option<&'static str> {
    let usual = bench.problem.half_width();
    let (survey, slowest) = (bench.problem.survey(after), DULLED / usual);
    let mut fast = selected.iter().enumerate().filter(|(_, selected)| {
        let effect = selected.trial.effect;
        effect.fast() && !effect.divides() && pace(&selected.trial, &survey) >= slowest
    });
    let (k, selected) = fast.next()?;
    let narrow = bench.narrowed(after, usual / NARROWER[0], slowest).ok()?;
    let lacking = select::without(after, before.terms.len() + k);
    let shown = HeldOut::anywhere(&narrow, after, &lacking);
    (shown.tells() && !shown.shows_again()).then(|| selected.trial.effect.id())
}

/// A selection with the windows that it was found under.
fn with_windows(more: Selection, at: usize, mut fine: Vec<Workbench>) -> (Selection, Option<Fast>) {
    let count = fast_ones(&more).count();
    let bench = fine.swap_remove(at);
    (more, Some(Fast { bench, count }))
}

/// The search under narrower windows.
struct Closer<'a> {
    fine: &'a [Workbench],
    usual: &'a Workbench,
    sought: &'a (dyn Fn(&dyn Effect) -> bool + Sync),
    refuted: &'a [&'a str],
    plain: &'a [&'a str],
    /// Hz from which on usual windows dull.
    slowest: f64,
    before: &'a Model,
    found: &'a Selection,
    recordings: &'a [Recording],
    progress: &'a dyn Fn(&str),
}

impl Closer<'_> {
    /// The selection with fast effects in under some of the windows, loads among them if they are sought, which takes
    /// measured positions without much noise. `None` if there are none.
    fn more(&self, at: usize, loads: bool) -> Result<Option<Selection>> {
        let fine = &self.fine[at];
        let (survey, slowest) = (fine.problem.survey(&self.found.1), self.slowest);
        let passes = |trial: &Trial| {
            let (share, evidence) = if trial.effect.divides() {
                (FLOOR, LEAST_DELTA_BIC)
            } else {
                (LINE_SHARE, LINE_EVIDENCE * LEAST_DELTA_BIC)
            };
            trial.certain && trial.reaches(share, evidence) && pace(trial, &survey) >= slowest
        };
        let sought = |e: &dyn Effect| e.fast() && (self.sought)(e) && (loads || !e.divides());
        let scope = Scope {
            bench: fine,
            usual: self.usual,
            sought: &sought,
            refuted: self.refuted,
            plain: self.plain,
            passes: &passes,
            fast: true,
        };
        let (before, all) = (self.before, self.recordings);
        // Narrow windows may hold too much noise of the encoder for a fit at all.
        match confirmed(&scope, before, self.found, all, self.progress) {
            Err(Error::NotIdentifiable(_)) => Ok(None),
            more => Ok(Some(more?.selection).filter(|more| fast_ones(more).next().is_some())),
        }
    }

    /// What stands of a selection, and under which windows: itself if no load is in it; otherwise itself or one without a
    /// load, if there is any.
    ///
    /// A hum passes for the swing of a load that hardly loses anything, most of all under windows that show but the foot of
    /// either. So a load must leave less than any line does, under windows that pass the line, and it must predict better
    /// than all that is found without one: the noise that moves the axis moves a supposed load, too, and in the weak form
    /// its resonance follows the colour of that noise; a free run knows of no noise.
    fn contested(&self, at: usize, more: Selection) -> Result<Option<(Selection, usize)>> {
        let Some(load) = more.1.terms.iter().rfind(|t| t.effect.divides()) else {
            return Ok(Some((more, at)));
        };
        if !fast_ones(&more).any(Effect::divides) {
            return Ok(Some((more, at)));
        }
        let mut best = (self.error(&self.found.1)?, None);
        for narrow in at..self.fine.len() {
            let Some(lines) = self.more(narrow, false)? else {
                continue;
            };
            if self.outdone(load, &lines, narrow)? {
                return Ok(Some((lines, narrow)));
            }
            let error = self.error(&lines.1)?;
            if error < best.0 {
                best = (error, Some((lines, narrow)));
            }
        }
        let predicts = self.error(&more.1)? < LOAD_LEAVES * best.0;
        Ok(if predicts { Some((more, at)) } else { best.1 })
    }

    /// Whether the first of some lines has more evidence than a load as it was found.
    fn outdone(&self, load: &Term, lines: &Selection, narrow: usize) -> Result<bool> {
        let Some(line) = lines.0.iter().find(|s| s.fast) else {
            return Ok(false);
        };
        let mut load = load.clone();
        let inner = [load.effect.inner(), load.effect.shape()];
        for k in inner.into_iter().flatten() {
            load.parameters[k].known = true;
        }
        let base = Base::new(&self.fine[narrow], &self.found.1)?;
        let trial = base.map(|base| base.attempt_as(&load)).transpose()?;
        let trial = trial.flatten();
        Ok(trial.is_none_or(|load| load.delta_bic < line.trial.delta_bic))
    }

    /// Error of held-out free runs.
    fn error(&self, model: &Model) -> Result<f64> {
        Ok(held_out(self.usual, model, self.recordings)?.nrmse)
    }
}

/// The fast effects of a selection.
fn fast_ones((selected, _): &Selection) -> impl Iterator<Item = &'static dyn Effect> {
    let fast = selected.iter().filter(|s| s.fast);
    fast.map(|s| s.trial.effect)
}

/// How fast an effect acts in a recording, Hz: at the usual speed, as in slow motion windows of the usual width show it.
fn pace(trial: &Trial, survey: &Survey) -> f64 {
    let quantity = |k: usize| trial.effect.parameters()[k].quantity;
    match trial.effect.inner().map(quantity) {
        Some(Quantity::Periodicity) => survey.usual_hertz(trial.inner[0]),
        Some(_) => trial.inner[0],
        // An error of the sensor, once per turn.
        None => survey.usual_hertz(1.0),
    }
}
