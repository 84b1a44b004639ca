//! Fourier sums over rows at any instants.

use std::sync::Arc;

use nalgebra::Complex;
use rustfft::{Fft, FftPlanner};

/// Places on the circle for every turn to either side of none.
const PLACES: usize = 32;

/// Rows on a circle of equally spaced places, each at the one nearest to it, and the fast Fourier transform over them.
///
/// A row is off by half a place at most, so a term of a sum over `n` turns, out of `most`, by a phase of no more than
/// `π·n/(32·most)`.
pub struct Circle {
    places: Vec<usize>,
    most: i32,
    transform: Arc<dyn Fft<f64>>,
}

impl Circle {
    /// Rows at `x`, of which whole numbers are once around, for sums over up to so many turns to either side.
    pub fn new(x: &[f64], most: i32) -> Self {
        let count = (PLACES * most.unsigned_abs() as usize).next_power_of_two();
        let place = |x: &f64| (x.rem_euclid(1.0) * count as f64).round() as usize % count;
        Self {
            places: x.iter().map(place).collect(),
            most,
            transform: FftPlanner::new().plan_fft_inverse(count),
        }
    }

    /// All numbers of turns.
    pub fn turns(&self) -> impl Iterator<Item = i32> {
        -self.most..=self.most
    }

    /// The sums over some rows and their `z`.
    pub fn sums(&self, rows: impl Iterator<Item = (usize, Complex<f64>)>) -> Sums {
        let mut sums = vec![Complex::ZERO; self.transform.len()];
        rows.for_each(|(row, z)| sums[self.places[row]] += z);
        self.transform.process(&mut sums);
        Sums(sums)
    }
}

/// Sums over rows on a circle by the number of turns.
pub struct Sums(Vec<Complex<f64>>);

impl Sums {
    /// `Σ z·e^(2πi·n·x)`.
    pub fn at(&self, n: i32) -> Complex<f64> {
        self.0[n.rem_euclid(self.0.len() as i32) as usize]
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::{Circle, Complex, PLACES};

    /// Against the sums themselves, term by term within the phase that half a place makes.
    #[test]
    fn sums_err_by_half_a_place_at_most() {
        let most = 11;
        let x: Vec<f64> = (0..300).map(|k| 0.0173 * f64::from(k) - 1.2).collect();
        let z: Vec<Complex<f64>> = (0..300).map(|k| Complex::cis(f64::from(k * k))).collect();
        let circle = Circle::new(&x, most);
        let sums = circle.sums(z.iter().copied().enumerate().skip(7));
        assert_eq!(circle.turns().count(), 23);
        for n in circle.turns() {
            let terms = x.iter().zip(&z).skip(7);
            let exact: Complex<f64> = terms
                .map(|(x, z)| z * Complex::cis(TAU * f64::from(n) * x))
                .sum();
            let bound = 293.0 * PI * f64::from(n.abs()) / (PLACES as f64 * f64::from(most));
            assert!((sums.at(n) - exact).norm() <= bound + 1e-9, "{n}");
        }
    }
}
