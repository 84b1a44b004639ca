//! The rational Stribeck curve as one linear problem.
//!
//! Sliding under `J·v̇ + Fv·v + [Fc + (Fs − Fc)/(1 + (v/vs)²)]·sgn v = k·u`, multiplied by `vs² + v²`, is polynomial:
//!
//! `J·vs²·v̇ + J·v²·v̇ + Fv·vs²·v + Fv·v³ + Fs·vs²·sgn v + Fc·v·|v| = k·u·vs² + k·u·v²`.
//!
//! Under a test function `v̇` becomes `∫q φ̈` and `v²·v̇ = d(v³/3)/dt` becomes `−∫v³ φ̇/3`, exactly. The unknowns are the
//! products vs², Fs·vs², Fc, Fv, Fv·vs², J and J·vs²; nothing is scanned. The equation is divided by `J·vs²`, so that
//! `∫q φ̈`, which carries the worst of the encoder's noise, is the response.
//!
//! All this holds in sliding alone. Windows in which the axis reverses, rests or creeps on bent bristles are left out.
//!
//! Multiplied rows weigh noise by `1 + (v/vs)²`: fast sliding would rule. A second pass divides each row by that
//! factor with `vs` of the first (Sanathanan and Koerner, IEEE TAC 8, 1963).
//!
//! Source: the modified `LuGre` law in sliding, with the curve of D. P. Hess and A. Soom, J. Tribology 112, 1990.

use super::weights::{Weights, cell_means};
use super::{Form, Given, Quantities};
use crate::effects::Quantity;
use crate::weak::{Track, Windows};

pub(super) struct RationalStribeck {
    /// What the curve leaves out of the model's own law.
    pub remark: &'static str,
}

impl Form for RationalStribeck {
    fn name(&self) -> &'static str {
        "Rational Stribeck curve"
    }
    fn equation(&self) -> &'static str {
        "J·vs²·∫q φ̈ − J·⅓∫v³ φ̇ − Fv·vs²·∫q φ̇ + Fv·∫v³ φ + Fs·vs²·∫s φ + Fc·∫v|v| φ = vs²·k·∫u φ + k·∫u v² φ"
    }
    fn remark(&self) -> &'static str {
        self.remark
    }
    /// `∫q φ̈`, then what multiplies 1/J, 1/(J·vs²), 1/vs², Fv/J, Fv/(J·vs²), Fs/J and Fc/(J·vs²).
    fn columns(&self, track: &Track, windows: &Windows, given: &Given) -> Vec<Vec<f64>> {
        let weights = Weights::new(track, windows);
        let square = cell_means(&track.v, |v| v * v);
        let swept: Vec<f64> = given
            .drive
            .iter()
            .zip(&square)
            .map(|(u, v)| u * v)
            .collect();
        let nodes = |f: fn(f64) -> f64| -> Vec<f64> { track.v.iter().map(|v| f(*v)).collect() };
        let cube = nodes(|v| v * v * v);
        let directed = nodes(|v| v * v.abs());
        let sign: Vec<f64> = track.cells.iter().map(|c| c.s).collect();
        let scaled =
            |x: Vec<f64>, factor: f64| -> Vec<f64> { x.iter().map(|x| factor * x).collect() };
        vec![
            windows.acceleration(&track.q),
            windows.hold(track, &given.drive),
            windows.hold(track, &swept),
            scaled(windows.apply(&weights.slope, &cube), 1.0 / 3.0),
            scaled(windows.velocity(&track.q), -1.0),
            scaled(windows.apply(&weights.value, &cube), -1.0),
            scaled(windows.hold(track, &sign), -1.0),
            scaled(windows.apply(&weights.value, &directed), -1.0),
        ]
    }
    fn physical(&self) -> Quantities {
        &[
            ("inertia", Quantity::Inertia),
            ("viscous", Quantity::Viscous),
            ("static", Quantity::Torque),
            ("coulomb", Quantity::Torque),
            ("stribeck_velocity", Quantity::Speed),
        ]
    }
    fn decode(&self, beta: &[f64]) -> Vec<f64> {
        let (inertia, square) = (1.0 / beta[0], beta[0] / beta[1]);
        vec![
            inertia,
            beta[4] / beta[1],
            beta[5] * inertia,
            beta[6] / beta[1],
            square.sqrt(),
        ]
    }
    fn products(&self) -> &'static [&'static str] {
        &[
            "1/J",
            "1/(J·vs²)",
            "1/vs²",
            "Fv/J",
            "Fv/(J·vs²)",
            "Fs/J",
            "Fc/(J·vs²)",
        ]
    }
    fn encode(&self, p: &[f64]) -> Vec<f64> {
        let [inertia, viscous, top, coulomb, speed] = p[..] else {
            return Vec::new();
        };
        let square = speed * speed;
        vec![
            1.0 / inertia,
            1.0 / (inertia * square),
            1.0 / square,
            viscous / inertia,
            viscous / (inertia * square),
            top / inertia,
            coulomb / (inertia * square),
        ]
    }
    fn sliding_only(&self) -> bool {
        true
    }
    /// `1 + (v/vs)²` by the mean square of velocity in each window.
    fn factor(&self, physical: &[f64], track: &Track, windows: &Windows) -> Option<Vec<f64>> {
        let speed = physical
            .last()
            .copied()
            .filter(|v| v.is_finite() && *v > 0.0)?;
        let weights = Weights::new(track, windows);
        let square: Vec<f64> = track.v.iter().map(|v| (v / speed).powi(2)).collect();
        let mean = windows.apply(&weights.value, &square);
        Some(mean.iter().map(|m| 1.0 + m).collect())
    }
}
