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
                view.status.aim = Mode::Off;
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
                view.status.aim = mode;
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;
    use std::sync::mpsc::{Sender, channel};
    use std::sync::{Arc, Mutex};
    use std::time::Duration;

    use bristle_core::link::{Command, Deframer, Packet, decode};

    use crate::emulate::Twin;
    use crate::error::Result;
    use crate::link::{BLOCK, Peer, Wire};
    use crate::monitor::session::link::Link;
    use crate::monitor::session::{Options, Request, Session};
    use crate::monitor::{Mode, Moves, Shared};
    use crate::place::Place;

    /// A board that answers at once, and what it was sent.
    struct Tapped {
        board: Twin,
        sent: Arc<Mutex<Vec<u8>>>,
    }

    impl Wire for Tapped {
        fn is_noisy(&self) -> bool {
            false
        }
        fn set_patience(&mut self, patience: Duration) -> Result<()> {
            self.board.set_patience(patience)
        }
        fn write(&mut self, bytes: &[u8]) -> Result<()> {
            self.sent.lock().unwrap().extend_from_slice(bytes);
            self.board.write(bytes)
        }
        fn read(&mut self, buffer: &mut [u8; BLOCK]) -> Result<usize> {
            self.board.read(buffer)
        }
        fn name(&self) -> &'static str {
            "a tap"
        }
    }

    /// A session that has found its board, a way to ask it for things, and what it has sent since.
    fn session() -> (Session, Link, Sender<Request>, Arc<Mutex<Vec<u8>>>) {
        let (requests, inbox) = channel();
        let options = Options {
            model: None,
            moves: Moves {
                speed: 1.0,
                acceleration: 10.0,
            },
            telemetry: None,
            folder: ".".into(),
        };
        let place = Place::Port("none".to_owned());
        let mut session = Session::new(place, options, Arc::new(Shared::new()), inbox);
        let sent = Arc::new(Mutex::new(Vec::new()));
        let board: Box<dyn Wire + Send> = Box::new(Tapped {
            board: Twin::new().unwrap(),
            sent: Arc::clone(&sent),
        });
        let link = session.link_to(Peer::called(board).unwrap()).unwrap();
        sent.lock().unwrap().clear();
        (session, link, requests, sent)
    }

    fn commands(sent: &Mutex<Vec<u8>>) -> Vec<Command<f32>> {
        let mut deframer = Deframer::new();
        let bytes = std::mem::take(&mut *sent.lock().unwrap());
        let mut command = |byte| {
            let frame = deframer.push(byte)?;
            Some(frame.and_then(decode::<Packet<f32>>).unwrap().command)
        };
        bytes.into_iter().filter_map(&mut command).collect()
    }

    #[test]
    fn a_stop_goes_first_and_what_was_asked_for_before_it_is_dropped() {
        let (mut session, mut link, requests, sent) = session();
        for request in [
            Request::Enable,
            Request::Aim(Mode::Input(1e-9)),
            Request::Clear,
        ] {
            requests.send(request).unwrap();
        }
        session.shared.stop.store(true, Ordering::Release);
        session.turn(&mut link).unwrap();
        let first = commands(&sent);
        assert_eq!(first.first(), Some(&Command::Disable));
        assert!(!first.contains(&Command::Enable) && !first.contains(&Command::Clear));
        // The board has confirmed it, so it is not sent again; what is asked for later is served.
        std::thread::sleep(2 * super::REPEAT);
        requests.send(Request::Enable).unwrap();
        session.turn(&mut link).unwrap();
        let later = commands(&sent);
        assert!(later.contains(&Command::Enable) && !later.contains(&Command::Disable));
    }

    #[test]
    fn set_points_go_out_only_while_this_monitor_has_the_axis_on() {
        let (mut session, mut link, requests, sent) = session();
        let is_set_point = |command: &Command<f32>| matches!(command, Command::SetPoint(_));
        let mut turns = |session: &mut Session| {
            for _ in 0..3 {
                std::thread::sleep(super::TICK);
                session.shared.watchers.store(1, Ordering::Release);
                session.turn(&mut link).unwrap();
            }
            commands(&sent)
        };
        assert!(!turns(&mut session).iter().any(is_set_point));
        requests.send(Request::Enable).unwrap();
        assert!(turns(&mut session).iter().any(is_set_point));
        session.shared.stop.store(true, Ordering::Release);
        assert!(!turns(&mut session).iter().any(is_set_point));
    }
}
