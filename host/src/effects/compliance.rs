//! # What it is
//! An elastic transmission: part of the inertia, `load_inertia`, hangs on the measured side by a spring with damping. Alone,
//! with the measured side held, it would swing at the antiresonance: `q_L = H·q` with
//! `H = (2ζωs + ω²)/(s² + 2ζωs + ω²)`, `ω = 2π·antiresonance`, ζ the damping ratio. The model's inertia is that of both
//! together; with `J` and the measured side free, both swing at `antiresonance·√(J/(J − load_inertia))`.
//!
//! Where the encoder sits on the load, what moves the axis arrives through the spring instead, and neither the load nor the
//! antiresonance shows: then it is `J·q̈ = G·(u − F)` with `G = (2ζωs + ω²)/(s² + 2ζωs + ω²)`, `ω = 2π·resonance`, and the parameters
//! are `resonance` and `damping_ratio`. `diagnose` tries both, and a model file may have either.
//!
//! # What it looks like in a recording
//! After steps of the drive the axis rings; slow motion is as ever. The residual has the shape of the fourth derivative of
//! position and grows towards the resonance.
//!
//! # What excites it
//! Steps, or a chirp through the resonance; samples at ten times its frequency. It is sought up to about 40 Hz where the
//! encoder is fine enough, and up to 10 Hz otherwise.
//!
//! # Confused with
//! delay, actuator-lag and sensor errors where only the foot of the resonance is excited: chirp past it.
//!
//! # Example
//! Belts, couplings, long shafts, harmonic drives.
//!
//! # References
//! G. Ellis, R. D. Lorenz, Resonant load control methods for industrial servo drives, IAS 2000, eq. 1 (motor and load,
//! resonance and antiresonance).

use super::compliance_load_side::ComplianceLoadSide;
use super::{Carried, Confusion, Coupling, Effect, Given, Inner, Motion, Quantity, Seat, Spec, Survey, geometric, undriven};
use crate::format::quantity;

/// Damping ratio of steel parts.
const DAMPING: f64 = 0.05;

pub(super) struct Compliance;

impl Effect for Compliance {
    fn id(&self) -> &'static str {
        "compliance"
    }
    fn name(&self) -> &'static str {
        "Elastic transmission"
    }
    fn doc(&self) -> &'static str {
        include_str!("compliance.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::within("load_inertia", Quantity::Inertia, (0.0, f64::INFINITY)),
                Spec::within("antiresonance", Quantity::Frequency, (f64::MIN_POSITIVE, f64::INFINITY)),
                Spec::within("damping_ratio", Quantity::Number, (0.0, 1.0)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "backlash",
                    tell_apart_by: "make small steps of several amplitudes, or add a load-side encoder: a spring answers in proportion, lost motion is the same whatever the step",
                },
                Confusion {
                    id: "delay",
                    tell_apart_by: "chirp the drive past the suspected resonance: an elastic transmission amplifies there, a delay only shifts",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "A load of {} hangs elastically on the axis and would swing alone at {}: put a notch there or stiffen the transmission, and keep the loop's bandwidth below a third of it.",
            quantity(p[0], Quantity::Inertia.unit(motion)),
            quantity(p[1], "Hz")
        )
    }
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[&ComplianceLoadSide]
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        undriven(axis)
    }
    fn seat(&self) -> Seat {
        Seat::Load
    }
    fn fast(&self) -> bool {
        true
    }
    fn inner(&self) -> Option<usize> {
        Some(1)
    }
    fn shape(&self) -> Option<usize> {
        Some(2)
    }
    fn textbook(&self) -> Option<f64> {
        Some(DAMPING)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        // From what the windows resolve to what the samples do.
        let low = 0.2 / survey.half_width;
        geometric(low, (0.1 / survey.period).clamp(2.0 * low, 20.0 * low), 14)
    }
    /// Between two samples the measured position is taken as a straight line. Seen from it the load swings freely; where
    /// the slope changes at a sample, its relative velocity jumps by as much.
    fn load(&self, inner: Inner, q: &[f64], _v: &[f64], period: f64) -> Carried {
        let omega = std::f64::consts::TAU * inner[0];
        let zeta = inner[1].clamp(0.0, 0.999);
        let damped = omega * (1.0 - zeta * zeta).sqrt();
        let decay = (-zeta * omega * period).exp();
        let (sin, cos) = (damped * period).sin_cos();
        let (mut y, mut rate, mut slope) = (0.0, 0.0, None);
        let mut ahead = vec![0.0];
        for pair in q.windows(2) {
            let next = (pair[1] - pair[0]) / period;
            rate -= slope.map_or(0.0, |slope| next - slope);
            slope = Some(next);
            let along = (rate + zeta * omega * y) / damped;
            let swung = decay * (y * cos + along * sin);
            rate = decay * (rate * cos - (omega * omega * y + zeta * omega * rate) / damped * sin);
            y = swung;
            ahead.push(y);
        }
        Carried {
            ahead,
            ..Carried::default()
        }
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0] > 0.0
    }
    fn coupling(&self, p: &[f64], _inertia: f64, _friction: [f64; 2]) -> Option<Coupling> {
        let omega = std::f64::consts::TAU * p[1];
        Some(Coupling {
            inertia: p[0],
            stiffness: p[0] * omega * omega,
            damping: 2.0 * p[2] * omega * p[0],
            gap: 0.0,
            friction: 0.0,
            viscous: 0.0,
            load_side: false,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Compliance, Effect};

    /// Under `q = sin Ωt` the load settles at `|H(iΩ)|`; straight lines between samples err by `(Ωh)²/12` of the motion,
    /// which `H` amplifies.
    #[test]
    fn the_load_follows_as_the_transfer_function_says() {
        let (h, f, zeta, drive) = (1e-3, 20.0, 0.05, 12.0);
        let turn = std::f64::consts::TAU;
        let q: Vec<f64> = (0..6000).map(|k| (turn * drive * f64::from(k) * h).sin()).collect();
        let relative = Compliance.load([f, zeta], &q, &[], h).ahead;
        let position = relative.iter().zip(&q).skip(4000).map(|(e, q)| (e + q).abs());
        let (x, damping) = (drive / f, 2.0 * zeta * drive / f);
        let gain = ((1.0 + damping * damping) / ((1.0 - x * x).powi(2) + damping * damping)).sqrt();
        let peak = position.fold(0.0, f64::max);
        assert!((peak / gain - 1.0).abs() < 2e-3, "{peak} {gain}");
    }
}
