//! An experiment's runs once more, on the firmware.
//!
//! A run is a sequence of encoder counts and set points, and of the commands that the controller made of them. The board
//! gets the same counts and set points, period by period. As long as each of its commands is the same, the plant would
//! have moved the same, so it would have got the same counts: equal commands throughout are the same run in closed loop.

use bristle_core::drive::Parameters;
use bristle_core::link::Command;

use super::{Campaign, Replayed, Shown};
use crate::emulate::{Board, Driver, Sensors};
use crate::error::Result;
use crate::servo::{set_point, single};

/// Repeats the runs of a campaign's first plant on a board that has just started and is off. Left out are those whose
/// parameters change under way, which a board takes only while it is off.
pub fn replay(campaign: &Campaign, board: &mut Board<f32>) -> Result<Vec<Replayed>> {
    let mut all = Vec::new();
    for shown in &campaign.shown {
        if let Some(parameters) = &shown.parameters {
            let sensors = Sensors::emulated(campaign.count);
            board.restart()?;
            board.tell(Command::Set(Parameters {
                limits: sensors.limits(1.0 / parameters.period),
                control: single(parameters)?,
                current: None,
            }))?;
            board.tell(Command::Enable)?;
            all.push(run(shown, &sensors, board)?);
        }
    }
    Ok(all)
}

fn run(shown: &Shown, sensors: &Sensors, board: &mut Board<f32>) -> Result<Replayed> {
    let mut equal = 0;
    for sample in &shown.samples {
        // In the middle of its count, which the encoder rounds down to.
        let q = (f64::from(sample.counts) + 0.5) * sensors.count;
        let aim = set_point(sample.aim, sensors.count);
        let period = board.period(Some(aim), sensors.sample(q, 0.0))?;
        equal += usize::from(period.input.to_bits() == sample.output.command.to_bits());
    }
    Ok(Replayed {
        way: shown.way,
        periods: shown.samples.len(),
        equal,
    })
}
