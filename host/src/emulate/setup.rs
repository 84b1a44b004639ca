//! From a model file to what a board has to be told.

use bristle_core::control::{Effects, Learning, Method};
use bristle_core::drive::{Number, Parameters};
use bristle_core::friction::{OutOfRange, Units};

use super::Sensors;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::tune::{self, Wish};

/// How an axis is to be controlled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// What the gains follow from.
    pub wish: Wish,
    /// Whether the model's friction and effects are compensated.
    pub compensate: bool,
}

/// What a board in floating point counts in.
const SI: Units = Units {
    force: 1.0,
    position: 1.0,
    velocity: 1.0,
};

/// The parameters of a board that knows an axis by its model file. Fails if the model lacks a value, or says what no
/// controller knows, or a number does not fit the format.
pub fn parameters<T: Number>(
    model: &Model,
    setup: &Setup,
    sensors: &Sensors,
) -> Result<Parameters<T>> {
    let mut control = tune::parameters(model, &setup.wish)?;
    if !setup.compensate {
        control.compensation.method = Method::Off;
        control.adaptation.method = Learning::Off;
        control.effects = Effects::NONE;
    }
    let out_of_range =
        |e: OutOfRange| Error::Usage(format!("{e}; check the units of the model and --limit"));
    let parameters = Parameters {
        limits: sensors.limits(setup.wish.rate),
        control: control.scaled(&SI).map_err(out_of_range)?,
    };
    if let Err(invalid) = parameters.control.check() {
        return Err(Error::Usage(format!(
            "the controller does not fit the board's numbers: {invalid}"
        )));
    }
    Ok(parameters)
}
