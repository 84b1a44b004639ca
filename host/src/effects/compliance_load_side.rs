//! An elastic transmission between the drive and the side that the encoder measures.
//!
//! With `T` what the spring transmits and `x` how far the drive is ahead, `J_L·q̈ = T = k·x + c·ẋ` and `J·q̈ + J_M·ẍ = u − F`
//! give `J·q̈ = G·(u − F)`, `G = (2ζωs + ω²)/(s² + 2ζωs + ω²)`, with `ω² = k·J/(J_M·J_L)` and `2ζω = c·J/(J_M·J_L)`: the friction `F`
//! of the motor passes the spring, too, and how `J` is divided shows in nothing but where that friction acts while the spring
//! swings. Fits let it act at the measured speed.

use super::compliance::Compliance;
use super::{
    Confusion, Coupling, Effect, Given, MOTOR, Motion, Path, Quantity, Seat, Spec, Survey,
    geometric,
};
use crate::format::quantity;

/// Damping ratio with which a resonance is sought: more than it will have, so that a few frequencies come near it.
const SOUGHT: f64 = 0.15;
/// Resonance beyond which no recording shows a spring, Hz: simulation follows every swing of it.
const STIFFEST: f64 = 1000.0;

pub(super) struct ComplianceLoadSide;

impl Effect for ComplianceLoadSide {
    fn id(&self) -> &'static str {
        Compliance.id()
    }
    fn name(&self) -> &'static str {
        Compliance.name()
    }
    fn doc(&self) -> &'static str {
        Compliance.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::within(
                    "resonance",
                    Quantity::Frequency,
                    (f64::MIN_POSITIVE, STIFFEST),
                ),
                Spec::within("damping_ratio", Quantity::Number, (0.0, 1.0)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        Compliance.confusions()
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        format!(
            "Between the drive and the measured side something elastic swings at {}: stiffen the transmission, and keep the loop's bandwidth below a third of that, or close it over an encoder on the motor.",
            quantity(p[0], "Hz")
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        Compliance.unsuited(axis)
    }
    fn seat(&self) -> Seat {
        Seat::Input
    }
    fn divides(&self) -> bool {
        true
    }
    fn fast(&self) -> bool {
        Compliance.fast()
    }
    fn width(&self) -> usize {
        0
    }
    fn inner(&self) -> Option<usize> {
        Some(0)
    }
    fn shape(&self) -> Option<usize> {
        Some(1)
    }
    fn textbook(&self) -> Option<f64> {
        Some(SOUGHT)
    }
    /// Neighbours are a bandwidth of the resonance apart.
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        let low = 0.1 / survey.half_width;
        let high = (0.1 / survey.period).clamp(2.0 * low, 40.0 * low);
        let count = ((high / low).ln() / (2.0 * SOUGHT)).ceil();
        geometric(low, high, 1 + count as usize)
    }
    fn coupling(&self, p: &[f64], inertia: f64, _friction: [f64; 2]) -> Option<Coupling> {
        let omega = std::f64::consts::TAU * p[0];
        let reduced = (1.0 - MOTOR) * MOTOR * inertia;
        Some(Coupling {
            inertia: (1.0 - MOTOR) * inertia,
            stiffness: reduced * omega * omega,
            damping: 2.0 * p[1] * omega * reduced,
            gap: 0.0,
            friction: 0.0,
            viscous: 0.0,
            load_side: true,
        })
    }
    fn transmit(&self, p: &[f64], path: &mut Path) {
        path.resonance = std::f64::consts::TAU * p[0];
        path.damping = p[1];
    }
}
