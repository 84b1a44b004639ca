//! A serial port.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::Duration;

use serialport::{ClearBuffer, SerialPort};

use super::{BLOCK, Wire, denied};
use crate::error::{Error, Result};

/// Bits a second of the board's port, 8N1.
pub const BAUD: u32 = 115_200;

/// The longest answer takes 40 ms at this rate, but a large sector of flash may take 4 s to erase.
const PATIENCE: Duration = Duration::from_secs(6);

/// While a board is looked for, silence is the rule.
const LOOKING: Duration = Duration::from_millis(400);

/// An open serial port.
pub struct SerialLine {
    name: String,
    port: Box<dyn SerialPort>,
}

impl SerialLine {
    /// Opens a port by its name, as in `/dev/ttyUSB0`.
    pub fn open(name: &str) -> Result<Self> {
        let refused = |e: serialport::Error| {
            let hint = match e.kind() {
                serialport::ErrorKind::Io(ErrorKind::PermissionDenied) => denied(Path::new(name)),
                serialport::ErrorKind::NoDevice
                | serialport::ErrorKind::Io(ErrorKind::NotFound) => {
                    "is the board plugged in, and is this its port (bristle ports lists them)? Another program may also have it open".to_owned()
                }
                _ if Path::new(name).is_file() => {
                    "it is a file and no serial port (bristle ports lists them)".to_owned()
                }
                _ => "is it a serial port?".to_owned(),
            };
            Error::Usage(format!("{name}: cannot be opened: {e}; {hint}"))
        };
        let port = serialport::new(name, BAUD).timeout(LOOKING);
        let port = port.open().map_err(refused)?;
        port.clear(ClearBuffer::Input).map_err(refused)?;
        Ok(Self {
            name: name.to_owned(),
            port,
        })
    }

    /// From now on the board is known to answer, and is given the time that it may take.
    pub fn be_patient(&mut self) -> Result<()> {
        self.set_patience(PATIENCE)
    }

    fn broken(&self, e: &io::Error) -> Error {
        Error::Board(format!(
            "{} broke off: {e}; check the cable and try again",
            self.name
        ))
    }
}

impl Wire for SerialLine {
    fn is_noisy(&self) -> bool {
        true
    }

    fn set_patience(&mut self, patience: Duration) -> Result<()> {
        let set = self.port.set_timeout(patience);
        set.map_err(|e| Error::Board(format!("{}: {e}", self.name)))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let sent = self.port.write_all(bytes);
        let sent = sent.and_then(|()| self.port.flush());
        sent.map_err(|e| self.broken(&e))
    }

    fn read(&mut self, buffer: &mut [u8; BLOCK]) -> Result<usize> {
        match self.port.read(buffer) {
            Ok(0) => Err(self.broken(&ErrorKind::UnexpectedEof.into())),
            Ok(n) => Ok(n),
            Err(e) if e.kind() == ErrorKind::TimedOut => Ok(0),
            Err(e) => Err(self.broken(&e)),
        }
    }

    fn name(&self) -> &str {
        &self.name
    }
}
