//! `bristle monitor`

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::emulate::chosen_image;
use super::{DONE, Outcome, terminal};
use crate::emulate::{self, Axis, Sensors, Setup};
use crate::error::{self, Error, Result};
use crate::image::F405;
use crate::model::Model;
use crate::monitor::{Farewell, Handle, Kind, Monitor, Moves, Options, Server, screen};
use crate::place::Place;
use crate::plant;
use crate::ports;
use crate::tune::Wish;

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
  bristle monitor --emulate axis.toml --limit 2
  bristle monitor --emulate truth.toml --known found.toml --compensate --limit 2 --tui
  bristle monitor /dev/ttyUSB0 --model found.toml --speed 5")]
pub(super) struct Command {
    /// Serial port of the board [default: the one port at which a board answers]
    #[arg(value_name = "PORT", conflicts_with = "emulate")]
    port: Option<String>,
    /// An emulated board, with the axis of this model file simulated around it
    #[arg(long, value_name = "MODEL.toml", requires = "limit")]
    emulate: Option<PathBuf>,
    /// Model file that tells the name and the units of the axis at a port
    #[arg(long, value_name = "M.toml", conflicts_with = "emulate")]
    model: Option<PathBuf>,
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
    #[command(flatten)]
    emulated: Emulated,
}

/// Options of an emulated board.
#[derive(Args, Debug)]
#[command(next_help_heading = "With --emulate")]
struct Emulated {
    /// Model file of what the board knows of the axis [default: the same]
    #[arg(long, value_name = "KNOWN.toml", requires = "emulate")]
    known: Option<PathBuf>,
    /// Largest input that the board may apply, in the unit of u
    #[arg(
        long,
        value_name = "U",
        requires = "emulate",
        allow_negative_numbers = true
    )]
    limit: Option<f64>,
    /// Compensate the friction and the effects that the board knows of
    #[arg(long, requires = "emulate")]
    compensate: bool,
    /// Frequency up to which the position follows its set point, Hz [default: a hundredth of the rate]
    #[arg(
        long,
        value_name = "HZ",
        requires = "emulate",
        allow_negative_numbers = true
    )]
    bandwidth: Option<f64>,
    /// Control periods a second
    #[arg(
        long,
        value_name = "HZ",
        default_value_t = 1000.0,
        allow_negative_numbers = true
    )]
    rate: f64,
    /// Encoder counts per turn or per metre
    #[arg(
        long,
        value_name = "N",
        default_value_t = 16384.0,
        allow_negative_numbers = true
    )]
    counts: f64,
    /// Image of the firmware [default: built from the sources by cargo]
    #[arg(
        long,
        value_name = "ELF",
        requires = "emulate",
        conflicts_with = "on_host"
    )]
    image: Option<PathBuf>,
    /// Run the same drive on the host, without the emulator
    #[arg(long, requires = "emulate")]
    on_host: bool,
}

impl Command {
    pub fn run(&self) -> Outcome {
        self.check()?;
        let (place, model) = self.place()?;
        let ended = signals()?;
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
        let emulated = &self.emulated;
        error::positive(&[
            ("--speed", Some(self.speed)),
            ("--acceleration", self.acceleration),
            ("--telemetry", self.telemetry),
            ("--limit", emulated.limit),
            ("--bandwidth", emulated.bandwidth),
            ("--rate", Some(emulated.rate)),
            ("--counts", Some(emulated.counts)),
        ])?;
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
        if let Some(path) = &self.emulate {
            let axis = self.emulated.axis(path)?;
            let model = axis.model.clone();
            let image = if self.emulated.on_host {
                None
            } else {
                Some(chosen_image(self.emulated.image.as_deref(), F405, false)?)
            };
            let axis = Box::new(axis);
            return Ok((Place::Emulated { image, axis }, Some(model)));
        }
        let model = self.model.as_deref().map(Model::read).transpose()?;
        let port = match &self.port {
            Some(port) => port.clone(),
            None => only_board()?,
        };
        Ok((Place::Port(port), model))
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

impl Emulated {
    fn axis(&self, path: &Path) -> Result<Axis> {
        let model = Model::read(path)?;
        plant::new(&model).map_err(|e| e.in_model(path))?;
        let known_path = self.known.as_deref().unwrap_or(path);
        let known = Model::read(known_path)?;
        let sensors = Sensors::emulated(model.motion.turn() / self.counts);
        let setup = Setup {
            wish: Wish {
                bandwidth: self.bandwidth.unwrap_or(self.rate / 100.0),
                rate: self.rate,
                counts: self.counts,
                limit: self.limit.unwrap_or_default(),
                current: None,
            },
            compensate: self.compensate,
        };
        let parameters = emulate::parameters(&known, &setup, &sensors);
        Ok(Axis {
            parameters: parameters.map_err(|e| e.in_model(known_path))?,
            model,
            sensors,
        })
    }
}

/// The port at which the only board answers.
fn only_board() -> Result<String> {
    let mut ports = ports::list()?;
    ports.iter_mut().for_each(ports::Port::ask);
    let boards: Vec<&str> = ports
        .iter()
        .filter(|p| p.has_board())
        .map(|p| p.name.as_str())
        .collect();
    match boards.as_slice() {
        [one] => Ok((*one).to_owned()),
        [] => Err(Error::Usage(
            "no board answers at any serial port (bristle ports says what is at each); name its port, or use --emulate".to_owned(),
        )),
        several => Err(Error::Usage(format!(
            "boards answer at {}; name the port of one",
            several.join(", ")
        ))),
    }
}

/// Set by the signals that end a program.
fn signals() -> Result<Arc<AtomicBool>> {
    let ended = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        let registered = signal_hook::flag::register(signal, Arc::clone(&ended));
        registered.map_err(|e| Error::Internal(format!("no handler for signal {signal}: {e}")))?;
    }
    Ok(ended)
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
