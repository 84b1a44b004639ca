//! A sensor error once per turn that depends on what the sensor shows rather than on where the axis stands: of the true position it
//! is `amplitude·sin(q + phase) + second_amplitude·sin(2·q + second_phase)`, of a second amplitude of half of the first squared.

use super::sensor_eccentricity::SensorEccentricity;
use super::{
    Confusion, Effect, FREE, Given, Impostor, Inner, Motion, Quantity, Scale, Seat, Spec,
    cartesian, polar,
};

pub(super) struct SensorEccentricityHarmonic;

impl Effect for SensorEccentricityHarmonic {
    fn id(&self) -> &'static str {
        SensorEccentricity.id()
    }
    fn name(&self) -> &'static str {
        SensorEccentricity.name()
    }
    fn doc(&self) -> &'static str {
        SensorEccentricity.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("amplitude", Quantity::Position),
                Spec::new("phase", Quantity::Phase),
                Spec::new("second_amplitude", Quantity::Position),
                Spec::new("second_phase", Quantity::Phase),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        SensorEccentricity.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        SensorEccentricity.sentence(p, motion)
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        SensorEccentricity.unsuited(axis)
    }
    fn impostor(&self) -> Option<Impostor> {
        SensorEccentricity.impostor()
    }
    fn seat(&self) -> Seat {
        SensorEccentricity.seat()
    }
    fn fast(&self) -> bool {
        SensorEccentricity.fast()
    }
    fn width(&self) -> usize {
        4
    }
    fn error(&self, q: f64, out: &mut [(f64, f64)]) {
        SensorEccentricity.error(q, out);
        let ((sin, cos), _) = (out[0], out[1]);
        let (sin, cos) = (2.0 * sin * cos, cos * cos - sin * sin);
        (out[2], out[3]) = ((sin, 2.0 * cos), (cos, -2.0 * sin));
    }
    fn named(&self, _inner: Inner, c: &[f64], _scale: Scale) -> Vec<f64> {
        [polar(&c[..2]), polar(&c[2..])].concat()
    }
    fn linear(&self, p: &[f64], _scale: Scale) -> (Inner, Vec<f64>) {
        let both = [cartesian(p[0], p[1]), cartesian(p[2], p[3])];
        (FREE, both.concat())
    }
    fn admissible(&self, c: &[f64]) -> bool {
        let ([first, _], [second, _]) = (polar(&c[..2]), polar(&c[2..]));
        // Twice what it is for an error that depends on what is shown. Beyond, it has a cause of its own.
        second <= first * first && SensorEccentricity.admissible(c)
    }
}
