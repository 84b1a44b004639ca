//! Which effects are certainly left out: forward selection with re-examination.

use std::collections::HashSet;

use rayon::prelude::*;

use super::trial::{Base, Trial};
use super::{confirm, forms, leftover, pairs};
use crate::effects::{self, Effect};
use crate::error::Result;
use crate::fit::{self, Parts};
use crate::identify::{self, Workbench};
use crate::model::{Model, Term};
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
/// Effects at which a search ends. Then they are not named: see [`super::judged`].
pub(super) const MOST: usize = 5;

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
    /// The first of those that passed, with the others that it stood against.
    fn first(passing: impl IntoIterator<Item = Trial>, fast: bool) -> Option<Self> {
        let mut passing = passing.into_iter();
        Some(Self {
            trial: passing.next()?,
            fast,
            others: passing.collect(),
        })
    }

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
    /// Effects that were refuted: they are not tried, and take no other's place.
    pub refuted: &'a [&'a str],
    /// Effects of which forms that refine them were refuted: they stay plain.
    pub plain: &'a [&'a str],
    /// Whether the evidence suffices.
    pub passes: &'a (dyn Fn(&Trial) -> bool + Sync),
    /// Whether it is for what only windows narrower than usual show. There, of effects without sufficient evidence only a load
    /// counts if it predicts better, elsewhere any: see [`rescued`].
    pub fast: bool,
}

impl<'a> Scope<'a> {
    /// The usual search, through the whole catalogue.
    pub fn usual(bench: &'a Workbench) -> Self {
        Self {
            bench,
            usual: bench,
            sought: &|_| true,
            refuted: &[],
            plain: &[],
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
        let tried = trials(&base, &current, &open)?;
        if round == 1 {
            alone = tried.clone();
        }
        let found = match choose(&open, &current, tried, |_| true, recordings)? {
            Some(found) => found,
            None => match beside_a_bent_law(&open, &current)? {
                Some(found) => found,
                None if scope.fast => break,
                None => match forms::unfolded(&open, model, &selected, &current, recordings)? {
                    Some(unfolded) => {
                        (selected, current) = unfolded;
                        continue;
                    }
                    None => break,
                },
            },
        };
        let id = found.trial.effect.id();
        // Beside what explains most, next to nothing is evident, too, and may speak for another name of the most.
        let counts = |next: &Model| selected.is_empty() || leftover::differs(bench, next, &current);
        // What rows give evidence for need not be where the whole model fits.
        let fits =
            |(_, next): &(Selected, Model)| bench.chi2(next) < bench.chi2(&current) && counts(next);
        let fitted = forms::in_best(scope, &current, found).ok();
        let Some((found, mut next)) = fitted.filter(fits) else {
            unfit.push(id);
            continue;
        };
        if selected.is_empty() && !scope.fast {
            // A law that has bent to what was left out may not find the way back by itself.
            let chi2 = bench.chi2(&next);
            let found = bench.or_anew(identify::reopened(&next), (next, chi2));
            (next, _) = bench.or_anew(identify::reopened_throughout(&found.0), found);
        }
        unfit.clear();
        selected.push(found);
        // What narrow windows show says nothing of the others.
        current = if scope.fast {
            next
        } else {
            forms::absorbed(scope, model, &mut selected, next)
        };
        current = reexamine(scope, model, &mut selected, current, recordings)?;
        scan::tell_later_ends(&bench.problem, &bench.noise, &mut current);
    }
    if from_nothing
        && !scope.fast
        && let Some(pair) = pairs::better(scope, model, &alone, (&selected, &current), recordings)?
    {
        progress("going on from two effects together");
        return select(scope, model, pair, recordings, progress);
    }
    Ok((selected, current))
}

/// Trials that are fitted in full.
pub(super) const LIKELIEST: usize = 3;

/// The effect of a scope with the best evidence if the friction law is sought anew with it, of those that may have sufficient
/// evidence so. A law that was fitted to what is left out has bent to it; beside an effect that explains it, it then is no law any
/// more, and the effect no candidate.
fn beside_a_bent_law(scope: &Scope, model: &Model) -> Result<Option<Selected>> {
    let base = (law_is_open(model) && !scope.fast).then(|| Base::new(scope.bench, model));
    let Some(base) = base.transpose()?.flatten().map(Base::leniently) else {
        return Ok(None);
    };
    let mut likely = trials(&base, model, scope)?;
    likely.retain(|trial| (scope.passes)(trial) && !trial.effect.nuisance());
    likely.truncate(LIKELIEST);
    let fitted = fitted(&base, model, likely)?.into_iter();
    Ok(Selected::first(fitted.filter(scope.passes), false))
}

/// The model with the effect of a trial, started from the trial's inner parameter.
pub(super) fn with_trial(model: &Model, trial: &Trial) -> Model {
    let reopened = trial.reopens.then(|| identify::reopened(model)).flatten();
    let mut next = reopened.as_ref().unwrap_or(model).with_effect(trial.effect);
    let levelled = model.level_at_rest() > 0.0;
    // Bristles that were tried under a stand-in for a level that is none are sought anew.
    if let Some(term) = next.terms.last_mut().filter(|t| levelled || !t.bends()) {
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

/// Whether a model has room for an effect: it does not have it yet, nor one that includes it, such an axis can show it, and only
/// one load can hang on an axis.
pub(super) fn fits_in(effect: &dyn Effect, model: &Model) -> bool {
    let mut terms = model.terms.iter();
    if terms.any(|t| t.effect.includes() == Some(effect.id())) {
        return false;
    }
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

/// Every effect of a scope that a model has room for, tried on it; best first.
pub(super) fn trials(base: &Base, model: &Model, scope: &Scope) -> Result<Vec<Trial>> {
    let nuisance: &'static dyn Effect = &effects::CREEP;
    let forms = |effect: &'static dyn Effect| {
        let others = effect.other_forms().iter().copied();
        [effect]
            .into_iter()
            .chain(others.filter(|form| !form.refines()))
    };
    let all = (effects::ALL.iter().copied().chain([nuisance])).flat_map(forms);
    let sought = |e: &dyn Effect| (scope.sought)(e) && !scope.refuted.contains(&e.id());
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
    let tried = trials(&base, model, scope)?;
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
    // Of what is fast, a load swings only while the drive passes its resonance; the others are there at all times.
    let rare = |effect: &dyn Effect| !scope.fast || effect.divides();
    let open = |t: &Trial| worth_a_look(t) && rare(t.effect) && may_be_rescued(t.effect);
    let rest: Vec<Trial> = rest.into_iter().filter(open).collect();
    if passing.is_empty() && !rest.is_empty() {
        let before = fit::parts(model, recordings, &bench.problem.tracks)?;
        let counts: Result<Vec<bool>> = rest
            .par_iter()
            .map(|trial| rescued(bench, (model, &before), trial, recordings))
            .collect();
        let rest = rest.into_iter().zip(counts?);
        passing.extend(rest.filter_map(|(trial, counts)| counts.then_some(trial)));
    }
    if !scope.fast && model.terms.iter().any(is_open) {
        passing = contested(bench, model, passing)?;
    }
    Ok(Selected::first(passing, scope.fast))
}

/// Whether a friction law, with what was found to belong to it, has inner parameters that are to be estimated.
fn law_is_open(model: &Model) -> bool {
    let mut contact = model.terms.iter().filter(|term| term.is_of_contact());
    model.has_curved_law() && contact.any(is_open)
}

/// Whether an inner parameter of a term is to be estimated: trials hold it where it is.
fn is_open(term: &Term) -> bool {
    let inner = term.effect.inner().map(|k| &term.parameters[k]);
    inner.is_some_and(|parameter| !parameter.known)
}

/// The trials with the likeliest in the order of their evidence with the whole model fitted to each, if they are more than one.
fn contested(bench: &Workbench, model: &Model, mut trials: Vec<Trial>) -> Result<Vec<Trial>> {
    let least = trials.first().map_or(0.0, |best| 0.5 * best.delta_bic);
    let likely = trials
        .iter()
        .take(LIKELIEST)
        .take_while(|t| t.delta_bic >= least);
    let count = likely.count();
    let base = (count > 1).then(|| Base::new(bench, model));
    let Some(base) = base.transpose()?.flatten() else {
        return Ok(trials);
    };
    let rest = trials.split_off(count);
    let mut fitted = fitted(&base, model, trials)?;
    fitted.extend(rest);
    Ok(fitted)
}

/// Trials with the evidence of the whole model fitted to each, the best first; without those that cannot be fitted.
fn fitted(base: &Base, model: &Model, trials: Vec<Trial>) -> Result<Vec<Trial>> {
    let fitted: Result<Vec<Option<Trial>>> = trials
        .into_par_iter()
        .map(|trial| {
            let fitted = base.bench.estimate(&with_trial(model, &trial)).ok();
            fitted.map_or(Ok(None), |(fitted, _)| base.fitted(&trial, &fitted))
        })
        .collect();
    let mut fitted: Vec<Trial> = fitted?.into_iter().flatten().collect();
    fitted.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
    Ok(fitted)
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
    confirm::halves(bench, &with, before, recordings)
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
                if let Ok((next, _)) = scope.bench.estimate(&next)
                    && !spoils(scope, (&next, &current), recordings)?
                    && replaces(scope, (&rival.trial, &next), (&selected[k].trial, &current))
                {
                    (selected[k], current) = (rival, next);
                }
                k += 1;
            }
            None => match scope.bench.estimate(&lacking) {
                Ok((next, _)) if !spoils(scope, (&next, &current), recordings)? => {
                    selected.remove(k);
                    current = next;
                }
                // The rest cannot be fitted without it, or predicts nothing.
                _ => k += 1,
            },
        }
    }
    Ok(current)
}

/// Whether a rival with its model has better evidence than what it is to replace with its own, both fitted in full: beside inner
/// parameters of others that are held, it may only seem so. What only narrow windows show is for `spoils` to judge.
fn replaces(
    scope: &Scope,
    (rival, next): (&Trial, &Model),
    (own, current): (&Trial, &Model),
) -> bool {
    let criterion = |trial: &Trial, model: &Model| scope.bench.chi2(model) + trial.price;
    scope.fast || criterion(rival, next) < criterion(own, current)
}

/// Whether free runs of the training part err by more than twice the squared error with a model in the place of another, beside
/// effects that only narrow windows show: the usual ones, under which earlier effects are re-examined, tell little there.
fn spoils(
    scope: &Scope,
    (next, current): (&Model, &Model),
    recordings: &[Recording],
) -> Result<bool> {
    let tracks = &scope.bench.problem.tracks;
    let error = |model: &Model| fit::part(Part::Train, model, recordings, tracks);
    Ok(scope.fast && error(current)?.halves(&error(next)?))
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
    let forms: Vec<&dyn Effect> = stood.map(|trial| trial.effect).collect();
    let sought = |effect: &dyn Effect| forms.iter().any(|form| effects::same_form(*form, effect));
    let scope = if selected.fast {
        Scope {
            sought: &sought,
            ..*scope
        }
    } else {
        Scope {
            sought: &sought,
            refuted: scope.refuted,
            plain: scope.plain,
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
