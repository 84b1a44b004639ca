//! The board's receiving end: bytes in, commands out, losses counted.

use super::{Command, Counters, Deframer, Packet, decode};
use crate::control::SetPoint;
use crate::drive::{Number, Sample};

/// What a frame brought.
#[derive(Clone, Debug, PartialEq)]
pub enum Received<T> {
    /// The readings of a period, for the control task.
    Sample(Sample),
    /// A set point, for the control task.
    SetPoint(SetPoint<T>),
    /// Anything else, for the task that serves.
    Packet(Packet<T>),
}

/// Turns bytes into commands.
#[derive(Debug, Default)]
pub struct Receiver {
    deframer: Deframer,
    last: Option<u16>,
    counters: Counters,
}

impl Receiver {
    /// A receiver at the start of a frame.
    pub const fn new() -> Self {
        Self {
            deframer: Deframer::new(),
            last: None,
            counters: Counters {
                damaged: 0,
                missing: 0,
                dropped: 0,
                stack: 0,
            },
        }
    }

    /// Takes the next byte; returns what this byte completes, if anything.
    pub fn push<T: Number>(&mut self, byte: u8) -> Option<Received<T>> {
        let frame = self.deframer.push(byte)?;
        let Ok(packet) = frame.and_then(decode::<Packet<T>>) else {
            add(&mut self.counters.damaged, 1);
            return None;
        };
        if let Some(last) = self.last {
            let gap = packet.sequence.wrapping_sub(last).wrapping_sub(1);
            add(&mut self.counters.missing, gap.into());
        }
        self.last = Some(packet.sequence);
        Some(match packet.command {
            Command::Sample(sample) => Received::Sample(sample),
            Command::SetPoint(value) => Received::SetPoint(value),
            _ => Received::Packet(packet),
        })
    }

    /// Accounts for a command that nobody had time for.
    pub fn dropped(&mut self) {
        add(&mut self.counters.dropped, 1);
    }

    /// What was lost since boot.
    pub const fn counters(&self) -> Counters {
        self.counters
    }
}

fn add(counter: &mut u32, count: u32) {
    *counter = counter.saturating_add(count);
}
