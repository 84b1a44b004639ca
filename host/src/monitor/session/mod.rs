//! The thread that speaks to the board.
//!
//! - [`link`]: the way to the board: found, set up, lost, found again.
//! - [`turn`]: what is sent, and in which order.
//! - [`answers`]: what comes back.
//! - [`saving`]: recordings that are done.

mod answers;
mod link;
mod saving;
mod turn;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use bristle_core::drive::State;
use bristle_core::drive::signal::Selection;
use bristle_core::link::Command;
use serde::{Deserialize, Serialize};

use super::Shared;
use super::aim::{Aim, Mode, Moves};
use super::recording::{Form, Recording, Saved};
use crate::error::Result;
use crate::link::Wire;
use crate::model::Model;
use crate::place::Place;
use link::Link;

/// What can be asked for. In JSON: `"enable"`, `{"aim": {"velocity": 0.5}}`.
//
// Not by a field that tells the kind: serde holds what stands beside such a field back, and a number held back cannot be read
// where `serde_json` keeps numbers as text, which the log's decoder has it do.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Request {
    /// To turn the axis on, with nothing asked of it.
    Enable,
    /// To forget the latched faults.
    Clear,
    /// Something else of the axis.
    Aim(Mode),
    /// To record.
    Record,
    /// To end the recording and save it.
    Save,
}

/// What a monitor is told at its start.
#[derive(Clone)]
pub struct Options {
    /// Tells names and units.
    pub model: Option<Model>,
    /// How fast moves are.
    pub moves: Moves,
    /// Telemetry frames a second; as many as the line carries if none.
    pub telemetry: Option<f64>,
    /// Where recordings go.
    pub folder: PathBuf,
}

/// How the axis was left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Farewell {
    /// It was off, and is.
    WasOff,
    /// It was on, and the board has confirmed that it is off.
    Stopped,
    /// The board has not confirmed it.
    Unconfirmed,
}

/// From attempt to attempt to find the board.
const RETRY: Duration = Duration::from_millis(200);
/// The board answers what it is asked in less, but for writing its flash, which is not asked here.
const ANSWER: Duration = Duration::from_millis(500);

pub(super) struct Session {
    place: Place,
    options: Options,
    shared: Arc<Shared>,
    inbox: Receiver<Request>,
    link: Option<Link>,
    aim: Aim,
    form: Form,
    recording: Option<Recording>,
    saving: Vec<JoinHandle<Result<Saved>>>,
    watched: Instant,
}

impl Session {
    /// Finds the board.
    pub fn begin(
        place: Place,
        options: Options,
        shared: Arc<Shared>,
        inbox: Receiver<Request>,
    ) -> Result<Self> {
        let mut session = Self::new(place, options, shared, inbox);
        session.connect()?;
        Ok(session)
    }

    fn new(place: Place, options: Options, shared: Arc<Shared>, inbox: Receiver<Request>) -> Self {
        Self {
            aim: Aim::new(options.moves, 1.0),
            form: Form {
                folder: options.folder.clone(),
                model: options.model.clone(),
                period: 0.0,
                every: 1,
            },
            place,
            options,
            shared,
            inbox,
            link: None,
            recording: None,
            saving: Vec::new(),
            watched: Instant::now(),
        }
    }

    /// Serves until the monitor is closed.
    pub fn run(mut self) -> Farewell {
        while !self.shared.closing.load(Ordering::Acquire) {
            let turned = match self.link.take() {
                Some(mut link) => {
                    let turned = self.turn(&mut link);
                    self.link = turned.is_ok().then_some(link);
                    turned
                }
                None => self.connect(),
            };
            if let Err(e) = turned {
                self.lose(&e.to_string());
                sleep(RETRY);
            }
            self.collect_saved(false);
        }
        let farewell = self.farewell();
        self.save();
        self.collect_saved(true);
        farewell
    }

    /// Whether the board is heard.
    fn is_up(&self) -> bool {
        self.shared.view(|view| view.status.link)
    }

    /// Leaves the axis off, and the board without telemetry.
    fn farewell(&mut self) -> Farewell {
        let (armed, running) = self.shared.view(|view| {
            let running = view.status.state == Some(State::Running);
            (view.status.armed || view.status.stopping, running)
        });
        let is_on = armed || running || self.shared.stop.load(Ordering::Acquire);
        let Some(mut link) = self.link.take() else {
            return if is_on {
                Farewell::Unconfirmed
            } else {
                Farewell::WasOff
            };
        };
        let mut leave = || -> Result<()> {
            link.peer.send(Command::Disable)?;
            link.peer.wire().set_patience(ANSWER)?;
            link.peer.tell(Command::Disable)?;
            let selection = Selection::of(&[]);
            link.peer.tell(Command::Telemetry {
                selection,
                every: 0,
            })
        };
        match leave() {
            Ok(()) if is_on => Farewell::Stopped,
            Err(_) if is_on => Farewell::Unconfirmed,
            _ => Farewell::WasOff,
        }
    }
}
