//! What the board does on a command, without the hardware: what ships is what the host tests.

use super::{Answer, CHUNK, Command, Counters, Injection};
use crate::drive::{Drive, Fault, Number, Refusal};

/// What is left to do for a command that needs more than the drive.
#[derive(Clone, Debug, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "a board has no heap to put the larger one on"
)]
pub enum Reaction<T> {
    /// Send this.
    Answer(Answer<T>),
    /// Greet the host.
    Greet,
    /// Write the parameters in force to the flash.
    Store,
    /// Let the hardware fail.
    Inject(Injection),
}

/// Carries out a command.
pub fn serve<T: Number>(
    drive: &mut Drive<T>,
    counters: Counters,
    command: &Command<T>,
) -> Reaction<T> {
    let answer = match *command {
        Command::Hello => return Reaction::Greet,
        Command::Inject(Injection::CorruptParameter) => {
            drive.corrupt();
            Ok(Answer::Done)
        }
        Command::Inject(Injection::Clock) => {
            drive.raise(Fault::Clock);
            Ok(Answer::Done)
        }
        Command::Inject(injection) => return Reaction::Inject(injection),
        Command::Store => match drive.must_not_run() {
            Ok(()) => return Reaction::Store,
            Err(refusal) => Err(refusal),
        },
        // The receiver passes these two on to the control task by itself.
        Command::Sample(_) | Command::SetPoint(_) => Err(Refusal::NotEmulated),
        Command::Enable => drive.enable().map(|()| Answer::Done),
        Command::Disable => {
            drive.disable();
            Ok(Answer::Done)
        }
        Command::Clear => {
            drive.clear();
            Ok(Answer::Done)
        }
        Command::Status => Ok(Answer::Status {
            state: drive.state(),
            faults: drive.faults(),
            counters,
        }),
        Command::Set(ref parameters) => drive.set(parameters).map(|()| Answer::Done),
        Command::Get => Ok(Answer::Parameters(*drive.parameters())),
        Command::Record(order) if drive.recorder().start(order) => Ok(Answer::Done),
        Command::Record(_) => Err(Refusal::NothingSelected),
        Command::StopRecording => {
            drive.recorder().stop();
            Ok(Answer::Done)
        }
        Command::Recorded => Ok(Answer::Recorded(drive.recorder().contents())),
        Command::Read { first } => Ok(Answer::Words {
            first,
            words: drive.recorder().read(first).take(CHUNK).collect(),
        }),
        Command::Telemetry { selection, every } => {
            drive.stream(selection, every);
            Ok(Answer::Done)
        }
    };
    Reaction::Answer(answer.unwrap_or_else(Answer::Refused))
}
