//! `bristle monitor`

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;

use super::interrupt;
use super::place::Where;
use super::{DONE, Outcome, terminal};
use crate::error::{self, Error, Result};
use crate::model::Model;
use crate::monitor::{Farewell, Handle, Kind, Monitor, Moves, Options, Server, screen};
use crate::place::Place;

/// Watch a board live, move its axis, and record it
///
/// Shows what the board's signals do, its faults, and the friction level that it learns, in a page that it serves to the
/// browsers of this machine, or in the terminal with --tui. There the axis is turned on and off, asked for an input, a
/// torque, a velocity or a position, and recorded for diagnose. Open the whole address that it prints: the token in it keeps
/// others out.
///
/// STOP (space, or escape) goes to the board before everything else and turns the bridge off: the axis coasts. The axis is
/// turned off as well when the monitor is closed, and a second after the last page is closed. When the monitor is killed or
/// the cable breaks, the board turns its bridge off by itself, after the time that deploy has set.
///
/// A link that is lost shows within a second and is taken up again by itself; the axis stays off until it is turned on.
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  bristle monitor --emulate found.toml --limit 2
  bristle monitor --emulate truth.toml --known found.toml --compensate --limit 2 --tui
  bristle monitor /dev/ttyUSB0 --model found.toml --speed 5")]
pub(super) struct Command {
    #[command(flatten)]
    place: Where,
    /// Largest input that the board may apply, in the unit of u
    #[arg(
        long,
        value_name = "U",
        requires = "emulate",
        allow_negative_numbers = true
    )]
    limit: Option<f64>,
    /// Largest velocity to ask for, and that of moves to a position, rad/s or m/s
    #[arg(
        long,
        value_name = "V",
        default_value_t = 1.0,
        allow_negative_numbers = true
    )]
    speed: f64,
    /// How fast velocities change, rad/s² or m/s² [default: ten times --speed]
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    acceleration: Option<f64>,
    /// Telemetry frames a second [default: every period of an emulated board; at a port, as many as the line carries]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    telemetry: Option<f64>,
    /// Folder for recordings, which are called monitor-1.csv and so on
    #[arg(long, value_name = "DIR", default_value = ".")]
    folder: PathBuf,
    /// Show it in this terminal, without a page
    #[arg(long)]
    tui: bool,
    /// Port of 127.0.0.1 to serve the page at [default: any that is free]
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        hide_default_value = true,
        conflicts_with = "tui"
    )]
    http: u16,
}

impl Command {
    pub fn run(&self) -> Outcome {
        self.check()?;
        let (place, model) = self.place()?;
        let ended = interrupt::signals()?;
        let options = Options {
            model,
            moves: Moves {
                speed: self.speed,
                acceleration: self.acceleration.unwrap_or(10.0 * self.speed),
            },
            telemetry: self.telemetry,
            folder: self.folder.clone(),
        };
        let monitor = Monitor::start(place, options)?;
        let handle = monitor.handle();
        let shown = if self.tui {
            screen::show(&handle, &ended)
        } else {
            self.serve(&handle, &ended)
        };
        // However it ended, the axis is turned off before anything is said of it.
        let farewell = monitor.close()?;
        tell(&handle);
        shown?;
        farewells(farewell);
        Ok(DONE)
    }

    fn check(&self) -> Result<()> {
        error::positive(&[
            ("--speed", Some(self.speed)),
            ("--acceleration", self.acceleration),
            ("--telemetry", self.telemetry),
            ("--limit", self.limit),
        ])?;
        self.place.check()?;
        if !self.folder.is_dir() {
            return Err(Error::Usage(format!(
                "--folder {}: there is no such folder; make it first, or name another",
                self.folder.display()
            )));
        }
        if self.tui && !(std::io::stdin().is_terminal() && std::io::stdout().is_terminal()) {
            return Err(Error::Usage(
                "--tui needs a terminal for input and output; leave it out for the page in a browser".to_owned(),
            ));
        }
        Ok(())
    }

    /// Where the board is, and the model of its axis if one is known.
    fn place(&self) -> Result<(Place, Option<Model>)> {
        match (&self.place.emulate, self.limit) {
            (Some(path), Some(limit)) => self.place.emulated(path, |_| Ok(limit)),
            (Some(_), None) => Err(Error::Usage(
                "--emulate needs --limit, the largest input that the board may apply, in the unit of u"
                    .to_owned(),
            )),
            (None, _) => self.place.at_port(),
        }
    }

    fn serve(&self, handle: &Handle, ended: &AtomicBool) -> Result<()> {
        let server = Server::start(handle.clone(), self.http)?;
        let mut out = anstream::stdout();
        // The address is all that a program which starts this one has to read.
        let said = writeln!(out, "Monitor: {}\nCtrl-C ends it.", server.address());
        // A reader that has had enough is no reason to stop.
        let _ = said.and_then(|()| out.flush());
        while !ended.load(Ordering::Acquire) {
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(())
    }
}

/// What was saved while it was closed.
fn tell(handle: &Handle) {
    let saved = handle.view(|view| {
        let notes = view.notes_from(&mut 0);
        let saved = notes.filter(|note| note.kind == Kind::Saved);
        saved.map(|note| note.text.clone()).collect::<Vec<_>>()
    });
    saved.iter().for_each(|text| anstream::println!("{text}"));
}

fn farewells(farewell: Farewell) {
    match farewell {
        Farewell::WasOff => anstream::println!("Closed. The axis was off."),
        Farewell::Stopped => {
            anstream::println!("Closed. The axis was on; the board has confirmed that it is off.");
        }
        Farewell::Unconfirmed => terminal::note(
            "closed without an answer from the board: if it is still powered, it turns its bridge off by itself as no set point comes any more",
        ),
    }
}
