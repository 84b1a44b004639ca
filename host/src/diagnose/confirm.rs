//! What the held-out part says of the effects that the training part selected.

use rayon::prelude::*;

use super::leftover;
use super::select::{self, Scope, Selected, Selection};
use super::trial::{Trial, students_t};
use super::{DEPARTS, HOPELESS, error, whitened};
use crate::error::Result;
use crate::fit::{self, Fit, Parts};
use crate::identify::Workbench;
use crate::model::{Causality, Model};
use crate::recording::Recording;
use crate::weak::Part;

/// What one model predicts of the held-out rows that another does not.
pub(super) struct HeldOut {
    /// `Σ(z − z')²` of the whitened residuals: the fall of χ² to expect if the difference is real.
    pub expected: f64,
    /// The fall of χ².
    pub fall: f64,
}

impl HeldOut {
    /// Compares a model with one that lacks something.
    pub fn of(bench: &Workbench, with: &Model, without: &Model) -> Self {
        Self::between(bench, &whitened(bench, with), &whitened(bench, without))
    }

    /// Compares whitened residuals with something with those without it.
    pub fn between(bench: &Workbench, with: &[f64], without: &[f64]) -> Self {
        let rows = with.iter().zip(without).zip(&bench.problem.rows);
        let rows = rows.filter(|(_, row)| row.part == Part::HeldOut);
        Self::over(rows.map(|(pair, _)| pair))
    }

    /// Compares a model with one that lacks something over all rows of windows that neither has been fitted under.
    pub fn anywhere(bench: &Workbench, with: &Model, without: &Model) -> Self {
        let (with, without) = (whitened(bench, with), whitened(bench, without));
        Self::over(with.iter().zip(&without))
    }

    fn over<'a>(rows: impl Iterator<Item = (&'a f64, &'a f64)>) -> Self {
        let nothing = Self {
            expected: 0.0,
            fall: 0.0,
        };
        rows.fold(nothing, |sums, (with, without)| Self {
            expected: sums.expected + (with - without).powi(2),
            fall: sums.fall + without * without - with * with,
        })
    }

    /// Whether the difference is large enough for the rows to tell: the fall scatters by twice the root of what is
    /// expected of it, and must be expected to be at least twice that.
    pub fn tells(&self) -> bool {
        self.expected >= 16.0
    }

    /// Whether it shows: in at least half of the fall to expect.
    pub fn shows_again(&self) -> bool {
        self.tells() && self.fall >= 0.5 * self.expected
    }
}

/// What the held-out part confirms.
pub(super) struct Confirmed {
    pub selection: Selection,
    /// All that there was evidence for before it was asked.
    pub evident: Selection,
}

/// Adds to a selection what else is left out, and confirms all of it on the held-out part; what that part refutes makes
/// room for others.
pub(super) fn confirmed(
    scope: &Scope,
    before: &Model,
    start: &Selection,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Confirmed> {
    let mut refuted: Vec<&str> = scope.refuted.to_vec();
    let mut evident = None;
    loop {
        let open = Scope {
            refuted: &refuted,
            ..*scope
        };
        let selection = select::select(&open, before, start.clone(), recordings, progress)?;
        let evident = evident.get_or_insert_with(|| selection.clone());
        progress("confirming on the held-out part");
        if selection.0.is_empty() {
            return Ok(Confirmed {
                selection,
                evident: evident.clone(),
            });
        }
        let run = fit::parts(&selection.1, recordings, &scope.bench.problem.tracks)?;
        if !scope.fast {
            let outpredicted = outpredicted(scope.bench, before, (&selection, &run), recordings)?;
            if !outpredicted.is_empty() {
                refuted.extend(outpredicted);
                continue;
            }
        }
        let known = |id: &&str| start.0.iter().any(|s| s.trial.effect.id() == *id);
        let ids = selection.0.iter().map(|s| s.trial.effect.id());
        let added: Vec<&str> = ids.filter(|id| !known(id)).collect();
        let (kept, after) = confirm(scope.bench, before, (selection, run), recordings)?;
        let dropped = |id: &&str| !kept.iter().any(|s| s.trial.effect.id() == *id);
        let count = refuted.len();
        refuted.extend(added.into_iter().filter(dropped));
        if refuted.len() == count {
            return Ok(Confirmed {
                selection: (kept, after),
                evident: evident.clone(),
            });
        }
    }
}

/// The effects that keep a rival which predicts better from being selected: free runs with the rival in the place of an effect err
/// by less than half of the squared error of its own in the held-out part, and over the whole as well. Where travel, speed or
/// drive differ from those of the training part, names part that explain much the same there. So does a rival that predicts as well
/// with fewer parameters and explains the same but for less than counts: such evidence is of errors in what the columns are made
/// of. Free runs that are [`HOPELESS`] predict nothing. None if no rival is better.
fn outpredicted(
    bench: &Workbench,
    before: &Model,
    ((selected, after), with_it): (&Selection, &Parts),
    recordings: &[Recording],
) -> Result<Vec<&'static str>> {
    let run = |model: &Model| fit::parts(model, recordings, &bench.problem.tracks);
    let better = |a: &Parts, b: &Parts| a.held_out().halves(&b.held_out()) && a.halves(b);
    let predicts = |run: &Parts| !hopeless(&run.train(), &run.held_out());
    let as_well = |a: fit::Error, b: fit::Error| a.nrmse <= FREE_RUN_TOLERANCE * b.nrmse;
    let simpler = |model: &Model, run: &Parts| {
        model.parameters().len() < after.parameters().len()
            && as_well(run.train(), with_it.train())
            && as_well(run.held_out(), with_it.held_out())
            && !leftover::differs(bench, after, model)
    };
    for (k, own) in selected.iter().enumerate() {
        let term = before.terms.len() + k;
        let lacking = select::without(after, term);
        let instead = |rival: &Trial| {
            let instead = select::with_trial_at(term, &lacking, rival);
            // What cannot be fitted predicts nothing.
            let fitted = bench.estimate(&instead).ok();
            let run = fitted.map(|(instead, _)| Ok((run(&instead)?, instead)));
            let run: Option<(Parts, Model)> = run.transpose()?;
            Ok(run.map(|(run, model)| {
                let simpler = simpler(&model, &run);
                (rival.effect.id(), run, simpler)
            }))
        };
        let rivals: Vec<&Trial> = own.rivals(&lacking).collect();
        let rivals: Result<Vec<_>> = rivals.into_par_iter().map(instead).collect();
        let rivals: Vec<(&str, Parts, bool)> = rivals?.into_iter().flatten().collect();
        let squares = |(_, run, _): &(&str, Parts, bool)| run.squares();
        let best = (rivals.iter()).min_by(|a, b| squares(a).total_cmp(&squares(b)));
        let best = best.filter(|(_, best, _)| predicts(best) && better(best, with_it));
        if let Some((id, best, _)) = best {
            // Those with more evidence than the best would be next.
            let before = rivals.iter().take_while(|(other, ..)| other != id);
            let worse = before
                .filter(|(_, run, _)| better(best, run))
                .map(|(id, ..)| *id);
            return Ok([own.trial.effect.id()].into_iter().chain(worse).collect());
        }
        if (rivals.iter()).any(|(_, run, simpler)| *simpler && predicts(run)) {
            return Ok(vec![own.trial.effect.id()]);
        }
    }
    Ok(Vec::new())
}

/// Drops effects that are too small to count, in what they do or in what they do beyond what the rest of the model makes up for
/// without them, unless that is a curved friction law and free runs of both parts err by more than twice the squared error without,
/// and those without which the held-out part is predicted as well: weak-form error and free run both count, as far as the axis moves
/// enough there for them to tell. Of a load that came and went before, the weak form tells nothing there. One at a time, that first
/// without which free runs err least: beside one that spoils them others may seem to.
fn confirm(
    bench: &Workbench,
    before: &Model,
    ((mut selected, mut after), mut with_it): (Selection, Parts),
    recordings: &[Recording],
) -> Result<Selection> {
    loop {
        let z = whitened(bench, &after);
        let now = (&after, z.as_slice(), &with_it);
        let each = selected.par_iter().enumerate();
        let each = each.map(|selected| refuted(bench, before, selected, now, recordings));
        let each: Result<Vec<_>> = each.collect();
        let refuted = each?.into_iter().enumerate();
        let refuted = refuted.filter_map(|(k, without)| Some((k, without?)));
        let error = |(_, (_, run)): &(usize, (Model, Parts))| run.held_out().nrmse;
        let Some((k, without)) = refuted.min_by(|a, b| error(a).total_cmp(&error(b))) else {
            return Ok((selected, after));
        };
        selected.remove(k);
        (after, with_it) = without;
    }
}

/// The model without a selected effect, with its free runs, if the held-out part refutes that effect. `z` is the whitened residual
/// with it.
fn refuted(
    bench: &Workbench,
    before: &Model,
    (k, selected): (usize, &Selected),
    (after, z, with_it): (&Model, &[f64], &Parts),
    recordings: &[Recording],
) -> Result<Option<(Model, Parts)>> {
    let lacking = select::without(after, before.terms.len() + k);
    // What the rest cannot be fitted without stays.
    let Ok((without, _)) = bench.estimate(&lacking) else {
        return Ok(None);
    };
    let counts = leftover::differs(bench, after, &lacking);
    let dominates = selected.trial.gain.share >= DOMINANT;
    let acts = HeldOut::between(bench, z, &whitened(bench, &lacking)).tells();
    let few = bench.problem.count(Part::HeldOut) < FEWEST_HELD_OUT;
    let held_out = HeldOut::between(bench, z, &whitened(bench, &without));
    let without_it = fit::parts(&without, recordings, &bench.problem.tracks)?;
    // A curved law bends to much, which free runs show. What weakens the input, though, takes off noise that it is read with, in
    // these as in rows.
    let effect = selected.trial.effect;
    let weakens = effect.driven() || effect.width() == 0;
    let predicts = before.has_curved_law()
        && !weakens
        && with_it.train().halves(&without_it.train())
        && with_it.held_out().halves(&without_it.held_out());
    let shows = || {
        let differs = predicts || leftover::differs(bench, after, &without);
        differs && (few || held_out.fall > 0.0)
    };
    let holds = counts && (dominates && !acts || shows());
    let shows_again = !few && held_out.shows_again();
    // Free runs start from velocities that are smoothed over what is as fast: with a line in the model, they start wrong.
    let dulled = selected.fast && !effect.divides() && shows_again;
    let worse = !dulled
        && worsens(with_it, &without_it, after.causality, shows_again)
        && !(dominates && outweighs(with_it, &without_it));
    let stays = holds && !worse;
    Ok((!stays).then_some((without, without_it)))
}

/// By which factor the RMS of the whitened residual in the held-out part exceeds that in the training part; 1 with too few
/// rows to say.
pub(super) fn departure(bench: &Workbench, model: &Model) -> f64 {
    let (problem, z) = (&bench.problem, whitened(bench, model));
    let mean_square = |part: Part| {
        let rows = z.iter().zip(&problem.rows);
        let squares = rows.filter(|(_, r)| r.part == part).map(|(z, _)| z * z);
        squares.sum::<f64>() / problem.count(part).max(1) as f64
    };
    if problem.count(Part::HeldOut) < FEWEST_HELD_OUT {
        return 1.0;
    }
    (mean_square(Part::HeldOut) / mean_square(Part::Train).max(f64::MIN_POSITIVE)).sqrt()
}

/// Whether free runs of the held-out part go wrong more than [`DEPARTS`] times as far as noise explains, and further than in the rest:
/// where an axis is faster than before, what sensors do to rows may be all there is to a [`departure`].
pub(super) fn departs(
    bench: &Workbench,
    model: &Model,
    fit: &Fit,
    recordings: &[Recording],
) -> Result<bool> {
    if fit.held_out.nrmse <= fit.train.nrmse {
        return Ok(false);
    }
    let own = fit::parts(model, recordings, &bench.problem.tracks)?;
    let excess = bench.excess(model, recordings, (&own, &[Part::HeldOut]), DEPARTS)?;
    Ok(excess.is_none_or(|times| times[0] > DEPARTS))
}

/// Whether free runs tell nothing of what was found, as those of an axis that flees from where it was by itself, which friction that
/// falls with speed makes it do: they go no further wrong than noise explains, in either part. Then it is for the weak form to tell:
/// what was found must be most of what there was, and show again in the rows of the held-out part.
pub(super) fn scatters(
    bench: &Workbench,
    (before, fitted, told): (&Model, &Model, &Model),
    recordings: &[Recording],
) -> Result<bool> {
    let most = || -> Result<bool> {
        Ok(error(bench, fitted)? <= (1.0 - DOMINANT) * error(bench, before)?)
    };
    if !HeldOut::of(bench, fitted, before).shows_again() || !most()? {
        return Ok(false);
    }
    let own = fit::parts(told, recordings, &bench.problem.tracks)?;
    let both = [Part::Train, Part::HeldOut];
    let excess = bench.excess(told, recordings, (&own, &both), DEPARTS)?;
    Ok(excess.is_some_and(|times| times.iter().all(|times| *times <= DEPARTS)))
}

/// Whether free runs of a model err by less than half of the squared error of others on both parts.
pub(super) fn halves(
    bench: &Workbench,
    model: &Model,
    before: &Parts,
    recordings: &[Recording],
) -> Result<bool> {
    let halves = |part: Part, before: fit::Error| -> Result<bool> {
        let after = fit::part(part, model, recordings, &bench.problem.tracks)?;
        Ok(after.halves(&before))
    };
    // The shorter part first.
    Ok(halves(Part::HeldOut, before.held_out())? && halves(Part::Train, before.train())?)
}

/// Whether one model predicts the held-out part worse than another: by more than [`FREE_RUN_TOLERANCE`] and, window against
/// window, by more than chance, or by twice the squared error; of an imposed motion, which has no windows, by the tolerance alone.
/// Where the axis hardly moves, it only is worse by twice the squared error in both parts. What the weak form shows again may be worse
/// by [`BY_CHANCE`], and by any error if it predicts most windows better: where friction holds the axis or lets it go by a hair, a
/// single one may be far off.
pub(super) fn worsens(
    with: &Parts,
    without: &Parts,
    causality: Causality,
    shows_again: bool,
) -> bool {
    let doubles = without.held_out().halves(&with.held_out());
    if !moves(&with.train(), &with.held_out()) {
        return doubles && without.train().halves(&with.train());
    }
    if with.held_out().nrmse < FREE_RUN_TOLERANCE * without.held_out().nrmse {
        return false;
    }
    let pairs = with.held_out.iter().zip(&without.held_out);
    let rises: Vec<f64> = pairs.map(|(a, b)| a.squares() - b.squares()).collect();
    if causality == Causality::Inverse || rises.len() < FEWEST_WINDOWS {
        return true;
    }
    let better = rises.iter().filter(|rise| **rise < 0.0).count();
    let chance = if shows_again { BY_CHANCE } else { 0.0 };
    !(shows_again && 2 * better > rises.len()) && (doubles || students_t(&rises) > chance)
}

/// Whether one model halves the squared error of another over the whole, where the held-out part has too few windows to show a scatter
/// and the error there does not double.
fn outweighs(with: &Parts, without: &Parts) -> bool {
    let doubles = without.held_out().halves(&with.held_out());
    with.held_out.len() < FEWEST_WINDOWS && !doubles && with.halves(without)
}

/// Whether free runs explain nothing: see [`HOPELESS`].
pub(super) fn hopeless(train: &fit::Error, held_out: &fit::Error) -> bool {
    train.nrmse.min(held_out.nrmse) > HOPELESS
}

/// Whether the axis moves enough in the held-out part, beside the training part, for a free run to say anything.
pub(super) fn moves(train: &fit::Error, held_out: &fit::Error) -> bool {
    held_out.signal > LEAST_MOTION * train.signal
}

/// A held-out free run over a handful of windows scatters by a few per cent through its measured starting
/// velocities alone.
pub(super) const FREE_RUN_TOLERANCE: f64 = 1.05;
/// An effect that explains this share of the squared error in the training part needs no held-out part.
const DOMINANT: f64 = 0.5;
/// Windows that can show a scatter.
const FEWEST_WINDOWS: usize = 4;
/// A rise by this many standard errors is chance in one of six cases: none against an effect that the weak form shows again.
const BY_CHANCE: f64 = 1.0;
/// A held-out part that moves by less than this share of the training part's motion says nothing about a free run.
const LEAST_MOTION: f64 = 0.1;
/// Nor do fewer rows than this about the weak form.
const FEWEST_HELD_OUT: usize = 20;

#[cfg(test)]
mod tests {
    use super::*;

    /// A window of one sample, in which a force of 1 is predicted with this squared error.
    fn window(square: f64) -> fit::Sums {
        fit::of_force(1.0 + square.sqrt(), 1.0)
    }

    /// Windows of one sample each, in which a force of 1 is predicted with these squared errors.
    fn run(squares: [f64; 5]) -> Parts {
        Parts {
            train: vec![window(0.04)],
            held_out: squares.map(window).to_vec(),
        }
    }

    /// That one window alone goes wrong may be chance, but no chance is as large as the error before, unless most others do better.
    #[test]
    fn an_error_that_doubles_is_worse_unless_most_windows_are_better() {
        let without = run([0.04; 5]);
        let worse = |with: [f64; 5], shows_again| {
            worsens(&run(with), &without, Causality::Forward, shows_again)
        };
        let one_more = |rise: f64| [0.04 + rise, 0.04, 0.038, 0.04, 0.041];
        let others_less = |rise: f64| [0.04 + rise, 0.04, 0.039, 0.039, 0.039];
        assert!(!worse([0.04; 5], true));
        assert!(!worse(one_more(0.1), true) && worse(one_more(0.1), false));
        assert!(worse(one_more(0.25), true));
        assert!(!worse(others_less(0.25), true) && worse(others_less(0.25), false));
    }

    /// One window that errs a little more says less than all others that err much less; four say what they say.
    #[test]
    fn few_windows_do_not_outweigh_the_rest() {
        let outweighs = |with: [f64; 2], without: [f64; 2], count: usize| {
            let parts = |[train, held_out]: [f64; 2]| Parts {
                train: vec![window(train); 3],
                held_out: vec![window(held_out); count],
            };
            super::outweighs(&parts(with), &parts(without))
        };
        assert!(outweighs([0.01, 0.06], [0.5, 0.04], 1));
        assert!(!outweighs([0.01, 0.06], [0.5, 0.04], 4));
        assert!(!outweighs([0.01, 0.09], [0.5, 0.04], 1));
        assert!(!outweighs([0.04, 0.06], [0.06, 0.04], 1));
    }

    /// Where the axis hardly moves in the held-out part, that part alone says nothing.
    #[test]
    fn where_the_axis_rests_an_error_must_double_in_both_parts() {
        let at = |train: f64, held_out: f64| {
            let window = |square: f64, signal: f64| fit::of_force(signal + square.sqrt(), signal);
            Parts {
                train: vec![window(train, 100.0)],
                held_out: vec![window(held_out, 1.0); 5],
            }
        };
        let without = at(0.04, 0.04);
        let worse =
            |train, held_out| worsens(&at(train, held_out), &without, Causality::Forward, true);
        assert!(worse(0.1, 0.1));
        assert!(!worse(0.04, 0.4) && !worse(0.4, 0.04));
    }
}
