//! Where a board is, and how to open it: the same for a serial port and for an emulated board.

use std::path::PathBuf;

use crate::emulate::{Axis, Board, Launch, Live, Transport, Twin};
use crate::error::Result;
use crate::link::{Peer, SerialLine, Wire};

/// Where a board is.
#[derive(Clone)]
pub enum Place {
    /// At a serial port of this name.
    Port(String),
    /// In the emulator, which runs this image, or on the host where there is none, with an axis simulated around it.
    Emulated {
        /// The firmware.
        image: Option<PathBuf>,
        /// The axis.
        axis: Box<Axis>,
    },
}

impl Place {
    /// Opens the way to the board. An emulated one is started, and set up for its axis.
    pub fn open(&self) -> Result<Box<dyn Wire + Send>> {
        Ok(match self {
            Self::Port(name) => Box::new(SerialLine::open(name)?),
            Self::Emulated { image, axis } => {
                let axis = (**axis).clone();
                Box::new(match image {
                    Some(image) => {
                        let board: Board<f32> = Board::boot(image, Launch::F405, Transport::Fast)?;
                        Live::start(board, axis)?
                    }
                    None => Live::start(Peer::awaited(Twin::new()?)?, axis)?,
                })
            }
        })
    }

    /// What a person calls it.
    pub fn name(&self) -> &str {
        match self {
            Self::Port(name) => name,
            Self::Emulated { image: Some(_), .. } => "QEMU",
            Self::Emulated { image: None, .. } => "this machine",
        }
    }

    /// Bytes a second that come from the board, if a line limits them.
    pub const fn capacity(&self) -> Option<f64> {
        match self {
            // A start bit and a stop bit with each byte.
            Self::Port(_) => Some(crate::link::BAUD as f64 / 10.0),
            Self::Emulated { .. } => None,
        }
    }
}
