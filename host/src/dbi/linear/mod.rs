//! Forms of DBI that are linear in products of the parameters: no scan, no start values, no iteration over them.
//!
//! Each is an alternative to the default estimate, shown beside it. The price is noise: products of measured signals are
//! regressors, and what noise does to them does not average out.

mod dahl;
mod rational;
mod simex;
mod weights;

use bristle_core::friction::Curve;
use nalgebra::{DMatrix, DVector};

use crate::effects::{Quantity, Seat};
use crate::linear;
use crate::model::{Law, Model};
use crate::normal::Normal;
use crate::problem::Problem;
use crate::refine::clusters;
use crate::system;
use crate::weak::{Track, Windows};

pub use simex::{NoiseDraws, Shift};

/// Names and quantities of physical parameters.
type Quantities = &'static [(&'static str, Quantity)];

/// A friction law as one linear problem in products of its parameters.
pub trait Form {
    /// What it is called.
    fn name(&self) -> &'static str;
    /// The row of a window.
    fn equation(&self) -> &'static str;
    /// What it assumes beyond the model.
    fn remark(&self) -> &'static str;
    /// Response and regressors of a track, functional by functional.
    fn columns(&self, track: &Track, windows: &Windows, given: &Given) -> Vec<Vec<f64>>;
    /// The parameters that follow from the products.
    fn physical(&self) -> Quantities;
    /// Physical parameters from the coefficients of the regressors.
    fn decode(&self, beta: &[f64]) -> Vec<f64>;
    /// What each regressor is multiplied by.
    fn products(&self) -> &'static [&'static str];
    /// The coefficients that physical parameters stand for: what redundant products are checked against.
    fn encode(&self, physical: &[f64]) -> Vec<f64>;
    /// Whether it holds only while the direction of sliding stays: windows with a reversal inside are then left out.
    fn sliding_only(&self) -> bool {
        false
    }
    /// How much the form multiplies the noise of each row, for a second pass.
    fn factor(&self, _physical: &[f64], _track: &Track, _windows: &Windows) -> Option<Vec<f64>> {
        None
    }
}

/// What a form takes from the model and the recording as it is. Effects in the load and in the sensor are left out.
pub struct Given {
    /// Mean over each cell of the driving torque, `k·u` less what effects beyond the friction law resist.
    pub drive: Vec<f64>,
}

impl Given {
    fn new(track: &Track, model: &Model) -> Self {
        let gain = model.gain.value.unwrap_or(1.0);
        let input = track.input(&system::path(model));
        let mut drive: Vec<f64> = input.iter().map(|u| gain * u).collect();
        let effects = model.terms.iter().filter(|t| !t.in_law);
        for term in effects.filter(|t| t.effect.seat() == Seat::Torque) {
            let (inner, coefficients) = term.effect.linear(&system::values(term), model.scale());
            let mut basis = vec![0.0; term.effect.width()];
            for (k, drive) in drive.iter_mut().enumerate() {
                term.effect
                    .basis(inner, track.driven(k, input[k]), &mut basis);
                let resisting = basis.iter().zip(&coefficients);
                *drive -= resisting.map(|(b, c)| b * c).sum::<f64>();
            }
        }
        Self { drive }
    }
}

/// What a linear form finds.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Coefficients of the regressors.
    pub products: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Physical parameters.
    pub physical: Vec<f64>,
    /// Their standard errors, by the delta method.
    pub se: Vec<f64>,
    /// How far each product lies from what the physical parameters make of it, in standard errors of that difference;
    /// none for products that the physical parameters were computed from.
    pub redundancy: Vec<Option<f64>>,
}

/// The forms that a model's friction law has.
pub fn forms(model: &Model) -> Vec<Box<dyn Form>> {
    match model.law {
        Law::Dahl => vec![Box::new(dahl::SimplifiedDahl)],
        Law::Stribeck if model.curve() == Curve::Rational => {
            vec![Box::new(rational::RationalStribeck {
                remark: "The model's own law. Windows with a reversal or rest inside are left out.",
            })]
        }
        Law::ModifiedLuGre => vec![Box::new(rational::RationalStribeck {
            remark: "The sliding part of the model's own law: windows with a reversal, rest or bending bristles inside (by the default estimate) are left out.",
        })],
        Law::Stribeck => vec![Box::new(rational::RationalStribeck {
            remark: "The model's law has the curve e^(−(v/vs)²) in place of 1/(1 + (v/vs)²): parameters of the two agree in order of magnitude only. Windows with a reversal or rest inside are left out.",
        })],
        Law::CoulombViscous | Law::Static | Law::LuGre => Vec::new(),
    }
}

/// Solves a form on the rows of a problem; `model` gives the gain and the effects beyond the law. `None` where the rows
/// do not determine the products.
pub fn solve(
    form: &dyn Form,
    problem: &Problem,
    blocks: &[Option<usize>],
    model: &Model,
) -> Option<Solution> {
    let blocks = &seen(form, problem, blocks, model);
    let tracks = problem.tracks.iter().zip(&problem.windows);
    let mut stacked: Vec<Vec<f64>> = Vec::new();
    for (track, windows) in tracks {
        let given = Given::new(track, model);
        let columns = form.columns(track, windows, &given);
        stacked.resize(columns.len(), Vec::new());
        for (all, own) in stacked.iter_mut().zip(columns) {
            all.extend(own);
        }
    }
    let first = least_squares(blocks, &stacked)?;
    let first = decoded(form, first);
    let factors = problem.tracks.iter().zip(&problem.windows);
    let factors: Option<Vec<Vec<f64>>> = factors
        .map(|(t, w)| form.factor(&first.physical, t, w))
        .collect();
    let Some(factors) = factors else {
        return Some(first);
    };
    let factors = factors.concat();
    for column in &mut stacked {
        column.iter_mut().zip(&factors).for_each(|(x, f)| *x /= f);
    }
    least_squares(blocks, &stacked).map(|fit| decoded(form, fit))
}

/// Share of the friction level that bristles bear over a window in which the axis slides. Below, it reverses, rests or
/// creeps on bent bristles for part of the time.
const SLIDING: f64 = 0.99;

/// The blocks of the rows that a form may see. Where bristles bend is taken from the model's own, where it has any.
fn seen(
    form: &dyn Form,
    problem: &Problem,
    blocks: &[Option<usize>],
    model: &Model,
) -> Vec<Option<usize>> {
    if !form.sliding_only() {
        return blocks.to_vec();
    }
    let direction = problem.coulomb(&problem.direction(model), &system::path(model));
    let rows = blocks.iter().zip(direction.iter());
    rows.map(|(block, s)| block.filter(|_| s.abs() >= SLIDING))
        .collect()
}

/// Least squares on the rows as they are, with covariance.
///
/// The rows are not whitened: the noise model of the default estimate takes what rows at reversals leave for errors in
/// the instant of the reversal, and it is there that bristles and Stribeck curves show. The covariance allows for the
/// overlap of windows by blocks that hold many of them.
fn least_squares(
    blocks: &[Option<usize>],
    stacked: &[Vec<f64>],
) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let (response, regressors) = stacked.split_first()?;
    let columns: Vec<&[f64]> = regressors.iter().map(Vec::as_slice).collect();
    let products = linear::score(response, &columns, blocks, 0.0, None)?.beta;
    let seen = |x: &[f64]| -> DVector<f64> {
        let rows = x.iter().zip(blocks).filter(|(_, f)| f.is_some());
        DVector::from_vec(rows.map(|(x, _)| *x).collect())
    };
    let columns: Vec<DVector<f64>> = regressors.iter().map(|c| seen(c)).collect();
    let columns = DMatrix::from_columns(&columns);
    let residual = seen(response) - &columns * &products;
    // In units of the residual's standard deviation.
    let freedom = (residual.len() as f64 - products.len() as f64).max(1.0);
    let sigma = (residual.norm_squared() / freedom)
        .sqrt()
        .max(f64::MIN_POSITIVE);
    let normal = Normal::new(&(columns / sigma), &(residual / sigma), &clusters(blocks));
    let (plain, sandwich, scale) = normal.covariances()?;
    // The larger of the two variances, with the correlations of the sandwich.
    let raised: Vec<f64> = (0..scale.len())
        .map(|k| (plain[(k, k)] / sandwich[(k, k)].max(f64::MIN_POSITIVE)).max(1.0))
        .map(f64::sqrt)
        .collect();
    let covariance = DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
        sandwich[(i, j)] * raised[i] * raised[j] / (scale[i] * scale[j])
    });
    Some((products, covariance))
}

fn decoded(form: &dyn Form, (products, covariance): (DVector<f64>, DMatrix<f64>)) -> Solution {
    let physical = form.decode(products.as_slice());
    let slope = gradient(&|beta| form.decode(beta), &products, &covariance);
    let variance = &slope * &covariance * slope.transpose();
    let difference = |beta: &[f64]| -> Vec<f64> {
        let implied = form.encode(&form.decode(beta));
        beta.iter().zip(&implied).map(|(b, i)| b - i).collect()
    };
    let slope = gradient(&difference, &products, &covariance);
    let spread = &slope * &covariance * slope.transpose();
    let redundancy = difference(products.as_slice())
        .iter()
        .enumerate()
        .map(|(k, d)| {
            // Products that define the physical ones differ from them by rounding alone.
            let se = spread[(k, k)].max(0.0).sqrt();
            (se > 1e-3 * covariance[(k, k)].sqrt()).then(|| d / se)
        })
        .collect();
    Solution {
        se: variance
            .diagonal()
            .iter()
            .map(|v| v.max(0.0).sqrt())
            .collect(),
        products,
        covariance,
        physical,
        redundancy,
    }
}

/// Jacobian by central differences over a hundredth of a standard error, far inside the range where the products are
/// known to be linear enough for the delta method.
fn gradient(
    f: &dyn Fn(&[f64]) -> Vec<f64>,
    at: &DVector<f64>,
    covariance: &DMatrix<f64>,
) -> DMatrix<f64> {
    let columns: Vec<DVector<f64>> = (0..at.len())
        .map(|k| {
            let h = (0.01 * covariance[(k, k)].sqrt())
                .max(1e-7 * at[k].abs())
                .max(f64::MIN_POSITIVE);
            let moved = |by: f64| {
                let mut moved = at.clone();
                moved[k] += by;
                DVector::from_vec(f(moved.as_slice()))
            };
            (moved(h) - moved(-h)) / (2.0 * h)
        })
        .collect();
    DMatrix::from_columns(&columns)
}

#[cfg(test)]
mod tests;
