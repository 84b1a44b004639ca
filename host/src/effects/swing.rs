//! # What it is
//! An inertia that changes over the turn, `J(q) = J + amplitude·cos(q + phase)`: `τ = d/dt(ΔJ·v) − ½·ΔJ'·v²` is missing.
//! The first part is a second derivative, `d²/dt²(amplitude·sin(q + phase))`, of which the weak form takes none of a noisy
//! position.
//!
//! No effect of the catalogue: a crank, a linkage or a load that swings on another axis. But a sensor eccentricity feigns the
//! first part, and is what such an axis would be called.
//!
//! # References
//! B. Siciliano et al., Robotics: Modelling, Planning and Control, 2009, sec. 7.2 (a configuration-dependent inertia brings
//! half of its derivative times the squared speed).

use super::sensor_eccentricity::SensorEccentricity;
use super::{Confusion, Effect, Given, Inner, Motion, Point, Quantity, Scale, Seat, Spec};
use crate::format::quantity;

pub(super) struct Swing;

impl Effect for Swing {
    fn id(&self) -> &'static str {
        "swing"
    }
    fn name(&self) -> &'static str {
        "Inertia that changes over the turn"
    }
    fn doc(&self) -> &'static str {
        include_str!("swing.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("amplitude", Quantity::Inertia),
                Spec::new("phase", Quantity::Phase),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        &[]
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "The inertia changes over the turn, by about ±{}.",
            quantity(p[0].abs(), Quantity::Inertia.unit(motion))
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        SensorEccentricity.unsuited(axis)
    }
    fn width(&self) -> usize {
        2
    }
    fn seat(&self) -> Seat {
        Seat::Momentum
    }
    fn basis(&self, _inner: Inner, at: Point, out: &mut [f64]) {
        let (sin, cos) = at.q.sin_cos();
        let half = 0.5 * at.v * at.v;
        (out[0], out[1]) = (half * sin, half * cos);
    }
    fn error(&self, q: f64, out: &mut [(f64, f64)]) {
        SensorEccentricity.error(q, out);
    }
    fn named(&self, inner: Inner, c: &[f64], scale: Scale) -> Vec<f64> {
        SensorEccentricity.named(inner, c, scale)
    }
    fn linear(&self, p: &[f64], scale: Scale) -> (Inner, Vec<f64>) {
        SensorEccentricity.linear(p, scale)
    }
}
