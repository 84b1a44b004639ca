//! The lockstep of a plant and what drives it.

use bristle_core::control::{Position, SetPoint};
use bristle_core::drive::{Drive, Faults, Mailbox, Number, Parameters, Sample};
use bristle_core::friction::Units;

use super::Sensors;
use crate::bench::Record;
use crate::error::{Error, Result};
use crate::plant::Plant;

/// What the bridge does until the next sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period<T> {
    /// The number of the control period, counted from the board's start.
    pub number: u32,
    /// What drives the axis, in the unit of `u`.
    pub input: T,
    /// Whether the bridge is on.
    pub bridge: bool,
    /// The latched faults.
    pub faults: Faults,
}

/// What turns a sample into an input: an emulated board, or the same code on the host.
pub trait Driver<T> {
    /// One control period, in which a set point may come.
    fn period(&mut self, set_point: Option<SetPoint<T>>, sample: Sample) -> Result<Period<T>>;
}

/// The drive on the host, for comparison.
pub struct OnHost<T: 'static> {
    drive: Drive<'static, T>,
    mailbox: Mailbox<T>,
}

impl<T: Number> OnHost<T> {
    /// A drive that is on. Fails if the parameters are not valid, or it cannot be turned on.
    pub fn new(parameters: Parameters<T>) -> Result<Self> {
        let drive = Drive::new(parameters, Faults::NONE, &mut []);
        let mut drive = drive.ok_or_else(|| Error::Usage("the model and the options give the controller parameters that are not finite or out of their ranges; check the model, --bandwidth and --limit".to_owned()))?;
        let refused = |why| Error::Internal(format!("the drive refuses to be enabled: {why:?}"));
        drive.enable().map_err(refused)?;
        let mailbox = Mailbox::new();
        Ok(Self { drive, mailbox })
    }

    /// Other parameters from the next period on, as a board takes them while it is on.
    pub fn set(&mut self, parameters: &Parameters<T>) -> Result<()> {
        self.drive.set(parameters).map_err(|why| {
            Error::Usage(format!(
                "the drive does not take the parameters under way: {why:?}"
            ))
        })
    }
}

impl<T: Number> Driver<T> for OnHost<T> {
    fn period(&mut self, set_point: Option<SetPoint<T>>, sample: Sample) -> Result<Period<T>> {
        if let Some(set_point) = set_point {
            self.mailbox.put_set_point(set_point);
        }
        let actuation = self.drive.step(&sample, &self.mailbox.take_news());
        Ok(Period {
            number: self.drive.snapshot().period,
            input: actuation.input,
            bridge: actuation.bridge,
            faults: self.drive.faults(),
        })
    }
}

/// What the axis is to do over a run.
pub struct Plan<T> {
    /// Instants of the samples, s.
    pub t: Vec<f64>,
    /// What is asked for at each.
    pub set_points: Vec<SetPoint<T>>,
    /// The set points in rad or m, if they are positions.
    pub positions: Vec<f64>,
    /// A torque or force that acts on the axis from each instant on and that no recording shows; empty for none.
    pub loads: Vec<f64>,
    /// The converters.
    pub sensors: Sensors,
}

/// A run's recording, and what the board did in each period.
pub struct Outcome<T> {
    /// As a driver would have recorded it, with the truth behind it.
    pub record: Record,
    /// One for each sample.
    pub periods: Vec<Period<T>>,
}

/// Runs a plant that stands at zero under a driver that is on.
pub fn run<T: Number>(
    driver: &mut dyn Driver<T>,
    plant: &mut dyn Plant,
    plan: &Plan<T>,
) -> Result<Outcome<T>> {
    let mut record = Record::default();
    let mut periods = Vec::with_capacity(plan.t.len());
    for k in 0..plan.t.len() {
        let truth = plant.measured();
        let current = plant.current();
        let sample = plan.sensors.sample(truth.q, current.unwrap_or(0.0));
        let period = driver.period(plan.set_points.get(k).copied(), sample)?;
        record.u.push(period.input.to_f64());
        record
            .q
            .push(plan.sensors.counts(truth.q) as f64 * plan.sensors.count);
        record.current.extend(current);
        record.truth.push(truth);
        periods.push(period);
        if k + 1 < plan.t.len() {
            let load = plan.loads.get(k).copied().unwrap_or(0.0);
            plant.advance(&plan.t, &record.u, k, load);
        }
    }
    record.t.clone_from(&plan.t);
    record.set_point.clone_from(&plan.positions);
    Ok(Outcome { record, periods })
}

/// A position set point with its rates, for an encoder whose count is `count` rad or m, in the units of the board.
pub fn position<T: Number>(q: f64, rates: (f64, f64), count: f64, units: &Units) -> SetPoint<T> {
    SetPoint::Position {
        position: Position::from_f64(q / count),
        velocity: T::from_f64(rates.0 / units.velocity),
        acceleration: acceleration(rates.1, units),
    }
}

/// A velocity set point with its rate, likewise.
pub fn velocity<T: Number>(v: f64, rate: f64, units: &Units) -> SetPoint<T> {
    SetPoint::Velocity {
        velocity: T::from_f64(v / units.velocity),
        acceleration: acceleration(rate, units),
    }
}

fn acceleration<T: Number>(a: f64, units: &Units) -> T {
    T::from_f64(a * units.time() / units.velocity)
}
