//! An emulated board.

use std::path::Path;
use std::time::Duration;

use bristle_core::control::SetPoint;
use bristle_core::drive::{Number, Sample};
use bristle_core::link::{Command, Injection, Report};

use super::machine::{Launch, Machine, Transport};
use super::run::{Driver, Period};
use crate::error::Result;
use crate::link::{Peer, Wire};

/// A board in the emulator.
pub type Board<T> = Peer<T, Machine>;

impl<T: Number> Board<T> {
    /// Starts an image and waits for its greeting.
    pub fn boot(image: &Path, launch: Launch, transport: Transport) -> Result<Self> {
        Self::awaited(Machine::start(image, launch, transport)?)
    }

    /// The emulator.
    pub const fn machine(&mut self) -> &mut Machine {
        self.wire()
    }

    /// Starts the board anew, as after a loss of power: what it then has is what its flash holds.
    pub fn restart(&mut self) -> Result<()> {
        self.send(Command::Inject(Injection::Restart))?;
        self.greet().map(drop)
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

impl Wire for Machine {
    fn is_noisy(&self) -> bool {
        false
    }

    fn set_patience(&mut self, patience: Duration) -> Result<()> {
        Self::set_patience(self, patience)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        Self::write(self, bytes)
    }

    fn read(&mut self, buffer: &mut [u8; crate::link::BLOCK]) -> Result<usize> {
        Self::read(self, buffer)
    }

    fn name(&self) -> &'static str {
        "the emulator"
    }
}
