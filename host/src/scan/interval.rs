//! The search for the interval in time in which a term acts.

use super::{Found, Ground, set_inner};
use crate::error::Result;
use crate::model::Term;
use crate::system;
use crate::weak::Part;

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
        let forever = term.effect.shape().map_or(end, |(_, forever)| forever);
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
            self.end_later(term, &mut found);
        }
        Ok(guess.filter(|_| found.inner[1] <= end).or(Some(found)))
    }

    /// Where what is on at the end of the training part goes off in the held-out part, if it does: no past tells such an
    /// instant, so it is read off there, with everything else as the training part says.
    fn end_later(&self, term: &Term, found: &mut Found) {
        let (from, to) = (self.training(), self.survey.duration);
        let mut model = self.model_with(term, found.inner);
        self.extended(&model).decode(&found.score.beta, &mut model);
        let error = |off: f64| -> f64 {
            let mut model = model.clone();
            if let Some(last) = model.terms.last_mut() {
                set_inner(last, [found.inner[0], off]);
            }
            let z = self
                .setting
                .noise
                .whiten(&system::residual(self.setting.problem, &model));
            let rows = z.iter().zip(&self.setting.problem.rows);
            rows.filter(|(_, row)| row.part == Part::HeldOut)
                .map(|(z, _)| z * z)
                .sum()
        };
        let borders = (0..BLOCKS).map(|k| from + (to - from) * k as f64 / BLOCKS as f64);
        let ends = borders.map(|off| (error(off), off));
        let Some((least, off)) = ends.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return;
        };
        let price =
            2.0 * (BLOCKS as f64).ln() + (self.setting.problem.count(Part::HeldOut) as f64).ln();
        if error(found.inner[1]) - least > price {
            found.inner[1] = off;
        }
    }
}
