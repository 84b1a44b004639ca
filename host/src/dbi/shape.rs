//! The test function of the windows, and what it passes.

use bristle_core::weak::TestFunction;
use serde::Serialize;

/// φ over its support and over frequency.
#[derive(Clone, Debug, Serialize)]
pub struct Shape {
    /// Half-width, s.
    pub half_width: f64,
    /// Time from the centre, s.
    pub tau: Vec<f64>,
    /// `φ`, 1/s.
    pub value: Vec<f64>,
    /// `φ̇`, 1/s².
    pub first_derivative: Vec<f64>,
    /// `φ̈`, 1/s³.
    pub second_derivative: Vec<f64>,
    /// Frequency, Hz.
    pub frequency: Vec<f64>,
    /// `|Φ(f)|`, the share of a sine of that frequency that `∫x φ` passes.
    pub response: Vec<f64>,
    /// Where the response has fallen to `1/√2`, Hz.
    pub cutoff: f64,
}

/// Points of φ over its support.
const POINTS: usize = 200;
/// The response is shown up to this many times the cutoff: into the side lobes.
const SPAN: f64 = 10.0;

impl Shape {
    /// The test function of a half-width in seconds.
    pub fn new(half_width: f64) -> Self {
        let phi = TestFunction::new(half_width);
        let tau: Vec<f64> = (0..=POINTS)
            .map(|k| half_width * (2.0 * k as f64 / POINTS as f64 - 1.0))
            .collect();
        let over = |f: &dyn Fn(f64) -> f64| tau.iter().map(|t| f(*t)).collect();
        let cutoff = cutoff(&phi);
        let frequency: Vec<f64> = (0..=4 * POINTS)
            .map(|k| SPAN * cutoff * k as f64 / (4 * POINTS) as f64)
            .collect();
        Self {
            half_width,
            value: over(&|t| phi.value(t)),
            first_derivative: over(&|t| phi.first_derivative(t)),
            second_derivative: over(&|t| phi.second_derivative(t)),
            response: frequency.iter().map(|f| response(&phi, *f)).collect(),
            tau,
            frequency,
            cutoff,
        }
    }
}

/// `|∫φ(τ)·cos(2πfτ) dτ|` by the trapezoidal rule, which converges fast: φ vanishes with its derivatives at both ends.
fn response(phi: &TestFunction<f64>, frequency: f64) -> f64 {
    const STEPS: i32 = 400;
    let step = phi.half_width() / f64::from(STEPS);
    let sum: f64 = (-STEPS..=STEPS)
        .map(|k| {
            let tau = f64::from(k) * step;
            phi.value(tau) * (std::f64::consts::TAU * frequency * tau).cos()
        })
        .sum();
    (sum * step).abs()
}

/// Frequency of −3 dB, by bisection; φ is all positive, so the response falls up to its first zero.
fn cutoff(phi: &TestFunction<f64>) -> f64 {
    let (mut low, mut high) = (0.0, 1.0 / phi.half_width());
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if response(phi, middle) > 0.5_f64.sqrt() {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::Shape;

    /// `∫(1 − x²)⁶·cos(zx) dx` over its area is `Γ(7.5)·(2/z)^6.5·J₆.₅(z) = 0F1(; 7.5; −z²/4)` (Poisson's integral).
    fn bessel(z: f64) -> f64 {
        let (mut term, mut sum) = (1.0, 1.0);
        for k in (0..200).map(f64::from) {
            term *= -z * z / (4.0 * (k + 1.0) * (7.5 + k));
            sum += term;
        }
        f64::abs(sum)
    }

    #[test]
    fn the_response_is_a_bessel_function() {
        let shape = Shape::new(0.1);
        let z = |f: f64| std::f64::consts::TAU * f * 0.1;
        for (f, measured) in shape.frequency.iter().zip(&shape.response).step_by(40) {
            // The series cancels terms that grow as e^z, each rounded to 10⁻¹⁶ of itself.
            let rounding = 1e-15 * z(*f).exp();
            assert!((measured - bessel(z(*f))).abs() < 1e-9 + rounding, "{f} Hz");
        }
        assert!((bessel(z(shape.cutoff)) - 0.5_f64.sqrt()).abs() < 1e-9);
    }
}
