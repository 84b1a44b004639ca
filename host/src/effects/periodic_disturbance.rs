//! # What it is
//! An external torque that is periodic in time, wherever the axis stands: `τ = −amplitude·sin(2π·frequency·t + phase)`, so
//! that a positive sine pushes in the positive direction. Time counts from the first sample of the recording. With a
//! `second_amplitude` and a `second_phase` a wave of twice the frequency comes on top, with a `third_amplitude` and a `third_phase`
//! one of three times the frequency, as where a force goes on and off.
//!
//! # What it looks like in a recording
//! A hum of one frequency in the residual, the same at every position and speed.
//!
//! # What excites it
//! Nothing needs to: it is there by itself. The recording must hold several of its periods, and tell frequencies up to
//! about 0.8 over the half-width of the narrowest test functions, a quarter of the usual (46 Hz where the encoder is fine);
//! faster ones average out of the motion.
//!
//! # Confused with
//! cogging and gravity at constant speed, where position and time run together: repeat at another speed.
//!
//! # Example
//! A pump or fan on the same frame, mains hum, another axis that oscillates, an engine's firing frequency.
//!
//! # References
//! M. Bodson, S. C. Douglas, Adaptive algorithms for the rejection of sinusoidal disturbances with unknown frequency,
//! Automatica 33(12), 1997; A. Schuster, On the investigation of hidden periodicities, 1898 (the periodogram).

use super::overtone::{Overtone, SECOND_AMPLITUDE, SECOND_PHASE, THIRD_AMPLITUDE, THIRD_PHASE};
use super::{Confusion, Effect, Inner, Motion, Quantity, Scale, Search, Spec, Wave, cartesian, polar};
use crate::format::quantity;

pub(super) struct PeriodicDisturbance;

const WAVE: [Spec; 3] = [
    Spec::new("amplitude", Quantity::Torque),
    Spec::new("phase", Quantity::Phase),
    Spec::within("frequency", Quantity::Frequency, (0.0, f64::INFINITY)),
];

/// With a wave of twice the periods beside.
pub(super) const OCTAVE: Overtone =
    Overtone { plain: &PeriodicDisturbance, parameters: &[WAVE[0], WAVE[1], WAVE[2], SECOND_AMPLITUDE, SECOND_PHASE] };

/// With one of three times the periods as well.
pub(super) const THREE_WAVES: Overtone = Overtone {
    plain: &PeriodicDisturbance,
    parameters: &[WAVE[0], WAVE[1], WAVE[2], SECOND_AMPLITUDE, SECOND_PHASE, THIRD_AMPLITUDE, THIRD_PHASE],
};

impl Effect for PeriodicDisturbance {
    fn id(&self) -> &'static str {
        "periodic-disturbance"
    }
    fn name(&self) -> &'static str {
        "Periodic disturbance"
    }
    fn doc(&self) -> &'static str {
        include_str!("periodic_disturbance.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        &WAVE
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "cogging",
                    tell_apart_by: "repeat the motion at half the speed: a disturbance keeps its frequency, cogging halves it",
                },
                Confusion {
                    id: "load-step",
                    tell_apart_by: "record three times as long: a periodic disturbance returns at equal intervals, a load step does not",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        let torque = if motion == Motion::Rotary { "torque" } else { "force" };
        format!(
            "A {torque} of {} disturbs the axis at {}, wherever it stands: find what runs at this frequency nearby, or add a resonant term to the controller.",
            quantity(p[0].abs(), Quantity::Torque.unit(motion)),
            quantity(p[2], "Hz")
        )
    }
    fn timed(&self) -> bool {
        true
    }
    fn search(&self) -> Search {
        Search::Line
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&OCTAVE, &THREE_WAVES]
    }
    fn width(&self) -> usize {
        2
    }
    fn fast(&self) -> bool {
        true
    }
    fn inner(&self) -> Option<usize> {
        Some(2)
    }
    fn wave(&self, inner: Inner) -> Option<Wave> {
        let number = std::f64::consts::TAU * inner[0];
        Some(Wave { number, coordinate: |at| at.moment.t, carrier: |_| -1.0 })
    }
    fn named(&self, inner: Inner, c: &[f64], _scale: Scale) -> Vec<f64> {
        let [amplitude, phase] = polar(c);
        vec![amplitude, phase, inner[0]]
    }
    fn linear(&self, p: &[f64], _scale: Scale) -> (Inner, Vec<f64>) {
        ([p[2], 0.0], cartesian(p[0], p[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, PeriodicDisturbance};
    use crate::effects::{Moment, Motion, Point, Scale};

    #[test]
    fn a_positive_sine_pushes() {
        let scale = Scale { coulomb: 0.0, gain: 1.0 };
        let (inner, c) = PeriodicDisturbance.linear(&[0.2, 0.4, 3.0], scale);
        for t in [0.0, 0.07, 1.9] {
            let at = Point::new(Motion::Rotary, 5.0, 1.0, 1.0).at(Moment { t, dt: 1e-3, u: 1.0 });
            let mut b = [0.0; 2];
            PeriodicDisturbance.basis(inner, at, &mut b);
            let pushing = 0.2 * (std::f64::consts::TAU * 3.0 * t + 0.4).sin();
            assert!((pushing + c[0] * b[0] + c[1] * b[1]).abs() < 1e-14);
        }
    }
}
