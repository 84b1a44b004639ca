//! What is sent to the board, and in which order.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use bristle_core::drive::signal::Signal;
use bristle_core::link::{Command, Report};

use super::link::{Asked, Link};
use super::{Request, Session};
use crate::error::Result;
use crate::monitor::aim::Mode;
use crate::monitor::recording::Recording;
use crate::monitor::view::{Kind, View};

/// From set point to set point. A board that is set up by this program takes ten times this for stale.
const TICK: Duration = Duration::from_millis(5);
/// From question to question about the state.
const ASK: Duration = Duration::from_millis(50);
/// A stop that the board has not confirmed is sent again.
const REPEAT: Duration = Duration::from_millis(20);
/// With nobody watching, the axis is turned off. A page that is loaded anew is back before.
const UNWATCHED: Duration = Duration::from_secs(1);

impl Session {
    /// Some milliseconds of a link.
    pub(super) fn turn(&mut self, link: &mut Link) -> Result<()> {
        self.stop_first(link)?;
        while let Ok(request) = self.inbox.try_recv() {
            // A stop overtakes what was asked for before it.
            if !self.stop_first(link)? {
                self.serve(link, request)?;
            }
        }
        self.tick(link)?;
        let (reports, heard) = link.peer.poll()?;
        if heard {
            self.shared.view(View::hear);
        }
        // Nobody has asked it to greet while it was heard, so it has restarted, and sends no telemetry.
        let restarted = reports.iter().any(|r| matches!(r, Report::Hello(_)));
        if restarted {
            self.lose("the board has restarted");
        }
        if heard && !self.is_up() {
            self.resume(link)?;
        } else {
            reports
                .into_iter()
                .for_each(|report| self.take(link, &report));
            self.take_telemetry(link);
        }
        self.mind_silence(link)?;
        self.mind_watchers();
        Ok(())
    }

    /// A stop goes before all else, and again until it is confirmed. Whether one came.
    fn stop_first(&mut self, link: &mut Link) -> Result<bool> {
        let has_come = self.shared.stop.swap(false, Ordering::AcqRel);
        if has_come {
            self.aim.drop_all();
            // What was asked for before is not meant any more.
            while self.inbox.try_recv().is_ok() {}
            self.shared.view(|view| {
                view.status.armed = false;
                view.status.stopping = true;
                view.status.mode = Mode::Off;
                view.note(Kind::Note, "stop");
            });
        }
        let is_open = self.shared.view(|view| view.status.stopping);
        if has_come || is_open && link.last_stop.elapsed() >= REPEAT {
            link.send(Command::Disable, Asked::Stop)?;
            link.last_stop = Instant::now();
        }
        Ok(has_come)
    }

    fn serve(&mut self, link: &mut Link, request: Request) -> Result<()> {
        match request {
            Request::Enable => {
                self.aim.drop_all();
                link.send(Command::Enable, Asked::Enable)?;
            }
            Request::Clear => link.send(Command::Clear, Asked::Clear)?,
            Request::Aim(mode) => self.ask_of_axis(mode),
            Request::Record => {
                if self.recording.is_none() {
                    self.recording = Some(Recording::default());
                    self.warn_of_coarse_rows();
                }
            }
            Request::Save => self.save(),
        }
        Ok(())
    }

    fn ask_of_axis(&mut self, mode: Mode) {
        self.shared.view(|view| {
            let wrong = match view.about() {
                Some(about) => mode.check(about).err(),
                None => Some("the board has not said what its limits are".to_owned()),
            };
            if let Some(wrong) = wrong {
                view.note(Kind::Warning, wrong);
            } else if !view.status.armed {
                view.note(
                    Kind::Warning,
                    "turn the axis on before anything is asked of it",
                );
            } else {
                let velocity = view
                    .latest()
                    .map_or(0.0, |s| s.values[Signal::Velocity as usize]);
                self.aim.set(mode, velocity);
                view.status.mode = mode;
            }
        });
    }

    fn warn_of_coarse_rows(&self) {
        if self.form.every > 1 {
            let every = self.form.every;
            let text = format!(
                "a row is recorded every {every} periods, as the line carries no more: what u does in between is not seen, and a diagnosis takes it for held"
            );
            self.shared.view(|view| view.note(Kind::Warning, text));
        }
    }

    /// Set points while the axis is on, and a question now and then.
    fn tick(&mut self, link: &mut Link) -> Result<()> {
        if !self.is_up() {
            return Ok(());
        }
        let waited = link.last_sent.elapsed();
        if waited >= TICK && self.shared.view(|view| view.status.armed) {
            let counts = self.shared.view(|view| {
                let q = view
                    .latest()
                    .map_or(0.0, |s| s.values[Signal::Position as usize]);
                (q / link.count).round() as i32
            });
            let set_point = self.aim.next(waited.as_secs_f64(), counts);
            link.peer.send(Command::SetPoint(set_point))?;
            link.last_sent = Instant::now();
        }
        if link.last_asked.elapsed() >= ASK {
            link.last_asked = Instant::now();
            link.send(Command::Status, Asked::Status)?;
        }
        Ok(())
    }

    /// An axis that nobody watches is turned off.
    fn mind_watchers(&mut self) {
        if self.shared.watchers.load(Ordering::Acquire) > 0 {
            self.watched = Instant::now();
        }
        let armed = self.shared.view(|view| view.status.armed);
        if armed && self.watched.elapsed() > UNWATCHED {
            self.shared.stop.store(true, Ordering::Release);
            let text = "nobody watches any more: the axis is turned off";
            self.shared.view(|view| view.note(Kind::Warning, text));
        }
    }
}
