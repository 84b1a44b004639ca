//! `bristle flash`

use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;

use super::{DONE, Outcome};
use crate::error::{Error, Result};
use crate::flash::{self, ALL, Board, Image, Plan, Program};
use crate::image;

/// Put the firmware onto a board, and read it back
///
/// Builds the image, or takes the one of --image, checks that it is one for the board, writes it by an installed probe-rs
/// (through a debug probe) or dfu-util (through the chip's own loader, over USB), whichever reaches a board, and compares
/// what the flash then holds. Says what is missing otherwise, and how to get it.
///
/// The firmware replaces what was on the board; parameters stored by an earlier Bristle stay. It leaves the bridge off
/// until it is told to move, but disconnect the motor for the first time all the same: it has never run on silicon yet.
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  bristle flash odrive-v3 --dry-run
  bristle flash odrive-v3 --with dfu-util")]
pub(super) struct Command {
    /// The board
    #[arg(value_parser = PossibleValuesParser::new(ALL.iter().map(|board| board.id)))]
    board: String,
    /// Image of the firmware, an ELF file [default: built from the sources by cargo]
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,
    /// The program to flash by [default: the first of them that reaches a board]
    #[arg(long, value_name = "PROGRAM", value_parser = PossibleValuesParser::new(Program::ALL.map(Program::name)))]
    with: Option<String>,
    /// Which one, where several are connected: VID:PID:SERIAL of a probe, or the serial number of a board in its loader
    #[arg(long, value_name = "WHICH", requires = "with")]
    select: Option<String>,
    /// Build and check the image and show the commands, but touch no board
    #[arg(long)]
    dry_run: bool,
}

impl Command {
    pub fn run(&self) -> Outcome {
        let board = flash::find(&self.board)
            .ok_or_else(|| Error::Internal(format!("no board {:?}", self.board)))?;
        // What is missing shows before a build that takes minutes.
        let program = self.program(board)?;
        let path = match &self.image {
            Some(path) => path.clone(),
            None => {
                anstream::println!("Building the firmware for {} …", board.target.triple);
                image::build(board.target, None, &[])?
            }
        };
        let image = Image::read(&path, &board.target)?;
        let plan = Plan::new(program, board, &image, self.select.as_deref())?;
        anstream::println!(
            "{}: {} bytes from {:#010x} for {}, by {}",
            image.path.display(),
            image.bytes.len(),
            image.address,
            board.name,
            program.name()
        );
        if self.dry_run {
            show(&plan);
            return Ok(DONE);
        }
        plan.run(&image, |step| anstream::println!("{step} …"))?;
        anstream::println!("The flash holds the image.");
        if program == Program::DfuUtil {
            anstream::println!("{}", board.leave_loader);
        }
        Ok(DONE)
    }

    /// The program to flash by.
    fn program(&self, board: &Board) -> Result<Program> {
        let wanted = |program: &Program| self.with.as_ref().is_none_or(|w| w == program.name());
        let programs: Vec<Program> = Program::ALL.into_iter().filter(wanted).collect();
        if self.dry_run {
            flash::installed(&programs, board)
        } else {
            flash::choose(&programs, board)
        }
    }
}

/// What would be done.
fn show(plan: &Plan) {
    for call in &plan.calls {
        anstream::println!("\n{}:\n  {}", call.purpose, call.line());
    }
    if plan.program == Program::DfuUtil {
        anstream::println!(
            "\nThen what was read back is compared with the image, byte for byte. Both files are temporary ones of this command."
        );
    }
    anstream::println!("\nNo board was touched (--dry-run).");
}
