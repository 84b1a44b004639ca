//! A hardening spring that rests elsewhere than where the position counts from:
//! `τ = stiffness·(q − rest) + cubic·(q − rest)³`.

use super::hardening_spring::HardeningSpring;
use super::spring_off_centre::places;
use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Spec, Survey};

pub(super) struct HardeningSpringOffCentre;

impl Effect for HardeningSpringOffCentre {
    fn id(&self) -> &'static str {
        HardeningSpring.id()
    }
    fn name(&self) -> &'static str {
        HardeningSpring.name()
    }
    fn doc(&self) -> &'static str {
        HardeningSpring.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("stiffness", Quantity::Stiffness),
                Spec::new("cubic", Quantity::Cubic),
                Spec::new("rest", Quantity::Position),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        HardeningSpring.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        HardeningSpring.sentence(p, motion)
    }
    fn width(&self) -> usize {
        2
    }
    fn essential(&self) -> Option<usize> {
        HardeningSpring.essential()
    }
    fn includes(&self) -> Option<&'static str> {
        HardeningSpring.includes()
    }
    fn inner(&self) -> Option<usize> {
        Some(2)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        places(survey.travel.0, survey.travel.1)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        let q = at.q - inner[0];
        (out[0], out[1]) = (q, q * q * q);
    }
    fn admissible(&self, c: &[f64]) -> bool {
        // What pushes away from the middle of a travel does not rest there.
        c[0] >= 0.0 && HardeningSpring.admissible(c)
    }
}
