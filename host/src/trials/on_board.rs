//! A plant of an experiment once more, under the firmware.
//!
//! The plant and all that happens to it are on the host, and the board is what controls it: it gets encoder counts and set
//! points period by period, the plant moves by its commands, and DBI sees what was recorded of that. What is identified
//! then goes over the link to the board, which takes it while the axis runs.

use std::cell::Cell;
use std::rc::Rc;

use bristle_core::control::{Parameters, SetPoint};
use bristle_core::drive;
use bristle_core::drive::signal::{Selection, Signal};
use bristle_core::link::Command;

use super::{Campaign, OnBoard, Shown};
use crate::emulate::{Board, Driver, Sensors};
use crate::error::{Error, Result};
use crate::servo::{Act, Control, Make};

/// Runs the plant of a campaign that is drawn under a board that has just started, beside the runs on the host.
pub fn on_board(campaign: &Campaign, board: &mut Board<f32>) -> Result<Vec<OnBoard>> {
    let mut boards = Boards {
        board,
        sensors: Sensors::emulated(campaign.count),
        taken: Vec::new(),
    };
    let played = campaign
        .experiment
        .play(campaign.drawn, campaign.seed, &mut boards)?;
    let trial = campaign.trials.iter().find(|t| t.plant == campaign.drawn);
    let hosts = trial.into_iter().flat_map(|t| &t.merits);
    let runs = played.shown.iter().zip(&campaign.shown);
    let merits = played.trial.merits.into_iter().zip(hosts.cloned());
    Ok(runs
        .zip(merits)
        .zip(&boards.taken)
        .map(|(((board, host), (firmware, hosts)), taken)| OnBoard {
            way: board.way,
            periods: board.samples.len(),
            equal: equal(board, host),
            sets: taken.get(),
            firmware,
            host: hosts,
        })
        .collect())
}

/// Periods that are the same bits.
fn equal(a: &Shown, b: &Shown) -> usize {
    let both = a.samples.iter().zip(&b.samples);
    let bits = |act: &Act| [act.command, act.coulomb].map(f32::to_bits);
    both.filter(|(a, b)| a.counts == b.counts && bits(&a.act) == bits(&b.act))
        .count()
}

/// One board for one run after the other.
struct Boards<'b> {
    board: &'b mut Board<f32>,
    sensors: Sensors,
    /// Sets taken under way, run by run.
    taken: Vec<Rc<Cell<usize>>>,
}

impl Make for Boards<'_> {
    fn control<'a>(&'a mut self, parameters: &Parameters<f32>) -> Result<Box<dyn Control + 'a>> {
        let limits = self.sensors.limits(1.0 / f64::from(parameters.period));
        let taken = Rc::new(Cell::new(0));
        self.taken.push(Rc::clone(&taken));
        let mut running = Running {
            board: self.board,
            sensors: self.sensors,
            limits,
            taken,
        };
        running.board.restart()?;
        running.tell(parameters)?;
        running.board.tell(Command::Telemetry {
            selection: Selection::of(&[Signal::Coulomb]),
            every: 1,
        })?;
        running.board.tell(Command::Enable)?;
        Ok(Box::new(running))
    }
}

/// A board that is on.
struct Running<'a> {
    board: &'a mut Board<f32>,
    sensors: Sensors,
    limits: drive::Limits<f32>,
    taken: Rc<Cell<usize>>,
}

/// Pieces that a frame of telemetry may come in.
const PIECES: usize = 4;

impl Running<'_> {
    fn tell(&mut self, parameters: &Parameters<f32>) -> Result<()> {
        self.board.tell(Command::Set(drive::Parameters {
            limits: self.limits,
            control: *parameters,
            current: None,
        }))
    }

    /// The Coulomb level of a period, which comes behind its command.
    fn level(&mut self, period: u32) -> Result<f32> {
        for _ in 0..PIECES {
            let (frames, _) = self.board.take_telemetry();
            if let Some(frame) = frames.iter().find(|frame| frame.period == period) {
                return Ok(frame.words.first().map_or(f32::NAN, |w| f32::from_bits(*w)));
            }
            self.board.poll()?;
        }
        Err(Error::Board(format!(
            "the telemetry of period {period} has not come"
        )))
    }
}

impl Control for Running<'_> {
    fn step(&mut self, counts: i32, set_point: SetPoint<f32>) -> Result<Act> {
        // In the middle of its count, which the encoder rounds down to.
        let q = (f64::from(counts) + 0.5) * self.sensors.count;
        let sample = self.sensors.sample(q, 0.0);
        let period = self.board.period(Some(set_point), sample)?;
        Ok(Act {
            command: period.input,
            coulomb: self.level(period.number)?,
        })
    }

    fn set(&mut self, parameters: &Parameters<f32>) -> Result<()> {
        self.tell(parameters)?;
        self.taken.set(self.taken.get() + 1);
        Ok(())
    }
}
