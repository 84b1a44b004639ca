//! From what estimates are off by to the step that puts them right.

use nalgebra::{DMatrix, DVector};

/// The way that estimates take from one repetition to the next.
#[derive(Default)]
pub(super) struct Way {
    /// By how much estimates follow the truth: `D`.
    follows: Option<DMatrix<f64>>,
    /// What the last estimates were off by, and the step that was taken from them.
    off: Option<DVector<f64>>,
    pub stepped: Option<DVector<f64>>,
}

impl Way {
    /// `D⁻¹`, with what the last step has changed: estimates that were off by so much are now off by `off`. `first` is
    /// `D` to begin with; `unit` are the sizes in which parameters are compared, and in squares of which `chance` is the variance
    /// that `off` has by itself from one repetition to the next: a step that is no longer than that says little of `D`.
    pub fn back(
        &mut self,
        off: DVector<f64>,
        first: DMatrix<f64>,
        unit: &DVector<f64>,
        chance: f64,
    ) -> Option<DMatrix<f64>> {
        let mut follows = self.follows.take().unwrap_or(first);
        if let (Some(before), Some(step)) = (self.off.take(), self.stepped.take()) {
            let missed = before - &off - &follows * &step;
            let weights = step.zip_map(unit, |s, u| s / (u * u));
            let length = step.dot(&weights);
            if length > 0.0 {
                follows += missed * weights.transpose() / (length + chance);
            }
        }
        // In these units, as parameters differ in size by orders of magnitude.
        let scaled = DMatrix::from_fn(unit.len(), unit.len(), |i, j| {
            follows[(i, j)] * unit[j] / unit[i]
        });
        let inverse = scaled.try_inverse()?;
        (self.off, self.follows) = (Some(off), Some(follows));
        Some(DMatrix::from_fn(unit.len(), unit.len(), |i, j| {
            inverse[(i, j)] * unit[i] / unit[j]
        }))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::Way;

    /// In a linear problem with a wrong first guess of `D`, as many steps as there are unknowns, and one more, settle it
    /// (Gay, SIAM Journal on Numerical Analysis 16, 1979: twice as many at most).
    #[test]
    fn learns_how_estimates_follow_the_truth() {
        let follows = DMatrix::from_row_slice(2, 2, &[0.5, 0.2, -0.1, 0.7]);
        let truth = DVector::from_vec(vec![3.0, -200.0]);
        let unit = DVector::from_vec(vec![1.0, 100.0]);
        let mut at = DVector::zeros(2);
        let mut way = Way::default();
        for _ in 0..5 {
            let off = &follows * (&truth - &at);
            let back = way.back(off.clone(), DMatrix::identity(2, 2), &unit, 0.0);
            let step = back.unwrap() * off;
            at += &step;
            way.stepped = Some(step);
        }
        assert!((at - truth).component_div(&unit).norm() < 1e-9);
    }

    #[test]
    fn nothing_learnt_is_the_first_guess() {
        let unit = DVector::from_vec(vec![1.0]);
        let first = DMatrix::from_element(1, 1, 0.25);
        let back = Way::default().back(DVector::from_vec(vec![1.0]), first, &unit, 0.0);
        assert!((back.unwrap()[(0, 0)] - 4.0).abs() < 1e-12);
    }

    /// Of a step of a quarter of a standard error, by which estimates seem to go astray by as much, chance tells as well.
    #[test]
    fn little_is_learnt_from_a_step_within_chance() {
        let unit = DVector::from_vec(vec![1.0]);
        let vector = |value| DVector::from_vec(vec![value]);
        let after = |chance| {
            let mut way = Way::default();
            let first = || DMatrix::from_element(1, 1, 1.0);
            way.back(vector(0.25), first(), &unit, chance);
            way.stepped = Some(vector(0.25));
            way.back(vector(0.24), first(), &unit, chance).unwrap()[(0, 0)]
        };
        assert!(after(0.0) > 20.0 && after(1.0 / 3.0) < 1.25);
    }
}
