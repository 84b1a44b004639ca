//! The hierarchy's last step: bristles.

use super::Workbench;
use crate::model::{Model, Parameter, Term};
use crate::system;

/// Breakaway distances to go on from: the optimum lies between two neighbours on the grid, and a third may pass for the best.
const STARTS: usize = 3;

impl Workbench {
    /// The last step of the hierarchy: the breakaway distances of bristles that fit best, each with the Stribeck velocity
    /// that goes best with it where that is unknown, the best first. The model itself where there is nothing to find.
    ///
    /// They are more than one since each bends the bristles with the ratio of levels that it begins with, not with that which
    /// it ends with: only refinement tells which of them is best.
    pub(super) fn bend(&self, model: &Model) -> Vec<Model> {
        self.bent(model).unwrap_or_else(|| vec![model.clone()])
    }

    /// `None` where there is nothing to find, or nothing that physics allows.
    fn bent(&self, model: &Model) -> Option<Vec<Model>> {
        let bristles = model.bristle_term()?;
        let free = |term: usize| {
            let inner = model.terms[term].effect.inner()?;
            let parameter = &model.terms[term].parameters[inner];
            (!parameter.known && parameter.se.is_none()).then_some(inner)
        };
        let stiffness = free(bristles)?;
        let fall = model.terms.iter().position(Term::falls);
        let velocity = fall.and_then(|k| free(k).map(|inner| (k, inner)));
        // What the motion does to bristles depends on the ratios of stiffness and levels alone. Sliding levels found
        // without bristles can be anything where most of the motion is bending, so ratios come first.
        let mut scaled = model.clone();
        if !model.coulomb.known {
            scaled.coulomb.value = Some(1.0);
        }
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
        let mut found: Vec<(f64, Model)> = Vec::new();
        for start in model.terms[bristles].effect.grid(&survey) {
            let mut best: Option<(f64, Model)> = None;
            for velocity in &velocities {
                let mut model = scaled.clone();
                model.terms[bristles].parameters[stiffness].value = Some(start);
                if let Some((k, inner, v)) = *velocity {
                    model.terms[k].parameters[inner].value = Some(v);
                }
                let level = survey.coulomb;
                let Some((chi2, mut model)) = self.solve_undamped(model, bristles) else {
                    continue;
                };
                let ratio = model.coulomb.value.unwrap_or_default() / level;
                if ratio > 0.0 && best.as_ref().is_none_or(|(least, _)| chi2 < *least) {
                    model.terms[bristles].parameters[stiffness].value = Some(start * ratio);
                    best = Some((chi2, model));
                }
            }
            found.extend(best);
        }
        if !found.is_empty() {
            found.sort_by(|a, b| a.0.total_cmp(&b.0));
            found.truncate(STARTS);
            return Some(found.into_iter().map(|(_, model)| model).collect());
        }
        // Nothing shows them: next to stiff, with an error without bound.
        let mut stiff = model.clone();
        let stiffest = model.terms[bristles].effect.grid(&survey).last().copied()?;
        let level = model.coulomb.value.unwrap_or_default().max(0.0);
        for (k, parameter) in stiff.terms[bristles].parameters.iter_mut().enumerate() {
            if !parameter.known {
                let value = if k == stiffness {
                    stiffest * level / survey.coulomb
                } else {
                    0.0
                };
                (parameter.value, parameter.se) = (Some(value), Some(f64::INFINITY));
            }
        }
        Some(vec![stiff])
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
