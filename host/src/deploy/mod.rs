//! From a model to a board that compensates it: what the board has to be told, told, stored, read back and compared.
//!
//! - [`Rig`]: what the model does not know: the board, its supply and its limits.
//! - [`parameters`]: the set for a board, checked against what it can do.
//! - [`deploy`] and [`verify`]: the way onto the board, and what it holds.

mod compare;
mod rig;

pub use compare::{Difference, differences};
pub use rig::{Rig, parameters};

use bristle_core::drive::{Parameters, Refusal, State};
use bristle_core::link::{Answer, Command};

use crate::error::{Error, Result};
use crate::link::{Peer, Wire};

/// Puts parameters in force on a board, has them written to its flash, reads back what is in force, and compares.
///
/// A board takes the set whole or not at all; whatever goes wrong before it is in force leaves the one before. Fails if
/// the axis runs, the board refuses, or what comes back differs.
pub fn deploy<W: Wire>(board: &mut Peer<f32, W>, parameters: &Parameters<f32>) -> Result<()> {
    board.in_same_numbers("deploy")?;
    must_not_run(board)?;
    carry_out(board, Command::Set(*parameters), "take the parameters")?;
    carry_out(board, Command::Store, "store the parameters")?;
    verify(board, parameters)
}

/// Reads back the parameters in force and compares them.
pub fn verify<W: Wire>(board: &mut Peer<f32, W>, parameters: &Parameters<f32>) -> Result<()> {
    let found = differences(parameters, &in_force(board)?)?;
    if found.is_empty() {
        return Ok(());
    }
    let all: Vec<String> = found.iter().map(ToString::to_string).collect();
    Err(Error::Board(format!(
        "it holds other parameters than it was sent ({}); deploy again, and do not run the axis before they agree",
        all.join("; ")
    )))
}

/// The parameters in force.
pub fn in_force<W: Wire>(board: &mut Peer<f32, W>) -> Result<Parameters<f32>> {
    match board.ask(Command::Get)? {
        Answer::Parameters(parameters) => Ok(parameters),
        other => Err(Error::Board(format!(
            "it answers {other:?} to the question which parameters are in force; is its firmware of this release?"
        ))),
    }
}

fn must_not_run<W: Wire>(board: &mut Peer<f32, W>) -> Result<()> {
    match board.ask(Command::Status)? {
        Answer::Status {
            state: State::Running,
            ..
        } => Err(Error::Usage(
            "the axis is running, and what is deployed goes to the board's flash, which is written only at rest; disable it first"
                .to_owned(),
        )),
        _ => Ok(()),
    }
}

fn carry_out<W: Wire>(board: &mut Peer<f32, W>, command: Command<f32>, what: &str) -> Result<()> {
    let why = match board.ask(command)? {
        Answer::Done => return Ok(()),
        Answer::Refused(Refusal::Running) => "the axis runs; disable it first",
        Answer::Refused(Refusal::Invalid) => {
            "it finds a value out of range that this program does not; are firmware and program of the same release?"
        }
        Answer::Refused(Refusal::WriteFailed) => {
            "its flash cannot be written; the parameters stored before are still in it, and the new ones are in force until it restarts"
        }
        Answer::Refused(Refusal::Faulted) => "faults are latched; clear them first",
        _ => "the answer is none to this command; are firmware and program of the same release?",
    };
    Err(Error::Board(format!("it does not {what}: {why}")))
}
