//! What further columns would take off the squared residual of a linear fit, without refitting it.

use nalgebra::{Complex, DMatrix, DVector};

use crate::linear::dot;
use crate::spectrum::Circle;

/// A fit over some rows, taken out of everything.
pub struct Projection {
    rows: Vec<usize>,
    /// Orthonormal columns that span the fit.
    span: Vec<Vec<f64>>,
    residual: Vec<f64>,
}

/// Columns that the fit leaves less than this share of are part of it.
const NOTHING: f64 = 1e-10;

impl Projection {
    /// Fits `columns` to a response over the rows that are `seen`.
    pub fn new(response: &[f64], columns: &[Vec<f64>], seen: &[bool]) -> Self {
        let mut projection = Self {
            rows: (0..seen.len()).filter(|&k| seen[k]).collect(),
            span: Vec::new(),
            residual: Vec::new(),
        };
        for column in columns {
            let before = projection.pick(column);
            // Twice, as nearly dependent columns lose digits the first time.
            let once = projection.without_fit(before.clone());
            let mut rest = projection.without_fit(once);
            let norm = dot(&rest, &rest).sqrt();
            if norm > NOTHING * dot(&before, &before).sqrt() {
                rest.iter_mut().for_each(|x| *x /= norm);
                projection.span.push(rest);
            }
        }
        projection.residual = projection.without_fit(projection.pick(response));
        projection
    }

    fn pick(&self, column: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|&k| column[k]).collect()
    }

    fn without_fit(&self, mut column: Vec<f64>) -> Vec<f64> {
        for direction in &self.span {
            let along = dot(&column, direction);
            for (x, d) in column.iter_mut().zip(direction) {
                *x -= along * d;
            }
        }
        column
    }

    /// Gram matrix of further columns without the fit, and their products with the residual.
    fn gram(&self, columns: &[Vec<f64>]) -> (DMatrix<f64>, DVector<f64>) {
        let rest: Vec<Vec<f64>> = columns
            .iter()
            .map(|c| self.without_fit(self.pick(c)))
            .collect();
        let gram = DMatrix::from_fn(rest.len(), rest.len(), |i, j| {
            if i <= j { dot(&rest[i], &rest[j]) } else { 0.0 }
        });
        let right = DVector::from_fn(rest.len(), |i, _| dot(&rest[i], &self.residual));
        (gram, right)
    }

    /// How much the squared residual falls with a few more columns.
    pub fn gain(&self, columns: &[Vec<f64>]) -> f64 {
        let (gram, right) = self.gram(columns);
        gain(gram, &right)
    }

    /// The gain of a pair of columns after each number of turns `n` around a circle: of the real and the imaginary part of
    /// `z = e^(2πi·n·x)·(cos + i·sin)`.
    ///
    /// `Σ Re² z = ½ Σ (|z|² + Re z²)`, `Σ Im² z = ½ Σ (|z|² − Re z²)` and `Σ Re z·Im z = ½ Σ Im z²`, less what the fit takes,
    /// are the Gram matrix; all sums are Fourier sums.
    pub fn gains_of_turned(&self, sin: &[f64], cos: &[f64], circle: &Circle) -> Vec<f64> {
        let pair = || self.rows.iter().map(|&k| (k, Complex::new(cos[k], sin[k])));
        let along = |d: &Vec<f64>| circle.sums(pair().zip(d).map(|((k, z), d)| (k, z * d)));
        let energy: f64 = pair().map(|(_, z)| z.norm_sqr()).sum();
        let squares = circle.sums(pair().map(|(k, z)| (k, z * z)));
        let span: Vec<_> = self.span.iter().map(along).collect();
        let residual = along(&self.residual);
        let vector = |z: Complex<f64>| DVector::from_column_slice(&[z.re, z.im]);
        let turned = |n: i32| {
            let square = 0.5 * squares.at(2 * n);
            let diagonal = vector(Complex::new(square.re, -square.re)).add_scalar(0.5 * energy);
            let mut gram = DMatrix::from_diagonal(&diagonal);
            gram[(0, 1)] = square.im;
            for taken in span.iter().map(|sums| vector(sums.at(n))) {
                gram.ger(-1.0, &taken, &taken, 1.0);
            }
            gain(gram, &vector(residual.at(n)))
        };
        circle.turns().map(turned).collect()
    }

    /// How much the squared residual falls with the columns of every two of some sets, as shares of it; which two come first.
    pub fn gains_of_two(&self, sets: &[Vec<Vec<f64>>]) -> Vec<([usize; 2], f64)> {
        let (gram, right) = self.gram(&sets.concat());
        let mut ends = vec![0];
        ends.extend(sets.iter().scan(0, |end, set| {
            *end += set.len();
            Some(*end)
        }));
        let all = dot(&self.residual, &self.residual).max(f64::MIN_POSITIVE);
        let of = |i: usize, j: usize| {
            let columns: Vec<usize> = (ends[i]..ends[i + 1]).chain(ends[j]..ends[j + 1]).collect();
            let gram = gram.select_columns(&columns).select_rows(&columns);
            gain(gram, &right.select_rows(&columns)) / all
        };
        let pairs = (0..sets.len()).flat_map(|j| (0..j).map(move |i| [i, j]));
        pairs.map(|[i, j]| ([i, j], of(i, j))).collect()
    }

    /// The run of consecutive columns whose sum takes most off: its first, and one past its last.
    ///
    /// `(Σ b)²/ΣΣ G` of every run, by cumulative sums along the diagonals.
    pub fn best_interval(&self, columns: &[Vec<f64>]) -> (usize, usize) {
        let (gram, right) = self.gram(columns);
        let (mut best, mut most) = ((0, columns.len()), 0.0);
        for first in 0..columns.len() {
            let (mut product, mut square, mut apart) = (0.0, 0.0, 0.0);
            for last in first..columns.len() {
                product += right[last];
                let beside: f64 = (first..last).map(|k| gram[(k, last)]).sum();
                square += gram[(last, last)] + 2.0 * beside;
                apart += gram[(last, last)];
                let gain = product * product / square.max(f64::MIN_POSITIVE);
                // Columns that add up to nothing are part of the fit together.
                if gain > most && square > NOTHING * apart {
                    (best, most) = ((first, last + 1), gain);
                }
            }
        }
        best
    }
}

/// `bᵀG⁻¹b`, from the upper triangle of `G`.
fn gain(mut gram: DMatrix<f64>, right: &DVector<f64>) -> f64 {
    gram.fill_lower_triangle_with_upper_triangle();
    let scale = gram.diagonal().map(|d| d.max(f64::MIN_POSITIVE));
    for k in 0..right.len() {
        gram[(k, k)] += NOTHING * scale[k];
    }
    gram.cholesky()
        .map_or(0.0, |factor| right.dot(&factor.solve(right)))
}

#[cfg(test)]
mod tests {
    use super::Projection;
    use crate::spectrum::Circle;

    /// A step on a ramp: the ramp is fitted away, the step is found where it is, and its gain is what refitting gives.
    #[test]
    fn an_interval_is_found_and_its_gain_is_that_of_a_refit() {
        let n = 120;
        let ramp: Vec<f64> = (0..n).map(f64::from).collect();
        let seen: Vec<bool> = (0..n).map(|k| k < 110).collect();
        let inside = |from: i32, to: i32| -> Vec<f64> {
            (0..n)
                .map(|k| f64::from(u8::from(k >= from && k < to)))
                .collect()
        };
        let step = inside(30, 60);
        let response: Vec<f64> = ramp
            .iter()
            .zip(&step)
            .map(|(r, s)| 0.1 * r + 2.0 * s)
            .collect();
        let projection = Projection::new(&response, std::slice::from_ref(&ramp), &seen);
        let blocks: Vec<Vec<f64>> = (0..12).map(|k| inside(10 * k, 10 * k + 10)).collect();
        assert_eq!(projection.best_interval(&blocks), (3, 6));
        // All blocks together are a constant: of a fit that has one they are no step.
        let constant = Projection::new(&step, &[inside(0, n)], &seen);
        assert_eq!(constant.best_interval(&blocks), (3, 6));
        let left = |p: &Projection| p.residual.iter().map(|r| r * r).sum::<f64>();
        let refit = Projection::new(&response, &[ramp, step.clone()], &seen);
        let fall = left(&projection) - left(&refit);
        assert!(left(&refit) < 1e-18 && (projection.gain(&[step]) - fall).abs() < 1e-6 * fall);
    }

    /// Rows that lie on places of the circle, so that nothing is rounded but numbers.
    #[test]
    fn a_turned_pair_gains_what_its_columns_do() {
        let n = 100;
        let column =
            |of: &dyn Fn(f64) -> f64| -> Vec<f64> { (0..n).map(f64::from).map(of).collect() };
        let x = column(&|k| 0.25 * (0.37 * k * k).floor());
        let (sin, cos) = (
            column(&|k| (0.2 * k * k).sin()),
            column(&|k| (0.3 * k).cos()),
        );
        let response = column(&|k| (1.3 * k * k).sin());
        let seen: Vec<bool> = (0..n).map(|k| k % 7 > 0).collect();
        let projection = Projection::new(&response, &[column(&|k| k), column(&|_| 1.0)], &seen);
        let circle = Circle::new(&x, 3);
        let gains = projection.gains_of_turned(&sin, &cos, &circle);
        for (turns, gain) in circle.turns().zip(gains) {
            let turned = |k: usize| {
                let (s, c) = (std::f64::consts::TAU * f64::from(turns) * x[k]).sin_cos();
                (c * sin[k] + s * cos[k], c * cos[k] - s * sin[k])
            };
            let (sin, cos) = (0..x.len()).map(turned).unzip();
            let exact = projection.gain(&[sin, cos]);
            assert!(
                (gain - exact).abs() < 1e-9 * exact,
                "{turns}: {gain} {exact}"
            );
        }
    }

    /// Two columns that add up to the residual, each of them nearly at right angles to it.
    #[test]
    fn two_sets_do_together_what_neither_does_alone() {
        let n = 60;
        let wave = |k: i32, number: i32| (0.1 * f64::from(number * k)).sin();
        let column = |of: &dyn Fn(i32) -> f64| -> Vec<f64> { (0..n).map(of).collect() };
        let residual = column(&|k| 0.1 * wave(k, 3));
        let first = column(&|k| wave(k, 1) + 0.1 * wave(k, 3));
        let sets = [
            vec![first],
            vec![column(&|k| wave(k, 1))],
            vec![column(&|k| wave(k, 5))],
        ];
        let projection = Projection::new(&residual, &[], &[true; 60]);
        let gains = projection.gains_of_two(&sets);
        let pairs: Vec<[usize; 2]> = gains.iter().map(|(pair, _)| *pair).collect();
        assert_eq!(pairs, [[0, 1], [0, 2], [1, 2]]);
        assert!((gains[0].1 - 1.0).abs() < 1e-6, "{gains:?}");
        assert!(gains[1..].iter().all(|(_, gain)| *gain < 0.2), "{gains:?}");
    }
}
