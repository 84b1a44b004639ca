//! Serial ports, and what answers on them.

use bristle_core::link::{Board, Hello, Numbers};
use serde::Serialize;
use serialport::SerialPortType;

use crate::error::{Error, Result};
use crate::link::{Peer, SerialLine};

/// How often a port is called: a board that is busy may miss one call.
const CALLS: u32 = 2;

/// A serial port.
#[derive(Clone, Debug, Serialize)]
pub struct Port {
    /// Its name, as every command takes it.
    pub name: String,
    /// What it is plugged into, as far as the operating system knows.
    pub device: String,
    /// What was found at its other end; none if it was not asked.
    pub found: Option<Found>,
}

/// What answers.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Found {
    /// A board with Bristle's firmware.
    Board(Hello),
    /// Nothing that speaks the protocol.
    Silence,
    /// The port cannot be used, or the board not with this program.
    Failure {
        /// Why, and what to do.
        why: String,
    },
}

/// The ports that the operating system knows, by name.
pub fn list() -> Result<Vec<Port>> {
    let ports = serialport::available_ports();
    let ports = ports.map_err(|e| {
        Error::Usage(format!(
            "the serial ports cannot be listed: {e}; name the port itself, as in bristle ports /dev/ttyUSB0"
        ))
    })?;
    let mut ports: Vec<Port> = ports.into_iter().map(described).collect();
    ports.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(ports)
}

/// A port that was named.
pub fn named(name: &str) -> Port {
    let known = list().unwrap_or_default();
    let known = known.into_iter().find(|port| port.name == name);
    known.unwrap_or_else(|| Port {
        name: name.to_owned(),
        device: "not known to the operating system as a serial port".to_owned(),
        found: None,
    })
}

fn described(port: serialport::SerialPortInfo) -> Port {
    let device = match port.port_type {
        SerialPortType::UsbPort(usb) => {
            let names = [usb.manufacturer, usb.product];
            let name = names.into_iter().flatten().collect::<Vec<_>>().join(" ");
            format!("USB {:04x}:{:04x} {name}", usb.vid, usb.pid)
        }
        SerialPortType::PciPort => "on the bus of this machine".to_owned(),
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::Unknown => "of unknown kind".to_owned(),
    };
    Port {
        name: port.port_name,
        device: device.trim_end().to_owned(),
        found: None,
    }
}

impl Port {
    /// Asks what is at its other end. A board goes on as it was; what else is there sees a zero byte and a short frame.
    pub fn ask(&mut self) {
        let line = match SerialLine::open(&self.name) {
            Ok(line) => line,
            Err(e) => {
                self.found = Some(Found::Failure { why: e.to_string() });
                return;
            }
        };
        self.found = Some(match Peer::<f32, _>::called_up_to(CALLS, line) {
            Ok(board) => board
                .hello()
                .map_or(Found::Silence, |hello| Found::Board(*hello)),
            // Of these two the first says that nobody answers, and the second why not.
            Err(Error::Usage(why)) if why.starts_with("no board") => Found::Silence,
            Err(e) => Found::Failure { why: e.to_string() },
        });
    }

    /// Whether a board answers.
    pub fn has_board(&self) -> bool {
        matches!(self.found, Some(Found::Board(_)))
    }
}

impl std::fmt::Display for Found {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Board(hello) => {
                let board = match hello.board {
                    Board::Emulated => "an emulated board",
                    Board::OdriveV3 => "an ODrive v3",
                };
                let numbers = match hello.numbers {
                    Numbers::F32 => "single precision",
                    Numbers::Q16 => "fixed point",
                };
                let [major, minor, patch] = hello.version;
                write!(f, "{board}, firmware {major}.{minor}.{patch}, {numbers}")
            }
            Self::Silence => f.write_str(
                "nothing that speaks Bristle's protocol; is the board powered and flashed (bristle flash)?",
            ),
            Self::Failure { why } => f.write_str(why),
        }
    }
}
