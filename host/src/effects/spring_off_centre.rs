//! A spring that rests elsewhere than where the position counts from: `τ = stiffness·(q − rest)`.

use super::spring::Spring;
use super::{Confusion, Effect, FREE, Inner, Motion, Point, Quantity, Scale, Spec};

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
    fn width(&self) -> usize {
        2
    }
    fn essential(&self) -> Option<usize> {
        // Where it rests says nothing of whether it is there.
        Some(0)
    }
    fn basis(&self, _inner: Inner, at: Point, out: &mut [f64]) {
        (out[0], out[1]) = (at.q, 1.0);
    }
    fn named(&self, _inner: Inner, c: &[f64], _scale: Scale) -> Vec<f64> {
        vec![c[0], -c[1] / c[0]]
    }
    fn linear(&self, p: &[f64], _scale: Scale) -> (Inner, Vec<f64>) {
        (FREE, vec![p[0], -p[0] * p[1]])
    }
    fn admissible(&self, c: &[f64]) -> bool {
        Spring.admissible(c)
    }
}
