//! A drive that gives out by degrees: `soft_limit·tanh(u/soft_limit)`.

use super::saturation::Saturation;
use super::{Confusion, Effect, Given, Motion, Path, Quantity, Seat, Spec, Survey, geometric};
use crate::format::significant;

pub(super) struct SaturationSoft;

impl Effect for SaturationSoft {
    fn id(&self) -> &'static str {
        Saturation.id()
    }
    fn name(&self) -> &'static str {
        Saturation.name()
    }
    fn doc(&self) -> &'static str {
        Saturation.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[Spec::within(
                "soft_limit",
                Quantity::Input,
                (0.0, f64::INFINITY),
            )]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        Saturation.confusions()
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        format!(
            "The drive gives out by degrees, and no more than what u = ±{} asks for: take the curve back in the controller, and stay below against windup.",
            significant(p[0], 3)
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        Saturation.unsuited(axis)
    }
    /// A curve over the input without a corner stands for much that grows with the drive, as friction under load.
    fn refines(&self) -> bool {
        true
    }
    fn seat(&self) -> Seat {
        Saturation.seat()
    }
    fn width(&self) -> usize {
        0
    }
    fn inner(&self) -> Option<usize> {
        Some(0)
    }
    /// Up to twice the largest input, which then loses 8 %.
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        let (rms, most) = survey.input;
        geometric(0.1 * rms.min(most), 2.0 * most, 14)
    }
    fn transmit(&self, p: &[f64], path: &mut Path) {
        path.soft_limit = path.soft_limit.min(p[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, SaturationSoft};
    use crate::effects::Path;

    #[test]
    fn it_gives_all_of_little_and_its_limit_of_much() {
        let mut path = Path::default();
        SaturationSoft.transmit(&[2.0], &mut path);
        let passed = [1e-3, -2.0, 50.0].map(|u| path.pass(u));
        let exact = [1e-3, -2.0 * 1f64.tanh(), 2.0];
        assert!(passed.iter().zip(exact).all(|(p, e)| (p - e).abs() < 1e-9));
    }
}
