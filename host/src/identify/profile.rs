//! How far estimates may be off where the recordings hardly show what they depend on.

use rayon::prelude::*;

use super::{Workbench, empty};
use crate::effects::Search;
use crate::model::{Model, Parameter, Status};
use crate::uncertainty::KNOWN;
use crate::{refine, system};

/// How far the profile is followed, in standard errors.
const FOLLOWED: f64 = 3.0;
/// How far below its grid an inner parameter is held, too: friction may fall at speeds that no recording resolves.
const BELOW: f64 = 10.0;

/// A fit with the inner parameter of a term held at a value.
struct Held {
    chi2: f64,
    /// Of every parameter.
    values: Vec<f64>,
    /// Standard errors of every parameter, 0 where nothing was estimated.
    errors: Vec<f64>,
    /// Whether physics allows it.
    allowed: bool,
}

impl Workbench {
    /// Widens the standard errors of a model that was refined to an optimum, and what was made of it since, by what the inner
    /// parameter of a term leaves open that the recordings do not show to be there.
    ///
    /// Standard errors follow from derivatives at the estimates. Where a recording is described as well without a term, as with
    /// a Stribeck fall that the axis passes within a few samples, its inner parameter may be anything, and derivatives at one
    /// value of it say nothing of the others. So it is held at each value `x` of its grid while the linear parameters are
    /// estimated: values `p(x)` with errors `s(x)`, and a rise of χ² by `Δ(x)` over the least that physics allows, in units of
    /// what a row leaves. A third of the furthest `|p(x) − p| + s(x)·√(9 − Δ(x))` with `Δ(x) < 9` is what three standard errors
    /// of the profile likelihood come to (Venzon and Moolgavkar, Applied Statistics 37, 1988). Where physics does not allow
    /// `p(x)`, the interval begins where there is nothing of the term. A term whose absence raises χ² by nine units or more keeps
    /// its errors: there χ² is close to a parabola.
    pub(super) fn widen(&self, model: &mut Model, optimum: &Model) {
        let labels: Vec<String> = optimum.labels().iter().map(ToString::to_string).collect();
        let own: usize = optimum.terms.iter().map(|t| t.parameters.len()).sum();
        let mut next = labels.len() - own;
        for (at, term) in optimum.terms.iter().enumerate() {
            let first = next;
            next += term.parameters.len();
            let scanned = term.effect.search() == Search::Grid && !term.bends();
            let inner = term.effect.inner().filter(|_| scanned);
            let Some(inner) = inner.filter(|&k| !term.parameters[k].known) else {
                continue;
            };
            if term.effect.width() == 0 || system::absent(optimum, at) {
                continue;
            }
            for (k, reach) in self.reach(optimum, at, inner).unwrap_or_default() {
                let parameter = &mut *model.parameters_mut().swap_remove(k);
                let se = reach / FOLLOWED;
                if !parameter.se.is_some_and(|own| own < se) {
                    continue;
                }
                parameter.se = Some(se);
                let known = parameter.value.is_some_and(|v| v.abs() >= KNOWN * se);
                if k != first + inner && !known && parameter.status != Status::AtBound {
                    parameter.status = Status::TradedOff(labels[first + inner].clone());
                }
            }
        }
    }

    /// How far each free parameter of a model reaches over the values of the inner parameter of a term; `None` if the recordings
    /// show the term, or do not determine the model without it.
    fn reach(&self, optimum: &Model, at: usize, inner: usize) -> Option<Vec<(usize, f64)>> {
        let nothing = self.held(optimum, at, inner, None)?;
        let term = &optimum.terms[at];
        let free = refine::free_parameters(optimum);
        let rows = self.blocks.iter().flatten().count();
        let freedom = rows.saturating_sub(free.len()).max(1) as f64;
        let left =
            |h: &Held, least: f64| FOLLOWED.powi(2) - (h.chi2 - least) / (least / freedom).max(1.0);
        // The best of all leaves nothing no more than this one does, so most terms show by it alone.
        let found = self.held(optimum, at, inner, term.parameters[inner].value);
        if found.is_some_and(|h| h.allowed && left(&nothing, h.chi2) <= 0.0) {
            return None;
        }
        let grid = term.effect.grid(&self.problem.survey(optimum));
        let beyond = [
            grid.first().map(|x| x / BELOW),
            term.parameters[inner].value,
        ];
        let grid: Vec<f64> = grid
            .into_iter()
            .chain(beyond.into_iter().flatten())
            .collect();
        let held = |&x: &f64| self.held(optimum, at, inner, Some(x));
        let held: Vec<Held> = grid.par_iter().filter_map(held).collect();
        let allowed = held.iter().filter(|h| h.allowed).chain([&nothing]);
        let least = allowed.map(|h| h.chi2).fold(f64::INFINITY, f64::min);
        if left(&nothing, least) <= 0.0 {
            return None;
        }
        let left = |h: &Held| left(h, least);
        let furthest = |k: usize| {
            let here = optimum.parameters()[k].value.unwrap_or_default();
            let from = |h: &Held| {
                let reach = h.errors[k] * left(h).max(0.0).sqrt();
                if h.allowed {
                    return (left(h) > 0.0).then(|| (h.values[k] - here).abs() + reach);
                }
                let end = nothing.values[k];
                let beyond = (reach - (end - h.values[k]).abs()).max(0.0);
                Some((end - here).abs() + beyond)
            };
            (k, held.iter().filter_map(from).fold(0.0, f64::max))
        };
        Some(free.into_iter().map(furthest).collect())
    }

    /// Estimates the linear parameters of a model with the inner parameter of a term held at a value, or with nothing of the
    /// term. `None` if the recordings do not determine them.
    fn held(&self, optimum: &Model, at: usize, inner: usize, x: Option<f64>) -> Option<Held> {
        let mut model = optimum.clone();
        let chi2 = if let Some(x) = x {
            let parameter = &mut model.terms[at].parameters[inner];
            (parameter.value, parameter.known) = (Some(parameter.clamp(x)), true);
            self.solve(&mut model).ok()?
        } else {
            let mut term = model.terms.remove(at);
            let chi2 = self.solve(&mut model).ok()?;
            empty(&mut term, model.scale());
            model.terms.insert(at, term);
            chi2
        };
        let value = |p: &&Parameter| p.value.unwrap_or_default();
        let values: Vec<f64> = model.parameters().iter().map(value).collect();
        let mut errors = vec![0.0; values.len()];
        if x.is_some() {
            let normal = refine::normal(&self.problem, &model, &self.noise, &self.blocks);
            let free = refine::free_parameters(&model);
            for (k, se) in free.into_iter().zip(normal.errors()?) {
                errors[k] = if model.is_linear(k) { se } else { 0.0 };
            }
        }
        Some(Held {
            chi2,
            allowed: system::inadmissible(&model).is_none(),
            values,
            errors,
        })
    }
}
