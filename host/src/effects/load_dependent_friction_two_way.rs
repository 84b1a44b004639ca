//! Friction in proportion to what the load gets, as the efficiency of a gear counts it: beside the Coulomb level
//! `τ = k·(driving·max(u·sgn v − level, 0) + braking·max(level − u·sgn v, 0))·sgn v`. Of a load torque `L` a friction `ratio·|L|` is
//! `ratio/(1 + ratio)` of what a drive gives beyond the level, in units of `u`, that other friction takes, and `ratio/(1 − ratio)`
//! of what it lacks of that when the load drives it.

use super::load_dependent_friction::{LoadDependentFriction, MOST_LOST};
use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Scale, Spec, Survey};
use crate::format::significant;

/// Levels that are tried, from none to the RMS input: friction takes less than what moves the axis.
const LEVELS: usize = 9;

pub(super) struct LoadDependentFrictionTwoWay;

impl Effect for LoadDependentFrictionTwoWay {
    fn id(&self) -> &'static str {
        LoadDependentFriction.id()
    }
    fn name(&self) -> &'static str {
        LoadDependentFriction.name()
    }
    fn doc(&self) -> &'static str {
        LoadDependentFriction.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::within("driving", Quantity::Number, (0.0, MOST_LOST)),
                Spec::within("braking", Quantity::Number, (0.0, f64::INFINITY)),
                Spec::within("level", Quantity::Input, (0.0, f64::INFINITY)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        LoadDependentFriction.confusions()
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        let percent = |share: f64| significant(100.0 * share, 3);
        format!(
            "Friction grows with the load: of what drives it {} % is lost, and of what it gives back when braked {} %: compensate in proportion, and check lubrication and efficiency of the gear.",
            percent(p[0]),
            percent(p[1] / (1.0 + p[1]))
        )
    }
    /// Two slopes over the drive stand for an inertia, too.
    fn refines(&self) -> bool {
        true
    }
    fn driven(&self) -> bool {
        true
    }
    fn width(&self) -> usize {
        2
    }
    fn inner(&self) -> Option<usize> {
        Some(2)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        let step = survey.input.0 / (LEVELS - 1) as f64;
        (0..LEVELS).map(|k| k as f64 * step).collect()
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        let beyond = at.moment.u * at.s.signum() - inner[0];
        out[0] = at.s * beyond.max(0.0);
        out[1] = at.s * (-beyond).max(0.0);
    }
    fn named(&self, inner: Inner, c: &[f64], scale: Scale) -> Vec<f64> {
        vec![c[0] / scale.gain, c[1] / scale.gain, inner[0]]
    }
    fn linear(&self, p: &[f64], scale: Scale) -> (Inner, Vec<f64>) {
        ([p[2], 0.0], vec![scale.gain * p[0], scale.gain * p[1]])
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0] > 0.0 && c[1] > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, LoadDependentFrictionTwoWay};
    use crate::effects::{Moment, Motion, Point, Scale};

    /// A load that gets `L` beside a friction of 0.3 and a share of 0.2 of it, both ways.
    #[test]
    fn it_is_a_share_of_what_the_load_gets() {
        let scale = Scale {
            coulomb: 0.3,
            gain: 0.5,
        };
        let (level, ratio) = (0.3, 0.2);
        let p = [
            ratio / (1.0 + ratio),
            ratio / (1.0 - ratio),
            level / scale.gain,
        ];
        let (inner, c) = LoadDependentFrictionTwoWay.linear(&p, scale);
        for (load, s) in [(2.0, 1.0), (-2.0, 1.0), (1.5, -1.0), (-0.1, -1.0)] {
            let lost = s * ratio * f64::abs(load);
            let u = (load + s * level + lost) / scale.gain;
            let at = Point::new(Motion::Rotary, 0.0, s, s).at(Moment { t: 0.0, dt: 0.0, u });
            let mut b = [0.0; 2];
            LoadDependentFrictionTwoWay.basis(inner, at, &mut b);
            assert!((c[0] * b[0] + c[1] * b[1] - lost).abs() < 1e-15);
        }
    }
}
