//! # What it is
//! Friction that grows with the torque that the transmission carries: `τ = ratio·|k·u|·sgn v` beside the Coulomb level. The
//! ratio is the share of the transmitted torque that is lost. Or in proportion to what the load gets of it, which is another share of
//! the drive when it moves the load (`driving`) and when it brakes it (`braking`):
//! `τ = k·(driving·max(u·sgn v − level, 0) + braking·max(level − u·sgn v, 0))·sgn v`, where `level` is what other friction takes.
//!
//! # What it looks like in a recording
//! Fast accelerations lose more torque than slow ones; the residual has the sign of velocity and the size of the drive,
//! so that it helps braking and hinders speeding up.
//!
//! # What excites it
//! Drives of very different size at the same speed: gentle and hard accelerations, or an added load.
//!
//! # Confused with
//! inertia and Coulomb level where every acceleration is alike; quadratic-drag where hard drive and high speed come
//! together: vary the acceleration at one speed.
//!
//! # Example
//! Worm and planetary gears, lead screws, harmonic drives: the mesh friction of an efficiency below one.
//!
//! # References
//! P. Hamon, M. Gautier, P. Garrec, Dynamic identification of robots with a dry friction model depending on load and
//! velocity, IROS 2010, eq. 7.

use super::load_dependent_friction_two_way::LoadDependentFrictionTwoWay;
use super::{Confusion, Effect, FREE, Inner, Motion, Point, Quantity, Scale, Spec};
use crate::format::significant;

/// Largest share that may be lost: close to one it says that nothing gets through, which fits any motion that follows the drive.
pub(super) const MOST_LOST: f64 = 0.95;

pub(super) struct LoadDependentFriction;

impl Effect for LoadDependentFriction {
    fn id(&self) -> &'static str {
        "load-dependent-friction"
    }
    fn name(&self) -> &'static str {
        "Load-dependent friction"
    }
    fn doc(&self) -> &'static str {
        include_str!("load_dependent_friction.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::within("ratio", Quantity::Number, (0.0, MOST_LOST))] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "quadratic-drag",
                    tell_apart_by: "reach the same speed once gently and once with full drive: drag is the same, load-dependent friction grows with the drive",
                },
                Confusion {
                    id: "input-dead-zone",
                    tell_apart_by: "hold a constant load and move both ways: a dead zone takes the same off every drive, load-dependent friction a share of it",
                },
                Confusion {
                    id: "saturation",
                    tell_apart_by: "log the current: saturation cuts it at a level, load-dependent friction leaves it as commanded",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        format!(
            "Of the transmitted torque {} % is lost to friction that grows with it: compensate in proportion to |u|, and check lubrication and efficiency of the gear.",
            significant(100.0 * p[0], 3)
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&LoadDependentFrictionTwoWay]
    }
    fn driven(&self) -> bool {
        true
    }
    fn basis(&self, _inner: Inner, at: Point, out: &mut [f64]) {
        out[0] = at.s * at.moment.u.abs();
    }
    fn named(&self, _inner: Inner, c: &[f64], scale: Scale) -> Vec<f64> {
        vec![c[0] / scale.gain]
    }
    fn linear(&self, p: &[f64], scale: Scale) -> (Inner, Vec<f64>) {
        (FREE, vec![scale.gain * p[0]])
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0] > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, LoadDependentFriction};
    use crate::effects::{Moment, Motion, Point, Scale};

    #[test]
    fn it_opposes_motion_whatever_the_drive() {
        let scale = Scale { coulomb: 0.0, gain: 0.5 };
        let (inner, c) = LoadDependentFriction.linear(&[0.2], scale);
        for (u, s) in [(3.0, 1.0), (-3.0, 1.0), (3.0, -1.0)] {
            let at = Point::new(Motion::Rotary, 0.0, s, s).at(Moment { t: 0.0, dt: 0.0, u });
            let mut b = [0.0];
            LoadDependentFriction.basis(inner, at, &mut b);
            assert!((c[0] * b[0] - s * 0.2 * 1.5).abs() < 1e-15);
        }
    }
}
