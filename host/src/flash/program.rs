//! The programs that flash: where they are, what they are called with, and what is missing otherwise.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::{Board, said};
use crate::error::{Error, Result};

/// A program that can write the flash of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    /// Through a debug probe: <https://probe.rs>.
    ProbeRs,
    /// Through the loader in the chip's system memory, over USB: <https://dfu-util.sourceforge.net>.
    DfuUtil,
}

impl Program {
    /// All programs; the first that reaches a board is taken.
    pub const ALL: [Self; 2] = [Self::ProbeRs, Self::DfuUtil];

    /// The name of its file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ProbeRs => "probe-rs",
            Self::DfuUtil => "dfu-util",
        }
    }

    /// How to install it.
    const fn remedy(self) -> &'static str {
        match self {
            Self::ProbeRs => {
                "not installed; get it with `cargo install probe-rs-tools --locked` or from https://probe.rs/docs/getting-started/installation"
            }
            Self::DfuUtil => {
                "not installed; get it with `apt install dfu-util` (Debian, Ubuntu), `dnf install dfu-util` (Fedora), `pacman -S dfu-util` (Arch), `brew install dfu-util` (macOS) or from https://dfu-util.sourceforge.net"
            }
        }
    }

    /// Where it is installed, if it is.
    pub fn path(self) -> Option<PathBuf> {
        let file = format!("{}{}", self.name(), std::env::consts::EXE_SUFFIX);
        let folders = std::env::var_os("PATH")?;
        std::env::split_paths(&folders)
            .map(|folder| folder.join(&file))
            .find(|path| path.is_file())
    }

    /// Whether it is installed and sees something to flash; else what is missing and what to do.
    pub(super) fn reaches(self, board: &Board) -> std::result::Result<(), String> {
        let Some(path) = self.path() else {
            return Err(self.remedy().to_owned());
        };
        // Both list what is connected without touching it.
        let list = match self {
            Self::ProbeRs => "list",
            Self::DfuUtil => "--list",
        };
        let text = said(Command::new(&path).arg(list))
            .map_err(|e| format!("{} does not start: {e}", path.display()))?;
        match self {
            Self::ProbeRs => sees_probe(&text, board),
            Self::DfuUtil => sees_loader(&text, board),
        }
    }
}

fn sees_probe(list: &str, board: &Board) -> std::result::Result<(), String> {
    // Probes are listed as `[0]: ST-LINK …`.
    if list.lines().any(|line| line.trim_start().starts_with('[')) {
        return Ok(());
    }
    Err(format!(
        "sees no debug probe; {}; on Linux, a probe that only root may open needs the udev rules of https://probe.rs/docs/getting-started/probe-setup",
        board.probe_wiring
    ))
}

fn sees_loader(list: &str, board: &Board) -> std::result::Result<(), String> {
    let is_found = |line: &str| line.starts_with("Found DFU") && line.contains(board.loader);
    if list.lines().any(is_found) {
        return Ok(());
    }
    let is_locked = |line: &str| line.contains("Cannot open DFU device");
    if let Some(line) = list.lines().find(|line| is_locked(line)) {
        let (vendor, product) = board.loader.split_once(':').unwrap_or_default();
        return Err(format!(
            "may not open the board ({}); on Linux, write this line into /etc/udev/rules.d/70-bristle.rules and connect the board anew: SUBSYSTEM==\"usb\", ATTRS{{idVendor}}==\"{vendor}\", ATTRS{{idProduct}}==\"{product}\", TAG+=\"uaccess\"",
            line.trim()
        ));
    }
    Err(format!(
        "sees no board in its loader ({}); {}",
        board.loader, board.start_loader
    ))
}

/// One call of a program.
#[derive(Debug)]
pub struct Call {
    /// What it is for, as a person reads it.
    pub purpose: &'static str,
    program: Program,
    arguments: Vec<OsString>,
}

impl Call {
    /// The command line, as a shell would take it.
    pub fn line(&self) -> String {
        let words = self.arguments.iter().map(|word| quoted(word));
        std::iter::once(self.program.name().to_owned())
            .chain(words)
            .collect::<Vec<String>>()
            .join(" ")
    }

    pub(super) fn run(&self) -> Result<()> {
        let status = Command::new(self.program.name())
            .args(&self.arguments)
            .status()
            .map_err(|e| Error::Usage(format!("{} does not start: {e}", self.program.name())))?;
        if status.success() {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "flashing stopped ({status}) for the reason that {} gives above, at: {}; the board may hold half an image: keep its motor off the supply and flash it again",
            self.program.name(),
            self.line()
        )))
    }
}

/// A word as a POSIX shell reads it back.
fn quoted(word: &std::ffi::OsStr) -> String {
    let word = word.to_string_lossy();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.into_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// Calls of probe-rs: it reads back what it has written by itself, then the chip starts anew.
pub(super) fn by_probe(board: &Board, elf: &Path, probe: Option<&str>) -> Vec<Call> {
    let chip = || {
        let mut words: Vec<OsString> = vec!["--chip".into(), board.chip.into()];
        words.extend(
            probe
                .iter()
                .flat_map(|probe| ["--probe".into(), probe.into()]),
        );
        words
    };
    let mut download: Vec<OsString> = vec!["download".into()];
    download.extend(chip());
    download.extend(["--verify".into(), elf.into()]);
    let mut reset: Vec<OsString> = vec!["reset".into()];
    reset.extend(chip());
    let call = |purpose, arguments| Call {
        purpose,
        program: Program::ProbeRs,
        arguments,
    };
    vec![
        call("Writing the flash and reading it back", download),
        call("Starting the board anew", reset),
    ]
}

/// Calls of dfu-util: the image is written to the beginning of the flash, and as many bytes are read back.
pub(super) fn by_loader(
    board: &Board,
    flat: &Path,
    length: usize,
    read_back: &Path,
    serial: Option<&str>,
) -> Vec<Call> {
    let call = |purpose, address: String, direction: &str, file: &Path| {
        let mut arguments: Vec<OsString> = vec!["--device".into(), board.loader.into()];
        arguments.extend(serial.iter().flat_map(|s| ["--serial".into(), s.into()]));
        arguments.extend(["--alt".into(), "0".into()]);
        arguments.extend(["--dfuse-address".into(), address.into()]);
        arguments.extend([direction.into(), file.into()]);
        Call {
            purpose,
            program: Program::DfuUtil,
            arguments,
        }
    };
    let start = format!("{:#010x}", board.target.flash);
    let span = format!("{start}:{length}");
    vec![
        call("Writing the flash", start, "--download", flat),
        call("Reading it back", span, "--upload", read_back),
    ]
}
