//! What there is to see of a board at a moment, and what there was in the last minute.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bristle_core::drive::State;
use bristle_core::drive::signal::{SIGNALS, Signal};
use bristle_core::link::Counters;
use serde::Serialize;

use super::{About, Farewell, Mode};

/// A telemetry frame, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The number of the control period.
    pub period: u32,
    /// In the order of [`Signal::ALL`].
    pub values: [f64; SIGNALS],
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Note {
    /// Since the monitor was started, s.
    pub t: f64,
    /// Of what kind.
    pub kind: Kind,
    /// In words.
    pub text: String,
}

/// Kinds of notes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Something that somebody asked for.
    Note,
    /// Something that was refused or went wrong.
    Warning,
    /// A fault of the board.
    Fault,
    /// The link was lost or came back.
    Link,
    /// A recording was written.
    Saved,
}

/// How the board stands.
#[derive(Clone, Debug, Serialize)]
pub struct Status {
    /// Whether the board is heard.
    pub link: bool,
    /// Why not.
    pub why: String,
    /// Where its drive stands; none before it has said so.
    pub state: Option<State>,
    /// The ids of its latched faults.
    pub faults: Vec<&'static str>,
    /// Whether this monitor has turned the axis on.
    pub armed: bool,
    /// Whether a stop was sent that the board has not confirmed.
    pub stopping: bool,
    /// What the axis is asked for.
    pub aim: Mode,
    /// What was lost.
    pub losses: Losses,
    /// Rows recorded so far, while a recording is made.
    pub recording: Option<usize>,
}

/// What was lost, since the monitor was started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Losses {
    /// Telemetry frames that found the line busy.
    pub telemetry: u32,
    /// Frames from the board that came damaged.
    pub damaged: u32,
    /// Commands that the board missed, could not read or had no time for, since it booted.
    pub commands: u32,
}

impl Losses {
    pub(super) fn count_commands(&mut self, counters: &Counters) {
        let lost = [counters.damaged, counters.missing, counters.dropped];
        self.commands = lost.into_iter().fold(0, u32::saturating_add);
    }
}

/// Samples that are kept: a minute at 1 kHz.
const KEPT: usize = 60_000;
/// Notes that are kept.
const NOTES: usize = 200;
/// What a level's spread is told over.
const LEVEL_OVER: f64 = 5.0;

/// A level that the board learns, over the last seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Level {
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation over that time: how much it still wanders, and not how far it is from the truth.
    pub spread: f64,
    /// That time, s.
    pub over: f64,
}

/// Everything that is shown.
pub struct View {
    started: Instant,
    heard: Instant,
    samples: VecDeque<Sample>,
    first_sample: u64,
    notes: VecDeque<Note>,
    first_note: u64,
    about: Option<Arc<About>>,
    /// How the board stands.
    pub status: Status,
    /// How the axis was left, once the monitor is closed.
    pub farewell: Option<Farewell>,
}

impl View {
    pub(super) fn new() -> Self {
        let now = Instant::now();
        Self {
            started: now,
            heard: now,
            samples: VecDeque::new(),
            first_sample: 0,
            notes: VecDeque::new(),
            first_note: 0,
            about: None,
            status: Status {
                link: false,
                why: String::new(),
                state: None,
                faults: Vec::new(),
                armed: false,
                stopping: false,
                aim: Mode::Off,
                losses: Losses::default(),
                recording: None,
            },
            farewell: None,
        }
    }

    pub(super) fn set_about(&mut self, about: About) {
        if self.about.as_deref() != Some(&about) {
            self.about = Some(Arc::new(about));
        }
    }

    /// The board that was heard last. It is replaced when another answers, or one with other parameters.
    pub const fn about(&self) -> Option<&Arc<About>> {
        self.about.as_ref()
    }

    pub(super) fn hear(&mut self) {
        self.heard = Instant::now();
    }

    /// For how long nothing was heard of the board.
    pub fn silence(&self) -> Duration {
        self.heard.elapsed()
    }

    pub(super) fn push(&mut self, sample: Sample) {
        if self.samples.len() == KEPT {
            self.samples.pop_front();
            self.first_sample += 1;
        }
        self.samples.push_back(sample);
    }

    pub(super) fn note(&mut self, kind: Kind, text: impl Into<String>) {
        if self.notes.len() == NOTES {
            self.notes.pop_front();
            self.first_note += 1;
        }
        self.notes.push_back(Note {
            t: self.started.elapsed().as_secs_f64(),
            kind,
            text: text.into(),
        });
    }

    /// The samples from number `next` on, counted from the start, and how many of those were forgotten. Leaves in `next`
    /// the number of the first one to come.
    pub fn samples_from<'a>(
        &'a self,
        next: &mut u64,
    ) -> (impl Iterator<Item = &'a Sample> + use<'a>, u64) {
        let forgotten = self.first_sample.saturating_sub(*next);
        let from = next.saturating_sub(self.first_sample) as usize;
        *next = self.end();
        (self.samples.iter().skip(from), forgotten)
    }

    /// The number of the sample to come.
    pub fn end(&self) -> u64 {
        self.first_sample + self.samples.len() as u64
    }

    /// The notes from number `next` on, likewise.
    pub fn notes_from<'a>(&'a self, next: &mut u64) -> impl Iterator<Item = &'a Note> + use<'a> {
        let from = next.saturating_sub(self.first_note) as usize;
        *next = self.first_note + self.notes.len() as u64;
        self.notes.iter().skip(from)
    }

    /// The last sample.
    pub fn latest(&self) -> Option<&Sample> {
        self.samples.back()
    }

    /// The Coulomb level over the last seconds; none before there are two samples of one.
    pub fn coulomb(&self) -> Option<Level> {
        let about = self.about.as_ref()?;
        let kept = (LEVEL_OVER * about.rate / f64::from(about.every.max(1))) as usize;
        let last = self.samples.iter().rev().take(kept.max(2));
        let (mut n, mut mean, mut squares) = (0.0, 0.0, 0.0);
        // Welford (1962): the spread may be small against the level.
        for sample in last {
            let x = sample.values[Signal::Coulomb as usize];
            n += 1.0;
            let off = x - mean;
            mean += off / n;
            squares += off * (x - mean);
        }
        (n >= 2.0).then(|| Level {
            mean,
            spread: (squares / (n - 1.0)).sqrt(),
            over: n * f64::from(about.every) / about.rate,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{KEPT, Kind, NOTES, Sample, View};

    fn sample(period: u32) -> Sample {
        Sample {
            period,
            values: [0.0; 8],
        }
    }

    #[test]
    fn every_sample_is_seen_once_and_what_is_forgotten_is_counted() {
        let mut view = View::new();
        let mut next = 0;
        (0..3).for_each(|k| view.push(sample(k)));
        let (seen, forgotten) = view.samples_from(&mut next);
        assert!(seen.map(|s| s.period).eq(0..3) && forgotten == 0);
        assert_eq!(view.samples_from(&mut next).0.count(), 0);
        let all = KEPT as u32 + 10;
        (3..all).for_each(|k| view.push(sample(k)));
        let (seen, forgotten) = view.samples_from(&mut next);
        // Ten were pushed out of the full view, three of which had been seen.
        assert!(seen.map(|s| s.period).eq(10..all));
        assert_eq!(forgotten, 7);
        assert_eq!(next, u64::from(all));
    }

    #[test]
    fn notes_are_seen_once() {
        let mut view = View::new();
        let mut next = 0;
        (0..NOTES + 5).for_each(|k| view.note(Kind::Note, k.to_string()));
        assert_eq!(view.notes_from(&mut next).count(), NOTES);
        view.note(Kind::Fault, "more");
        let texts: Vec<&str> = view
            .notes_from(&mut next)
            .map(|n| n.text.as_str())
            .collect();
        assert_eq!(texts, ["more"]);
    }
}
