//! What all optimisers minimise: the weighted sum of squared prediction errors, at given gains.

use std::cell::{Cell, RefCell};

use nalgebra::{DMatrix, DVector};

use super::chart::Chart;
use super::optimise::LeastSquares;
use super::predictor::{Gain, Pass, Weighing, pass};
use super::sequence::Sequence;
use crate::error::Result;

/// Half the sum of squared weighted innovations, in units of their variance at the start: `−ln L` but for a constant.
pub struct Objective<'a> {
    pub chart: &'a Chart,
    sequences: &'a [Sequence<'a>],
    gains: Vec<Vec<Gain>>,
    /// Root of the mean square of the weighted innovations where the gains were found.
    scale: f64,
    /// Residuals and derivatives found last, with where.
    last: RefCell<Option<(DVector<f64>, DVector<f64>, DMatrix<f64>)>>,
    evaluations: Cell<usize>,
}

/// Runs the filter over all sequences at some coordinates.
pub fn filter(
    chart: &Chart,
    sequences: &[Sequence],
    at: &DVector<f64>,
    share: f64,
) -> Result<Vec<Pass>> {
    let family = chart.family(at, false)?;
    let passes = sequences.iter();
    Ok(passes
        .map(|s| pass(s, &family, Weighing::Filter(share)))
        .collect())
}

/// Number of readings in some passes.
fn readings(passes: &[Pass]) -> f64 {
    passes.iter().flat_map(|p| &p.counts).sum::<f64>().max(1.0)
}

/// Mean square of the weighted innovations.
fn square(passes: &[Pass]) -> f64 {
    let squares = passes.iter().flat_map(|p| &p.residuals).map(|r| r * r);
    (squares.sum::<f64>() / readings(passes)).max(f64::MIN_POSITIVE)
}

/// `−2·ln L` at its best scale over the number of readings, of all sequences together.
pub fn deviance(passes: &[Pass]) -> f64 {
    let pairs = passes.iter().flat_map(|p| p.gains.iter().zip(&p.counts));
    let spread = pairs
        .map(|(gain, count)| gain.variance.ln() * count)
        .sum::<f64>();
    square(passes).ln() + spread / readings(passes)
}

impl<'a> Objective<'a> {
    /// The objective with the gains that a filter found.
    pub fn new(chart: &'a Chart, sequences: &'a [Sequence<'a>], passes: &[Pass]) -> Self {
        Self {
            chart,
            sequences,
            gains: passes.iter().map(|p| p.gains.clone()).collect(),
            scale: square(passes).sqrt(),
            last: RefCell::new(None),
            evaluations: Cell::new(0),
        }
    }

    /// Passes over all recordings so far.
    pub fn evaluations(&self) -> usize {
        self.evaluations.get()
    }

    fn passes(&self, at: &DVector<f64>, derivatives: bool) -> Option<Vec<Pass>> {
        self.evaluations.set(self.evaluations.get() + 1);
        let family = self.chart.family(at, derivatives).ok()?;
        let pairs = self.sequences.iter().zip(&self.gains);
        Some(
            pairs
                .map(|(s, g)| pass(s, &family, Weighing::Given(g)))
                .collect(),
        )
    }
}

impl LeastSquares for Objective<'_> {
    /// Weighted innovations; `None` where the coordinates make no axis.
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>> {
        if !at.iter().all(|x| x.is_finite()) {
            return None;
        }
        let passes = self.passes(at, false)?;
        Some(stack(&passes) / self.scale)
    }

    /// Weighted innovations and their derivatives by the coordinates.
    fn linearised(&self, at: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        if let Some((known, residuals, jacobian)) = &*self.last.borrow()
            && known == at
        {
            return Some((residuals.clone(), jacobian.clone()));
        }
        let passes = self.passes(at, true)?;
        let residuals = stack(&passes) / self.scale;
        let slopes: Vec<f64> = passes.iter().flat_map(|p| p.slopes.clone()).collect();
        let jacobian =
            DMatrix::from_row_slice(residuals.len(), self.chart.len(), &slopes) / self.scale;
        *self.last.borrow_mut() = Some((at.clone(), residuals.clone(), jacobian.clone()));
        Some((residuals, jacobian))
    }
}

fn stack(passes: &[Pass]) -> DVector<f64> {
    let all: Vec<f64> = passes.iter().flat_map(|p| p.residuals.clone()).collect();
    DVector::from_vec(all)
}
