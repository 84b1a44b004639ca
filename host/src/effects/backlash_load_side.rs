//! Lost motion between the drive and the side that the encoder measures: see [`crate::slack`] for the equation.

use super::backlash::{Backlash, CONTACT};
use super::{
    Confusion, Coupling, Effect, Gap, Given, MOTOR, Motion, Path, Quantity, Seat, Spec, Survey,
};
use crate::format::quantity;

pub(super) struct BacklashLoadSide {
    /// Whether the measured side has all the friction, and may be the lighter one, rather than weigh as much as the motor.
    light: bool,
}

impl BacklashLoadSide {
    pub(super) const ALIKE: Self = Self { light: false };
    pub(super) const LIGHT: Self = Self { light: true };

    fn gap(&self, p: &[f64]) -> Gap {
        let (friction, inertia) = if self.light {
            (0.0, p[1])
        } else {
            (p[1], MOTOR)
        };
        Gap {
            width: p[0],
            friction,
            inertia,
        }
    }
}

impl Effect for BacklashLoadSide {
    fn id(&self) -> &'static str {
        Backlash.id()
    }
    fn name(&self) -> &'static str {
        Backlash.name()
    }
    fn doc(&self) -> &'static str {
        Backlash.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const ALIKE: &[Spec] = &[
            Spec::within("matched_gap", Quantity::Position, (0.0, f64::INFINITY)),
            Spec::within("motor_friction", Quantity::Number, (0.0, 1.0)),
        ];
        const LIGHT: &[Spec] = &[
            Spec::within("gap", Quantity::Position, (0.0, f64::INFINITY)),
            // Neither side is without inertia.
            Spec::within("motor_share", Quantity::Number, (0.05, 0.95)),
        ];
        if self.light { LIGHT } else { ALIKE }
    }
    fn confusions(&self) -> &'static [Confusion] {
        Backlash.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        let play = quantity(p[0], Quantity::Position.unit(motion));
        let [friction, alike] = if self.light {
            [", which has the friction,", ""]
        } else {
            ["", " if both weigh alike"]
        };
        format!(
            "The measured side{friction} follows the drive with a play of {play}{alike}: preload or replace the gear or coupling, or cross the gap slowly at reversals."
        )
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        Backlash.unsuited(axis)
    }
    fn seat(&self) -> Seat {
        Seat::Input
    }
    fn divides(&self) -> bool {
        true
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
        Some(if self.light { MOTOR } else { 1.0 })
    }
    fn shapes(&self, _survey: &Survey) -> Vec<f64> {
        if self.light {
            // The motor half as heavy again as the load, and three times as heavy.
            vec![0.6, 0.75]
        } else {
            // All friction on the side of the motor, as much on either, all behind the gap.
            vec![1.0, 0.5, 0.0]
        }
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        Backlash.grid(survey)
    }
    fn transmit(&self, p: &[f64], path: &mut Path) {
        path.gap = self.gap(p);
    }
    fn coupling(&self, p: &[f64], inertia: f64, [coulomb, viscous]: [f64; 2]) -> Option<Coupling> {
        let gap = self.gap(p);
        let load = (1.0 - gap.inertia) * inertia;
        // Without a gap both sides are one.
        (gap.width > 0.0).then_some(Coupling {
            inertia: load,
            stiffness: load * CONTACT * CONTACT,
            damping: 2.0 * load * CONTACT,
            gap: gap.width,
            friction: (1.0 - gap.friction) * coulomb,
            viscous: (1.0 - gap.friction) * viscous,
            load_side: true,
        })
    }
}
