//! A run: the axis is turned on within bounds, driven along its set points, and turned off, whatever happens.

use std::time::{Duration, Instant};

use bristle_core::control::SetPoint;
use bristle_core::drive::recorder::{Order, Trigger};
use bristle_core::drive::signal::{Selection, Signal};
use bristle_core::drive::{Bounds, Fault, State};
use bristle_core::link::{Answer, Command, Report};

use super::{Line, Row, Rows};
use crate::error::{Error, Result};
use crate::link::{Peer, Telemetry, Wire};

/// How long a turn waits for bytes, and with that the longest that an abort waits.
const TURN: Duration = Duration::from_millis(2);
/// The board answers what it is asked in less.
const ANSWER: Duration = Duration::from_millis(500);
/// From set point to set point, s. A board that is set up by this program takes ten times this for stale.
const TICK: f64 = 2e-3;
/// From question to question about the state.
const ASK: Duration = Duration::from_millis(50);
/// A board that has been silent for so long is lost.
const LOST: Duration = Duration::from_millis(400);
/// How often a board is told to turn the axis off before its silence is believed.
const ATTEMPTS: u32 = 8;

/// What is to be done.
pub struct Run<'a> {
    /// What is asked for in each control period, on from where the axis stands: positions count from `origin`.
    pub set_points: &'a dyn Fn(i32) -> Vec<SetPoint<f32>>,
    /// What the board keeps the axis within.
    pub bounds: Bounds<f32>,
    /// How the recording comes.
    pub line: Line,
    /// What is recorded.
    pub selection: Selection,
    /// Control periods a second.
    pub rate: f64,
    /// rad or m to an encoder count.
    pub count: f64,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// At its end.
    Whole,
    /// Somebody has stopped it.
    Aborted,
    /// The board has, for these faults; none if another program has turned the axis off.
    Tripped(Vec<Fault>),
    /// The board was not heard any more.
    Lost(String),
}

/// What came of a run.
pub struct Excited {
    /// What was recorded while the bridge was on.
    pub rows: Rows,
    /// How it ended.
    pub ending: Ending,
    /// Whether the board has confirmed that the axis is off.
    pub is_off: bool,
}

/// Drives the axis, which must be off, until the end of the set points or until `is_aborted` says so; `follow` is told how far it has
/// come, in periods. Fails if the axis cannot be turned on; whatever happens later is an [`Ending`].
pub fn run<W: Wire>(
    board: &mut Peer<f32, W>,
    run: &Run,
    is_aborted: &dyn Fn() -> bool,
    follow: &dyn Fn(usize),
) -> Result<Excited> {
    board.wire().set_patience(ANSWER)?;
    let origin = begin(board, run)?;
    let mut going = Going {
        set_points: (run.set_points)(origin),
        run,
        rows: Rows::default(),
        start: None,
        sent: None,
    };
    // A line that fails is a board that is lost: what was recorded is worth keeping.
    let ending = going
        .until_the_end(board, is_aborted, follow)
        .unwrap_or_else(|e| Ending::Lost(e.to_string()));
    let is_off = turn_off(board);
    let mut rows = std::mem::take(&mut going.rows);
    if run.line.by_ring {
        rows = from_ring(board, run)?;
    }
    match (&ending, going.start) {
        (Ending::Whole, Some(start)) => {
            rows.end_after(start, going.set_points.len() as u32);
        }
        _ => rows.cut(),
    }
    // Nobody listens to telemetry any more. It does no harm where this is lost.
    let _ = board.send(telemetry(0));
    Ok(Excited {
        rows,
        ending,
        is_off,
    })
}

const fn telemetry(every: u16) -> Command<f32> {
    Command::Telemetry {
        selection: Selection::of(&[]),
        every,
    }
}

/// Turns the axis on; where it stands, in counts.
fn begin<W: Wire>(board: &mut Peer<f32, W>, run: &Run) -> Result<i32> {
    let line = &run.line;
    let selection = if line.by_ring {
        Selection::of(&[Signal::Position])
    } else {
        run.selection
    };
    board.tell(Command::Telemetry {
        selection,
        every: line.frames,
    })?;
    let origin = position(board, selection)?;
    match board.ask(Command::EnableWithin(run.bounds)) {
        Ok(Answer::Done) => Ok(origin),
        Ok(other) => Err(Error::Board(format!(
            "it does not turn the axis on within the bounds of this run: {other:?}; is another program driving it?"
        ))),
        // It may have been heard all the same.
        Err(e) => {
            turn_off(board);
            Err(e)
        }
    }
}

/// Where the axis stands, from the next telemetry frame.
fn position<W: Wire>(board: &mut Peer<f32, W>, selection: Selection) -> Result<i32> {
    let begun = Instant::now();
    while begun.elapsed() < LOST + ANSWER {
        board.poll()?;
        if let Some(frame) = board.take_telemetry().0.last() {
            return Ok(word(frame, selection, Signal::Position) as i32);
        }
    }
    Err(Error::Board(
        "it sends no telemetry, so its control periods do not pass; check its supply, or restart it".to_owned(),
    ))
}

fn word(frame: &Telemetry, selection: Selection, signal: Signal) -> u32 {
    let at = selection.iter().position(|s| s == signal);
    at.and_then(|at| frame.words.get(at)).copied().unwrap_or(0)
}

/// A run under way.
struct Going<'a> {
    run: &'a Run<'a>,
    set_points: Vec<SetPoint<f32>>,
    rows: Rows,
    /// The first control period of the run.
    start: Option<u32>,
    /// The latest period that a set point was sent in, from the first.
    sent: Option<usize>,
}

impl Going<'_> {
    fn until_the_end<W: Wire>(
        &mut self,
        board: &mut Peer<f32, W>,
        is_aborted: &dyn Fn() -> bool,
        follow: &dyn Fn(usize),
    ) -> Result<Ending> {
        if self.run.line.by_ring {
            board.record(Order {
                selection: self.run.selection,
                every: self.run.line.every,
                trigger: Trigger::Now,
                before: 0,
            })?;
        }
        // What came before is of an axis that was off.
        board.take_telemetry();
        board.wire().set_patience(TURN)?;
        let (mut heard, mut asked) = (Instant::now(), Instant::now());
        self.drive(board, 0)?;
        loop {
            if is_aborted() {
                return Ok(Ending::Aborted);
            }
            let (reports, _) = board.poll()?;
            for report in &reports {
                if let Some(ending) = ended(report) {
                    return Ok(ending);
                }
            }
            let frames = board.take_telemetry().0;
            if let Some(last) = frames.last() {
                heard = Instant::now();
                self.take(&frames);
                let start = *self.start.get_or_insert(frames[0].period);
                let now = last.period.wrapping_sub(start) as usize;
                follow(now.min(self.set_points.len()));
                if now >= self.set_points.len() {
                    return Ok(Ending::Whole);
                }
                self.drive(board, now)?;
            }
            if heard.elapsed() > LOST {
                return Ok(Ending::Lost("it is silent".to_owned()));
            }
            if asked.elapsed() >= ASK {
                asked = Instant::now();
                board.send(Command::Status)?;
            }
        }
    }

    /// Sends what is due in a period, if something has changed for long enough.
    fn drive<W: Wire>(&mut self, board: &mut Peer<f32, W>, now: usize) -> Result<()> {
        let tick = (TICK * self.run.rate) as usize;
        if self.sent.is_some_and(|sent| now < sent + tick) {
            return Ok(());
        }
        self.sent = Some(now);
        let set_point = self.set_points.get(now).copied();
        board.send(Command::SetPoint(set_point.unwrap_or(SetPoint::Off)))?;
        Ok(())
    }

    fn take(&mut self, frames: &[Telemetry]) {
        if self.run.line.by_ring {
            return;
        }
        let selection = self.run.selection;
        let number = |frame, signal| f64::from(f32::from_bits(word(frame, selection, signal)));
        self.rows.0.extend(frames.iter().map(|frame| Row {
            period: frame.period,
            input: number(frame, Signal::Input),
            position: f64::from(word(frame, selection, Signal::Position) as i32) * self.run.count,
            current: number(frame, Signal::Current),
        }));
    }
}

/// Whether a report says that the axis is not running any more.
fn ended(report: &Report<f32>) -> Option<Ending> {
    match report {
        Report::Hello(_) => Some(Ending::Lost("it has restarted".to_owned())),
        Report::Answer {
            answer: Answer::Status { state, faults, .. },
            ..
        } if *state != State::Running => Some(Ending::Tripped(faults.iter().collect())),
        _ => None,
    }
}

/// Turns the axis off; whether the board has confirmed it.
fn turn_off<W: Wire>(board: &mut Peer<f32, W>) -> bool {
    let _ = board.wire().set_patience(ANSWER);
    (0..ATTEMPTS).any(|_| {
        let told = board.ask(Command::Disable).is_ok();
        let status = board.ask(Command::Status);
        told && matches!(status, Ok(Answer::Status { state, .. }) if state != State::Running)
    })
}

/// What the board has recorded by itself.
fn from_ring<W: Wire>(board: &mut Peer<f32, W>, run: &Run) -> Result<Rows> {
    board.tell(Command::StopRecording)?;
    let recorded = board.recorded()?;
    let contents = &recorded.contents;
    let number = |word| f64::from(f32::from_bits(word));
    let mut current = recorded.column(Signal::Current).map(number);
    let inputs = recorded.column(Signal::Input).map(number);
    let rows = inputs.zip(recorded.column(Signal::Position)).zip(0_u32..);
    let rows = rows.map(|((input, position), k)| Row {
        period: contents
            .first
            .wrapping_add(k.wrapping_mul(contents.every.into())),
        input,
        position: f64::from(position as i32) * run.count,
        current: current.next().unwrap_or_default(),
    });
    Ok(Rows(rows.collect()))
}
