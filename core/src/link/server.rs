//! What the board does on a command, without the hardware: what ships is what the host tests.

use embedded_storage::nor_flash::NorFlash;

use super::{Answer, CHUNK, Command, Counters, Injection, Report};
use crate::drive::signal::{Selection, Snapshot};
use crate::drive::store::{self, Places, WriteFailed};
use crate::drive::{Actuation, Drive, Fault, Number, Parameters, Refusal};

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
        Command::Inject(injection) => return Reaction::Inject(injection),
        Command::Store => match drive.must_not_run() {
            Ok(()) => return Reaction::Store,
            Err(refusal) => Err(refusal),
        },
        // The receiver passes these two on to the control task by itself.
        Command::Sample(_) | Command::SetPoint(_) => Err(Refusal::NotEmulated),
        Command::Enable => drive.enable().map(|()| Answer::Done),
        Command::EnableWithin(ref bounds) => drive.enable_within(bounds).map(|()| Answer::Done),
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

/// Writes parameters into the flash, as [`Reaction::Store`] asks for; what became of it.
pub fn store<T: Number>(
    flash: &mut impl NorFlash,
    places: Places,
    parameters: &Parameters<T>,
) -> Answer<T> {
    match store::save(flash, places, parameters) {
        Ok(()) => Answer::Done,
        Err(WriteFailed) => Answer::Refused(Refusal::WriteFailed),
    }
}

/// What an emulated board reports of a period.
pub fn actuation<T: Number>(drive: &Drive<T>, actuation: &Actuation<T>) -> Report<T> {
    Report::Actuation {
        period: drive.snapshot().period,
        input: actuation.input,
        bridge: actuation.bridge,
        faults: drive.faults(),
    }
}

/// A frame of telemetry.
pub fn telemetry<T>(number: u16, selection: Selection, snapshot: &Snapshot) -> Report<T> {
    Report::Telemetry {
        number,
        period: snapshot.period,
        words: snapshot.chosen(selection),
    }
}

/// Brings about the part of a fault that happens in the drive. Only for a board whose hardware is not real.
pub fn suffer<T: Number>(drive: &mut Drive<T>, injection: Injection) {
    match injection {
        Injection::CorruptParameter => drive.corrupt(),
        Injection::Clock => drive.raise(Fault::Clock),
        Injection::CorruptFlash { .. } | Injection::Hang | Injection::Restart => {}
    }
}

#[cfg(test)]
mod tests {
    use super::{Reaction, serve, suffer};
    use crate::control::SetPoint;
    use crate::drive::recorder::{Order, Trigger};
    use crate::drive::signal::{Selection, Signal};
    use crate::drive::{Drive, Faults, News, Parameters, Refusal, Sample, State};
    use crate::link::{Answer, CHUNK, Command, Counters, Injection};

    fn drive() -> Drive<'static, f32> {
        let ring = std::vec![0; 200].leak();
        Drive::new(Parameters::harmless(), Faults::NONE, ring).unwrap()
    }

    fn answer(drive: &mut Drive<f32>, command: &Command<f32>) -> Answer<f32> {
        match serve(drive, Counters::default(), command) {
            Reaction::Answer(answer) => answer,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_needs_hardware_is_left_to_the_board() {
        let mut drive = drive();
        let serve = |drive: &mut Drive<f32>, command| serve(drive, Counters::default(), &command);
        assert_eq!(serve(&mut drive, Command::Hello), Reaction::Greet);
        assert_eq!(serve(&mut drive, Command::Store), Reaction::Store);
        let injection = Injection::CorruptParameter;
        let left = serve(&mut drive, Command::Inject(injection));
        assert_eq!(left, Reaction::Inject(injection));
        drive.verify();
        assert_eq!(drive.state(), State::Off);
        suffer(&mut drive, injection);
        drive.verify();
        assert_eq!(drive.state(), State::Faulted);
    }

    #[test]
    fn a_refusal_changes_nothing() {
        let mut drive = drive();
        assert_eq!(answer(&mut drive, &Command::Enable), Answer::Done);
        let mut other = Parameters::harmless();
        other.limits.jump = 1;
        for (command, why) in [
            (Command::Set(other), Refusal::Fixed),
            (Command::Store, Refusal::Running),
            (Command::Enable, Refusal::Running),
            (Command::SetPoint(SetPoint::Off), Refusal::NotEmulated),
            (Command::Sample(Sample::default()), Refusal::NotEmulated),
        ] {
            assert_eq!(answer(&mut drive, &command), Answer::Refused(why));
        }
        let get = answer(&mut drive, &Command::Get);
        assert_eq!(get, Answer::Parameters(Parameters::harmless()));
        assert_eq!(answer(&mut drive, &Command::Disable), Answer::Done);
        assert_eq!(answer(&mut drive, &Command::Set(other)), Answer::Done);
        assert_eq!(answer(&mut drive, &Command::Get), Answer::Parameters(other));
    }

    #[test]
    fn a_recording_is_read_in_chunks_to_its_end() {
        let mut drive = drive();
        let order = Order {
            selection: Selection::of(&[Signal::Position, Signal::Bus]),
            every: 1,
            trigger: Trigger::Now,
            before: 0,
        };
        assert_eq!(answer(&mut drive, &Command::Record(order)), Answer::Done);
        for k in 0..70 {
            let sample = Sample {
                count: 10 * k,
                ..Sample::default()
            };
            drive.step(&sample, &News::NONE);
        }
        let mut words = std::vec::Vec::new();
        loop {
            let first = words.len() as u32;
            let Answer::Words { words: more, .. } = answer(&mut drive, &Command::Read { first })
            else {
                panic!("no words")
            };
            words.extend_from_slice(&more);
            if more.len() < CHUNK {
                break;
            }
        }
        let positions = words.iter().step_by(2).copied();
        assert!(positions.eq((0..70).map(|k| 10 * k)));
        assert_eq!(words.len(), 140);
    }
}
