//! The drive behind the same messages on the host: an emulated board without the emulator.

use std::collections::VecDeque;
use std::time::Duration;

use bristle_core::drive::{Drive, Faults, Mailbox, Parameters, Refusal, Sample};
use bristle_core::link::{
    self, Answer, Board, Hello, Injection, Numbers, Packet, Reaction, Received, Receiver, Report,
    encode,
};

use crate::error::{Error, Result};
use crate::link::{BLOCK, Wire};

/// A board that was never set up, without flash and without a recording ring. It answers at once.
pub struct Twin {
    drive: Drive<'static, f32>,
    mailbox: Mailbox<f32>,
    receiver: Receiver,
    number: u16,
    out: VecDeque<u8>,
}

impl Twin {
    /// A board that has just booted.
    pub fn new() -> Result<Self> {
        let drive = Drive::new(Parameters::harmless(), Faults::NONE, &mut []);
        let drive =
            drive.ok_or_else(|| Error::Internal("the harmless set is refused".to_owned()))?;
        let mut twin = Self {
            drive,
            mailbox: Mailbox::new(),
            receiver: Receiver::new(),
            number: 0,
            out: VecDeque::new(),
        };
        twin.send(&Report::Hello(Hello::new(
            Board::Emulated,
            Numbers::F32,
            0,
            0,
        )))?;
        Ok(twin)
    }

    fn send(&mut self, report: &Report<f32>) -> Result<()> {
        let frame = encode(report);
        let frame = frame.map_err(|e| Error::Internal(format!("a report has no frame: {e:?}")))?;
        self.out.extend(frame);
        Ok(())
    }

    /// A control period.
    fn period(&mut self, sample: Sample) -> Result<()> {
        let actuation = self.drive.step(&sample, &self.mailbox.take_news());
        self.send(&link::actuation(&self.drive, &actuation))?;
        if let Some(selection) = self.drive.due() {
            self.number = self.number.wrapping_add(1);
            let report = link::telemetry(self.number, selection, self.drive.snapshot());
            self.send(&report)?;
        }
        if self.drive.is_to_be_verified() {
            self.drive.verify();
        }
        Ok(())
    }

    /// Carries out a command.
    fn serve(&mut self, packet: &Packet<f32>) -> Result<()> {
        let counters = self.receiver.counters();
        let answer = match link::serve(&mut self.drive, counters, &packet.command) {
            Reaction::Answer(answer) => answer,
            Reaction::Greet => {
                return self.send(&Report::Hello(Hello::new(
                    Board::Emulated,
                    Numbers::F32,
                    0,
                    0,
                )));
            }
            Reaction::Store => Answer::Refused(Refusal::WriteFailed),
            Reaction::Inject(injection @ (Injection::CorruptParameter | Injection::Clock)) => {
                link::suffer(&mut self.drive, injection);
                Answer::Done
            }
            Reaction::Inject(_) => Answer::Refused(Refusal::NotEmulated),
        };
        let to = packet.sequence;
        self.send(&Report::Answer { to, answer })
    }
}

impl Wire for Twin {
    fn is_noisy(&self) -> bool {
        false
    }

    /// There is nothing to wait for.
    fn set_patience(&mut self, _patience: Duration) -> Result<()> {
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        for &byte in bytes {
            match self.receiver.push(byte) {
                None => {}
                Some(Received::Sample(sample)) => self.period(sample)?,
                Some(Received::SetPoint(set_point)) => self.mailbox.put_set_point(set_point),
                Some(Received::Packet(packet)) => {
                    self.mailbox.hear();
                    self.serve(&packet)?;
                }
            }
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8; BLOCK]) -> Result<usize> {
        let length = self.out.len().min(BLOCK);
        for (to, from) in buffer.iter_mut().zip(self.out.drain(..length)) {
            *to = from;
        }
        Ok(length)
    }

    fn name(&self) -> &'static str {
        "the drive on the host"
    }
}
