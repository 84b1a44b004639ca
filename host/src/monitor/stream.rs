//! What a page is sent, again and again.

use std::io::{self, Write};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bristle_core::drive::signal::SIGNALS;
use serde::Serialize;

use super::view::{Level, Sample};
use super::{About, Handle, Note, Status, View};

/// From event to event: as often as an eye can follow.
const EVERY: Duration = Duration::from_millis(50);

/// What has happened since the last event.
#[derive(Serialize)]
struct Now<'a> {
    /// For how long nothing was heard of the board, s.
    silence: f64,
    status: &'a Status,
    coulomb: Option<Level>,
    notes: Vec<&'a Note>,
    /// Numbers of the control periods, and the values of each signal at them.
    periods: Vec<u32>,
    values: [Vec<f32>; SIGNALS],
    /// Samples that this page was too slow for.
    skipped: u64,
}

/// Where a page stands.
struct Cursor {
    sample: u64,
    note: u64,
    about: Option<Arc<About>>,
}

/// Sends events until the page goes away or the monitor is closed.
pub(super) fn send(handle: &Handle, out: &mut dyn Write) -> io::Result<()> {
    let _watcher = handle.watch();
    let mut cursor = Cursor {
        // The past minute would only delay the present.
        sample: handle.view(View::end),
        note: 0,
        about: None,
    };
    // A page that loses the connection is to come back soon.
    out.write_all(b"retry: 300\n\n")?;
    let mut due = Instant::now();
    loop {
        let (text, farewell) = handle.view(|view| (events(view, &mut cursor), view.farewell));
        out.write_all(text?.as_bytes())?;
        if let Some(farewell) = farewell {
            out.write_all(event("closed", &farewell)?.as_bytes())?;
            return out.flush();
        }
        out.flush()?;
        due = (due + EVERY).max(Instant::now());
        std::thread::sleep(due - Instant::now());
    }
}

fn events(view: &View, cursor: &mut Cursor) -> io::Result<String> {
    let mut text = String::new();
    let about = view.about();
    if cursor.about.as_ref() != about {
        cursor.about = about.cloned();
        text += &event("about", &about.map(Arc::as_ref))?;
    }
    let (samples, skipped) = view.samples_from(&mut cursor.sample);
    let samples: Vec<&Sample> = samples.collect();
    let now = Now {
        silence: view.silence().as_secs_f64(),
        status: &view.status,
        coulomb: view.coulomb(),
        notes: view.notes_from(&mut cursor.note).collect(),
        periods: samples.iter().map(|sample| sample.period).collect(),
        // The board computes in single precision; the position is exact to a part in 10⁷ here and whole in recordings.
        values: std::array::from_fn(|k| samples.iter().map(|s| s.values[k] as f32).collect()),
        skipped,
    };
    Ok(text + &event("now", &now)?)
}

fn event(name: &str, data: &impl Serialize) -> io::Result<String> {
    // JSON has no line breaks outside of strings, where they are escaped.
    let data = serde_json::to_string(data)?;
    Ok(format!("event: {name}\ndata: {data}\n\n"))
}
