//! A mass that a spring holds, with friction in feedback (the source's mass-spring system, its fig. 1 and 2).
//!
//! `m·ẍ = F_e − K_p·x − F_f`, with `m` = `plant.inertia`, `K_p` = `plant.stiffness` in N/m and `F_e` = `gain·u` in N;
//! in rad and N·m on a rotary axis. Slow ramps of `F_e` show stick-slip, periodic ones hysteresis.
//!
//! Pulling the free end of the spring is the same system: an end at `y` gives `F_e = K_p·y`, so that with
//! `gain = K_p` the input `u` is the position of the end.

use crate::axis::Axis;
use crate::effects;
use crate::error::{Error, Result};
use crate::model::Model;

/// An axis with one more effect, the spring.
pub fn mass_spring(model: &Model) -> Result<Axis> {
    let mut axis = Axis::simulated(model)?;
    let spring = effects::find("spring")
        .ok_or_else(|| Error::Internal("the spring effect is not built in".to_owned()))?;
    let (inner, coefficients) = spring.linear(&[model.constant("plant.stiffness")], model.scale());
    axis.contact.push(spring, inner, coefficients);
    Ok(axis)
}
