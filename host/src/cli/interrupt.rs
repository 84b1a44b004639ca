//! What ends a program that goes on by itself: signals and keys.

use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use crossterm::event::{self, Event, KeyEventKind};
use crossterm::terminal;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::error::{Error, Result};

/// Set by the signals that end a program.
pub(super) fn signals() -> Result<Arc<AtomicBool>> {
    let ended = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        let registered = signal_hook::flag::register(signal, Arc::clone(&ended));
        registered.map_err(|e| Error::Internal(format!("no handler for signal {signal}: {e}")))?;
    }
    Ok(ended)
}

/// The keys of the terminal, one by one, until dropped; none where the input is no terminal.
pub(super) struct Keys {
    is_open: bool,
}

impl Keys {
    pub fn listen() -> Self {
        let is_open = std::io::stdin().is_terminal() && terminal::enable_raw_mode().is_ok();
        Self { is_open }
    }

    /// Whether any key was pressed since the last time. A terminal that fails cannot stop anything, and counts as a key.
    pub fn pressed(&self) -> bool {
        let mut any = false;
        while self.is_open && !any {
            match event::poll(Duration::ZERO)
                .and_then(|is_there| is_there.then(event::read).transpose())
            {
                Ok(None) => break,
                Ok(Some(Event::Key(key))) => any = key.kind != KeyEventKind::Release,
                Ok(Some(_)) => {}
                Err(_) => any = true,
            }
        }
        any
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        if self.is_open {
            // Nothing more can be done about a terminal that refuses.
            let _ = terminal::disable_raw_mode();
        }
    }
}
