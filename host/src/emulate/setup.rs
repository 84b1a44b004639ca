//! From a model file to what a board has to be told.

use bristle_core::control::{Effects, Learning, Method};
use bristle_core::drive::{Limits, Number, Parameters};
use bristle_core::friction::{OutOfRange, Units};

use super::Sensors;
use crate::error::{Error, Result};
use crate::format::shortest;
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

/// A board's parameters, and the units that its numbers are in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuned<T> {
    /// What the board is told.
    pub parameters: Parameters<T>,
    /// SI units for a board in floating point, and chosen by [`tune::units`] for one in fixed point. `u` keeps its own.
    pub units: Units,
}

/// The parameters of a board that knows an axis by its model file. Fails if the model lacks a value, or says what no
/// controller knows, or a number does not fit the format.
pub fn tuned<T: Number>(model: &Model, setup: &Setup, sensors: &Sensors) -> Result<Tuned<T>> {
    let mut control = tune::parameters(model, &setup.wish)?;
    let current = tune::current(model, &setup.wish)?;
    if !setup.compensate {
        control.compensation.method = Method::Off;
        control.adaptation.method = Learning::Off;
        control.effects = Effects::NONE;
    }
    let limits: Limits<T> = sensors.limits(setup.wish.rate);
    let units = if T::FIXED {
        tune::units(&control, current.as_ref(), limits.jump)
    } else {
        tune::SI
    };
    let out_of_range =
        |e: OutOfRange| Error::Usage(format!("{e}; check the units of the model and --limit"));
    let parameters = Parameters {
        limits,
        control: control.scaled(&units).map_err(out_of_range)?,
        current: current
            .map(|current| current.scaled(&units))
            .transpose()
            .map_err(out_of_range)?,
    };
    if let Err(invalid) = parameters.control.check() {
        return Err(Error::Usage(format!(
            "the controller does not fit the board's numbers: {invalid}"
        )));
    }
    check_current(&parameters)?;
    Ok(Tuned { parameters, units })
}

/// Refuses a current loop that the board's numbers cannot hold, or that may ask for a current at which the bridge goes off.
pub fn check_current<T: Number>(parameters: &Parameters<T>) -> Result<()> {
    let Some(current) = &parameters.current else {
        return Ok(());
    };
    if !current.is_valid() {
        return Err(Error::Usage(
            "the gains of the current loop do not fit the board's numbers; ask for another --current-bandwidth".to_owned(),
        ));
    }
    let (asked, most) = (parameters.control.command_limit, parameters.limits.current);
    if asked < most {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "the current loop may ask for {} A, and at {} A the board turns its bridge off; give a lower --current-limit",
        shortest(asked.to_f64(), 4),
        shortest(most.to_f64(), 4)
    )))
}

/// The same in floating point, whose units are SI.
pub fn parameters(model: &Model, setup: &Setup, sensors: &Sensors) -> Result<Parameters<f32>> {
    Ok(tuned(model, setup, sensors)?.parameters)
}
