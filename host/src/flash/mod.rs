//! Puts the firmware onto a board, by programs that are made for it, and reads it back.

mod board;
mod image;
mod program;

use std::path::Path;
use std::process::Command;

pub use board::{ALL, Board, find};
pub use image::Image;
pub use program::{Call, Program};

use crate::error::{Error, Result};

/// What is going to be done: the calls of one program, and whether what it reads back is compared here.
#[derive(Debug)]
pub struct Plan {
    /// The program.
    pub program: Program,
    /// Its calls, in their order.
    pub calls: Vec<Call>,
    folder: tempfile::TempDir,
}

/// Files of a plan, in a folder that goes with it.
const FLAT: &str = "image.bin";
const READ_BACK: &str = "read-back.bin";

impl Plan {
    /// Plans to put `image` onto `board`. `selected` tells which probe or board, where several are connected.
    ///
    /// # Errors
    /// [`Error::Unwritable`] if there is no room for the image as a flat file.
    pub fn new(
        program: Program,
        board: &Board,
        image: &Image,
        selected: Option<&str>,
    ) -> Result<Self> {
        let unwritable = |path: &Path| {
            let path = path.to_owned();
            move |reason| Error::Unwritable { path, reason }
        };
        let folder = tempfile::tempdir().map_err(unwritable(&std::env::temp_dir()))?;
        let (flat, read_back) = (folder.path().join(FLAT), folder.path().join(READ_BACK));
        std::fs::write(&flat, &image.bytes).map_err(unwritable(&flat))?;
        let calls = match program {
            Program::ProbeRs => program::by_probe(board, &image.path, selected),
            Program::DfuUtil => {
                program::by_loader(board, &flat, image.bytes.len(), &read_back, selected)
            }
        };
        Ok(Self {
            program,
            calls,
            folder,
        })
    }

    /// Carries it out, `say` being told of each step.
    ///
    /// # Errors
    /// [`Error::Usage`] if a call fails or the flash does not hold the image.
    pub fn run(&self, image: &Image, mut say: impl FnMut(&str)) -> Result<()> {
        for call in &self.calls {
            say(call.purpose);
            call.run()?;
        }
        match self.program {
            // It has compared by itself.
            Program::ProbeRs => Ok(()),
            Program::DfuUtil => {
                say("Comparing");
                compare(&self.folder.path().join(READ_BACK), image)
            }
        }
    }
}

/// Whether what was read back is the image.
fn compare(read_back: &Path, image: &Image) -> Result<()> {
    let found = std::fs::read(read_back).map_err(|reason| Error::Unreadable {
        path: read_back.to_owned(),
        reason,
    })?;
    if found == image.bytes {
        return Ok(());
    }
    let pairs = image.bytes.iter().zip(&found);
    let same = pairs.take_while(|(a, b)| a == b).count();
    Err(Error::Usage(format!(
        "the flash does not hold the image: it differs from {:#010x} on ({} of {} bytes were read back); flash it again, and if it stays so, look at the cable and at the write protection of the chip",
        image.address as usize + same,
        found.len(),
        image.bytes.len()
    )))
}

/// The first of the programs that is installed and reaches a board.
///
/// # Errors
/// [`Error::Usage`] that says of each program what is missing and how to get it.
pub fn choose(programs: &[Program], board: &Board) -> Result<Program> {
    let mut missing = Vec::new();
    for program in programs {
        match program.reaches(board) {
            Ok(()) => return Ok(*program),
            Err(what) => missing.push(format!("  {}: {what}", program.name())),
        }
    }
    Err(Error::Usage(format!(
        "no way to flash {}; any of these is enough, once it is put right:\n{}",
        board.name,
        missing.join("\n")
    )))
}

/// The first of the programs that is installed.
///
/// # Errors
/// [`Error::Usage`] that says how to get them.
pub fn installed(programs: &[Program], board: &Board) -> Result<Program> {
    let found = programs.iter().find(|program| program.path().is_some());
    found.copied().map_or_else(|| choose(programs, board), Ok)
}

/// What a program prints, both ways together.
fn said(command: &mut Command) -> std::io::Result<String> {
    let output = command.output()?;
    let mut text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.push_str(&String::from_utf8_lossy(&output.stderr));
    Ok(text)
}
