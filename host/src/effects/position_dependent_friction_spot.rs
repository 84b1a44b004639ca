//! A friction level that is higher or lower about one place: `τ = amplitude·exp(−½·(d/spread)²)·sgn v` beside the Coulomb level, where
//! `d` is the distance from `centre`; on a rotary axis the chord `2·sin(½·(q − centre))`, as the place comes by with each turn.

use super::position_dependent_friction::PositionDependentFriction;
use super::{Confusion, Effect, Impostor, Inner, Motion, Point, Quantity, Spec, Survey, geometric};
use crate::format::quantity;

/// Places along the travel that are tried, or around the turn, up to one narrowest spread apart.
const PLACES: usize = 32;
/// Spreads that are tried, from 1/32 of this range to a quarter of it, doubling: the widest spans it.
const SPREADS: usize = 4;

pub(super) struct PositionDependentFrictionSpot;

/// The stretch of positions on which no place comes twice.
fn range(survey: &Survey) -> (f64, f64) {
    let (low, high) = survey.travel;
    let turn = match survey.motion {
        Motion::Rotary => std::f64::consts::TAU,
        Motion::Linear => f64::INFINITY,
    };
    (low, (high - low).clamp(f64::MIN_POSITIVE, turn))
}

impl Effect for PositionDependentFrictionSpot {
    fn id(&self) -> &'static str {
        PositionDependentFriction.id()
    }
    fn name(&self) -> &'static str {
        PositionDependentFriction.name()
    }
    fn doc(&self) -> &'static str {
        PositionDependentFriction.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("amplitude", Quantity::Torque),
                Spec::new("centre", Quantity::Position),
                Spec::within(
                    "spread",
                    Quantity::Position,
                    (f64::MIN_POSITIVE, f64::INFINITY),
                ),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        PositionDependentFriction.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        let place = |x| quantity(x, Quantity::Position.unit(motion));
        format!(
            "Friction is {} by up to {} within ±{} about {}: look for {} there, or compensate with a table over position.",
            if p[0] < 0.0 { "lower" } else { "higher" },
            quantity(p[0].abs(), Quantity::Torque.unit(motion)),
            place(p[2]),
            place(p[1]),
            if p[0] < 0.0 {
                "play or wear"
            } else {
                "a tight spot"
            },
        )
    }
    fn impostor(&self) -> Option<Impostor> {
        PositionDependentFriction.impostor()
    }
    fn inner(&self) -> Option<usize> {
        Some(1)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        let (low, length) = range(survey);
        let step = length / PLACES as f64;
        (0..=PLACES).map(|k| low + k as f64 * step).collect()
    }
    fn shape(&self) -> Option<usize> {
        Some(2)
    }
    fn shapes(&self, survey: &Survey) -> Vec<f64> {
        let (_, length) = range(survey);
        geometric(length / 32.0, length / 4.0, SPREADS)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        let [centre, spread] = inner;
        let distance = match at.motion {
            Motion::Rotary => 2.0 * (0.5 * (at.q - centre)).sin(),
            Motion::Linear => at.q - centre,
        };
        out[0] = at.s * (-0.5 * (distance / spread).powi(2)).exp();
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, PositionDependentFrictionSpot};
    use crate::effects::{Motion, Point, Scale};

    /// Halfway up at a distance of `spread·√(2·ln 2)`; a turn later on a rotary axis as here, and of the other sign on the way back.
    #[test]
    fn it_lies_about_its_centre() {
        let scale = Scale {
            coulomb: 0.0,
            gain: 1.0,
        };
        let (inner, c) = PositionDependentFrictionSpot.linear(&[0.2, 0.4, 0.05], scale);
        let torque = |motion, q: f64, s: f64| {
            let mut b = [0.0];
            PositionDependentFrictionSpot.basis(inner, Point::new(motion, q, s, s), &mut b);
            c[0] * b[0]
        };
        let half = 0.05 * (2.0 * 2f64.ln()).sqrt();
        assert!((torque(Motion::Linear, 0.4 + half, 1.0) - 0.1).abs() < 1e-12);
        assert!((torque(Motion::Linear, 0.4 - half, -1.0) + 0.1).abs() < 1e-12);
        assert!((torque(Motion::Rotary, 0.4 + std::f64::consts::TAU, 1.0) - 0.2).abs() < 1e-12);
        assert!(torque(Motion::Linear, 0.4 + std::f64::consts::TAU, 1.0).abs() < 1e-12);
    }
}
