//! A dead zone that larger inputs leave whole: `u` beyond `|u| = threshold`, zero within.

use super::input_dead_zone::InputDeadZone;
use super::{Confusion, Effect, Given, Motion, Path, Quantity, Seat, Spec, Survey};
use crate::format::significant;

pub(super) struct InputDeadZoneJump;

impl Effect for InputDeadZoneJump {
    fn id(&self) -> &'static str {
        InputDeadZone.id()
    }
    fn name(&self) -> &'static str {
        InputDeadZone.name()
    }
    fn doc(&self) -> &'static str {
        InputDeadZone.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[Spec::within(
                "threshold",
                Quantity::Input,
                (0.0, f64::INFINITY),
            )]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        InputDeadZone.confusions()
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        format!(
            "Inputs up to u = ±{} do nothing and larger ones act in full: ask for at least this amount or for nothing, and check the threshold of the amplifier.",
            significant(p[0], 3)
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        InputDeadZone.unsuited(axis)
    }
    fn seat(&self) -> Seat {
        InputDeadZone.seat()
    }
    fn width(&self) -> usize {
        0
    }
    fn inner(&self) -> Option<usize> {
        Some(0)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        InputDeadZone.grid(survey)
    }
    fn transmit(&self, p: &[f64], path: &mut Path) {
        path.threshold = path.threshold.max(p[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, InputDeadZoneJump};
    use crate::effects::Path;

    #[test]
    fn it_leaves_larger_inputs_whole() {
        let mut path = Path::default();
        InputDeadZoneJump.transmit(&[0.2], &mut path);
        assert_eq!([0.1, 0.5, -1.2].map(|u| path.pass(u)), [0.0, 0.5, -1.2]);
    }
}
