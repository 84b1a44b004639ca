//! # What it is
//! A drive gain that varies with position: the torque is `k·u·(1 + ripple·sin(N·q + phase))`, with N periods a turn
//! (rotary, a whole number) or per metre.
//!
//! # What it looks like in a recording
//! A ripple over position that grows with the drive and changes sign with it: strong while accelerating, absent while
//! coasting.
//!
//! # What excites it
//! Large drive, of both signs, at speeds slow enough for many samples in each period.
//!
//! # Confused with
//! cogging, whose size does not depend on the drive: repeat the motion under another load.
//! position-dependent-friction, which has the sign of velocity instead of that of the drive.
//!
//! # Example
//! Harmonics of the back-EMF, current sensors with unequal gains, commutation angle errors.
//!
//! # References
//! T. M. Jahns, W. L. Soong, Pulsating torque minimization techniques for permanent magnet AC motor drives: a review,
//! IEEE Trans. Industrial Electronics 43(2), 1996.

use super::{Confusion, Effect, Inner, Motion, Quantity, Scale, Spec, Survey, Wave, cartesian, periodicities, polar};
use crate::format::{shortest, significant};

pub(super) struct TorqueRipple;

impl Effect for TorqueRipple {
    fn id(&self) -> &'static str {
        "torque-ripple"
    }
    fn name(&self) -> &'static str {
        "Torque ripple"
    }
    fn doc(&self) -> &'static str {
        include_str!("torque_ripple.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("ripple", Quantity::Number),
                Spec::new("phase", Quantity::Phase),
                Spec::within("periods", Quantity::Periodicity, (0.0, f64::INFINITY)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "cogging",
                    tell_apart_by: "repeat the slow motion under another constant load: cogging keeps its size, torque ripple grows with the drive",
                },
                Confusion {
                    id: "position-dependent-friction",
                    tell_apart_by: "let the axis coast across the same positions: friction still varies there, torque ripple is gone with the drive",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        let per = if motion == Motion::Rotary { "turn" } else { "metre" };
        format!(
            "The drive's gain varies by ±{} % {} times per {per}: check commutation angle and current sensors, or divide u by a table over position.",
            significant(100.0 * p[0].abs(), 3),
            shortest(p[2], 4)
        )
    }
    fn width(&self) -> usize {
        2
    }
    fn driven(&self) -> bool {
        true
    }
    fn fast(&self) -> bool {
        true
    }
    fn inner(&self) -> Option<usize> {
        Some(2)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        periodicities(survey, 1)
    }
    fn wave(&self, inner: Inner) -> Option<Wave> {
        // More drive is less resistance.
        Some(Wave { number: inner[0], coordinate: |at| at.angle, carrier: |at| -at.moment.u })
    }
    fn named(&self, inner: Inner, c: &[f64], scale: Scale) -> Vec<f64> {
        let [size, phase] = polar(c);
        vec![size / scale.gain, phase, inner[0]]
    }
    fn linear(&self, p: &[f64], scale: Scale) -> (Inner, Vec<f64>) {
        ([p[2], 0.0], cartesian(scale.gain * p[0], p[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, TorqueRipple};
    use crate::effects::{Moment, Motion, Point, Scale};

    #[test]
    fn the_gain_ripples_about_one() {
        let scale = Scale { coulomb: 0.1, gain: 2.0 };
        let (inner, c) = TorqueRipple.linear(&[0.05, 0.3, 6.0], scale);
        for (q, u) in [(0.2, 1.5), (1.1, -0.7)] {
            let at = Point::new(Motion::Rotary, q, 1.0, 1.0).at(Moment { t: 0.0, dt: 0.0, u });
            let mut b = [0.0; 2];
            TorqueRipple.basis(inner, at, &mut b);
            let torque = scale.gain * u - c[0] * b[0] - c[1] * b[1];
            let exact = scale.gain * u * (1.0 + 0.05 * (6.0 * q + 0.3).sin());
            assert!((torque - exact).abs() < 1e-14);
        }
    }
}
