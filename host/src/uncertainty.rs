//! How certain estimates are: standard errors, and what the recordings say of each parameter.

use nalgebra::{DMatrix, DVector};

use crate::model::{Model, Status};

/// Norm of a column that is zero.
const NO_SCALE: f64 = 1e-150;

/// `JᵀJ` with unit diagonal, and the column norms that were divided out.
pub fn normal_matrix(jacobian: &DMatrix<f64>) -> (DMatrix<f64>, Vec<f64>) {
    let scale: Vec<f64> = jacobian
        .column_iter()
        .map(|c| c.norm().max(NO_SCALE))
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

/// Gives each free parameter its standard error and status from the Jacobian of whitened residuals.
///
/// Standard errors are `(JᵀJ)⁻¹·(Σ over clusters of gradient outer products)·(JᵀJ)⁻¹`: clusters stay independent even
/// where the model or the noise covariance is not exact (Liang and Zeger 1986). The larger of this and the model-based
/// error is reported. `drive` is the norm of what the drive contributes to the residuals.
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
    let (normal, scale) = normal_matrix(jacobian);
    let Some(inverse) = normal.try_inverse() else {
        return;
    };
    let freedom = residual.len() as f64 / (residual.len() as f64 - free.len() as f64).max(1.0);
    let sigma2 = (residual.norm_squared() / residual.len() as f64 * freedom).max(1.0);
    let groups = clusters.iter().max().map_or(0, |c| c + 1);
    let mut gradients = DMatrix::<f64>::zeros(free.len(), groups.max(1));
    for (row, &cluster) in clusters.iter().enumerate() {
        for j in 0..free.len() {
            gradients[(j, cluster)] += jacobian[(row, j)] / scale[j] * residual[row];
        }
    }
    let small_sample = groups as f64 / (groups as f64 - 1.0).max(1.0);
    let sandwich = &inverse * (&gradients * gradients.transpose()) * &inverse * small_sample;
    let names: Vec<String> = model.labels().iter().map(ToString::to_string).collect();
    for (j, &k) in free.iter().enumerate() {
        let variance = (sigma2 * inverse[(j, j)]).max(sandwich[(j, j)]).max(0.0);
        // What the residual does not depend on at all is not known at all.
        let seen = scale[j] > NO_SCALE;
        let se = if seen {
            variance.sqrt() / scale[j]
        } else {
            f64::INFINITY
        };
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
            _ if linear && seen && se * scale[j] <= NOTHING * drive => Status::Identified,
            Some(partner) => Status::TradedOff(names[free[partner]].clone()),
            None if distance >= TOLD => Status::WeaklyExcited,
            None => Status::NotExcited,
        };
    }
}
