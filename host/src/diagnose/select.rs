//! Which effects are certainly left out: forward selection with re-examination.

use std::collections::HashSet;

use rayon::prelude::*;

use super::trial::{Base, Trial};
use super::{confirm, pairs};
use crate::effects::{self, Effect};
use crate::error::Result;
use crate::fit::{self, Parts};
use crate::identify::Workbench;
use crate::model::Model;
use crate::recording::Recording;
use crate::scan;
use crate::weak::Part;

/// Share by which the cross-validated squared error must fall: 10 % of the RMS error. Reversals and coloured noise
/// leave artefacts that are statistically significant but stay below this on clean recordings; the rate of false
/// alarms that it leaves is measured by the `validate` example.
pub(super) const FLOOR: f64 = 0.19;
/// The smallest effects that are looked for, as a share of the drive's RMS. Beside effects that were found, what is left
/// counts from there on, or where they leave more than [`FLOOR`] of what there was to explain.
pub(super) const SOUGHT: f64 = 0.03;
/// Least t of a gain: 5 % one-sided, with the nine degrees of freedom of the ten blocks that there are at least; of many
/// blocks it is 3 to 4 %.
pub(super) const CERTAIN: f64 = 1.83;
/// Least fall of BIC: odds of e³ against the simpler model beyond the price of parameters and search.
pub(super) const LEAST_DELTA_BIC: f64 = 6.0;
/// Most effects named at once.
const MOST: usize = 5;

/// An effect that was selected, with what it competed against.
#[derive(Clone)]
pub(super) struct Selected {
    pub trial: Trial,
    /// Whether only windows narrower than usual show it.
    pub fast: bool,
    /// Other effects that would have passed at the same stage, best first.
    pub others: Vec<Trial>,
}

impl Selected {
    /// Effects that would have explained at least half as much, as far as a model has room for them.
    pub fn rivals<'a>(&'a self, model: &'a Model) -> impl Iterator<Item = &'a Trial> {
        let close = |other: &&Trial| other.delta_bic >= 0.5 * self.trial.delta_bic;
        let named = self.others.iter().filter(|o| !o.effect.nuisance());
        named.filter(close).filter(|o| fits_in(o.effect, model))
    }
}

/// What has been selected so far, strongest first, and the model that has it, refined.
pub(super) type Selection = (Vec<Selected>, Model);

/// Where effects are sought, which, and what speaks for one.
#[derive(Clone, Copy)]
pub(super) struct Scope<'a> {
    /// Where they are tried.
    pub bench: &'a Workbench,
    /// Where those found earlier are re-examined: under the windows that they were found with.
    pub usual: &'a Workbench,
    /// The effects to try.
    pub sought: &'a (dyn Fn(&dyn Effect) -> bool + Sync),
    /// Whether the evidence suffices.
    pub passes: &'a (dyn Fn(&Trial) -> bool + Sync),
    /// Whether it is for what only windows narrower than usual show. Otherwise an effect without sufficient evidence counts
    /// if it predicts better: see [`rescued`].
    pub fast: bool,
}

impl<'a> Scope<'a> {
    /// The usual search, through the whole catalogue.
    pub fn usual(bench: &'a Workbench) -> Self {
        Self {
            bench,
            usual: bench,
            sought: &|_| true,
            passes: &passes,
            fast: false,
        }
    }
}

/// Adds to a selection what else `model` leaves out.
pub(super) fn select(
    scope: &Scope,
    model: &Model,
    (mut selected, mut current): Selection,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Selection> {
    let bench = scope.bench;
    let from_nothing = selected.is_empty();
    let (mut alone, mut unfit) = (Vec::new(), Vec::new());
    // A round that makes an earlier effect superfluous does not add to their number, hence the bound on rounds.
    for round in 1..=2 * MOST {
        if selected.len() == MOST {
            break;
        }
        progress(&format!("trying the catalogue, round {round}"));
        let sought = |effect: &dyn Effect| {
            (scope.sought)(effect) && !taken(effect, &selected) && !unfit.contains(&effect.id())
        };
        let open = Scope {
            sought: &sought,
            ..*scope
        };
        let Some(base) = Base::new(bench, &current)? else {
            break;
        };
        let tried = trials(&base, &current, &sought)?;
        if round == 1 {
            alone = tried.clone();
        }
        let Some(found) = choose(&open, &current, tried, |_| true, recordings)? else {
            break;
        };
        let Ok((next, _)) = bench.estimate(&with_trial(&current, &found.trial)) else {
            unfit.push(found.trial.effect.id());
            continue;
        };
        selected.push(found);
        current = next;
        current = reexamine(scope, model, &mut selected, current, recordings)?;
    }
    if from_nothing
        && !scope.fast
        && let Some(pair) = pairs::better(scope, model, alone, (&selected, &current), recordings)?
    {
        progress("going on from two effects together");
        return select(scope, model, pair, recordings, progress);
    }
    Ok((selected, current))
}

/// The model with the effect of a trial, started from the trial's inner parameter.
pub(super) fn with_trial(model: &Model, trial: &Trial) -> Model {
    let mut next = model.with_effect(trial.effect);
    if let Some(term) = next.terms.last_mut() {
        scan::set_inner(term, trial.inner);
        if let Some(k) = trial.effect.inner() {
            // A value with an error marks a start that the scan need not repeat.
            term.parameters[k].se = Some(f64::INFINITY);
        }
    }
    next
}

/// The same with the effect in a given place among the terms.
pub(super) fn with_trial_at(term: usize, model: &Model, trial: &Trial) -> Model {
    let mut next = with_trial(model, trial);
    next.terms[term..].rotate_right(1);
    next
}

fn passes(trial: &Trial) -> bool {
    trial.certain && trial.reaches(FLOOR, LEAST_DELTA_BIC)
}

/// Whether a model has room for an effect: it does not have it yet, such an axis can show it, and only one load can hang on
/// an axis.
pub(super) fn fits_in(effect: &dyn Effect, model: &Model) -> bool {
    let loaded = model.terms.iter().any(|t| t.effect.divides());
    // Bristles know by themselves how friction builds up.
    let known = effect.nuisance() && model.has("presliding");
    let room = !(known || loaded && effect.divides());
    room && effect.unsuited(model.given()).is_none() && !model.has(effect.id())
}

/// Whether a fast effect that is taken for this one has been selected: of two such the second is a rival of the first and no
/// further finding.
fn taken(effect: &dyn Effect, selected: &[Selected]) -> bool {
    let confused = |a: &dyn Effect, b: &dyn Effect| a.confusions().iter().any(|c| c.id == b.id());
    let mut fast = selected.iter().filter(|s| s.fast).map(|s| s.trial.effect);
    fast.any(|other| confused(other, effect) || confused(effect, other))
}

/// Every effect that a model has room for, tried on it; best first.
fn trials(
    base: &Base,
    model: &Model,
    sought: &(dyn Fn(&dyn Effect) -> bool + Sync),
) -> Result<Vec<Trial>> {
    let nuisance: &'static dyn Effect = &effects::CREEP;
    let forms = |effect: &'static dyn Effect| [Some(effect), effect.load_side()];
    let all = (effects::ALL.iter().copied().chain([nuisance]))
        .flat_map(forms)
        .flatten();
    let open: Vec<_> = all.filter(|e| fits_in(*e, model) && sought(*e)).collect();
    let tried: Result<Vec<Option<Trial>>> = open
        .into_par_iter()
        // What takes longest may lie side by side.
        .with_max_len(1)
        .map(|effect| base.attempt(effect))
        .collect();
    let mut trials: Vec<Trial> = tried?.into_iter().flatten().collect();
    trials.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
    // Of two forms of an effect the better one.
    let mut ids = HashSet::new();
    trials.retain(|trial| ids.insert(trial.effect.id()));
    Ok(trials)
}

/// The effect of a scope with the best evidence among those that pass, or else among those that are [`rescued`], if they may be.
pub(super) fn best(
    scope: &Scope,
    model: &Model,
    may_be_rescued: impl Fn(&dyn Effect) -> bool,
    recordings: &[Recording],
) -> Result<Option<Selected>> {
    let Some(base) = Base::new(scope.bench, model)? else {
        return Ok(None);
    };
    let tried = trials(&base, model, scope.sought)?;
    choose(scope, model, tried, may_be_rescued, recordings)
}

/// The same of effects that have been tried.
fn choose(
    scope: &Scope,
    model: &Model,
    tried: Vec<Trial>,
    may_be_rescued: impl Fn(&dyn Effect) -> bool,
    recordings: &[Recording],
) -> Result<Option<Selected>> {
    let bench = scope.bench;
    let (mut passing, rest): (Vec<Trial>, Vec<Trial>) = tried.into_iter().partition(scope.passes);
    let open = |trial: &Trial| worth_a_look(trial) && may_be_rescued(trial.effect);
    let rest: Vec<Trial> = rest.into_iter().filter(open).collect();
    if passing.is_empty() && !scope.fast && !rest.is_empty() {
        let before = fit::parts(model, recordings, &bench.problem.tracks)?;
        let counts: Result<Vec<bool>> = rest
            .par_iter()
            .map(|trial| rescued(bench, (model, &before), trial, recordings))
            .collect();
        let rest = rest.into_iter().zip(counts?);
        passing.extend(rest.filter_map(|(trial, counts)| counts.then_some(trial)));
    }
    let mut passing = passing.into_iter();
    Ok(passing.next().map(|trial| Selected {
        trial,
        fast: scope.fast,
        others: passing.collect(),
    }))
}

/// Whether the evidence for an effect is significant, though it may not suffice.
fn worth_a_look(trial: &Trial) -> bool {
    trial.delta_bic >= LEAST_DELTA_BIC && trial.gain.share > 0.0
}

/// Whether an effect that is [`worth_a_look`] counts although its gain in the weak form does not suffice: because it acts too
/// rarely for a large gain to be told from chance block by block, but takes off the χ² of the held-out part what it should; or
/// because noise on the input drowns it, which the free run averages: then it must halve the squared error of the free run
/// without it, on the training part and on the held-out part.
fn rescued(
    bench: &Workbench,
    (model, before): (&Model, &Parts),
    trial: &Trial,
    recordings: &[Recording],
) -> Result<bool> {
    let Ok((with, _)) = bench.estimate(&with_trial(model, trial)) else {
        return Ok(false);
    };
    if trial.gain.share >= FLOOR && confirm::HeldOut::of(bench, &with, model).shows_again() {
        return Ok(true);
    }
    let halves = |part: Part, before: fit::Error| -> Result<bool> {
        let after = fit::part(part, &with, recordings, &bench.problem.tracks)?;
        Ok(after.halves(&before))
    };
    // The shorter part first.
    Ok(halves(Part::HeldOut, before.held_out())? && halves(Part::Train, before.train())?)
}

/// Looks again at all effects but the one selected last, each under the windows that it was found with: drops those that are
/// superfluous by now, and gives the place of one to the rival that has the better evidence beside all others. What was named
/// while much was left out may have stood in for more than itself.
fn reexamine(
    scope: &Scope,
    baseline: &Model,
    selected: &mut Vec<Selected>,
    full: Model,
    recordings: &[Recording],
) -> Result<Model> {
    let mut current = full;
    let mut k = 0;
    while k + 1 < selected.len() {
        let term = baseline.terms.len() + k;
        let lacking = without(&current, term);
        match again(scope, &selected[k], &lacking, recordings)? {
            Some(same) if same.trial.effect.id() == selected[k].trial.effect.id() => k += 1,
            Some(rival) => {
                let next = with_trial_at(term, &lacking, &rival.trial);
                if let Ok((next, _)) = scope.bench.estimate(&next) {
                    (selected[k], current) = (rival, next);
                }
                k += 1;
            }
            None => match scope.bench.estimate(&lacking) {
                Ok((next, _)) => {
                    selected.remove(k);
                    current = next;
                }
                // The rest cannot be fitted without it.
                Err(_) => k += 1,
            },
        }
    }
    Ok(current)
}

/// What takes the place of a selected effect in a model that lacks it: the effect itself where it is still needed, a rival with
/// better evidence, or nothing.
fn again(
    scope: &Scope,
    selected: &Selected,
    lacking: &Model,
    recordings: &[Recording],
) -> Result<Option<Selected>> {
    let stood = selected.others.iter().chain([&selected.trial]);
    let form = |effect: &dyn Effect| (effect.id(), effect.on_load_side());
    let forms: Vec<_> = stood.map(|trial| form(trial.effect)).collect();
    let sought = |effect: &dyn Effect| forms.contains(&form(effect));
    let scope = if selected.fast {
        Scope {
            sought: &sought,
            ..*scope
        }
    } else {
        Scope {
            sought: &sought,
            ..Scope::usual(scope.usual)
        }
    };
    // A rival takes the place by evidence alone.
    let id = selected.trial.effect.id();
    best(&scope, lacking, |effect| effect.id() == id, recordings)
}

/// The model without one of its terms.
pub(super) fn without(model: &Model, term: usize) -> Model {
    let mut model = model.clone();
    model.terms.remove(term);
    model
}
