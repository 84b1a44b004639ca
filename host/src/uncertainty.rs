//! How certain estimates are: standard errors, and what the recordings say of each parameter.

use crate::model::{Model, Parameter, Status};
use crate::normal::Normal;

/// A parameter this many standard errors from zero is known to a tenth or better.
pub const KNOWN: f64 = 10.0;
/// A parameter within this many standard errors of zero cannot be told from it (95 %).
pub const TOLD: f64 = 2.0;
/// Estimates correlated by more than this inflate each other's variance tenfold: `1/(1 − ρ²) > 10`, the usual limit
/// (Marquardt, Technometrics 12, 1970).
const COLLINEAR: f64 = 0.95;
/// Torque or force below this share of the drive is none.
const NOTHING: f64 = 0.01;

/// Gives each free parameter its standard error and status from the normal equations of whitened residuals.
///
/// Standard errors are `(JᵀJ)⁻¹·(Σ over clusters of gradient outer products)·(JᵀJ)⁻¹`: clusters stay independent even
/// where the model or the noise covariance is not exact (Liang and Zeger 1986). The larger of this and the model-based
/// error is reported.
pub fn assess(model: &mut Model, free: &[usize], normal: &Normal) {
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
    let (Some((plain, _, scale)), Some(errors)) = (normal.covariances(), normal.errors()) else {
        return;
    };
    let drive = normal.drive();
    let names: Vec<String> = model.labels().iter().map(ToString::to_string).collect();
    for (j, &k) in free.iter().enumerate() {
        let se = errors[j];
        let bound = model.at_bound(k);
        let linear = model.is_linear(k);
        let parameter = &mut *model.parameters_mut().swap_remove(k);
        parameter.se = Some(se);
        let distance = parameter.value.unwrap_or_default().abs() / se;
        let correlation = |i: usize| plain[(i, j)] / (plain[(i, i)] * plain[(j, j)]).sqrt();
        let partner = (0..free.len())
            .filter(|i| *i != j)
            .max_by(|a, b| correlation(*a).abs().total_cmp(&correlation(*b).abs()))
            .filter(|i| correlation(*i).abs() > COLLINEAR);
        parameter.status = match partner {
            _ if bound => Status::AtBound,
            _ if distance >= KNOWN => Status::Identified,
            _ if linear && se.is_finite() && se * scale[j] <= NOTHING * drive => Status::Identified,
            Some(partner) => Status::TradedOff(names[free[partner]].clone()),
            None if distance >= TOLD => Status::WeaklyExcited,
            None => Status::NotExcited,
        };
    }
}

/// Adds to the standard error of a parameter what it may be off by for another reason. One that was known, be it as next to nothing,
/// and that this leaves open altogether, is not excited.
pub fn add(parameter: &mut Parameter, off: f64) {
    let (Some(value), Some(se)) = (parameter.value, parameter.se) else {
        return;
    };
    let more = se.hypot(off);
    parameter.se = Some(more);
    let as_nothing = parameter.status == Status::Identified && more >= KNOWN * se;
    if (as_nothing || value.abs() >= KNOWN * se) && value.abs() < TOLD * more {
        parameter.status = Status::NotExcited;
    }
}
