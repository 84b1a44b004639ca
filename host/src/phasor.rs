//! Sines and cosines of many multiples of the same angles.
//!
//! `e^(i(n+d)x) = e^(inx)·e^(idx)`: from one number to the next every angle turns by the same step, a complex product in
//! place of a sine and a cosine. A product errs by at most `√5·ε` of its size, `ε = 2⁻⁵³` (Brent, Percival and Zimmermann,
//! Mathematics of Computation 76, 2007), and the numbers of a run are equally far apart within `8ε` of their size, so `k` steps
//! err by no more than `10k·ε·(1 + |nx|)`; the rounding of `nx` itself is `ε·|nx|`.

use rayon::prelude::*;

/// Steps after which sine and cosine are taken anew.
const LONGEST: usize = 32;
/// Steps between numbers that differ by less than this share of the numbers are equal.
const SAME: f64 = 4.0 * f64::EPSILON;

/// `e^(inx)` at every `x`.
struct Phasors {
    sin: Vec<f64>,
    cos: Vec<f64>,
}

impl Phasors {
    fn new(number: f64, x: &[f64]) -> Self {
        let (sin, cos) = x.iter().map(|x| (number * x).sin_cos()).unzip();
        Self { sin, cos }
    }

    /// The product with others.
    fn turn(&mut self, by: &Self) {
        let own = self.sin.iter_mut().zip(&mut self.cos);
        for ((s, c), (by_s, by_c)) in own.zip(by.sin.iter().zip(&by.cos)) {
            (*s, *c) = (*s * by_c + *c * by_s, *c * by_c - *s * by_s);
        }
    }
}

/// What becomes of `sin nx` and `cos nx` at all `x`, for every number `n` in turn.
pub fn each<T: Send>(
    numbers: &[f64],
    x: &[f64],
    take: impl Fn(&[f64], &[f64]) -> T + Sync,
) -> Vec<T> {
    let along = |run: &[f64]| -> Vec<T> {
        let mut phasors = Phasors::new(run[0], x);
        let mut taken = vec![take(&phasors.sin, &phasors.cos)];
        if let Some(second) = run.get(1) {
            let step = Phasors::new(second - run[0], x);
            for _ in 1..run.len() {
                phasors.turn(&step);
                taken.push(take(&phasors.sin, &phasors.cos));
            }
        }
        taken
    };
    let taken: Vec<Vec<T>> = runs(numbers).into_par_iter().map(along).collect();
    taken.into_iter().flatten().collect()
}

/// Numbers cut into runs of equal steps.
fn runs(numbers: &[f64]) -> Vec<&[f64]> {
    let mut runs = Vec::new();
    let mut rest = numbers;
    while !rest.is_empty() {
        let even = |k: &usize| {
            let (first, last) = (rest[1] - rest[0], rest[*k] - rest[k - 1]);
            (first - last).abs() <= SAME * rest[*k].abs().max(rest[0].abs())
        };
        let length = 1 + (1..rest.len().min(LONGEST)).take_while(even).count();
        let (run, after) = rest.split_at(length);
        runs.push(run);
        rest = after;
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::{LONGEST, each, runs};

    /// Against sine and cosine themselves, within the bound, for whole numbers, thirds, and steps that change.
    #[test]
    fn products_err_by_no_more_than_their_bound() {
        let x: Vec<f64> = (0..500).map(|k| 0.37 * f64::from(k) - 90.0).collect();
        let whole: Vec<f64> = (1..=120).map(f64::from).collect();
        let thirds: Vec<f64> = (6..=360).map(|k| f64::from(k) / 3.0 / 0.21).collect();
        let mixed = vec![24.0, 23.0, 22.0, 21.7, 21.0, 20.0, 19.0];
        for numbers in [whole, thirds, mixed] {
            let pairs = each(&numbers, &x, |sin, cos| (sin.to_vec(), cos.to_vec()));
            assert_eq!(pairs.len(), numbers.len());
            for (n, (sin, cos)) in numbers.iter().zip(pairs) {
                for ((x, s), c) in x.iter().zip(sin).zip(cos) {
                    let (exact_s, exact_c) = (n * x).sin_cos();
                    let bound = 5.0 * f64::EPSILON * LONGEST as f64 * (1.0 + (n * x).abs());
                    assert!((s - exact_s).hypot(c - exact_c) < bound, "{n}·{x}");
                }
            }
        }
    }

    #[test]
    fn runs_end_where_steps_change_or_errors_have_summed_up() {
        let numbers: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k)).collect();
        let lengths = |numbers: &[f64]| runs(numbers).iter().map(|r| r.len()).collect::<Vec<_>>();
        assert_eq!(lengths(&numbers), [LONGEST, 8]);
        assert_eq!(lengths(&[1.0, 2.0, 3.0, 3.5, 4.0, 5.0]), [3, 2, 1]);
        assert_eq!(lengths(&[]), [0; 0]);
    }
}
