//! The hierarchy's last step: bristles.

use super::{BEYOND, Workbench};
use crate::effects::{Search, Survey};
use crate::error::Result;
use crate::model::{Model, Parameter, Status, Term};
use crate::system;
use crate::uncertainty::TOLD;

/// Breakaway distances to go on from: the optimum lies between two neighbours on the grid, and a third may pass for the best.
const STARTS: usize = 3;

/// Models to refine.
pub(super) struct Starts {
    /// Of which the best counts.
    pub models: Vec<Model>,
    /// The one to take, its bristles as they are, if those of none of them [`yields`].
    pub stiff: Option<Model>,
}

/// Whether the recordings show a level that bristles yield at, in sliding or at rest. Those that never yield are a spring, which
/// stands in for whatever else depends on position.
pub(super) fn yields(model: &Model) -> bool {
    let falls = model.terms.iter().filter(|term| term.falls());
    let mut levels = falls
        .map(|term| &term.parameters[0])
        .chain([&model.coulomb]);
    levels.any(|level| {
        let told = |se: f64| level.value.unwrap_or_default().abs() >= TOLD * se;
        level.known || level.se.is_none_or(told)
    })
}

/// A model with bristles and the fall of friction sought anew, if its law has any. `None` if it has none, or they would be, or are
/// known.
pub(crate) fn reopened(model: &Model) -> Option<Model> {
    opened(model, Term::is_of_contact)
}

/// The same with whatever else is sought on a grid: what was found beside a law that had bent to it has bent as well.
pub(crate) fn reopened_throughout(model: &Model) -> Option<Model> {
    let on_grid = |term: &Term| term.effect.search() == Search::Grid;
    opened(model, |term| term.is_of_contact() || on_grid(term))
}

/// A model with a curved law, the inner parameters of some terms sought anew.
fn opened(model: &Model, sought_anew: impl Fn(&Term) -> bool) -> Option<Model> {
    if !model.has_curved_law() {
        return None;
    }
    let mut opened = model.clone();
    let mut any = false;
    for term in opened.terms.iter_mut().filter(|term| sought_anew(term)) {
        let inner = term.effect.inner().map(|k| &mut term.parameters[k]);
        if let Some(inner) = inner.filter(|p| !p.known && !sought(p)) {
            (inner.value, inner.se, any) = (None, None, true);
        }
    }
    any.then_some(opened)
}

impl Workbench {
    /// Whether the bristles of a model are clearly stiffer than any that are sought.
    pub(super) fn ran_away(&self, model: &Model) -> bool {
        let bristles = model.bristle_term().map(|k| &model.terms[k]);
        bristles.is_some_and(|bristles| {
            let grid = bristles.effect.grid(&self.problem.survey(model));
            let stiffest = grid.last().copied().unwrap_or(f64::INFINITY);
            bristles
                .bristle_stiffness()
                .is_some_and(|s| s > BEYOND * stiffest)
        })
    }

    /// Whether the recordings show such a level, if only with the exponent held of what else climbs steeply from rest: the two may
    /// trade off, and bristles yield all the same.
    pub(super) fn yields(&self, model: &Model) -> bool {
        if yields(model) {
            return true;
        }
        let mut held = model.clone();
        let mut any = false;
        for term in held.terms.iter_mut().filter(|t| t.effect.shapes_level()) {
            let inner = term.effect.inner().map(|k| &mut term.parameters[k]);
            if let Some(inner) = inner.filter(|p| !p.known) {
                (inner.known, any) = (true, true);
            }
        }
        any && self.refined(held).is_ok_and(|(held, _)| yields(&held))
    }

    /// The last step of the hierarchy: the breakaway distances of bristles that fit best, each with the Stribeck velocity
    /// that goes best with it where that is unknown, the best first; or those at which bristles of a given stiffness are likeliest to
    /// yield, the nearest first. The model itself where there is nothing to find.
    ///
    /// They are more than one since each bends the bristles with the ratio of levels that it begins with, not with that which
    /// it ends with: only refinement tells which of them is best. Distances that fit better than their neighbours come first,
    /// as what acts at reversals hardly shows beside something large that long distances make up for.
    pub(super) fn bend(&self, model: &Model) -> Starts {
        self.bent(model).unwrap_or_else(|| Starts {
            models: vec![model.clone()],
            stiff: None,
        })
    }

    /// `None` where there is nothing to find, or nothing that physics allows.
    fn bent(&self, model: &Model) -> Option<Starts> {
        let bristles = model.bristle_term()?;
        let free = |term: usize| {
            let inner = model.terms[term].effect.inner()?;
            let parameter = &model.terms[term].parameters[inner];
            (!parameter.known && sought(parameter)).then_some(inner)
        };
        let stiffness = model.terms[bristles].effect.inner()?;
        let fall = model.terms.iter().position(Term::falls);
        let velocity = fall.and_then(|k| free(k).map(|inner| (k, inner)));
        let given = &model.terms[bristles].parameters[stiffness];
        let given = given.value.filter(|_| given.known);
        // How far bristles of a given stiffness bend depends on the level, which is to be found.
        let open = match given {
            Some(_) => velocity.is_some() || !model.coulomb.known && sought(&model.coulomb),
            None => free(bristles).is_some(),
        };
        if !open {
            return None;
        }
        // Ratios come first.
        let mut scaled = self.problem.levelled(model.clone());
        if let Some(level) = fall.map(|k| &mut scaled.terms[k].parameters[0])
            && !level.known
        {
            level.value = scaled.coulomb.value;
        }
        let survey = self.problem.survey(&scaled);
        let velocities = velocity.map_or(vec![None], |(k, inner)| {
            let grid = model.terms[k].effect.grid(&survey).into_iter();
            grid.map(|v| Some((k, inner, v))).collect()
        });
        let mut found: Vec<Option<(f64, Model)>> = Vec::new();
        for start in model.terms[bristles].effect.grid(&survey) {
            let mut best: Option<(f64, Model)> = None;
            for velocity in &velocities {
                let mut model = scaled.clone();
                model.terms[bristles].parameters[stiffness].value = Some(start);
                if let Some((k, inner, v)) = *velocity {
                    model.terms[k].parameters[inner].value = Some(v);
                }
                let level = survey.level;
                let Some((chi2, mut model)) = self.solve_undamped(model, bristles) else {
                    continue;
                };
                let ratio = model.coulomb.value.unwrap_or_default() / level;
                if ratio > 0.0 && best.as_ref().is_none_or(|(least, _)| chi2 < *least) {
                    model.terms[bristles].parameters[stiffness].value = Some(start * ratio);
                    best = Some((chi2, model));
                }
            }
            found.push(best);
        }
        let (models, stiff) = match given {
            Some(given) => (nearest(found, given, bristles, stiffness), None),
            None => (best_of(&found), stiff(model, bristles, stiffness, &survey)),
        };
        Some(Starts { models, stiff })
    }

    /// The refinement of a model without its bristles, of which nothing shows: these are stiff ones, and their errors have no bound.
    pub(super) fn stiffly_refined(&self, model: Model) -> Result<(Model, f64)> {
        let Some(at) = model.bristle_term() else {
            return self.refined(model);
        };
        let distance = model.breakaway();
        let mut rest = model;
        let mut bristles = rest.terms.remove(at);
        let (mut rest, chi2) = self.refined(rest)?;
        for parameter in bristles.parameters.iter_mut().filter(|p| !p.known) {
            (parameter.se, parameter.status) = (Some(f64::INFINITY), Status::NotExcited);
        }
        rest.terms.insert(at, bristles);
        if let Some(distance) = distance {
            rest.break_away_after(distance);
        }
        Ok((rest, chi2))
    }

    /// The linear parameters of a model with given bristles, these without damping if it would be negative.
    fn solve_undamped(&self, mut model: Model, bristles: usize) -> Option<(f64, Model)> {
        let chi2 = self.solve(&mut model).ok()?;
        match system::inadmissible(&model) {
            None => Some((chi2, model)),
            Some(term) if term == bristles => {
                let damping = model.terms[bristles].parameters.last_mut()?;
                let free = std::mem::replace(damping, Parameter::known(0.0));
                let chi2 = self.solve(&mut model).ok()?;
                *model.terms[bristles].parameters.last_mut()? = Parameter {
                    value: Some(0.0),
                    ..free
                };
                system::inadmissible(&model)
                    .is_none()
                    .then_some((chi2, model))
            }
            Some(_) => None,
        }
    }
}

/// The models of a grid whose bristles are the nearest to a given stiffness, which they get.
fn nearest(
    grid: Vec<Option<(f64, Model)>>,
    given: f64,
    bristles: usize,
    stiffness: usize,
) -> Vec<Model> {
    let mut models: Vec<(f64, Model)> = (grid.into_iter().flatten())
        .map(|(_, mut model)| {
            let value = &mut model.terms[bristles].parameters[stiffness].value;
            let found = value.replace(given).unwrap_or(given);
            ((found / given).ln().abs(), model)
        })
        .collect();
    models.sort_by(|a, b| a.0.total_cmp(&b.0));
    models.truncate(STARTS);
    models.into_iter().map(|(_, model)| model).collect()
}

/// Bristles of which nothing shows: next to stiff.
fn stiff(model: &Model, bristles: usize, stiffness: usize, survey: &Survey) -> Option<Model> {
    let mut stiff = model.clone();
    let stiffest = model.terms[bristles].effect.grid(survey).last().copied()?;
    let level = model.level_at_rest();
    for (k, parameter) in stiff.terms[bristles].parameters.iter_mut().enumerate() {
        if !parameter.known {
            let value = if k == stiffness {
                stiffest * level / survey.level
            } else {
                0.0
            };
            parameter.value = Some(value);
        }
    }
    Some(stiff)
}

/// Whether a scanned parameter is open, or showed nothing so far.
fn sought(parameter: &Parameter) -> bool {
    let without_bound = parameter.se == Some(f64::INFINITY);
    parameter.se.is_none() || without_bound && parameter.status == Status::NotExcited
}

/// The models of a grid to go on from, of those that have a χ²: first those that fit better than their neighbours, then the others,
/// the best first of either.
fn best_of(grid: &[Option<(f64, Model)>]) -> Vec<Model> {
    let chi2 = |k: usize| {
        let found = grid.get(k).and_then(Option::as_ref);
        found.map_or(f64::INFINITY, |(chi2, _)| *chi2)
    };
    let dips = |k: usize| (k == 0 || chi2(k) <= chi2(k - 1)) && chi2(k) <= chi2(k + 1);
    let mut order: Vec<usize> = (0..grid.len()).filter(|&k| grid[k].is_some()).collect();
    order.sort_by(|&a, &b| dips(b).cmp(&dips(a)).then(chi2(a).total_cmp(&chi2(b))));
    let models = order.into_iter().take(STARTS);
    models
        .filter_map(|k| grid[k].as_ref().map(|(_, model)| model.clone()))
        .collect()
}
