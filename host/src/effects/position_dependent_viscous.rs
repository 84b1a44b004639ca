//! # What it is
//! Viscous friction that varies with position: `τ = amplitude·sin(2π·q/wavelength + phase)·v` beside the viscous friction that is
//! its mean.
//!
//! No effect of the catalogue: a film of oil or grease of uneven thickness, eddy currents in an uneven disc. But where speeds
//! are much the same it is a friction level that varies, and is what such an axis would be called.
//!
//! # References
//! B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and compensation methods for
//! the control of machines with friction, Automatica 30(7), 1994, sec. 2.1 (position dependence).

use super::position_dependent_friction::PositionDependentFriction;
use super::{Confusion, Effect, Inner, Motion, Quantity, Scale, Spec, Survey, Wave};
use crate::format::quantity;

pub(super) struct PositionDependentViscous;

impl Effect for PositionDependentViscous {
    fn id(&self) -> &'static str {
        "position-dependent-viscous"
    }
    fn name(&self) -> &'static str {
        "Position-dependent viscous friction"
    }
    fn doc(&self) -> &'static str {
        include_str!("position_dependent_viscous.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("amplitude", Quantity::Viscous),
                Spec::new("phase", Quantity::Phase),
                Spec::within(
                    "wavelength",
                    Quantity::Position,
                    (f64::MIN_POSITIVE, f64::INFINITY),
                ),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        &[]
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        format!(
            "Viscous friction varies by ±{} along the travel.",
            quantity(p[0].abs(), Quantity::Viscous.unit(motion))
        )
    }
    fn width(&self) -> usize {
        2
    }
    fn inner(&self) -> Option<usize> {
        Some(2)
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        PositionDependentFriction.grid(survey)
    }
    fn wave(&self, inner: Inner) -> Option<Wave> {
        Some(Wave {
            carrier: |at| at.v,
            ..PositionDependentFriction.wave(inner)?
        })
    }
    fn named(&self, inner: Inner, c: &[f64], scale: Scale) -> Vec<f64> {
        PositionDependentFriction.named(inner, c, scale)
    }
    fn linear(&self, p: &[f64], scale: Scale) -> (Inner, Vec<f64>) {
        PositionDependentFriction.linear(p, scale)
    }
}
