//! The way to the board.

use std::collections::VecDeque;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use bristle_core::drive::signal::{Selection, Signal};
use bristle_core::link::Command;

use super::{ANSWER, RETRY, Session};
use crate::deploy;
use crate::error::{Error, Result};
use crate::format::decimal;
use crate::link::{Peer, Wire, frames_carried};
use crate::monitor::About;
use crate::monitor::aim::{Aim, Mode};
use crate::monitor::view::Kind;

/// How long a turn waits for bytes, and with that the longest that a stop waits.
const TURN: Duration = Duration::from_millis(2);
/// A board that is asked so often and has been silent for so long is lost.
const LOST: Duration = Duration::from_millis(400);
/// A line that has been silent for so long is opened anew.
const REOPEN: Duration = Duration::from_secs(2);
/// A line may lose an answer, as a pseudo-terminal does whose other end has not yet noticed that it was opened. What a board
/// is set up with may be said more than once.
const ATTEMPTS: u32 = 3;

/// A question that the board has not answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Asked {
    Stop,
    Enable,
    Clear,
    Status,
}

/// A board that has been set up for watching.
pub(super) struct Link {
    pub peer: Peer<f32, Box<dyn Wire + Send>>,
    pub asked: VecDeque<(u16, Asked)>,
    pub count: f64,
    pub last_sent: Instant,
    pub last_asked: Instant,
    pub last_stop: Instant,
    /// Of the peer, which counts from its start.
    pub lost: (u32, u32),
}

impl Link {
    pub fn send(&mut self, command: Command<f32>, asked: Asked) -> Result<()> {
        let number = self.peer.send(command)?;
        self.asked.push_back((number, asked));
        Ok(())
    }

    /// The question that an answer is to. Those before it will not be answered any more, as answers come in order.
    pub fn answered(&mut self, to: u16) -> Option<Asked> {
        let at = self.asked.iter().position(|(number, _)| *number == to)?;
        self.asked.drain(..=at).next_back().map(|(_, asked)| asked)
    }
}

impl Session {
    /// Opens the way to the board and sets it up.
    pub(super) fn connect(&mut self) -> Result<()> {
        let link = self.link_to(Peer::called(self.place.open()?)?)?;
        self.link = Some(link);
        Ok(())
    }

    /// Sets up a board that answers. What it does otherwise is left as it is, unless this monitor had turned the axis on
    /// before the link was lost, or a stop is due.
    pub(super) fn link_to(&mut self, mut peer: Peer<f32, Box<dyn Wire + Send>>) -> Result<Link> {
        let mut attempts = 1;
        while let Err(e) = self.set_up(&mut peer) {
            if attempts == ATTEMPTS {
                return Err(e);
            }
            attempts += 1;
        }
        let now = Instant::now();
        Ok(Link {
            peer,
            asked: VecDeque::new(),
            count: self.aim.count(),
            last_sent: now,
            last_asked: now,
            last_stop: now,
            lost: (0, 0),
        })
    }

    fn set_up(&mut self, peer: &mut Peer<f32, Box<dyn Wire + Send>>) -> Result<()> {
        peer.in_same_numbers("monitor")?;
        peer.wire().set_patience(ANSWER)?;
        let must_stop = self
            .shared
            .view(|view| view.status.armed || view.status.stopping);
        if must_stop || self.shared.stop.swap(false, Ordering::AcqRel) {
            peer.tell(Command::Disable)?;
        }
        let parameters = deploy::in_force(peer)?;
        let rate = 1.0 / f64::from(parameters.control.period);
        let every = self.every(rate);
        peer.tell(Command::Telemetry {
            selection: Selection::of(&Signal::ALL),
            every,
        })?;
        peer.wire().set_patience(TURN)?;
        self.aim = Aim::new(self.options.moves, parameters.control.count.into());
        self.form.period = decimal(parameters.control.period);
        self.form.every = every;
        let about = About::new(
            self.place.name(),
            peer.hello(),
            &parameters,
            self.options.model.as_ref(),
            self.options.moves,
            (self.form.period, every),
        );
        self.shared.view(|view| {
            view.set_about(about);
            view.hear();
            view.status.armed = false;
            view.status.stopping = false;
            view.status.aim = Mode::Off;
            if !view.status.link {
                view.status.link = true;
                view.status.why.clear();
                view.note(
                    Kind::Link,
                    format!("{}: the board answers", self.place.name()),
                );
            }
        });
        Ok(())
    }

    /// Periods from telemetry frame to telemetry frame.
    fn every(&self, rate: f64) -> u16 {
        let carried = |bytes| frames_carried(bytes, Signal::ALL.len());
        let carried = self.place.capacity().map(carried);
        match self.options.telemetry.or(carried) {
            Some(wanted) => (rate / wanted).ceil().clamp(1.0, f64::from(u16::MAX)) as u16,
            None => 1,
        }
    }

    /// Notes that nothing is heard of the board.
    pub(super) fn lose(&mut self, why: &str) {
        self.aim.drop_all();
        self.shared.view(|view| {
            if view.status.link {
                view.note(Kind::Link, format!("lost: {why}"));
            }
            view.status.link = false;
            view.status.state = None;
            view.status.aim = Mode::Off;
            why.clone_into(&mut view.status.why);
        });
    }

    /// A board that was lost is set up anew: it may have restarted.
    pub(super) fn resume(&mut self, link: &mut Link) -> Result<()> {
        link.asked.clear();
        link.peer.wire().set_patience(ANSWER)?;
        link.peer.call()?;
        link.peer.greet()?;
        self.set_up(&mut link.peer)?;
        link.count = self.aim.count();
        link.peer.take_telemetry();
        Ok(())
    }

    pub(super) fn mind_silence(&mut self, link: &mut Link) -> Result<()> {
        let silence = self.shared.view(|view| view.silence());
        if silence < LOST {
            return Ok(());
        }
        let why = format!("{}: the board is silent", self.place.name());
        if self.is_up() {
            self.lose(&why);
        }
        if silence > REOPEN {
            return Err(Error::Board(why));
        }
        if link.last_sent.elapsed() >= RETRY {
            link.last_sent = Instant::now();
            link.peer.call()?;
        }
        Ok(())
    }
}
