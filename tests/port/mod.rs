//! An emulated board at a pseudo-terminal.
#![allow(
    dead_code,
    reason = "each test program uses its own part of this module"
)]

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use bristle::emulate::QEMU;
use bristle::link::{Peer, SerialLine};
use bristle_core::link::Command as Request;

/// An emulated board whose link is a serial port of this machine, a pseudo-terminal.
pub struct OnPort {
    emulator: Child,
    /// Its name.
    pub port: String,
}

impl OnPort {
    /// Starts an image.
    pub fn start(image: &Path) -> Self {
        let mut emulator = Command::new(QEMU)
            .args(["-M", "netduinoplus2", "-nographic", "-monitor", "none"])
            .args(["-semihosting-config", "enable=on,target=native"])
            .args(["-serial", "null", "-serial", "null", "-serial", "null"])
            .args(["-serial", "chardev:link", "-chardev", "pty,id=link"])
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the emulator starts");
        let said = emulator.stdout.take().expect("a pipe");
        // It says `char device redirected to /dev/pts/3 (label link)`.
        let mut lines = BufReader::new(said).lines().map_while(Result::ok);
        let port = lines.find_map(|line| {
            let mut words = line.split_whitespace();
            words.find(|w| w.starts_with("/dev/")).map(str::to_owned)
        });
        let port = port.expect("the emulator names its port");
        Self { emulator, port }
    }

    /// Has the board carry out a command.
    pub fn tell(&self, request: Request<f32>) {
        let line = open(&self.port);
        let mut board = Peer::<f32, _>::called(line).expect("the board answers");
        board.tell(request).expect("it does as told");
    }
}

/// Opens a port. A program that another test is just starting holds the lock of one that was open here for a moment longer.
pub fn open(port: &str) -> SerialLine {
    let begun = Instant::now();
    loop {
        match SerialLine::open(port) {
            Ok(line) => return line,
            Err(e) => assert!(begun.elapsed() < Duration::from_secs(2), "{e}"),
        }
        sleep(Duration::from_millis(20));
    }
}

impl Drop for OnPort {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}
