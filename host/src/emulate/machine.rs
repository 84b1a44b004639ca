//! The emulator's process and the line to it.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::error::{Error, Result};
use crate::link::BLOCK;

/// The emulator.
pub const QEMU: &str = "qemu-system-arm";

/// Far beyond anything the emulator takes, even on a busy machine: only a dead board runs into it.
const PATIENCE: Duration = Duration::from_secs(20);

/// How frames travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Over the emulator's standard input and output, which the image reads by semihosting: fast.
    Fast,
    /// Over the serial port of the board's link, byte by byte through its interrupt.
    Serial,
}

/// What is to run.
#[derive(Clone, Copy, Debug)]
pub struct Launch<'a> {
    /// QEMU's name of the board.
    pub machine: &'a str,
    /// Which of the chip's serial ports the link is on, counted from 0.
    pub port: usize,
    /// One nanosecond an instruction, so that a timer counts instructions.
    pub counted: bool,
    /// Whether the log, on the error stream, is kept for [`Machine::take_log`].
    pub logged: bool,
}

impl Launch<'_> {
    /// The STM32F405.
    pub const F405: Self = Launch {
        machine: "netduinoplus2",
        port: 3,
        counted: false,
        logged: false,
    };
    /// The STM32F100, without a floating-point unit.
    pub const F100: Self = Launch {
        machine: "stm32vldiscovery",
        port: 0,
        counted: false,
        logged: false,
    };
}

/// A running emulator, killed when dropped.
pub struct Machine {
    child: Child,
    line: Line,
    log: Option<JoinHandle<Vec<u8>>>,
    patience: Duration,
}

enum Line {
    /// Output comes by a thread, as a pipe cannot be waited for with a limit.
    Pipes(ChildStdin, Receiver<Vec<u8>>),
    Socket {
        stream: UnixStream,
        _directory: TempDir,
    },
}

impl Machine {
    /// Starts an image; nothing has been received yet.
    pub fn start(image: &Path, launch: Launch, transport: Transport) -> Result<Self> {
        let mut command = Command::new(QEMU);
        command
            .args(["-M", launch.machine, "-nographic", "-monitor", "none"])
            .arg("-kernel")
            .arg(image);
        if launch.counted {
            command.args(["-icount", "shift=0"]);
        }
        if launch.logged {
            command.stderr(Stdio::piped());
        }
        let mut machine = match transport {
            Transport::Fast => Self::with_pipes(command),
            Transport::Serial => Self::with_socket(command, launch.port),
        }?;
        machine.log = machine.child.stderr.take().map(gather);
        Ok(machine)
    }

    /// Ends the emulation; what was logged all along, if it was kept.
    pub fn take_log(&mut self) -> Vec<u8> {
        // Fails only if it has ended already, which is as good.
        let _ = self.child.kill();
        let log = self.log.take().map(JoinHandle::join);
        log.and_then(std::result::Result::ok).unwrap_or_default()
    }

    fn with_pipes(mut command: Command) -> Result<Self> {
        command
            .args(["-serial", "null", "-semihosting-config"])
            .arg("enable=on,target=native,arg=bristle,arg=fast")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            // Ctrl-C in a terminal is for this program, which may have a motor to stop first. The image ends by itself when
            // its input does.
            .process_group(0);
        let mut child = spawn(command)?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Error::Internal("the emulator has no pipes".to_owned()));
        };
        let line = Line::Pipes(input, forward(output));
        Ok(Self {
            child,
            line,
            log: None,
            patience: PATIENCE,
        })
    }

    fn with_socket(mut command: Command, port: usize) -> Result<Self> {
        let failed = |e: std::io::Error| Error::Emulator(format!("no socket for it: {e}"));
        let directory = tempfile::tempdir().map_err(failed)?;
        let path = directory.path().join("link");
        // Bound before the emulator starts, which connects to it: there is no race to lose.
        let listener = UnixListener::bind(&path).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        for _ in 0..port {
            command.args(["-serial", "null"]);
        }
        command
            .args(["-serial", "chardev:link", "-chardev"])
            .arg(format!("socket,id=link,server=off,path={}", path.display()))
            .args(["-semihosting-config", "enable=on,target=native"])
            .stdin(Stdio::null())
            .stdout(Stdio::null());
        let mut child = spawn(command)?;
        let start = Instant::now();
        let stream = loop {
            match listener.accept() {
                Ok((stream, _)) => break stream,
                Err(e) if e.kind() == ErrorKind::WouldBlock => {
                    let ended = child.try_wait().map_err(failed)?;
                    if ended.is_some() || start.elapsed() > PATIENCE {
                        let _ = child.kill();
                        return Err(Error::Emulator(format!("it does not connect ({ended:?})")));
                    }
                    sleep(Duration::from_millis(2));
                }
                Err(e) => return Err(failed(e)),
            }
        };
        stream.set_nonblocking(false).map_err(failed)?;
        stream.set_read_timeout(Some(PATIENCE)).map_err(failed)?;
        stream.set_write_timeout(Some(PATIENCE)).map_err(failed)?;
        let line = Line::Socket {
            stream,
            _directory: directory,
        };
        Ok(Self {
            child,
            line,
            log: None,
            patience: PATIENCE,
        })
    }

    /// How long to wait for an answer from now on.
    pub fn set_patience(&mut self, patience: Duration) -> Result<()> {
        self.patience = patience;
        match &self.line {
            Line::Pipes(..) => Ok(()),
            Line::Socket { stream, .. } => {
                let set = stream.set_read_timeout(Some(patience));
                set.map_err(|e| Error::Emulator(format!("its socket takes no time limit: {e}")))
            }
        }
    }

    /// Sends bytes.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let sent = match &mut self.line {
            Line::Pipes(input, _) => input.write_all(bytes).and_then(|()| input.flush()),
            Line::Socket { stream, .. } => stream.write_all(bytes),
        };
        sent.map_err(|e| self.broken(&e.to_string()))
    }

    /// Waits for bytes; how many came.
    pub fn read(&mut self, buffer: &mut [u8; BLOCK]) -> Result<usize> {
        let read = match &mut self.line {
            Line::Pipes(_, output) => match output.recv_timeout(self.patience) {
                Ok(bytes) => {
                    buffer[..bytes.len()].copy_from_slice(&bytes);
                    Ok(bytes.len())
                }
                Err(RecvTimeoutError::Disconnected) => Ok(0),
                Err(RecvTimeoutError::Timeout) => Err(ErrorKind::TimedOut.into()),
            },
            Line::Socket { stream, .. } => loop {
                match stream.read(buffer) {
                    // A signal is no answer: a suspended and resumed process gets one.
                    Err(e) if e.kind() == ErrorKind::Interrupted => {}
                    read => break read,
                }
            },
        };
        match read {
            Ok(0) => Err(self.broken("it closed the line")),
            Ok(n) => Ok(n),
            Err(e) => Err(self.broken(&e.to_string())),
        }
    }

    fn broken(&mut self, what: &str) -> Error {
        let status = match self.ended(Duration::from_millis(200)) {
            Some(status) => status.to_string(),
            None => "still running".to_owned(),
        };
        Error::Emulator(format!("no answer from the firmware ({what}; {status})"))
    }

    /// Waits for the emulator to end by itself.
    pub fn end(&mut self) -> Option<ExitStatus> {
        self.ended(PATIENCE)
    }

    fn ended(&mut self, patience: Duration) -> Option<ExitStatus> {
        let start = Instant::now();
        while start.elapsed() < patience {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            sleep(Duration::from_millis(5));
        }
        None
    }
}

/// Hands on what comes out of a pipe, until either end is closed.
fn forward(mut output: ChildStdout) -> Receiver<Vec<u8>> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let mut buffer = [0; BLOCK];
        while let Ok(length @ 1..) = output.read(&mut buffer) {
            if sender.send(buffer[..length].to_vec()).is_err() {
                break;
            }
        }
    });
    receiver
}

/// Takes all that comes out of a pipe until it is closed.
fn gather(mut output: ChildStderr) -> JoinHandle<Vec<u8>> {
    std::thread::spawn(move || {
        let mut all = Vec::new();
        // What came before a failure is kept.
        let _ = output.read_to_end(&mut all);
        all
    })
}

fn spawn(mut command: Command) -> Result<Child> {
    command.spawn().map_err(|e| match e.kind() {
        ErrorKind::NotFound => Error::Usage(format!(
            "{QEMU} is not installed, and the firmware runs in it; install it (Debian, Ubuntu: apt-get install {QEMU}; Fedora: dnf install {QEMU}-core; macOS: brew install qemu), or leave it out with --on-host where the command has that"
        )),
        _ => Error::Emulator(format!("{QEMU} does not start: {e}")),
    })
}

impl Drop for Machine {
    fn drop(&mut self) {
        // Fails only if it has ended already, which is as good.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
