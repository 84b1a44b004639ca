//! # What it is
//! The drive gives no more than a limit: inputs beyond `|u| = limit` act as the limit. Or it gives out by degrees
//! towards a `soft_limit`: `soft_limit·tanh(u/soft_limit)`.
//!
//! # What it looks like in a recording
//! Hard accelerations fall short of what the commanded input should give; gentle ones are right. The residual lives where
//! `|u|` is largest.
//!
//! # What excites it
//! Inputs well beyond the limit, for longer than the axis needs to answer.
//!
//! # Confused with
//! load-dependent-friction, which takes a share of every drive: log the current. quadratic-drag where hard drive and high
//! speed come together.
//!
//! # Example
//! Current and voltage limits of the amplifier that the controller does not know; magnetic saturation of the motor.
//!
//! # References
//! K. J. Åström, L. Rundqwist, Integrator windup and how to avoid it, American Control Conference 1989.

use super::saturation_soft::SaturationSoft;
use super::{Confusion, Effect, Given, Motion, Path, Quantity, Seat, Spec, Survey, geometric, uncut};
use crate::format::significant;

pub(super) struct Saturation;

impl Effect for Saturation {
    fn id(&self) -> &'static str {
        "saturation"
    }
    fn name(&self) -> &'static str {
        "Saturation of the drive"
    }
    fn doc(&self) -> &'static str {
        include_str!("saturation.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const { &[Spec::within("limit", Quantity::Input, (0.0, f64::INFINITY))] }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "load-dependent-friction",
                    tell_apart_by: "log the current: saturation cuts it at a level, load-dependent friction leaves it as commanded",
                },
                Confusion {
                    id: "quadratic-drag",
                    tell_apart_by: "drive hard from rest: saturation shows at any speed, drag only at high speed",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        format!(
            "The drive gives no more than what u = ±{} asks for: limit the controller's output there against windup, or raise the amplifier's limit.",
            significant(p[0], 3)
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&SaturationSoft]
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        uncut(axis)
    }
    fn seat(&self) -> Seat {
        Seat::Input
    }
    fn width(&self) -> usize {
        0
    }
    fn inner(&self) -> Option<usize> {
        Some(0)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        // A controller that winds up may ask for many times the limit; where only peaks are cut, steps must be small.
        let (rms, most) = survey.input;
        let low = 0.7 * rms.min(most);
        let deep = geometric(0.05 * low, low, 12).into_iter();
        let peaks = (0..20).map(|k| low + (most - low) * (f64::from(k) + 0.5) / 20.0);
        deep.chain(peaks).collect()
    }
    fn transmit(&self, p: &[f64], path: &mut Path) {
        path.limit = path.limit.min(p[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, Saturation};
    use crate::effects::Path;

    #[test]
    fn the_lower_of_two_limits_counts() {
        let mut path = Path::default();
        Saturation.transmit(&[2.0], &mut path);
        Saturation.transmit(&[3.0], &mut path);
        assert_eq!([path.pass(-5.0), path.pass(1.5)], [-2.0, 1.5]);
    }
}
