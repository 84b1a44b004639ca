//! A live view of a board: what its signals do, what faults it has, and what it is asked for.
//!
//! One thread, the session, holds the link; it alone speaks to the board, and what it learns it puts into one [`View`].
//! A page in the browser ([`Server`]) and a terminal ([`screen`]) show that view and ask for things. Stopping is not
//! one of those things: it is a flag of its own, which the thread looks at before everything else that it sends.
//!
//! What happens when something goes away, while the monitor has turned the axis on:
//! - the monitor is closed: it turns the axis off and waits for the board to say so;
//! - the last page is closed, or its browser ends: the axis is turned off a second later;
//! - the monitor is killed, or the cable breaks: no set point comes any more, and the board turns its bridge off after
//!   `limits.command_timeout` periods;
//! - the link comes back: the axis is off, and stays so until somebody turns it on.

mod about;
mod aim;
mod guard;
mod page;
mod recording;
pub mod screen;
mod server;
mod session;
mod stream;
mod view;

pub use about::About;
pub use aim::{Mode, Moves};
pub use server::Server;
pub use session::{Farewell, Options, Request};
pub use view::{Kind, Note, Sample, Status, View};

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::place::Place;
use session::Session;

/// What the session's thread and those who watch it have in common.
struct Shared {
    view: Mutex<View>,
    stop: AtomicBool,
    closing: AtomicBool,
    watchers: AtomicUsize,
}

impl Shared {
    fn new() -> Self {
        Self {
            view: Mutex::new(View::new()),
            stop: AtomicBool::new(false),
            closing: AtomicBool::new(false),
            watchers: AtomicUsize::new(0),
        }
    }

    /// Looks at the view, or changes it.
    fn view<R>(&self, with: impl FnOnce(&mut View) -> R) -> R {
        // A thread that panicked while it wrote has left a view that is old at worst.
        with(&mut self.view.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A way to see and to ask, for each who watches.
#[derive(Clone)]
pub struct Handle {
    shared: Arc<Shared>,
    requests: Sender<Request>,
}

impl Handle {
    /// Stops the axis, before anything else is sent.
    pub fn stop(&self) {
        self.shared.stop.store(true, Ordering::Release);
    }

    /// Asks for something; what became of it shows in the view.
    pub fn ask(&self, request: Request) {
        // Fails only if the monitor is closing, when there is nothing left to ask for.
        let _ = self.requests.send(request);
    }

    /// Looks at the view.
    pub fn view<R>(&self, with: impl FnOnce(&View) -> R) -> R {
        self.shared.view(|view| with(view))
    }

    /// Counts as a watcher until dropped: without any, a monitor that has turned the axis on turns it off.
    pub fn watch(&self) -> Watcher {
        self.shared.watchers.fetch_add(1, Ordering::AcqRel);
        Watcher(Arc::clone(&self.shared))
    }
}

/// Somebody who watches.
pub struct Watcher(Arc<Shared>);

impl Drop for Watcher {
    fn drop(&mut self) {
        self.0.watchers.fetch_sub(1, Ordering::AcqRel);
    }
}

/// Pages are sent an event far more often.
const TOLD: Duration = Duration::from_millis(500);

/// A running monitor.
pub struct Monitor {
    handle: Handle,
    thread: JoinHandle<Farewell>,
}

impl Monitor {
    /// Finds the board and begins to listen to it. Fails if it does not answer; a link that is lost later is looked for
    /// until it is back.
    pub fn start(place: Place, options: Options) -> Result<Self> {
        let (requests, inbox) = channel();
        let shared = Arc::new(Shared::new());
        let session = Session::begin(place, options, Arc::clone(&shared), inbox)?;
        Ok(Self {
            handle: Handle { shared, requests },
            thread: std::thread::spawn(move || session.run()),
        })
    }

    /// A way to see and to ask.
    pub fn handle(&self) -> Handle {
        self.handle.clone()
    }

    /// Turns the axis off, saves what is being recorded, and ends.
    pub fn close(self) -> Result<Farewell> {
        self.handle.shared.closing.store(true, Ordering::Release);
        let ended = self.thread.join();
        let farewell =
            ended.map_err(|_| Error::Internal("the monitor stopped at a panic".to_owned()))?;
        self.handle
            .shared
            .view(|view| view.farewell = Some(farewell));
        // Whoever watches is told how the axis was left, but not waited for if it does not listen.
        let begun = Instant::now();
        while self.handle.shared.watchers.load(Ordering::Acquire) > 0 && begun.elapsed() < TOLD {
            sleep(Duration::from_millis(5));
        }
        Ok(farewell)
    }
}
