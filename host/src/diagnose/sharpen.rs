//! What acts faster than the windows pass, sought under narrower ones.
//!
//! The narrow windows give the parameters of what they alone see; all others are better known from the usual ones, which
//! keep the noise of the encoder out.

use std::f64::consts::TAU;

use super::confirm::confirmed;
use super::select::{FLOOR, LEAST_DELTA_BIC, Scope, Selection};
use super::trial::Trial;
use crate::effects::{Effect, Quantity, Seat, Survey};
use crate::error::{Error, Result};
use crate::fit;
use crate::identify::Workbench;
use crate::model::Model;
use crate::motion::Motion;
use crate::recording::Recording;
use crate::weak::Part;

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
/// What a load behind the axis must leave at most of the error of held-out free runs. In narrow windows the noise that
/// moves the axis moves the supposed load, too, and a resonance follows its colour; a free run knows of no noise.
const LOAD_LEAVES: f64 = 0.9;

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

/// Adds fast effects to a selection that windows of the usual width have led to.
pub(super) fn sharpened(
    bench: &Workbench,
    before: &Model,
    found: Selection,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<(Selection, Option<Fast>)> {
    let usual = bench.problem.half_width();
    for narrower in NARROWER {
        progress("looking closer, with narrower windows");
        let Ok(fine) = bench.with_half_width(&found.1, usual / narrower) else {
            continue;
        };
        // Where the narrow windows hold so much noise of the encoder that the other side of the equation looks better,
        // nothing of theirs can be compared.
        if fine.problem.half_width() > CLOSE * usual
            || fine.problem.response != bench.problem.response
        {
            continue;
        }
        // Narrow windows may hold too much noise of the encoder for a fit at all.
        let more = match more(&fine, bench, before, &found, recordings, progress) {
            Err(Error::NotIdentifiable(_)) => continue,
            more => more?,
        };
        if let Some(more) = more {
            let count = fast_ones(&more).count();
            return Ok((more, Some(Fast { bench: fine, count })));
        }
    }
    Ok((found, None))
}

/// The selection with fast effects in; `None` if there are none.
fn more(
    fine: &Workbench,
    bench: &Workbench,
    before: &Model,
    found: &Selection,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Option<Selection>> {
    let survey = fine.problem.survey(&found.1);
    let slowest = DULLED / bench.problem.half_width();
    let passes = |trial: &Trial| {
        let line = trial.effect.seat() != Seat::Load;
        let (share, evidence) = if line {
            (LINE_SHARE, LINE_EVIDENCE * LEAST_DELTA_BIC)
        } else {
            (FLOOR, LEAST_DELTA_BIC)
        };
        trial.certain && trial.reaches(share, evidence) && pace(trial, &survey) >= slowest
    };
    // What a load does follows from measured positions, noise and all.
    let quiet = fine.width.quiet();
    let mut loads = quiet;
    loop {
        let sought = |e: &dyn Effect| e.fast() && (loads || e.seat() != Seat::Load);
        let scope = Scope {
            bench: fine,
            usual: bench,
            sought: &sought,
            passes: &passes,
            fast: true,
        };
        let more = confirmed(&scope, before, found, recordings, progress)?;
        let fast: Vec<&dyn Effect> = fast_ones(&more).collect();
        let hung = fast.iter().any(|e| e.seat() == Seat::Load);
        if hung && !predicts(&more.1, &found.1, fine, recordings)? {
            loads = false;
            continue;
        }
        return Ok((!fast.is_empty()).then_some(more));
    }
}

/// The fast effects of a selection.
fn fast_ones((selected, _): &Selection) -> impl Iterator<Item = &'static dyn Effect> {
    let fast = selected.iter().filter(|s| s.fast);
    fast.map(|s| s.trial.effect)
}

/// Whether held-out free runs are better with a load than without.
fn predicts(with: &Model, without: &Model, fine: &Workbench, all: &[Recording]) -> Result<bool> {
    let error = |model: &Model| -> Result<f64> {
        Ok(fit::part(Part::HeldOut, model, all, &fine.problem.tracks)?.nrmse)
    };
    Ok(error(with)? < LOAD_LEAVES * error(without)?)
}

/// The fastest that an effect acts in a recording, Hz.
fn pace(trial: &Trial, survey: &Survey) -> f64 {
    let scanned = trial.effect.inner();
    let periodic =
        scanned.is_some_and(|k| trial.effect.parameters()[k].quantity == Quantity::Periodicity);
    match (periodic, survey.motion) {
        (false, _) => trial.inner[0],
        (true, Motion::Rotary) => trial.inner[0] * survey.top_speed / TAU,
        (true, Motion::Linear) => trial.inner[0] * survey.top_speed,
    }
}
