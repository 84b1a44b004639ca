//! # What it is
//! Lubricated friction that grows slower than speed: `τ = coefficient·|v|^exponent·sgn v`, exponent between 0 and 1,
//! in place of or beside the linear viscous part.
//!
//! # What it looks like in a recording
//! Friction climbs steeply just above zero speed and flattens out. A Coulomb-viscous fit is too high at standstill, too
//! low at middle speeds and too high at the top.
//!
//! # What excites it
//! Speeds spread over two decades, slow ones included.
//!
//! # Confused with
//! quadratic-drag bends the other way; stribeck falls where this rises.
//!
//! # Example
//! Grease-lubricated harmonic drives and ball screws (shear thinning).
//!
//! # References
//! C. W. Kennedy, J. P. Desai, Modeling and control of the Mitsubishi PA-10 robot arm harmonic drive system,
//! IEEE/ASME Trans. Mechatronics 10(3), 2005; W. Ostwald, A. de Waele, 1923 (power-law fluids).

use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Spec, Survey};
use crate::format::significant;

/// Below, the curve is a Coulomb step within what a recording resolves; above, a viscous line.
const EXPONENTS: (f64, f64) = (0.2, 0.85);

pub(super) struct PowerLawViscous;

impl Effect for PowerLawViscous {
    fn id(&self) -> &'static str {
        "power-law-viscous"
    }
    fn name(&self) -> &'static str {
        "Power-law lubricated friction"
    }
    fn doc(&self) -> &'static str {
        include_str!("power_law_viscous.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("coefficient", Quantity::PowerLaw),
                Spec::within("exponent", Quantity::Number, EXPONENTS),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "stribeck",
                    tell_apart_by: "drive slow constant speeds down to a hundredth of the top speed: lubricated friction falls towards zero speed, Stribeck friction rises",
                },
                Confusion {
                    id: "presliding",
                    tell_apart_by: "repeat the reversals at half the acceleration: a function of speed stays where it is in velocity, a bristle deflection stays where it is in displacement",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], _motion: Motion) -> String {
        format!(
            "Friction grows as speed to the power {}, not linearly: a straight viscous line errs at slow and at middle speeds, so compensate with the power law.",
            significant(p[1], 2)
        )
    }
    fn inner(&self) -> Option<usize> {
        Some(1)
    }
    fn grid(&self, _survey: &Survey) -> Vec<f64> {
        vec![0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.78, 0.85]
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        out[0] = at.s * at.v.abs().powf(inner[0]);
    }
    fn shapes_level(&self) -> bool {
        true
    }
    fn admissible(&self, c: &[f64]) -> bool {
        c[0] > 0.0
    }
}
