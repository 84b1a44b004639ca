//! A board at the other end of a wire.

use std::collections::VecDeque;

use bristle_core::drive::Number;
use bristle_core::drive::recorder::Order;
use bristle_core::link::{
    Answer, Command, Deframer, Hello, Numbers, PROTOCOL_VERSION, Packet, Report, decode, encode,
};

use super::{BLOCK, Recorded, Wire};
use crate::error::{Error, Result};

/// A telemetry frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Telemetry {
    /// Counts up with every frame that was due.
    pub number: u16,
    /// The number of the control period.
    pub period: u32,
    /// The chosen signals in their order.
    pub words: Vec<u32>,
}

/// How often a board that may have booted long ago is asked to greet.
const CALLS: u32 = 8;

/// A board that has greeted.
pub struct Peer<T, W> {
    wire: W,
    hello: Option<Hello>,
    deframer: Deframer,
    reports: VecDeque<Report<T>>,
    sequence: u16,
    telemetry: Vec<Telemetry>,
    last_number: Option<u16>,
    lost: u32,
    damaged: u32,
}

impl<T: Number, W: Wire> Peer<T, W> {
    /// Waits for the greeting of a board that is about to boot.
    pub fn awaited(wire: W) -> Result<Self> {
        let mut peer = Self::new(wire);
        peer.greet()?;
        Ok(peer)
    }

    /// Asks a board that may have booted long ago to greet, until it does.
    pub fn called(wire: W) -> Result<Self> {
        Self::called_up_to(CALLS, wire)
    }

    /// The same with so many calls at most.
    pub fn called_up_to(calls: u32, wire: W) -> Result<Self> {
        let mut peer = Self::new(wire);
        for _ in 0..calls {
            peer.call()?;
            while peer.fill()? {
                if peer.reports.iter().any(|r| matches!(r, Report::Hello(_))) {
                    peer.greet()?;
                    return Ok(peer);
                }
            }
        }
        Err(Error::Usage(format!(
            "no board answers on {}; is it powered, is it this port, and does it run Bristle's firmware?",
            peer.wire.name()
        )))
    }

    /// Asks the board to greet, and does not wait.
    pub fn call(&mut self) -> Result<()> {
        // A zero byte ends whatever another program has left half said.
        self.wire.write(&[0])?;
        self.send(Command::Hello).map(drop)
    }

    fn new(wire: W) -> Self {
        Self {
            wire,
            hello: None,
            deframer: Deframer::new(),
            reports: VecDeque::new(),
            sequence: 0,
            telemetry: Vec::new(),
            last_number: None,
            lost: 0,
            damaged: 0,
        }
    }

    /// Waits for a greeting, as after a restart.
    pub fn greet(&mut self) -> Result<Hello> {
        loop {
            if let Report::Hello(hello) = self.receive()? {
                if hello.protocol != PROTOCOL_VERSION {
                    return Err(Error::Usage(format!(
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

    /// The last greeting, of a board that computes in the numbers of this peer: any other would take its words for
    /// something else. `who` asks.
    pub fn in_same_numbers(&self, who: &str) -> Result<&Hello> {
        let hello = self.hello.as_ref();
        let hello = hello.ok_or_else(|| Error::Board("it has not greeted".to_owned()))?;
        let (fixed, has, knows) = match hello.numbers {
            Numbers::F32 => (false, "single precision", "fixed point"),
            Numbers::Q16 => (true, "fixed point", "single precision"),
        };
        if fixed == T::FIXED {
            Ok(hello)
        } else {
            Err(Error::Usage(format!(
                "this board computes in {has}, and {who} knows boards in {knows} only"
            )))
        }
    }

    /// The wire.
    pub const fn wire(&mut self) -> &mut W {
        &mut self.wire
    }

    /// Frames from the board that came damaged.
    pub const fn damaged(&self) -> u32 {
        self.damaged
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

    /// Sends a command and does not wait; its number.
    pub fn send(&mut self, command: Command<T>) -> Result<u16> {
        let frame = self.frame(command)?;
        self.wire.write(&frame)?;
        Ok(self.sequence)
    }

    /// Sends several commands in one piece.
    pub fn send_all(&mut self, commands: Vec<Command<T>>) -> Result<()> {
        let mut bytes = Vec::new();
        for command in commands {
            bytes.extend(self.frame(command)?);
        }
        self.wire.write(&bytes)
    }

    /// Waits for the next report. Telemetry is put aside.
    pub fn receive(&mut self) -> Result<Report<T>> {
        loop {
            if let Some(report) = self.next() {
                return Ok(report);
            }
            if !self.fill()? {
                return Err(self.silent());
            }
        }
    }

    /// Takes what has come, waiting for the wire's patience at most: the reports, and whether anything came. Telemetry is put
    /// aside.
    pub fn poll(&mut self) -> Result<(Vec<Report<T>>, bool)> {
        let before = self.telemetry.len();
        // What came with an answer has been waiting already.
        if self.reports.is_empty() {
            self.fill()?;
        }
        let reports: Vec<Report<T>> = std::iter::from_fn(|| self.next()).collect();
        let heard = !reports.is_empty() || self.telemetry.len() > before;
        Ok((reports, heard))
    }

    /// The next report that has come but is not telemetry, which is put aside.
    fn next(&mut self) -> Option<Report<T>> {
        loop {
            match self.reports.pop_front()? {
                Report::Telemetry {
                    number,
                    period,
                    words,
                } => {
                    let expected = self.last_number.map(|last| last.wrapping_add(1));
                    let gap = expected.map_or(0, |expected| number.wrapping_sub(expected));
                    self.lost = self.lost.saturating_add(gap.into());
                    self.last_number = Some(number);
                    self.telemetry.push(Telemetry {
                        number,
                        period,
                        words: words.to_vec(),
                    });
                }
                Report::Hello(hello) => {
                    // Boards count anew after a restart.
                    self.last_number = None;
                    return Some(Report::Hello(hello));
                }
                report => return Some(report),
            }
        }
    }

    /// Takes what the wire brings; whether it brought anything before its patience ended.
    fn fill(&mut self) -> Result<bool> {
        let mut buffer = [0; BLOCK];
        let length = self.wire.read(&mut buffer)?;
        for &byte in &buffer[..length] {
            match self.deframer.push(byte) {
                None => {}
                Some(frame) => match frame.and_then(decode) {
                    Ok(report) => self.reports.push_back(report),
                    // A real line may begin in the middle of a frame, and has noise.
                    Err(_) if self.wire.is_noisy() => self.damaged += 1,
                    Err(e) => {
                        return Err(Error::Board(format!(
                            "a frame from the firmware is damaged: {e:?}"
                        )));
                    }
                },
            }
        }
        Ok(length > 0)
    }

    fn silent(&self) -> Error {
        Error::Board(format!(
            "no answer on {} ({} damaged frames); check cable and power, and try again",
            self.wire.name(),
            self.damaged
        ))
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
            other => Err(Error::Board(format!(
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

    /// What the board has recorded.
    pub fn recorded(&mut self) -> Result<Recorded> {
        let Answer::Recorded(contents) = self.ask(Command::Recorded)? else {
            return Err(Error::Board("no answer about the recording".to_owned()));
        };
        let total = contents.rows as usize * contents.selection.len();
        let mut words = Vec::with_capacity(total);
        while words.len() < total {
            let first = words.len() as u32;
            match self.ask(Command::Read { first })? {
                Answer::Words {
                    first: at,
                    words: some,
                } if at == first && !some.is_empty() => {
                    words.extend_from_slice(&some);
                }
                other => {
                    return Err(Error::Board(format!(
                        "the recording ends at value {first} of {total}: {other:?}"
                    )));
                }
            }
        }
        Ok(Recorded { contents, words })
    }
}
