//! # What it is
//! Friction that falls as speed rises from zero: `τ = (Fs − Fc)·e^(−|v/vs|^exponent)·sgn v` beside the Coulomb level, so
//! that breakaway needs the static level `Fs > Fc`. `vs` is the Stribeck velocity; the exponent is 2 in the friction laws
//! and estimated where the effect is looked for, as rigs show values from 0.5 to 2 (1 is Tustin's model).
//!
//! # What it looks like in a recording
//! Slow moves need more drive than the Coulomb level; the axis stands longer at reversals and starts with a jerk; at
//! very low speed it sticks and slips. The residual has the sign of velocity and lives near zero velocity.
//!
//! # What excites it
//! Slow motion: at least a tenth of the time below the Stribeck velocity, slow ramps through zero.
//!
//! # Confused with
//! presliding (a memory of displacement, not a function of speed): torque ramps below break-away tell.
//! power-law-viscous has the opposite slope near zero.
//!
//! # Example
//! Lubricated slideways and gear trains at low temperature; rubber seals.
//!
//! # References
//! R. Stribeck, 1902; B. Armstrong-Hélouvry, Control of Machines with Friction, 1991;
//! A. Tustin, 1947; C. Canudas de Wit et al., A new model for control of systems with friction, IEEE TAC 40(3), 1995, eq. 4.

use bristle_core::friction::Curve;

use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Scale, Spec, Survey, geometric};
use crate::format::quantity;

/// Exponent of the curve in the friction laws.
const EXPONENT: f64 = 2.0;

pub(super) struct Stribeck;

impl Effect for Stribeck {
    fn id(&self) -> &'static str {
        "stribeck"
    }
    fn name(&self) -> &'static str {
        "Stribeck effect"
    }
    fn doc(&self) -> &'static str {
        include_str!("stribeck.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("static", Quantity::Torque),
                Spec::within("stribeck_velocity", Quantity::Speed, (f64::MIN_POSITIVE, f64::INFINITY)),
                Spec::within("exponent", Quantity::Number, (0.5, 3.0)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "presliding",
                    tell_apart_by: "ramp the drive slowly up and down below break-away: bristles deflect and spring back, a Stribeck curve gives no motion at all",
                },
                Confusion {
                    id: "power-law-viscous",
                    tell_apart_by: "drive slow constant speeds down to a hundredth of the top speed: Stribeck friction rises towards zero speed, lubricated friction falls",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "Friction rises to {} towards zero speed, below about {}: expect stick-slip at slow set points, and compensate with the Stribeck curve rather than a constant.",
            quantity(p[0], Quantity::Torque.unit(motion)),
            quantity(p[1], Quantity::Speed.unit(motion))
        )
    }
    fn inner(&self) -> Option<usize> {
        Some(1)
    }
    fn shape(&self) -> Option<usize> {
        Some(2)
    }
    fn textbook(&self) -> Option<f64> {
        Some(EXPONENT)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        // From where the sign of velocity is known to where the curve blends into the viscous part.
        let high = 0.4 * survey.top_speed;
        let low = survey.slow.max(0.005 * survey.top_speed).min(0.5 * high);
        geometric(low, high, 10)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        let x = at.v / inner[0];
        // The law's own curve for its own exponent; the host and the target then share the code.
        let decay = if inner[1] == EXPONENT {
            Curve::Exponential.decay(x)
        } else {
            (-x.abs().powf(inner[1])).exp()
        };
        out[0] = at.s * decay;
    }
    fn named(&self, inner: Inner, c: &[f64], scale: Scale) -> Vec<f64> {
        vec![scale.coulomb + c[0], inner[0], inner[1]]
    }
    fn linear(&self, p: &[f64], scale: Scale) -> (Inner, Vec<f64>) {
        ([p[1], p[2]], vec![p[0] - scale.coulomb])
    }
    fn shapes_level(&self) -> bool {
        true
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0] > 0.0
    }
}

/// The part of a friction law with bristles that falls with speed, `(Fs − Fc)·d(v/vs)` with a fixed curve.
pub struct Fixed(Curve);

/// `e^(−(v/vs)²)`, of the `LuGre` law.
pub static EXPONENTIAL: Fixed = Fixed(Curve::Exponential);
/// `1/(1 + (v/vs)²)`, of the modified `LuGre` law.
pub static RATIONAL: Fixed = Fixed(Curve::Rational);

impl Effect for Fixed {
    fn id(&self) -> &'static str {
        Stribeck.id()
    }
    fn name(&self) -> &'static str {
        Stribeck.name()
    }
    fn doc(&self) -> &'static str {
        Stribeck.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        &Stribeck.parameters()[..2]
    }
    fn confusions(&self) -> &'static [Confusion] {
        Stribeck.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        Stribeck.sentence(p, motion)
    }
    fn inner(&self) -> Option<usize> {
        Stribeck.inner()
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        Stribeck.grid(survey)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        out[0] = at.s * self.0.decay(at.v / inner[0]);
    }
    fn named(&self, inner: Inner, c: &[f64], scale: Scale) -> Vec<f64> {
        vec![scale.coulomb + c[0], inner[0]]
    }
    fn linear(&self, p: &[f64], scale: Scale) -> (Inner, Vec<f64>) {
        ([p[1], 0.0], vec![p[0] - scale.coulomb])
    }
    fn shapes_level(&self) -> bool {
        true
    }
    fn admissible(&self, c: &[f64]) -> bool {
        Stribeck.admissible(c)
    }
}
