//! How certain estimates are: standard errors, and what the recordings say of each parameter.

use nalgebra::{DMatrix, DVector};

use crate::model::{Model, Status};

/// `JᵀJ` with unit diagonal, and the column norms that were divided out.
pub fn normal_matrix(jacobian: &DMatrix<f64>) -> (DMatrix<f64>, Vec<f64>) {
    let scale: Vec<f64> = jacobian
        .column_iter()
        .map(|c| c.norm().max(1e-150))
        .collect();
    let mut normal = jacobian.tr_mul(jacobian);
    for i in 0..scale.len() {
        for j in 0..scale.len() {
            normal[(i, j)] /= scale[i] * scale[j];
        }
        normal[(i, i)] += 1e-12;
    }
    (normal, scale)
}

/// A parameter this many standard errors from zero is known to a tenth or better.
const KNOWN: f64 = 10.0;
/// A parameter within this many standard errors of zero cannot be told from it (95 %).
const TOLD: f64 = 2.0;
/// Estimates correlated by more than this inflate each other's variance tenfold: `1/(1 − ρ²) > 10`, the usual limit
/// (Marquardt, Technometrics 12, 1970).
const COLLINEAR: f64 = 0.95;
/// Torque or force below this share of the drive is none.
const NOTHING: f64 = 0.01;

/// Covariances of the minimiser of a sum of squared whitened residuals.
pub struct Covariance {
    /// `(JᵀJ)⁻¹` for columns of unit norm: what the design of the experiment alone decides.
    pub inverse: DMatrix<f64>,
    /// Covariance matrix of the estimates.
    pub variance: DMatrix<f64>,
}

impl Covariance {
    /// From the Jacobian of the residuals and the cluster of each row; `None` where the estimates are not determined.
    ///
    /// `(JᵀJ)⁻¹·(Σ over clusters of gradient outer products)·(JᵀJ)⁻¹`: clusters stay independent even where the model or
    /// the noise covariance is not exact (Liang and Zeger 1986). A variance below the model-based one is raised to it,
    /// and its covariances with it.
    pub fn new(
        jacobian: &DMatrix<f64>,
        residual: &DVector<f64>,
        clusters: &[usize],
    ) -> Option<Self> {
        let (normal, scale) = normal_matrix(jacobian);
        let inverse = normal.try_inverse()?;
        let n = scale.len();
        let rows = residual.len() as f64;
        let freedom = rows / (rows - n as f64).max(1.0);
        let sigma2 = (residual.norm_squared() / rows * freedom).max(1.0);
        let groups = clusters.iter().max().map_or(0, |c| c + 1);
        let mut gradients = DMatrix::<f64>::zeros(n, groups.max(1));
        for (row, &cluster) in clusters.iter().enumerate() {
            for j in 0..n {
                gradients[(j, cluster)] += jacobian[(row, j)] / scale[j] * residual[row];
            }
        }
        let small_sample = groups as f64 / (groups as f64 - 1.0).max(1.0);
        let sandwich = &inverse * (&gradients * gradients.transpose()) * &inverse * small_sample;
        let raised: Vec<f64> = (0..n)
            .map(|j| {
                let own = sandwich[(j, j)].max(f64::MIN_POSITIVE);
                (sigma2 * inverse[(j, j)]).max(own) / own
            })
            .map(f64::sqrt)
            .collect();
        let variance = DMatrix::from_fn(n, n, |i, j| {
            sandwich[(i, j)] * raised[i] * raised[j] / (scale[i] * scale[j])
        });
        Some(Self { inverse, variance })
    }
}

/// Gives each free parameter its standard error and status from the Jacobian of whitened residuals.
///
/// Standard errors are those of [`Covariance`]. `drive` is the norm of what the drive contributes to the residuals.
pub fn assess(
    model: &mut Model,
    free: &[usize],
    jacobian: &DMatrix<f64>,
    residual: &DVector<f64>,
    clusters: &[usize],
    drive: f64,
) {
    for k in 0..model.parameters().len() {
        let whole = model.is_whole(k);
        let parameter = &mut *model.parameters_mut().swap_remove(k);
        if parameter.known {
            parameter.status = Status::Given;
        } else if whole {
            (parameter.se, parameter.status) = (Some(0.0), Status::Identified);
        } else {
            parameter.status = Status::NotExcited;
        }
    }
    if free.is_empty() {
        return;
    }
    let Some(Covariance { inverse, variance }) = Covariance::new(jacobian, residual, clusters)
    else {
        return;
    };
    let names: Vec<String> = model.labels().iter().map(ToString::to_string).collect();
    for (j, &k) in free.iter().enumerate() {
        let se = variance[(j, j)].sqrt();
        let bound = model.at_bound(k);
        let linear = model.is_linear(k);
        let parameter = &mut *model.parameters_mut().swap_remove(k);
        parameter.se = Some(se);
        let distance = parameter.value.unwrap_or_default().abs() / se;
        let correlation = |i: usize| inverse[(i, j)] / (inverse[(i, i)] * inverse[(j, j)]).sqrt();
        let partner = (0..free.len())
            .filter(|i| *i != j)
            .max_by(|a, b| correlation(*a).abs().total_cmp(&correlation(*b).abs()))
            .filter(|i| correlation(*i).abs() > COLLINEAR);
        parameter.status = match partner {
            _ if bound => Status::AtBound,
            _ if distance >= KNOWN => Status::Identified,
            _ if linear && se * jacobian.column(j).norm() <= NOTHING * drive => Status::Identified,
            Some(partner) => Status::TradedOff(names[free[partner]].clone()),
            None if distance >= TOLD => Status::WeaklyExcited,
            None => Status::NotExcited,
        };
    }
}
