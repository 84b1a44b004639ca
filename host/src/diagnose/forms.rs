//! Effects that have several forms: which one was found, and what is not needed beside it.

use super::select::{self, LEAST_DELTA_BIC, Scope, Selected, Selection};
use super::trial::Trial;
use crate::effects::{self, Effect};
use crate::error::Result;
use crate::identify::Workbench;
use crate::model::Model;
use crate::recording::Recording;
use crate::system;

/// What was found in a model, or the rival that has more evidence in a form with more to it.
pub(super) fn in_best(scope: &Scope, model: &Model, found: Selected) -> Result<(Selected, Model)> {
    let close = |other: &&Trial| other.delta_bic >= 0.5 * found.trial.delta_bic;
    let rivals = (found.others.iter().filter(close)).filter(|o| richer(scope, o.effect).is_some());
    let instead = |rival: &Trial| {
        let stood = found.others.iter().chain([&found.trial]);
        let others = stood.filter(|o| o.effect.id() != rival.effect.id());
        let rival = Selected {
            trial: rival.clone(),
            fast: found.fast,
            others: others.cloned().collect(),
        };
        in_better(scope, model, rival).ok()
    };
    let rivals: Vec<(Selected, Model)> = rivals.filter_map(instead).collect();
    let mut best = in_better(scope, model, found)?;
    for rival in rivals {
        if rival.0.trial.delta_bic > best.0.trial.delta_bic {
            best = rival;
        }
    }
    Ok(best)
}

/// A found effect in a model, in its other form if there is more to it in that and the evidence is better. What bends bristles is
/// what they hold: more to them tells only once the whole model is fitted with it.
fn in_better(scope: &Scope, model: &Model, found: Selected) -> Result<(Selected, Model)> {
    let (bench, own) = (scope.bench, found.trial.effect);
    let (next, chi2) = bench.estimate(&select::with_trial(model, &found.trial))?;
    let fitted = |other: &'static dyn Effect| {
        let (richer, least) = bench.estimate(&model.with_effect(other)).ok()?;
        let parameters = other.parameters().len() - own.parameters().len();
        let price = parameters as f64 * bench.training_rows().ln();
        Some((other, richer, least, price))
    };
    let worth = |(_, _, least, price): &(_, _, f64, f64)| chi2 - least - price;
    let best = (richer_forms(scope.plain, own).filter_map(fitted))
        .max_by(|a, b| worth(a).total_cmp(&worth(b)));
    let Some((other, richer, least, price)) = best.filter(|best| worth(best) > 0.0) else {
        return Ok((found, next));
    };
    let Some(term) = richer.terms.last() else {
        return Ok((found, next));
    };
    let (inner, _) = other.linear(&system::values(term), richer.scale());
    let price = found.trial.price + price;
    let trial = Trial {
        effect: other,
        inner,
        // Of what was fitted: a trial may have promised more than its fit came to.
        delta_bic: bench.chi2(model) - least - price,
        price,
        ..found.trial
    };
    Ok((Selected { trial, ..found }, richer))
}

/// An effect in the form with most to it.
pub(super) fn fullest(id: &str) -> Option<&'static dyn Effect> {
    effects::find(id).map(|plain| richer_forms(&[], plain).last().unwrap_or(plain))
}

/// The form of an effect with most to it, if it has one with more to it, or that refines it, and that is sought.
fn richer(scope: &Scope, effect: &dyn Effect) -> Option<&'static dyn Effect> {
    richer_forms(scope.plain, effect).last()
}

/// The forms of an effect with more to them, or that refine it unless it is to stay plain, those with most to them last.
fn richer_forms(plain: &[&str], effect: &dyn Effect) -> impl Iterator<Item = &'static dyn Effect> {
    let own = effect.parameters().len();
    let refined = !plain.contains(&effect.id());
    let others = effect.other_forms().iter().copied();
    others.filter(move |form| {
        let more = form.refines() || form.parameters().len() > own;
        more && (refined || !form.refines()) && !form.on_load_side()
    })
}

/// The model without effects that another makes up for in its form with more to it, as a spring that rests elsewhere does for an
/// offset, and a hardening spring that does for a spring: an effect more has to be worth its evidence.
pub(super) fn absorbed(
    scope: &Scope,
    baseline: &Model,
    selected: &mut Vec<Selected>,
    full: Model,
) -> Model {
    let mut current = full;
    let mut rich = 0;
    while selected.len() > 1 && rich < selected.len() {
        let plain = effects::find(selected[rich].trial.effect.id());
        let found = (plain.and_then(|plain| richer(scope, plain))).and_then(|form| {
            without_another(scope.bench, baseline, (selected, &current), rich, form)
        });
        match found {
            Some((poor, instead, trial)) => {
                selected[rich].trial = trial;
                selected.remove(poor);
                (current, rich) = (instead, 0);
            }
            None => rich += 1,
        }
    }
    current
}

/// The first effect that is not needed beside another in a richer form, the model without it, and the trial of that form.
fn without_another(
    bench: &Workbench,
    baseline: &Model,
    (selected, current): (&[Selected], &Model),
    rich: usize,
    form: &'static dyn Effect,
) -> Option<(usize, Model, Trial)> {
    let first = baseline.terms.len();
    let (_, before) = bench.estimate(current).ok()?;
    (0..selected.len()).filter(|&k| k != rich).find_map(|poor| {
        let mut instead = current.with_effect(form);
        instead.terms.swap_remove(first + rich);
        instead.terms.remove(first + poor);
        let (instead, after) = bench.estimate(&instead).ok()?;
        let term = instead
            .terms
            .iter()
            .find(|t| effects::same_form(t.effect, form))?;
        let (inner, _) = form.linear(&system::values(term), instead.scale());
        let trial = Trial {
            effect: form,
            inner,
            ..selected[rich].trial.clone()
        };
        let part = form.includes() == Some(selected[poor].trial.effect.id());
        (part || after - before < LEAST_DELTA_BIC).then_some((poor, instead, trial))
    })
}

/// A selection in which an effect is in its plain form and another takes over what there was more to it, if that has better
/// evidence: a rest position stands in for an offset beside a hardening spring, though not for all of it.
pub(super) fn unfolded(
    scope: &Scope,
    baseline: &Model,
    selected: &[Selected],
    current: &Model,
    recordings: &[Recording],
) -> Result<Option<Selection>> {
    let (bench, first) = (scope.bench, baseline.terms.len());
    let Ok((_, before)) = bench.estimate(current) else {
        return Ok(None);
    };
    for (k, rich) in selected.iter().enumerate() {
        let own = rich.trial.effect;
        let plain = effects::find(own.id()).filter(|plain| !effects::same_form(*plain, own));
        let Some(plain) = plain.filter(|_| !own.on_load_side()) else {
            continue;
        };
        let mut instead = current.with_effect(plain);
        instead.terms.swap_remove(first + k);
        let Ok((instead, _)) = bench.estimate(&instead) else {
            continue;
        };
        let Some(other) = select::best(scope, &instead, |_| false, recordings)? else {
            continue;
        };
        let Ok((both, after)) = bench.estimate(&select::with_trial(&instead, &other.trial)) else {
            continue;
        };
        let parameters = own.parameters().len() - plain.parameters().len();
        let saved = parameters as f64 * bench.training_rows().ln();
        if before - after + saved - other.trial.price > LEAST_DELTA_BIC {
            let mut selected = selected.to_vec();
            let (inner, _) = plain.linear(&system::values(&both.terms[first + k]), both.scale());
            (selected[k].trial.effect, selected[k].trial.inner) = (plain, inner);
            selected.push(other);
            return Ok(Some((selected, both)));
        }
    }
    Ok(None)
}
