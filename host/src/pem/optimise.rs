//! The optimisers, each a crate's: Levenberg-Marquardt, Nelder-Mead, BFGS.

use std::cell::RefCell;

use argmin::core::{CostFunction, Executor, Gradient, State as _, TerminationReason};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::neldermead::NelderMead;
use argmin::solver::quasinewton::BFGS;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};

/// Which optimiser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Optimiser {
    /// Levenberg-Marquardt (MINPACK's), with exact derivatives of the predictions.
    LevenbergMarquardt,
    /// Nelder and Mead's simplex, without derivatives.
    NelderMead,
    /// Quasi-Newton of Broyden, Fletcher, Goldfarb and Shanno, with the exact gradient.
    Bfgs,
}

impl Optimiser {
    /// Iterations after which fresh gains are worth more than another iteration.
    pub fn patience(self) -> usize {
        match self {
            Self::LevenbergMarquardt => 5,
            Self::Bfgs => 15,
            // Its simplex takes long to find its shape, and starts anew with each round.
            Self::NelderMead => 400,
        }
    }
}

/// Where an optimiser ended.
#[derive(Clone, Debug)]
pub struct Ended {
    /// The best coordinates it met, which may be those it began with.
    pub at: DVector<f64>,
    /// Iterations it took.
    pub iterations: usize,
    /// Whether it stopped because nothing was left to gain.
    pub converged: bool,
    /// Why it stopped, in a few words.
    pub reason: String,
}

/// A sum of squares `½·‖r(x)‖²` in units of its own noise, so that a change by ½ is one standard error.
pub trait LeastSquares {
    /// `r`; `None` where `x` makes no sense.
    fn residuals(&self, x: &DVector<f64>) -> Option<DVector<f64>>;
    /// `r` and `∂r/∂x`.
    fn linearised(&self, x: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)>;
}

/// Decrease of the objective that is not worth another iteration: a tenth of a standard error is `½·0.1²`.
const NEGLIGIBLE: f64 = 0.005;
/// Edge of the first simplex in every coordinate: a tenth of a value, or of a factor `e`.
const EDGE: f64 = 0.1;

/// Minimises a sum of squares from some coordinates on.
pub fn minimise(
    optimiser: Optimiser,
    problem: &impl LeastSquares,
    from: &DVector<f64>,
    most: usize,
) -> Ended {
    match optimiser {
        Optimiser::LevenbergMarquardt => levenberg_marquardt(problem, from, most),
        Optimiser::NelderMead => nelder_mead(problem, from, most),
        Optimiser::Bfgs => bfgs(problem, from, most),
    }
}

fn value(residuals: Option<DVector<f64>>) -> f64 {
    residuals
        .map(|r| 0.5 * r.norm_squared())
        .filter(|v| v.is_finite())
        .unwrap_or(f64::MAX)
}

/// The problem as the crate of Levenberg-Marquardt wants it.
struct Marquardt<'a, P> {
    problem: &'a P,
    x: DVector<f64>,
    slopes: RefCell<usize>,
    most: usize,
}

impl<P: LeastSquares> LeastSquaresProblem<f64, Dyn, Dyn> for Marquardt<'_, P> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.x.copy_from(x);
    }
    fn params(&self) -> DVector<f64> {
        self.x.clone()
    }
    fn residuals(&self) -> Option<DVector<f64>> {
        self.problem.residuals(&self.x)
    }
    fn jacobian(&self) -> Option<DMatrix<f64>> {
        if *self.slopes.borrow() >= self.most {
            return None;
        }
        *self.slopes.borrow_mut() += 1;
        self.problem.linearised(&self.x).map(|(_, j)| j)
    }
}

fn levenberg_marquardt(problem: &impl LeastSquares, from: &DVector<f64>, most: usize) -> Ended {
    let target = Marquardt {
        problem,
        x: from.clone(),
        slopes: RefCell::new(0),
        most,
    };
    let rows = problem.residuals(from).map_or(1, |r| r.len()) as f64;
    // Its tolerance is relative, and the objective is about half the number of rows.
    let tolerance = (2.0 * NEGLIGIBLE / rows).max(1e-14);
    // Coordinates are logarithms or relative already, so steps are bounded in these and not in units of each one's own
    // curvature, in which a parameter that the data say little about could go anywhere.
    let (target, report) = LevenbergMarquardt::new()
        .with_ftol(tolerance)
        .with_xtol(1e-9)
        .with_gtol(1e-12)
        .with_stepbound(0.3)
        .with_scale_diag(false)
        .with_patience(20)
        .minimize(target);
    let iterations = *target.slopes.borrow();
    let converged = report.termination.was_successful()
        || matches!(
            report.termination,
            levenberg_marquardt::TerminationReason::NoImprovementPossible(_)
        );
    let reason = if converged {
        "nothing left to gain".to_owned()
    } else if iterations >= most {
        "most iterations reached".to_owned()
    } else {
        format!("{:?}", report.termination)
    };
    Ended {
        at: target.x,
        iterations,
        converged,
        reason,
    }
}

/// The problem as argmin wants it, in coordinates from the start over given units; remembers the best it met, as a
/// failed line search returns nothing.
#[derive(Clone, Copy)]
struct Scaled<'a, P> {
    problem: &'a P,
    from: &'a DVector<f64>,
    units: &'a [f64],
    best: &'a RefCell<(f64, DVector<f64>)>,
}

impl<P> Scaled<'_, P> {
    fn place(&self, x: &[f64]) -> DVector<f64> {
        DVector::from_fn(x.len(), |k, _| self.from[k] + x[k] * self.units[k])
    }
}

impl<P: LeastSquares> CostFunction for Scaled<'_, P> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, x: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let at = self.place(x);
        let cost = value(self.problem.residuals(&at));
        let mut best = self.best.borrow_mut();
        if cost < best.0 {
            *best = (cost, at);
        }
        Ok(cost)
    }
}

impl<P: LeastSquares> Gradient for Scaled<'_, P> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;
    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, argmin::core::Error> {
        let Some((r, j)) = self.problem.linearised(&self.place(x)) else {
            return Ok(vec![0.0; x.len()]);
        };
        let gradient = j.tr_mul(&r);
        let pairs = gradient.iter().zip(self.units);
        Ok(pairs.map(|(g, unit)| g * unit).collect())
    }
}

fn nelder_mead(problem: &impl LeastSquares, from: &DVector<f64>, most: usize) -> Ended {
    let mut simplex = vec![vec![0.0; from.len()]];
    simplex.extend((0..from.len()).map(|k| {
        let mut corner = vec![0.0; from.len()];
        corner[k] = EDGE;
        corner
    }));
    let best = RefCell::new((f64::MAX, from.clone()));
    let scaled = Scaled {
        problem,
        from,
        units: &vec![1.0; from.len()],
        best: &best,
    };
    let run = NelderMead::new(simplex)
        .with_sd_tolerance(NEGLIGIBLE)
        .and_then(|solver| {
            Executor::new(scaled, solver)
                .configure(|state| state.max_iters(most as u64))
                .run()
        });
    let ran = run.map(|r| (r.state.iter, r.state.get_termination_reason().cloned()));
    ended(ran, best.into_inner().1)
}

fn bfgs(problem: &impl LeastSquares, from: &DVector<f64>, most: usize) -> Ended {
    let stay = |reason: &str| Ended {
        at: from.clone(),
        iterations: 0,
        converged: false,
        reason: reason.to_owned(),
    };
    let Some((_, jacobian)) = problem.linearised(from) else {
        return stay("no derivatives at the start");
    };
    // In units of each coordinate's own curvature the identity is the right first guess of the inverse Hessian.
    let norms = jacobian.column_iter().map(|c| c.norm());
    let units: Vec<f64> = norms.map(|n| if n > 0.0 { 1.0 / n } else { 1.0 }).collect();
    let best = RefCell::new((f64::MAX, from.clone()));
    let scaled = Scaled {
        problem,
        from,
        units: &units,
        best: &best,
    };
    let n = from.len();
    let identity: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    let run = BFGS::new(MoreThuenteLineSearch::new())
        .with_tolerance_cost(NEGLIGIBLE)
        .and_then(|solver| solver.with_tolerance_grad(NEGLIGIBLE))
        .and_then(|solver| {
            Executor::new(scaled, solver)
                .configure(|state| {
                    state
                        .param(vec![0.0; n])
                        .inv_hessian(identity)
                        .max_iters(most as u64)
                })
                .run()
        });
    let ran = run.map(|r| (r.state.iter, r.state.get_termination_reason().cloned()));
    ended(ran, best.into_inner().1)
}

fn ended(
    ran: Result<(u64, Option<TerminationReason>), argmin::core::Error>,
    at: DVector<f64>,
) -> Ended {
    let (iterations, converged, reason) = match ran {
        Ok((iterations, Some(TerminationReason::MaxItersReached))) => {
            (iterations, false, "most iterations reached".to_owned())
        }
        Ok((iterations, _)) => (iterations, true, "nothing left to gain".to_owned()),
        Err(error) => (0, false, error.to_string()),
    };
    Ended {
        at,
        iterations: iterations as usize,
        converged,
        reason,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::{LeastSquares, Optimiser, minimise};

    /// Rosenbrock's valley as a sum of squares: `r = (10·(y − x²), 1 − x)·100`, with its minimum at (1, 1).
    struct Valley;

    impl LeastSquares for Valley {
        fn residuals(&self, x: &DVector<f64>) -> Option<DVector<f64>> {
            Some(DVector::from_vec(vec![
                1000.0 * (x[1] - x[0] * x[0]),
                100.0 * (1.0 - x[0]),
            ]))
        }
        fn linearised(&self, x: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
            let slopes = [-2000.0 * x[0], 1000.0, -100.0, 0.0];
            Some((self.residuals(x)?, DMatrix::from_row_slice(2, 2, &slopes)))
        }
    }

    const ALL: [Optimiser; 3] = [
        Optimiser::LevenbergMarquardt,
        Optimiser::NelderMead,
        Optimiser::Bfgs,
    ];

    #[test]
    fn each_finds_the_end_of_a_curved_valley() {
        for optimiser in ALL {
            let ended = minimise(
                optimiser,
                &Valley,
                &DVector::from_vec(vec![-0.2, 1.0]),
                1000,
            );
            // The objective is known to 0.005, a tenth of a standard error of 0.01 along x.
            assert!((ended.at[0] - 1.0).abs() < 2e-3, "{optimiser:?}: {ended:?}");
            assert!(ended.converged && ended.iterations > 1, "{ended:?}");
        }
    }

    #[test]
    fn none_goes_on_beyond_the_iterations_it_may_have() {
        for optimiser in ALL {
            let ended = minimise(optimiser, &Valley, &DVector::from_vec(vec![-0.2, 1.0]), 3);
            assert!(!ended.converged && ended.iterations <= 3, "{ended:?}");
            assert_eq!(ended.reason, "most iterations reached");
        }
    }
}
