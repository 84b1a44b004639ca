//! Whether the values that the model file gives for friction hold.
//!
//! A wrong one leaves a torque behind that effects of the catalogue imitate: a slow drift is a constant, a power of velocity
//! next to a straight line is one. So what they explain is held against what the right values do.

use super::error;
use super::select::FLOOR;
use super::told::TOLD;
use crate::error::Result;
use crate::format;
use crate::identify::Workbench;
use crate::model::{Model, Parameter};

/// Friction that does not hold.
pub(super) struct Refuted {
    /// What it is, and what it comes out as.
    pub text: String,
    /// Whether that is the exponent that the law has by itself, and the model file gives all the rest rightly.
    pub of_law: bool,
}

/// What the recordings say of the friction that the model file gives, if that by itself explains more of a model's error
/// than counts, and no less than all effects that were found, which leave an error of `remaining`.
pub(super) fn refuted(
    bench: &Workbench,
    model: &Model,
    (error_before, remaining): (f64, f64),
) -> Result<Option<Refuted>> {
    let given = friction(model);
    if given.is_empty() {
        return Ok(None);
    }
    let mut free = model.clone();
    for &k in &given {
        free.parameters_mut()[k].known = false;
    }
    // A recording may not tell all of them.
    let Ok((mut free, _)) = bench.estimate(&free) else {
        return Ok(None);
    };
    let error_free = error(bench, &free)?;
    if error_free > (1.0 - FLOOR) * error_before || (1.0 - FLOOR) * error_free > remaining {
        return Ok(None);
    }
    let (labels, values) = (model.labels(), model.parameters());
    let estimates = free.parameters_mut();
    let off = |k: &usize| {
        let (value, se) = (values[*k].value?, estimates[*k].se?);
        let found = estimates[*k].value?;
        let show = |value, se| format::parameter(value, se, labels[*k].unit);
        ((found - value).abs() > TOLD * se).then(|| {
            format!(
                "{} is {} and comes out as {}",
                labels[*k].name,
                show(value, None),
                show(found, Some(se))
            )
        })
    };
    let off: Vec<(usize, String)> = given.iter().filter_map(|k| Some((*k, off(k)?))).collect();
    let of_law = model.exponent_of_law();
    Ok((!off.is_empty()).then(|| Refuted {
        of_law: off.iter().all(|(k, _)| Some(*k) == of_law),
        text: (off.into_iter().map(|(_, text)| text))
            .collect::<Vec<String>>()
            .join(", "),
    }))
}

/// The parameters of the friction law that are given, by their places in [`Model::parameters`].
fn friction(model: &Model) -> Vec<usize> {
    let of_law = model.terms.iter().flat_map(|term| {
        let count = term.parameters.len();
        std::iter::repeat_n(term.in_law, count)
    });
    let of_friction = [false, false, true, true].into_iter().chain(of_law);
    let given = |(k, (parameter, friction)): (usize, (&Parameter, bool))| {
        (friction && parameter.known && parameter.value.is_some()).then_some(k)
    };
    let parameters = model.parameters().into_iter().zip(of_friction);
    parameters.enumerate().filter_map(given).collect()
}
