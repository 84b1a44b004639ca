//! The search for the interval in time in which a term acts.

use super::{Found, Ground, set_inner};
use crate::effects::{Inner, Search};
use crate::error::Result;
use crate::model::{Model, Term};
use crate::noise::Noise;
use crate::problem::Problem;
use crate::system;
use crate::weak::{Part, TRAIN_SHARE};

/// Blocks of time at whose borders an interval may begin and end.
const BLOCKS: usize = 64;
/// Windows side by side that must show the axis without a term of which it is said when it acts: with less, that is a guess
/// from the first moments of a recording, which are unlike all others, and a constant says as much.
const FEWEST_WITHOUT: f64 = 4.0;

impl Ground<'_> {
    /// All intervals between the borders of equal blocks of time: with the projected columns of the blocks at hand, the
    /// gain of every interval follows from cumulative sums.
    pub(super) fn in_time(&self, term: &Term) -> Result<Option<Found>> {
        let end = self.training();
        let border = |k: usize| end * k as f64 / BLOCKS as f64;
        let mut blocks = Vec::with_capacity(BLOCKS);
        for k in 0..BLOCKS {
            let model = self.model_with(term, [border(k), border(k + 1)]);
            blocks.extend(self.columns(&model).into_iter().next());
        }
        let (on, off) = self.projection().best_interval(&blocks);
        let forever = term.effect.textbook().unwrap_or(end);
        let inner = [
            border(on),
            if off == BLOCKS { forever } else { border(off) },
        ];
        let Some(score) = self.with(term, inner)? else {
            return Ok(None);
        };
        let mut found = Found {
            inner,
            score,
            tried: BLOCKS * (BLOCKS + 1) / 2,
        };
        // Each end moves what the other is best at, so twice.
        for _ in 0..2 {
            self.refine(term, 0, (border(on.max(1) - 1), border(on + 1)), &mut found)?;
            if off < BLOCKS {
                self.refine(term, 1, (border(off - 1), border(off + 1)), &mut found)?;
            }
        }
        let few = FEWEST_WITHOUT * 2.0 * self.survey.half_width;
        // An end shortly before that of the training part is a guess from its last moments: the held-out part tells.
        let guess = (off < BLOCKS && end - found.inner[1] < few).then(|| found.clone());
        if guess.is_some() {
            found.inner[1] = forever;
            let Some(score) = self.with(term, found.inner)? else {
                return Ok(guess);
            };
            found.score = score;
        }
        let without = end - (found.inner[1].min(end) - found.inner[0]);
        if without < few {
            return Ok(None);
        }
        if off == BLOCKS || guess.is_some() {
            let mut model = self.model_with(term, found.inner);
            self.extended(&model).decode(&found.score.beta, &mut model);
            tell_later_ends(self.setting.problem, self.setting.noise, &mut model);
            if let Some(last) = model.terms.last() {
                found.inner = interval(last, &model);
            }
        }
        Ok(guess.filter(|_| found.inner[1] <= end).or(Some(found)))
    }
}

fn interval(term: &Term, model: &Model) -> Inner {
    term.effect.linear(&system::values(term), model.scale()).0
}

/// Tells where the terms of a model that are on at the end of the training part go off in the held-out part, if they do: no past
/// tells such an instant, so it is read off there, with everything else as the training part says.
pub fn tell_later_ends(problem: &Problem, noise: &Noise, model: &mut Model) {
    let to = problem.survey(model).duration;
    let from = TRAIN_SHARE * to;
    for k in 0..model.terms.len() {
        let term = &model.terms[k];
        let on = match (term.effect.search(), interval(term, model)) {
            (Search::Interval, [on, off]) if off >= from => on,
            _ => continue,
        };
        let error = |off: f64| -> f64 {
            let mut model = model.clone();
            set_inner(&mut model.terms[k], [on, off]);
            let z = noise.whiten(&system::residual(problem, &model));
            let rows = z.iter().zip(&problem.rows);
            let held_out = rows.filter(|(_, row)| row.part == Part::HeldOut);
            held_out.map(|(z, _)| z * z).sum()
        };
        let best = |(low, high): (f64, f64)| {
            let borders = (0..=BLOCKS).map(|k| low + (high - low) * k as f64 / BLOCKS as f64);
            let ends = borders.map(|off| (error(off), off));
            ends.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, off)| off)
        };
        let step = (to - from) / BLOCKS as f64;
        let closer = |off: f64| best(((off - step).max(from), (off + step).min(to)));
        let forever = term.effect.textbook().unwrap_or(to);
        let price = 2.0 * (BLOCKS as f64).ln() + (problem.count(Part::HeldOut) as f64).ln();
        let ends = best((from, to)).and_then(closer);
        let off = ends.filter(|off| error(forever) - error(*off) > price);
        set_inner(&mut model.terms[k], [on, off.unwrap_or(forever)]);
    }
}
