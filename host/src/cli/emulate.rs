//! `bristle emulate`

use std::path::{Path, PathBuf};

use bristle_core::drive::recorder::{Order, Trigger};
use bristle_core::drive::signal::{Selection, Signal};
use bristle_core::drive::{Number, Parameters};
use bristle_core::friction::Units;
use bristle_core::link::Command as Request;
use bristle_core::scalar::Q16;
use clap::{Args, ValueEnum};
use serde_json::json;

use super::bench::Excite;
use super::output::{self, Outputs};
use super::tune::Winding;
use super::{DONE, Outcome as Status, terminal};
use crate::bench::{self, Record, csv};
use crate::emulate::{
    self, Board, Driver, Launch, OnHost, Outcome, Plan, Sensors, Setup, Transport, Tuned,
};
use crate::error::{self, Error, Result};
use crate::excite::{Excitation, Shape};
use crate::flash::Image;
use crate::image::{self, Target};
use crate::model::Model;
use crate::plant;
use crate::report::{self, Emulation};
use crate::tune::Wish;

/// What the long help says at its end.
const EXAMPLES: &str = "\
Examples:
  bristle emulate --model axis.toml --excite multisine --amplitude 1 --out run.csv
  bristle emulate --model truth.toml --known model.toml --follow position --compensate \\
      --excite chirp --amplitude 0.5 --band 0.2:2 --limit 2 --out run.csv --json run.json
  bristle emulate --board stm32f100 --model axis.toml --excite multisine --amplitude 1 --out run.csv";

/// Options of a run in the emulator.
#[derive(Args, Debug)]
struct Options {
    /// Model file of the axis as it really is: any plant, any effect
    #[arg(long, value_name = "M.toml")]
    model: PathBuf,
    /// Model file of what the board knows of it [default: the same]
    #[arg(long, value_name = "KNOWN.toml")]
    known: Option<PathBuf>,
    /// Test signal
    #[arg(long, value_name = "SHAPE")]
    excite: Excite,
    /// Its largest value, in the unit of what follows it
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    amplitude: f64,
    /// What follows the test signal
    #[arg(long, value_name = "WHAT", default_value = "input")]
    follow: Follow,
    /// Compensate the friction and the effects that the board knows of
    #[arg(long)]
    compensate: bool,
    /// Lowest and highest frequency of the test signal, Hz
    #[arg(long, value_name = "LOW:HIGH", value_parser = super::bench::band, default_value = "0.1:10")]
    band: (f64, f64),
    /// Length of the run, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 10.0,
        allow_negative_numbers = true
    )]
    duration: f64,
    /// Control periods a second
    #[arg(
        long,
        value_name = "HZ",
        default_value_t = 1000.0,
        allow_negative_numbers = true
    )]
    rate: f64,
    /// What random phases and levels are drawn from
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Frequency up to which the position follows its set point, Hz [default: a hundredth of the rate]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    bandwidth: Option<f64>,
    /// Largest input that the board may apply, in the unit of u [default: twice the amplitude under --follow input]
    #[arg(long, value_name = "U", allow_negative_numbers = true)]
    limit: Option<f64>,
    #[command(flatten)]
    winding: Winding,
    /// Encoder counts per turn or per metre
    #[arg(
        long,
        value_name = "N",
        default_value_t = 16384.0,
        allow_negative_numbers = true
    )]
    counts: f64,
    /// How frames travel to the emulated board and back
    #[arg(long, value_name = "LINE", default_value = "fast")]
    transport: Line,
    /// Which board
    #[arg(long, value_name = "BOARD", default_value = "stm32f405")]
    board: Chip,
    /// Image of the firmware [default: built from the sources by cargo]
    #[arg(long, value_name = "ELF", conflicts_with = "on_host")]
    image: Option<PathBuf>,
    /// Run the same drive on the host, without the emulator: the results are the same bits
    #[arg(long)]
    on_host: bool,
    /// Where to write the recording
    #[arg(long, value_name = "OUT.csv")]
    out: PathBuf,
}

/// Boards in the emulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Chip {
    /// The motor driver's, in single precision
    Stm32f405,
    /// Without a floating-point unit and with 8 KB of RAM, in fixed point; it has no ring to record in
    Stm32f100,
}

impl Chip {
    const fn target(self) -> Target {
        match self {
            Self::Stm32f405 => image::F405,
            Self::Stm32f100 => image::F100,
        }
    }

    const fn launch(self) -> Launch<'static> {
        match self {
            Self::Stm32f405 => Launch::F405,
            Self::Stm32f100 => Launch::F100,
        }
    }
}

/// What a test signal is followed by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Follow {
    /// u itself, with the controllers off; under a current loop the current, A
    Input,
    /// Velocity, under control
    Velocity,
    /// Position, under control
    Position,
}

impl From<Follow> for emulate::Follow {
    fn from(follow: Follow) -> Self {
        match follow {
            Follow::Input => Self::Input,
            Follow::Velocity => Self::Velocity,
            Follow::Position => Self::Position,
        }
    }
}

/// Transports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Line {
    /// The emulator's standard input and output
    Fast,
    /// The board's serial port, byte by byte through its interrupt
    Serial,
}

/// Run the firmware in an emulator, with its axis simulated around it
///
/// QEMU runs the image that would be flashed on the board. Each control period, the axis moves under the last input,
/// and its encoder, current and bus voltage go to the board as the converters would read them; the board answers with
/// what its bridge applies. Neither side goes on before the other has answered, so the same options give the same bytes.
/// Writes a recording as a driver would have made it, which diagnose and identify read.
///
/// With --board stm32f100 it is the image in fixed point: the parameters are sent in units, powers of two of the SI units,
/// in which 16 bits before and 16 after the point hold them best, and the results lie within a bound of those in floating
/// point that the tests derive.
///
/// Needs qemu-system-arm and, unless --image is given, cargo with the target thumbv7em-none-eabihf (stm32f405) or
/// thumbv7m-none-eabi (stm32f100).
#[derive(Args, Debug)]
#[command(after_long_help = EXAMPLES)]
pub(super) struct Emulate {
    #[command(flatten)]
    options: Options,
    /// Where to write a report of the run
    #[arg(long, value_name = "OUT.json")]
    json: Option<PathBuf>,
    /// Where to write a report of the run to look at
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    /// Where to write what the board logs, a line each, beginning with the control period; needs a program built with
    /// --features log
    #[arg(long, value_name = "LOG.txt", conflicts_with = "on_host")]
    log: Option<PathBuf>,
    /// Let the board record in the ring in its memory, and read that out afterwards: the same run and the same bytes, of which
    /// one longer than the ring keeps the beginning
    #[arg(long, conflicts_with = "on_host")]
    ring: bool,
}

/// Everything that a run needs.
struct Prepared<T> {
    model: Model,
    plant: Box<dyn plant::Plant>,
    plan: Plan<T>,
    parameters: Parameters<T>,
}

impl Emulate {
    pub fn run(&self) -> Status {
        let options = &self.options;
        let files = [&self.json, &self.report, &self.log].map(Option::as_ref);
        options.check(&[&[Some(&options.out)], &files[..]].concat())?;
        if self.log.is_some() && !cfg!(feature = "log") {
            // Says why it cannot before the run, and not after it.
            emulate::decode(Path::new(""), &[])?;
        }
        match options.board {
            Chip::Stm32f100 if self.ring => Err(Error::Usage(
                "--board stm32f100 has no memory to record in; leave --ring out, and the host records"
                    .to_owned(),
            )),
            Chip::Stm32f405 => self.run_in::<f32>(),
            Chip::Stm32f100 => self.run_in::<Q16>(),
        }
    }

    /// The run on a board, recorded by the host or by the board.
    fn run_on<T: Number>(
        &self,
        board: &mut Board<T>,
        prepared: &mut Prepared<T>,
    ) -> Result<Outcome<T>> {
        if self.ring {
            let selection = Selection::of(&[Signal::Input, Signal::Position, Signal::Current]);
            board.record(Order {
                selection,
                every: 1,
                trigger: Trigger::Now,
                before: 0,
            })?;
        }
        let mut outcome = prepared.run(board)?;
        if self.ring {
            let count = self.options.counts_unit(&prepared.model);
            outcome.record = from_ring(board, &outcome, count)?;
        }
        Ok(outcome)
    }

    /// The run in the numbers of the board.
    fn run_in<T: Number>(&self) -> Status {
        let options = &self.options;
        let mut prepared = options.prepare::<T>()?;
        let (outcome, who, log) = if options.on_host {
            let mut driver = OnHost::new(prepared.parameters)?;
            (prepared.run(&mut driver)?, json!("host"), String::new())
        } else {
            let image = options.image(self.log.is_some())?;
            let mut board = options.board(&image, &prepared, self.log.is_some())?;
            let outcome = self.run_on(&mut board, &mut prepared)?;
            let log = match &self.log {
                Some(_) => emulate::decode(&image, &board.machine().take_log())?,
                None => String::new(),
            };
            (outcome, json!(board.hello()), log)
        };
        let mut outputs = Outputs::default();
        outputs.add(Some(&options.out), || {
            Ok(csv(&outcome.record, Some(&prepared.model)))
        })?;
        outputs.add(self.json.as_ref(), || Ok(json_report(&outcome, &who)))?;
        outputs.add(self.report.as_ref(), || {
            let options = &self.options;
            report::emulation(&options.emulation(&prepared.model, &outcome))
        })?;
        outputs.add(self.log.as_ref(), || Ok(log))?;
        terminal::written(&outputs.write()?);
        tell(&outcome);
        Ok(DONE)
    }
}

/// What the board has recorded, with the instants of its periods and the set points of the plan.
fn from_ring<T: Number>(board: &mut Board<T>, outcome: &Outcome<T>, count: f64) -> Result<Record> {
    board.tell(Request::StopRecording)?;
    let recorded = board.recorded()?;
    let start = outcome.periods.first().map_or(0, |p| p.number);
    let first = recorded.contents.first.wrapping_sub(start) as usize;
    let rows = recorded.contents.rows as usize;
    let made = &outcome.record;
    let part = |all: &[f64]| all.iter().skip(first).take(rows).copied().collect();
    let number = |word| T::from_word(word).to_f64();
    Ok(Record {
        t: part(&made.t),
        u: recorded.column(Signal::Input).map(number).collect(),
        q: recorded
            .column(Signal::Position)
            .map(|w| f64::from(w as i32) * count)
            .collect(),
        current: if made.current.is_empty() {
            Vec::new()
        } else {
            recorded.column(Signal::Current).map(number).collect()
        },
        set_point: part(&made.set_point),
        truth: made.truth.iter().skip(first).take(rows).copied().collect(),
    })
}

impl<T: Number> Prepared<T> {
    fn run(&mut self, driver: &mut dyn Driver<T>) -> Result<Outcome<T>> {
        emulate::run(driver, self.plant.as_mut(), &self.plan)
    }
}

impl Options {
    fn check(&self, outputs: &[Option<&PathBuf>]) -> Result<()> {
        let mut inputs: Vec<&Path> = vec![&self.model];
        inputs.extend(self.known.as_deref());
        inputs.extend(self.image.as_deref());
        output::check(&inputs, outputs)?;
        error::positive(&[
            ("--duration", Some(self.duration)),
            ("--rate", Some(self.rate)),
            ("--counts", Some(self.counts)),
            ("--bandwidth", self.bandwidth),
            ("--limit", self.limit),
        ])?;
        if self.amplitude == 0.0 || !self.amplitude.is_finite() {
            return Err(Error::Usage(format!(
                "--amplitude {} drives nothing; give a number other than zero",
                self.amplitude
            )));
        }
        let samples = (self.duration * self.rate).round();
        if !(200.0..=1e7).contains(&samples) {
            return Err(Error::Usage(format!(
                "--duration {} at --rate {} makes {samples} samples; a recording has 200 to 10000000",
                self.duration, self.rate
            )));
        }
        if self.band.1 >= 0.5 * self.rate {
            return Err(Error::Usage(format!(
                "--band goes up to {} Hz, but at --rate {} nothing above {} Hz can be made; lower the one or raise the other",
                self.band.1,
                self.rate,
                0.5 * self.rate
            )));
        }
        Ok(())
    }

    fn counts_unit(&self, model: &Model) -> f64 {
        model.motion.turn() / self.counts
    }

    fn input_limit(&self) -> Result<f64> {
        match (self.limit, self.follow) {
            (Some(limit), _) => Ok(limit),
            (None, Follow::Input) if self.winding.wish().is_none() => {
                Ok(2.0 * self.amplitude.abs())
            }
            (None, _) => Err(Error::Usage(
                "a controller needs --limit, the largest input that it may apply, in the unit of u"
                    .to_owned(),
            )),
        }
    }

    fn prepare<T: Number>(&self) -> Result<Prepared<T>> {
        let model = Model::read(&self.model)?;
        let plant = plant::new(&model).map_err(|e| e.in_model(&self.model))?;
        let known_path = self.known.as_ref().unwrap_or(&self.model);
        let known = Model::read(known_path)?;
        let sensors = Sensors::emulated(self.counts_unit(&model));
        let setup = Setup {
            wish: Wish {
                bandwidth: self.bandwidth.unwrap_or(self.rate / 100.0),
                rate: self.rate,
                counts: self.counts,
                limit: self.input_limit()?,
                current: self.winding.wish(),
            },
            compensate: self.compensate,
        };
        let tuned = emulate::tuned(&known, &setup, &sensors);
        let Tuned { parameters, units } = tuned.map_err(|e| e.in_model(known_path))?;
        let plan = self.plan(sensors, &units);
        Ok(Prepared {
            model,
            plant,
            plan,
            parameters,
        })
    }

    fn plan<T: Number>(&self, sensors: Sensors, units: &Units) -> Plan<T> {
        let t: Vec<f64> = (0..(self.duration * self.rate).round() as usize)
            .map(|k| k as f64 / self.rate)
            .collect();
        let shape = Shape::from(self.excite);
        let excitation = Excitation {
            shape,
            amplitude: self.amplitude,
            band: self.band,
            duration: self.duration,
            seed: self.seed,
        };
        let signal = excitation.values(&t);
        let smooth = shape.is_smooth();
        Plan {
            set_points: emulate::Follow::from(self.follow).set_points(
                &signal,
                (self.rate, smooth),
                sensors.count,
                units,
            ),
            positions: if self.follow == Follow::Position {
                signal.clone()
            } else {
                Vec::new()
            },
            t,
            loads: Vec::new(),
            sensors,
        }
    }

    /// The run as its report shows it.
    fn emulation<'a, T>(&self, model: &'a Model, outcome: &'a Outcome<T>) -> Emulation<'a> {
        let chip = match self.board {
            Chip::Stm32f405 => "STM32F405, in single precision",
            Chip::Stm32f100 => "STM32F100, in fixed point",
        };
        let place = if self.on_host {
            "the drive on the host, without the emulator"
        } else {
            "the firmware's image in QEMU"
        };
        let known = self.known.as_ref().unwrap_or(&self.model);
        let compensated = if self.compensate {
            "with friction and effects compensated"
        } else {
            "nothing compensated"
        };
        Emulation {
            record: &outcome.record,
            axis: &model.name,
            board: format!("{place}, {chip}"),
            told: format!("{}, {compensated}", known.display()),
            units: ["u", "q"].map(|column| bench::unit(column, model)),
            tracking: tracking(&outcome.record),
            trip: trip(outcome),
            seed: self.seed,
        }
    }

    fn image(&self, log: bool) -> Result<PathBuf> {
        chosen_image(self.image.as_deref(), self.board.target(), log)
    }

    /// An emulated board that is set up and on.
    fn board<T: Number>(
        &self,
        image: &Path,
        prepared: &Prepared<T>,
        logged: bool,
    ) -> Result<Board<T>> {
        let transport = match self.transport {
            Line::Fast => Transport::Fast,
            Line::Serial => Transport::Serial,
        };
        let launch = Launch {
            logged,
            ..self.board.launch()
        };
        let mut board = Board::boot(image, launch, transport)?;
        board.tell(Request::Set(prepared.parameters))?;
        board.tell(Request::Enable)?;
        Ok(board)
    }
}

/// The image that an option names, or one built from the sources.
pub(super) fn chosen_image(image: Option<&Path>, target: Target, log: bool) -> Result<PathBuf> {
    match image {
        // The emulator would run anything, and stop at it with words of its own.
        Some(image) => Ok(Image::read(image, &target)?.path),
        None if log => image::build(target, None, &["--features", "log"]),
        None => image::build(target, None, &[]),
    }
}

/// When the bridge went off and why, if it did.
pub(super) fn trip<T>(outcome: &Outcome<T>) -> Option<(f64, Vec<&'static str>)> {
    let at = outcome.periods.iter().position(|p| !p.faults.is_empty())?;
    let ids = outcome.periods[at].faults.iter().map(|f| f.page().id);
    Some((outcome.record.t[at], ids.collect()))
}

/// RMS and largest distance between set point and measured position.
fn tracking(record: &Record) -> Option<(f64, f64)> {
    let errors = record.set_point.iter().zip(&record.q).map(|(r, q)| r - q);
    let (sum, most) = errors.fold((0.0, 0.0_f64), |(sum, most), e| {
        (sum + e * e, most.max(e.abs()))
    });
    let n = record.set_point.len();
    (n > 0).then(|| ((sum / n as f64).sqrt(), most))
}

fn json_report<T>(outcome: &Outcome<T>, who: &serde_json::Value) -> String {
    let tracking = tracking(&outcome.record).map(|(rms, most)| json!({ "rms": rms, "max": most }));
    let trip = trip(outcome).map(|(t, faults)| json!({ "t": t, "faults": faults }));
    let most = outcome.record.u.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    let text = json!({
        "schema": "bristle.emulation/1",
        "driver": who,
        "samples": outcome.record.t.len(),
        "tracking": tracking,
        "largest_input": most,
        "trip": trip,
    });
    format!("{text:#}\n")
}

/// What is worth knowing about the run.
fn tell<T>(outcome: &Outcome<T>) {
    if let Some((t, faults)) = trip(outcome) {
        terminal::note(&format!(
            "the board turned its bridge off at t = {t} s: {}; bristle explain tells about each",
            faults.join(", ")
        ));
    }
    if let Some((rms, most)) = tracking(&outcome.record) {
        terminal::note(&format!("position error {rms:.3e} RMS, {most:.3e} at most"));
    }
}
