//! `bristle record`

mod asked;

use std::io::{BufRead, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use bristle_core::drive::{Parameters, State};
use bristle_core::link::{Answer, Command as Request};
use clap::Args;

use super::bench::Excite;
use super::briefing::{self, Briefing};
use super::emulate::Follow;
use super::interrupt::{self, Keys};
use super::output::Outputs;
use super::place::Where;
use super::terminal::Meter;
use super::{DONE, Outcome, terminal};
use crate::bench::csv;
use crate::deploy;
use crate::error::{Error, Result};
use crate::format::{decimal, shortest};
use crate::guided::{self, Line, Run};
use crate::link::{Peer, Wire};
use crate::model::Model;

/// Exit status of a run that did not come to its end.
const CUT: u8 = 3;

/// Excite the axis of a board, and record what it does
///
/// Says what will move, how far, how fast, for how long and with which input, asks, and drives the axis through a test
/// signal; the recording is for identify and diagnose. The default, sequence, goes both ways slowly and
/// then at once, and through a band of frequencies. --signal runs what diagnose --next-experiment has written.
///
/// The board itself keeps to --travel, --speed, --limit and --current, in every control period and whatever becomes of this
/// program: beyond travel, speed or current it turns its bridge off, and u is cut at its limit. With the bridge off the axis
/// coasts: leave room for that. ANY KEY, and Ctrl-C, ends the run; the axis is off then. When this program is killed or the
/// cable breaks, the board turns its bridge off by itself, after the time that deploy has set. What was recorded until then is kept.
///
/// Records every control period in the memory of the board where the run fits into it; a longer one by telemetry or with fewer
/// rows, whichever leaves more, and says so.
///
/// Exit status: 0 done, 1 the board failed, 2 unusable input or arguments, 3 the run was cut short; its recording is kept.
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  bristle record --emulate found.toml --amplitude 0.5 --travel 100 --speed 40 --out run.csv
  bristle record /dev/ttyUSB0 --model axis.toml --amplitude 2 --travel 30 --speed 20 --current 10 --out run.csv
  bristle record --emulate found.toml --follow position --excite multisine --amplitude 1 --band 0.1:2 --limit 2 \\
      --travel 1.5 --speed 20 --out run.csv
  bristle record /dev/ttyUSB0 --model axis.toml --signal next.csv --travel 3 --speed 20 --out next_run.csv")]
pub(super) struct Command {
    #[command(flatten)]
    place: Where,
    /// Test signal
    #[arg(
        long,
        value_name = "SHAPE",
        default_value = "sequence",
        conflicts_with = "signal"
    )]
    excite: Excite,
    /// Its largest value, in the unit of what follows it
    #[arg(
        long,
        value_name = "A",
        required_unless_present = "signal",
        conflicts_with = "signal",
        allow_negative_numbers = true
    )]
    amplitude: Option<f64>,
    /// What follows the test signal
    #[arg(
        long,
        value_name = "WHAT",
        default_value = "input",
        conflicts_with = "signal"
    )]
    follow: Follow,
    /// Lowest and highest frequency of the test signal, Hz
    #[arg(long, value_name = "LOW:HIGH", value_parser = super::bench::band, default_value = "0.1:10", conflicts_with = "signal")]
    band: (f64, f64),
    /// Length of the run, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 10.0,
        conflicts_with = "signal",
        allow_negative_numbers = true
    )]
    duration: f64,
    /// What random phases and levels are drawn from
    #[arg(long, default_value_t = 1, conflicts_with = "signal")]
    seed: u64,
    /// Drive the axis by the u of this file, as diagnose --next-experiment writes it
    #[arg(long, value_name = "FILE.csv")]
    signal: Option<PathBuf>,
    /// How far the axis may move either way from where it stands, rad or m
    #[arg(
        long,
        value_name = "X",
        allow_negative_numbers = true,
        help_heading = "What the board keeps to"
    )]
    travel: f64,
    /// How fast it may become, rad/s or m/s
    #[arg(
        long,
        value_name = "V",
        allow_negative_numbers = true,
        help_heading = "What the board keeps to"
    )]
    speed: f64,
    /// Largest |u|, in its unit [default: the largest of the signal; under control at a port, what the board was deployed with]
    #[arg(
        long,
        value_name = "U",
        allow_negative_numbers = true,
        help_heading = "What the board keeps to"
    )]
    limit: Option<f64>,
    /// Largest motor current, A [default: what the board was deployed with]
    #[arg(
        long,
        value_name = "A",
        allow_negative_numbers = true,
        help_heading = "What the board keeps to"
    )]
    current: Option<f64>,
    /// Begin without asking
    #[arg(long)]
    yes: bool,
    /// Where to write the recording
    #[arg(long, value_name = "OUT.csv")]
    out: PathBuf,
}

type Board = Peer<f32, Box<dyn Wire + Send>>;

impl Command {
    pub fn run(&self) -> Outcome {
        self.check()?;
        let (place, model) = self.place()?;
        let mut board = Peer::called(place.open()?)?;
        let parameters = in_force(&mut board)?;
        let faults = latched(&mut board)?;
        let rate = 1.0 / decimal(parameters.control.period);
        let signal = self.signal(model.as_ref(), rate)?;
        let bounds = self.bounds(&signal, &parameters)?;
        let selection = asked::selection(&place)?;
        let ring = board.hello().map_or(0, |hello| hello.ring);
        let periods = signal.values.len();
        let line = Line::finest(periods, rate, selection, ring, place.capacity());
        let known = match &self.place.emulated.known {
            Some(path) => Some(Model::read(path)?),
            None => model.clone(),
        };
        let briefing = Briefing {
            place: place.name(),
            hello: board.hello(),
            model: model.as_ref(),
            known: known.as_ref(),
            shape: self.signal.is_none().then_some(self.excite),
            file: self.signal.as_deref(),
            amplitude: self.amplitude.unwrap_or_default(),
            follow: self.follow,
            signal: &signal,
            rate,
            travel: self.travel,
            bounds: &bounds,
            line: &line,
            faults: &faults,
        };
        anstream::print!("{briefing}");
        let ended = interrupt::signals()?;
        self.confirm(&ended)?;
        if !faults.is_empty() {
            board.tell(Request::Clear)?;
        }
        let count = f64::from(parameters.control.count);
        let set_points = |origin: i32| self.set_points(&signal, rate, count, origin);
        let run = Run {
            set_points: &set_points,
            bounds,
            line,
            selection,
            rate,
            count,
        };
        let excited = drive(&mut board, &run, periods, &ended)?;
        self.finish(
            &excited,
            line,
            model.as_ref(),
            decimal(parameters.control.period),
        )
    }

    /// Asks whether to begin.
    fn confirm(&self, ended: &AtomicBool) -> Result<()> {
        if self.yes {
            return Ok(());
        }
        let mut out = anstream::stdout();
        let asked = write!(out, "Type yes to begin: ").and_then(|()| out.flush());
        asked.map_err(|e| Error::Usage(format!("the terminal cannot be used: {e}; add --yes")))?;
        let mut answer = String::new();
        let read = std::io::stdin().lock().read_line(&mut answer);
        let is_yes = ["y", "yes"].contains(&answer.trim().to_ascii_lowercase().as_str());
        if read.is_err() || !is_yes || ended.load(Ordering::Acquire) {
            return Err(Error::Usage(
                "nothing was begun; the axis is off".to_owned(),
            ));
        }
        Ok(())
    }

    fn finish(
        &self,
        excited: &guided::Excited,
        line: Line,
        model: Option<&Model>,
        period: f64,
    ) -> Outcome {
        let seconds = excited.rows.seconds(period);
        let is_whole = excited.ending == guided::Ending::Whole;
        briefing::told_off(excited.is_off);
        if excited.rows.0.is_empty() {
            return Err(Error::Board(format!(
                "nothing was recorded: {}",
                briefing::why(&excited.ending)
            )));
        }
        let mut outputs = Outputs::default();
        outputs.add(Some(&self.out), || {
            Ok(csv(&excited.rows.record(period), model))
        })?;
        terminal::written(&outputs.write()?);
        briefing::told_rows(&excited.rows, line, period);
        if is_whole {
            return Ok(DONE);
        }
        terminal::note(&format!(
            "cut after {} s: {}. The recording is kept up to there.",
            shortest(seconds, 4),
            briefing::why(&excited.ending)
        ));
        Ok(CUT)
    }
}

/// Drives the axis, with progress where there is a terminal.
fn drive(
    board: &mut Board,
    run: &Run,
    periods: usize,
    ended: &AtomicBool,
) -> Result<guided::Excited> {
    let keys = Keys::listen();
    let meter = Meter::new();
    meter.count("any key stops it", Some(periods));
    let come = std::cell::Cell::new(0);
    let excited = guided::run(
        board,
        run,
        &|| ended.load(Ordering::Acquire) || keys.pressed(),
        &|now| meter.add(now - come.replace(now).min(now)),
    );
    meter.finish();
    drop(keys);
    excited
}

/// The parameters of a board that can be excited.
fn in_force(board: &mut Board) -> Result<Parameters<f32>> {
    board.in_same_numbers("record")?;
    let parameters = deploy::in_force(board)?;
    if parameters == Parameters::harmless() {
        return Err(Error::Usage(
            "this board was never set up, and lets no motor turn; put what is known of its axis onto it by bristle deploy first"
                .to_owned(),
        ));
    }
    Ok(parameters)
}

/// The faults that are latched on a board that is off.
fn latched(board: &mut Board) -> Result<Vec<&'static str>> {
    match board.ask(Request::Status)? {
        Answer::Status {
            state: State::Running,
            ..
        } => Err(Error::Usage(
            "the axis is on already, by another program; turn it off there first".to_owned(),
        )),
        Answer::Status { faults, .. } => Ok(faults.iter().map(|f| f.page().id).collect()),
        other => Err(Error::Board(format!(
            "it answers {other:?} to the question how it is; is its firmware of this release?"
        ))),
    }
}
