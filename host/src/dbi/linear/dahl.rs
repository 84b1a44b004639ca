//! The simplified law of Dahl as one linear problem.
//!
//! With the bristle force `F = k·u − J·v̇ − Fv·v`, the law `Ḟ = σ0·v·(1 − F·sgn v/Fc)` is in the weak form
//!
//! `−∫F φ̇ = σ0·∫v φ − (σ0/Fc)·∫|v|·F φ`,
//!
//! and every `J·v̇` inside integrates by parts, `∫v̇ φ̇ = −∫v φ̈ = ∫q φ⃛` and `∫|v|·v̇ φ = −½·∫v·|v| φ̇`:
//!
//! `−k·∫u φ̇ + J·∫q φ⃛ − Fv·∫q φ̈ = −σ0·∫q φ̇ − (σ0/Fc)·k·∫|v|·u φ − (σ0/Fc)·J·½·∫v·|v| φ̇ + (σ0/Fc)·Fv·∫v·|v| φ`.
//!
//! The unknowns are the products J, Fv, σ0, σ0/Fc, σ0·J/Fc and σ0·Fv/Fc; no hidden state is needed and nothing is scanned.
//! Encoder noise is worst in `∫q φ⃛`, so the equation is divided by J and that functional is the response. At rest the
//! law holds as well, so rest is not masked.
//!
//! Source: the weak form of distribution-based identification applied to P. R. Dahl, A solid friction model, 1968, with
//! the exponent 1.

use super::weights::{Weights, cell_means};
use super::{Form, Given, Quantities};
use crate::effects::Quantity;
use crate::weak::{Track, Windows};

pub(super) struct SimplifiedDahl;

impl Form for SimplifiedDahl {
    fn name(&self) -> &'static str {
        "Simplified Dahl law"
    }
    fn equation(&self) -> &'static str {
        "−k·∫u φ̇ + J·∫q φ⃛ − Fv·∫q φ̈ = −σ0·∫q φ̇ − (σ0/Fc)·k·∫|v|u φ − (σ0/Fc)·J·½∫v|v| φ̇ + (σ0/Fc)·Fv·∫v|v| φ"
    }
    fn remark(&self) -> &'static str {
        "Exact for this law; the products |v|u and v|v| are made of smoothed velocity, whose noise biases them."
    }
    /// `∫q φ⃛`, then what multiplies 1/J, Fv/J, σ0/J, (σ0/Fc)/J, σ0/Fc and (σ0/Fc)·Fv/J.
    fn columns(&self, track: &Track, windows: &Windows, given: &Given) -> Vec<Vec<f64>> {
        let weights = Weights::new(track, windows);
        let speed = cell_means(&track.v, f64::abs);
        let power: Vec<f64> = given.drive.iter().zip(&speed).map(|(u, v)| u * v).collect();
        let square: Vec<f64> = track.v.iter().map(|v| v * v.abs()).collect();
        let scaled =
            |x: Vec<f64>, factor: f64| -> Vec<f64> { x.iter().map(|x| factor * x).collect() };
        vec![
            windows.apply(&weights.third, &track.q),
            windows.apply(&weights.held_slope, &given.drive),
            windows.acceleration(&track.q),
            windows.velocity(&track.q),
            scaled(windows.apply(windows.hold_weights(), &power), -1.0),
            scaled(windows.apply(&weights.slope, &square), -0.5),
            windows.apply(&weights.value, &square),
        ]
    }
    fn physical(&self) -> Quantities {
        &[
            ("inertia", Quantity::Inertia),
            ("viscous", Quantity::Viscous),
            ("bristle_stiffness", Quantity::Stiffness),
            ("coulomb", Quantity::Torque),
        ]
    }
    fn decode(&self, beta: &[f64]) -> Vec<f64> {
        let inertia = 1.0 / beta[0];
        vec![
            inertia,
            beta[1] * inertia,
            beta[2] * inertia,
            beta[2] / beta[3],
        ]
    }
    fn products(&self) -> &'static [&'static str] {
        &["1/J", "Fv/J", "σ0/J", "σ0/(Fc·J)", "σ0/Fc", "σ0·Fv/(Fc·J)"]
    }
    fn encode(&self, p: &[f64]) -> Vec<f64> {
        let [inertia, viscous, stiffness, coulomb] = p[..] else {
            return Vec::new();
        };
        let rate = stiffness / coulomb;
        vec![
            1.0 / inertia,
            viscous / inertia,
            stiffness / inertia,
            rate / inertia,
            rate,
            rate * viscous / inertia,
        ]
    }
}
