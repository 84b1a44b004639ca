//! What all optimisers minimise: the weighted sum of squared prediction errors, at given gains.

use std::cell::{Cell, RefCell};

use nalgebra::{DMatrix, DVector};

use super::chart::Chart;
use super::optimise::LeastSquares;
use super::predictor::{Gain, Pass, Weighing, pass};
use super::sequence::Sequence;
use crate::error::Result;

/// Coordinates with the residuals and the derivatives there.
type Linearised = (DVector<f64>, DVector<f64>, DMatrix<f64>);

/// Half the sum of squared weighted innovations, in units of their variance at the start: `−ln L` but for a constant.
pub struct Objective<'a> {
    pub chart: &'a Chart,
    sequences: &'a [Sequence<'a>],
    gains: Vec<Vec<Gain>>,
    /// Root of the mean square of the weighted innovations where the gains were found.
    scale: f64,
    /// Residuals and derivatives found last, with where.
    last: RefCell<Option<Linearised>>,
    evaluations: Cell<usize>,
}

/// Runs the filter over all sequences at some coordinates.
pub fn filter(
    chart: &Chart,
    sequences: &[Sequence],
    at: &DVector<f64>,
    weighing: Weighing,
) -> Result<Vec<Pass>> {
    let family = chart.family(at, false)?;
    let passes = sequences.iter();
    Ok(passes.map(|s| pass(s, &family, weighing)).collect())
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
            DMatrix::from_row_slice(residuals.len(), self.chart.count(), &slopes) / self.scale;
        *self.last.borrow_mut() = Some((at.clone(), residuals.clone(), jacobian.clone()));
        Some((residuals, jacobian))
    }
}

fn stack(passes: &[Pass]) -> DVector<f64> {
    let all: Vec<f64> = passes.iter().flat_map(|p| p.residuals.clone()).collect();
    DVector::from_vec(all)
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::{LeastSquares, Objective, filter};
    use crate::axis::Axis;
    use crate::model::Model;
    use crate::pem::chart::Chart;
    use crate::pem::predictor::Weighing;
    use crate::pem::sequence::Sequence;
    use crate::recording::Recording;
    use crate::simulate::{State, run_axis};
    use crate::weak::Track;

    const TRUTH: &str = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\nmodel = \"lugre\"\ncoulomb = 0.2\nviscous = 0.02\nstatic = 0.3\nstribeck_velocity = 0.5\nbristle_stiffness = 60.0\nbristle_damping = 0.3\n";

    /// Sensitivities of a smooth law agree with differences of whole runs of the predictor, at the same gains.
    #[test]
    fn sensitivities_are_those_of_the_whole_run() {
        let truth = Model::parse(TRUTH).unwrap();
        let t: Vec<f64> = (0..1500).map(|k| f64::from(k) * 1e-3).collect();
        let mut recording = Recording {
            path: "made.csv".into(),
            u: t.iter()
                .map(|t| 0.5 * (9.0 * t).sin() + 0.3 * (23.0 * t).sin())
                .collect(),
            t,
            ..Recording::default()
        };
        let axis = Axis::new(&truth).unwrap();
        let states = run_axis(&axis, &recording, 0, 1499, State::default());
        recording.q = Some(
            states
                .iter()
                .map(|s| (s.q * 652.0).round() / 652.0)
                .collect(),
        );
        let track = Track::new(&recording, truth.motion, None);
        let mut model = truth.clone();
        for (k, parameter) in model.parameters_mut().into_iter().enumerate() {
            parameter.known = k == 1;
            parameter.value = parameter.value.map(|v| if k == 1 { v } else { 1.1 * v });
        }
        let chart = Chart::new(&model);
        assert_eq!(chart.count(), 7);
        let sequences = [Sequence::new(&recording, &track, f64::INFINITY)];
        let at = chart.origin();
        let passes = filter(&chart, &sequences, &at, Weighing::Filter(5.0)).unwrap();
        let objective = Objective::new(&chart, &sequences, &passes);
        let (_, jacobian) = objective.linearised(&at).unwrap();
        for k in 0..7 {
            const H: f64 = 1e-5;
            let moved = |h: f64| {
                let mut x: DVector<f64> = at.clone();
                x[k] += h;
                objective.residuals(&x).unwrap()
            };
            let whole = (moved(H) - moved(-H)) / (2.0 * H);
            let error = (&whole - jacobian.column(k)).norm() / whole.norm();
            // One-sided differences of a step: an error of the size of the step, some times over.
            assert!(error < 1e-3, "parameter {k}: {error:e}");
        }
    }
}
