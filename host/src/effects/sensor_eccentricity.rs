//! # What it is
//! A once-per-turn error of the measured position: where the axis stands at `q`, the sensor shows
//! `q + amplitude·sin(q + phase)`. Where the error depends on what is shown instead, there is a second harmonic of half of the
//! amplitude squared, a `second_amplitude` with a `second_phase`, in `second_amplitude·sin(2·q + second_phase)`; up to twice that is
//! taken for one.
//!
//! # What it looks like in a recording
//! A feigned acceleration once per turn that grows with the square of speed; at constant speed the measured velocity
//! sways.
//!
//! # What excites it
//! Many turns at high constant speed.
//!
//! # Confused with
//! gravity, whose torque does not grow with speed; once-per-turn torques in general: constant speeds, slow and fast.
//! Below a count of the sensor it cannot be seen: use a reference encoder.
//! An inertia that changes over the turn, which the catalogue lacks, is tried in its place.
//!
//! # Example
//! A code wheel mounted off centre, a magnet beside the axis of its Hall sensor, a resolver with unequal windings.
//!
//! # References
//! J. Lara, J. Xu, A. Chandra, Effects of rotor position error in the performance of field-oriented-controlled PMSM drives
//! for electric vehicle traction applications, IEEE Trans. Industrial Electronics 63(8), 2016.

use super::{Confusion, Effect, FREE, Given, Impostor, Inner, Motion, Quantity, Scale, Seat, Spec, cartesian, polar};
use super::sensor_eccentricity_harmonic::SensorEccentricityHarmonic;
use super::swing::Swing;
use crate::format::quantity;

pub(super) struct SensorEccentricity;

/// Largest amplitude, rad: half of that from which on the sensor would run backwards.
const LARGEST: f64 = 0.5;

impl Effect for SensorEccentricity {
    fn id(&self) -> &'static str {
        "sensor-eccentricity"
    }
    fn name(&self) -> &'static str {
        "Sensor eccentricity"
    }
    fn doc(&self) -> &'static str {
        include_str!("sensor_eccentricity.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("amplitude", Quantity::Position),
                Spec::new("phase", Quantity::Phase),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "gravity",
                    tell_apart_by: "turn at several constant speeds: an unbalance keeps its torque, a sensor error feigns one that grows with the square of speed",
                },
                Confusion {
                    id: "cogging",
                    tell_apart_by: "turn at several constant speeds, or compare with a reference encoder: a sensor error grows with the square of speed",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "The measured position errs by ±{} once per turn: centre the sensor, or subtract a table over the turn before differentiating.",
            quantity(p[0].abs(), Quantity::Position.unit(motion))
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        (axis.motion == Motion::Linear).then_some("a linear axis has no turn")
    }
    fn impostor(&self) -> Option<Impostor> {
        Some(Impostor {
            effect: &Swing,
            coordinate: "position and squared velocity",
        })
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&SensorEccentricityHarmonic]
    }
    fn seat(&self) -> Seat {
        Seat::Sensor
    }
    fn fast(&self) -> bool {
        true
    }
    fn width(&self) -> usize {
        2
    }
    fn error(&self, q: f64, out: &mut [(f64, f64)]) {
        let (sin, cos) = q.sin_cos();
        (out[0], out[1]) = ((sin, cos), (cos, -sin));
    }
    fn named(&self, _inner: Inner, c: &[f64], _scale: Scale) -> Vec<f64> {
        polar(c).to_vec()
    }
    fn linear(&self, p: &[f64], _scale: Scale) -> (Inner, Vec<f64>) {
        (FREE, cartesian(p[0], p[1]))
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0].hypot(c[1]) <= LARGEST
    }
}
