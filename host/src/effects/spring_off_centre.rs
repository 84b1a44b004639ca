//! A spring that rests elsewhere than where the position counts from: `τ = stiffness·(q − rest)`.

use super::spring::Spring;
use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Spec, Survey};

/// Rest positions that are tried: between neighbours what a spring does is smooth.
const PLACES: usize = 15;

pub(super) struct SpringOffCentre;

impl Effect for SpringOffCentre {
    fn id(&self) -> &'static str {
        Spring.id()
    }
    fn name(&self) -> &'static str {
        Spring.name()
    }
    fn doc(&self) -> &'static str {
        Spring.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("stiffness", Quantity::Stiffness),
                Spec::new("rest", Quantity::Position),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        Spring.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        Spring.sentence(p, motion)
    }
    fn inner(&self) -> Option<usize> {
        Some(1)
    }
    /// Places along the travel, and beyond it as far again, where a preloaded spring rests. One that rests farther away is an offset
    /// that hardly varies.
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        let (low, high) = survey.travel;
        let span = high - low;
        places(low - span, high + span)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        out[0] = at.q - inner[0];
    }
    fn admissible(&self, c: &[f64]) -> bool {
        Spring.admissible(c)
    }
}

/// Places that are equally far apart.
pub(super) fn places(low: f64, high: f64) -> Vec<f64> {
    let step = (high - low) / (PLACES - 1) as f64;
    (0..PLACES).map(|k| low + k as f64 * step).collect()
}
