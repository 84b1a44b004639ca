//! What the held-out part says of the effects that the training part selected.

use super::select::{self, Selected};
use super::whitened;
use crate::error::Result;
use crate::fit;
use crate::identify::Workbench;
use crate::model::Model;
use crate::recording::Recording;
use crate::weak::Part;

/// χ² of the held-out rows.
fn held_out_chi2(bench: &Workbench, model: &Model) -> f64 {
    let z = whitened(bench, model);
    z.iter()
        .zip(&bench.problem.rows)
        .filter(|(_, r)| r.part == Part::HeldOut)
        .map(|(z, _)| z * z)
        .sum()
}

/// Selects effects and confirms them on the held-out part; what that part refutes makes room for others.
pub(super) fn confirmed(
    bench: &Workbench,
    before: &Model,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<(Vec<Selected>, Model)> {
    let mut refuted: Vec<&str> = Vec::new();
    loop {
        let (selected, after) = select::select(bench, before, recordings, &refuted, progress)?;
        progress("confirming on the held-out part");
        let ids: Vec<&str> = selected.iter().map(|s| s.trial.effect.id()).collect();
        let (kept, after) = confirm(bench, before, selected, after, recordings)?;
        let dropped = |id: &&str| !kept.iter().any(|s| s.trial.effect.id() == *id);
        let count = refuted.len();
        refuted.extend(ids.into_iter().filter(dropped));
        if refuted.len() == count {
            return Ok((kept, after));
        }
    }
}

/// Drops effects without which the held-out part is predicted as well: weak-form error and free run both count, as far
/// as the axis moves enough there for them to tell.
fn confirm(
    bench: &Workbench,
    before: &Model,
    mut selected: Vec<Selected>,
    mut after: Model,
    recordings: &[Recording],
) -> Result<(Vec<Selected>, Model)> {
    let rows = bench.problem.count(Part::HeldOut);
    let mut k = selected.len();
    while k > 0 {
        k -= 1;
        let (without, _) = bench.estimate(&select::without(&after, before.terms.len() + k))?;
        let judge = |model: &Model| fit::judge(model, recordings, &bench.problem.tracks);
        let (with_it, without_it) = (judge(&after)?, judge(&without)?);
        let moves = with_it.held_out.signal > LEAST_MOTION * with_it.train.signal;
        let weak_form_helps =
            rows < FEWEST_HELD_OUT || held_out_chi2(bench, &after) < held_out_chi2(bench, &without);
        let free_run_helps =
            !moves || with_it.held_out.nrmse < FREE_RUN_TOLERANCE * without_it.held_out.nrmse;
        if !(weak_form_helps && free_run_helps) {
            selected.remove(k);
            after = without;
        }
    }
    Ok((selected, after))
}

/// A held-out free run over a handful of windows scatters by a few per cent through its measured starting
/// velocities alone.
const FREE_RUN_TOLERANCE: f64 = 1.05;
/// A held-out part that moves by less than this share of the training part's motion says nothing about a free run.
const LEAST_MOTION: f64 = 0.1;
/// Nor do fewer rows than this about the weak form.
const FEWEST_HELD_OUT: usize = 20;
