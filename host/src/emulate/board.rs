//! The host's end of the link.

use std::collections::VecDeque;
use std::path::Path;

use bristle_core::control::SetPoint;
use bristle_core::drive::recorder::{Contents, Order};
use bristle_core::drive::{Number, Sample};
use bristle_core::link::{
    Answer, Command, Deframer, Hello, PROTOCOL_VERSION, Packet, Report, decode, encode,
};

use super::machine::{BLOCK, Launch, Machine, Transport};
use super::run::{Driver, Period};
use crate::error::{Error, Result};

/// A telemetry frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Telemetry {
    /// The number of the control period.
    pub period: u32,
    /// The chosen signals in their order.
    pub words: Vec<u32>,
}

/// A board that has greeted.
pub struct Board<T> {
    machine: Machine,
    hello: Option<Hello>,
    deframer: Deframer,
    reports: VecDeque<Report<T>>,
    sequence: u16,
    telemetry: Vec<Telemetry>,
    last_number: Option<u16>,
    lost: u32,
}

impl<T: Number> Board<T> {
    /// Starts an image and waits for its greeting.
    pub fn boot(image: &Path, launch: Launch, transport: Transport) -> Result<Self> {
        let machine = Machine::start(image, launch, transport)?;
        let mut board = Self {
            machine,
            hello: None,
            deframer: Deframer::new(),
            reports: VecDeque::new(),
            sequence: 0,
            telemetry: Vec::new(),
            last_number: None,
            lost: 0,
        };
        board.greet()?;
        Ok(board)
    }

    /// Waits for a greeting, as after a restart.
    pub fn greet(&mut self) -> Result<Hello> {
        loop {
            if let Report::Hello(hello) = self.receive()? {
                if hello.protocol != PROTOCOL_VERSION {
                    return Err(Error::Emulator(format!(
                        "the board speaks version {} of the protocol and this program version {PROTOCOL_VERSION}; use an image of the same release",
                        hello.protocol
                    )));
                }
                self.hello = Some(hello);
                return Ok(hello);
            }
        }
    }

    /// The last greeting.
    pub const fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// The emulator.
    pub const fn machine(&mut self) -> &mut Machine {
        &mut self.machine
    }

    /// The bytes of a command, with the next number.
    fn frame(&mut self, command: Command<T>) -> Result<Vec<u8>> {
        self.sequence = self.sequence.wrapping_add(1);
        let sequence = self.sequence;
        let frame = encode(&Packet { sequence, command });
        let frame = frame.map_err(|e| Error::Internal(format!("a command has no frame: {e:?}")))?;
        Ok(frame.to_vec())
    }

    /// Leaves out a number, as if a packet had been lost.
    pub fn skip_number(&mut self) {
        self.sequence = self.sequence.wrapping_add(1);
    }

    /// Sends a command and does not wait.
    pub fn send(&mut self, command: Command<T>) -> Result<()> {
        let frame = self.frame(command)?;
        self.machine.write(&frame)
    }

    /// Sends several commands in one piece.
    pub fn send_all(&mut self, commands: Vec<Command<T>>) -> Result<()> {
        let mut bytes = Vec::new();
        for command in commands {
            bytes.extend(self.frame(command)?);
        }
        self.machine.write(&bytes)
    }

    /// Waits for the next report. Telemetry is put aside.
    pub fn receive(&mut self) -> Result<Report<T>> {
        loop {
            match self.reports.pop_front() {
                Some(Report::Telemetry {
                    number,
                    period,
                    words,
                }) => {
                    let gap = self
                        .last_number
                        .map_or(0, |last| number.wrapping_sub(last) - 1);
                    self.lost += u32::from(gap);
                    self.last_number = Some(number);
                    self.telemetry.push(Telemetry {
                        period,
                        words: words.to_vec(),
                    });
                }
                Some(report) => return Ok(report),
                None => self.fill()?,
            }
        }
    }

    fn fill(&mut self) -> Result<()> {
        let mut buffer = [0; BLOCK];
        let length = self.machine.read(&mut buffer)?;
        for &byte in &buffer[..length] {
            if let Some(frame) = self.deframer.push(byte) {
                let report = frame.and_then(decode);
                self.reports.push_back(report.map_err(|e| {
                    Error::Emulator(format!("a frame from the firmware is damaged: {e:?}"))
                })?);
            }
        }
        Ok(())
    }

    /// Sends a command and waits for the answer to it.
    pub fn ask(&mut self, command: Command<T>) -> Result<Answer<T>> {
        self.send(command)?;
        loop {
            if let Report::Answer { to, answer } = self.receive()?
                && to == self.sequence
            {
                return Ok(answer);
            }
        }
    }

    /// Sends a command that must be carried out.
    pub fn tell(&mut self, command: Command<T>) -> Result<()> {
        let what = format!("{command:?}");
        match self.ask(command)? {
            Answer::Done => Ok(()),
            other => Err(Error::Emulator(format!(
                "the board answers {other:?} to {what}"
            ))),
        }
    }

    /// The telemetry since the last time, and how many frames found the line busy since the start.
    pub fn take_telemetry(&mut self) -> (Vec<Telemetry>, u32) {
        (std::mem::take(&mut self.telemetry), self.lost)
    }

    /// Begins a recording on the board.
    pub fn record(&mut self, order: Order<T>) -> Result<()> {
        self.tell(Command::Record(order))
    }

    /// What the board has recorded: its description, and the words row after row.
    pub fn recorded(&mut self) -> Result<(Contents, Vec<u32>)> {
        let Answer::Recorded(contents) = self.ask(Command::Recorded)? else {
            return Err(Error::Emulator("no answer about the recording".to_owned()));
        };
        let total = contents.rows as usize * contents.selection.len();
        let mut all = Vec::with_capacity(total);
        while all.len() < total {
            let first = all.len() as u32;
            match self.ask(Command::Read { first })? {
                Answer::Words { first: at, words } if at == first && !words.is_empty() => {
                    all.extend_from_slice(&words);
                }
                other => {
                    return Err(Error::Emulator(format!(
                        "the recording ends at value {first} of {total}: {other:?}"
                    )));
                }
            }
        }
        Ok((contents, all))
    }

    /// Waits for what the board does with a sample that was sent.
    pub fn actuation(&mut self) -> Result<Period<T>> {
        loop {
            if let Report::Actuation {
                period,
                input,
                bridge,
                faults,
            } = self.receive()?
            {
                return Ok(Period {
                    number: period,
                    input,
                    bridge,
                    faults,
                });
            }
        }
    }
}

impl<T: Number> Driver<T> for Board<T> {
    fn period(&mut self, set_point: Option<SetPoint<T>>, sample: Sample) -> Result<Period<T>> {
        let mut commands = Vec::with_capacity(2);
        commands.extend(set_point.map(Command::SetPoint));
        commands.push(Command::Sample(sample));
        self.send_all(commands)?;
        self.actuation()
    }
}
