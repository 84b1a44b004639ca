//! Two effects of which neither shows without the other.
//!
//! Forward selection takes the effect that does most alone. Where two act at once, neither of them may do much alone, or a third
//! may do more than either by standing in for both. So every two are tried together: to begin with as linear columns at the
//! inner parameters that each is best at alone, which costs next to nothing, and in earnest if that promises more than the
//! selection has.
//!
//! What acts for a while only, or at some places only, may be sought in the wrong ones while the other is not in the model: so where
//! the selection leaves something, the whole catalogue is tried beside the effects that do most alone, too.

use super::leftover;
use super::select::{self, FLOOR, LEAST_DELTA_BIC, Scope, Selected, Selection};
use super::trial::{Base, Gain, Trial};
use crate::effects;
use crate::error::Result;
use crate::identify::Workbench;
use crate::model::Model;
use crate::recording::Recording;
use crate::scan;

/// Most pairs that are fitted in earnest: their order by the linear columns is rough, as inner parameters move.
const MOST: usize = 5;
/// Times that either of two is sought anew beside the other, by turns.
const TURNS: usize = 6;

/// Two effects that together explain what `model` leaves out better than a selection does: by as much as a further effect
/// must where the selection has fewer, or else by the evidence alone. Each is the best one to add to the other. `alone` is what
/// every effect does alone.
pub(super) fn better(
    scope: &Scope,
    model: &Model,
    alone: &[Trial],
    (selected, current): (&[Selected], &Model),
    recordings: &[Recording],
) -> Result<Option<Selection>> {
    let bench = scope.bench;
    let (Some(base), Some(than)) = (Base::new(bench, model)?, Base::new(bench, current)?) else {
        return Ok(None);
    };
    let prices = selected.iter().map(|s| s.trial.price);
    let choices = effects::ALL.len() * (effects::ALL.len() - 1) / 2;
    let choice = 2.0 * (choices as f64).ln();
    let criterion = than.score().chi2 + prices.sum::<f64>() - choice - LEAST_DELTA_BIC;
    let share = if selected.len() < 2 { FLOOR } else { 0.0 };
    let mut best: Option<(f64, [Trial; 2], Model)> = None;
    let mut twos = promising(&base, model, alone, selected, criterion)?;
    if leftover::of(bench, current)?.certain {
        twos.extend(beside_the_likeliest(scope, model, &base, alone)?);
    }
    for two in twos {
        for (two, with) in fitted(bench, model, &two)? {
            let Some(together) = Base::new(bench, &with)? else {
                continue;
            };
            let score = together.score();
            let reached = score.chi2 + two.iter().map(|t| t.price).sum::<f64>();
            let certain = Gain::of(base.score(), score).t >= base.least_t;
            let predicts = score.cross_validated < (1.0 - share) * than.score().cross_validated;
            let most = best.as_ref().map_or(criterion, |(reached, ..)| *reached);
            if certain && predicts && reached < most {
                best = Some((reached, two, with));
            }
        }
    }
    match best {
        Some((_, two, with)) => beside_each_other(scope, model, &two, with, recordings),
        None => Ok(None),
    }
}

/// A model with two effects, the inner parameters of either sought beside the other.
fn fitted(bench: &Workbench, model: &Model, two: &[Trial; 2]) -> Result<Vec<([Trial; 2], Model)>> {
    let mut fits = Vec::new();
    for [first, second] in [[0, 1], [1, 0]].map(|order| order.map(|k: usize| &two[k])) {
        let Ok((with, _)) = bench.estimate(&select::with_trial(model, first)) else {
            continue;
        };
        let second = match Base::new(bench, &with)? {
            Some(base) => base.attempt(second.effect)?,
            None => None,
        };
        if let Some(second) = second
            && let Ok((both, _)) = bench.estimate(&select::with_trial(&with, &second))
        {
            fits.push(([first.clone(), second], both));
        }
    }
    Ok(fits)
}

/// Every two effects that promise to get below a criterion, their price paid, the most promising ones first.
fn promising(
    base: &Base,
    model: &Model,
    alone: &[Trial],
    selected: &[Selected],
    criterion: f64,
) -> Result<Vec<[Trial; 2]>> {
    let mut candidates: Vec<(&Trial, Vec<Vec<f64>>)> = Vec::new();
    for trial in alone {
        let directions = base
            .ground
            .directions(&scan::open(trial.effect), trial.inner)?;
        candidates.extend(directions.map(|directions| (trial, directions)));
    }
    let (trials, directions): (Vec<&Trial>, Vec<_>) = candidates.into_iter().unzip();
    let chosen =
        |trial: &Trial| (selected.iter()).any(|s| s.trial.effect.id() == trial.effect.id());
    let gains = base.ground.projection().gains_of_two(&directions);
    let mut pairs: Vec<(f64, [usize; 2])> = gains
        .into_iter()
        .filter(|([i, j], _)| {
            let fit = select::fits_in(trials[*j].effect, &select::with_trial(model, trials[*i]));
            fit && !(chosen(trials[*i]) && chosen(trials[*j]))
        })
        .map(|([i, j], gain)| {
            let price = trials[i].price + trials[j].price;
            (base.score().chi2 * (1.0 - gain) + price, [i, j])
        })
        .filter(|(predicted, ..)| *predicted < criterion)
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let two = |(_, pair): &(f64, [usize; 2])| pair.map(|k| trials[k].clone());
    Ok(pairs.iter().take(MOST).map(two).collect())
}

/// The effects that do most alone, each with the one that does most beside it. What more there is to a form of one may stand in
/// for the other, as a spring that rests elsewhere does for a load: such an effect is tried in its plain form.
fn beside_the_likeliest(
    scope: &Scope,
    model: &Model,
    base: &Base,
    alone: &[Trial],
) -> Result<Vec<[Trial; 2]>> {
    let mut firsts = Vec::new();
    for trial in alone.iter().take(select::LIKELIEST) {
        let plain = effects::find(trial.effect.id());
        match plain.filter(|plain| !effects::same_form(*plain, trial.effect)) {
            Some(plain) => firsts.extend(base.attempt(plain)?),
            None => firsts.push(trial.clone()),
        }
    }
    let mut twos = Vec::new();
    for first in firsts {
        let Ok((with, _)) = scope.bench.estimate(&select::with_trial(model, &first)) else {
            continue;
        };
        let Some(base) = Base::new(scope.bench, &with)? else {
            continue;
        };
        let second = select::trials(&base, &with, scope)?.into_iter().next();
        twos.extend(second.map(|second| [first, second]));
    }
    Ok(twos)
}

/// The two as a selection, if each is the best effect to add to the other, or what took the place of one is.
fn beside_each_other(
    scope: &Scope,
    model: &Model,
    two: &[Trial; 2],
    mut with: Model,
    recordings: &[Recording],
) -> Result<Option<Selection>> {
    let mut ids = [0, 1].map(|k: usize| two[k].effect.id());
    // The other one, as it was found beside the present one.
    let mut other: Option<Selected> = None;
    for k in [0, 1].into_iter().cycle().take(TURNS) {
        let term = model.terms.len() + k;
        let lacking = select::without(&with, term);
        let Ok((lacking, _)) = scope.bench.estimate(&lacking) else {
            return Ok(None);
        };
        let own = ids[k];
        let found = select::best(scope, &lacking, |effect| effect.id() == own, recordings)?;
        let Some(found) = found else {
            return Ok(None);
        };
        ids[k] = found.trial.effect.id();
        if ids[k] != own {
            let instead = select::with_trial_at(term, &lacking, &found.trial);
            let Ok((instead, _)) = scope.bench.estimate(&instead) else {
                return Ok(None);
            };
            with = instead;
        } else if let Some(other) = other {
            let mut both = vec![other, found];
            both.rotate_right(1 - k);
            return Ok(Some((both, with)));
        }
        other = Some(found);
    }
    Ok(None)
}
