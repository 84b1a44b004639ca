//! The recording on the board: a ring of rows at the full control rate, started by a command or a trigger.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::Number;
use super::signal::{SIGNALS, Selection, Signal, Snapshot};

/// When a recording begins for good.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Trigger<T> {
    /// At the next sample.
    Now,
    /// When a signal passes a level upwards; a position is compared in counts.
    Rises(Signal, T),
    /// When a signal passes a level downwards.
    Falls(Signal, T),
}

/// What to record.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order<T> {
    /// The signals of a row.
    pub selection: Selection,
    /// A row is taken every so many periods; 0 counts as 1.
    pub every: u16,
    /// When to begin.
    pub trigger: Trigger<T>,
    /// Rows to keep from before the trigger.
    pub before: u16,
}

/// How far a recording has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Progress {
    /// Nothing was ordered.
    Empty,
    /// The trigger has not come.
    Waiting,
    /// Rows are being taken.
    Running,
    /// The ring is full, or the recording was stopped.
    Done,
}

/// What there is to read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contents {
    /// How far it has come.
    pub progress: Progress,
    /// The signals of a row.
    pub selection: Selection,
    /// Rows to read.
    pub rows: u32,
    /// The control period of the first row.
    pub first: u32,
    /// Periods from row to row.
    pub every: u16,
}

/// A recording in memory that the caller lends.
pub struct Recorder<'a, T> {
    ring: &'a mut [u32],
    order: Order<T>,
    /// The signals of a row, as their selection is too slow to ask in every period.
    columns: Vec<Signal, SIGNALS>,
    progress: Progress,
    /// Rows that fit, rows that count, and the ring's place of the next one.
    capacity: u32,
    rows: u32,
    next: u32,
    /// Periods until the next row.
    wait: u16,
    /// The control period of the latest row.
    latest: u32,
    /// The trigger's signal at the last row.
    previous: Option<T>,
}

impl<'a, T: Number> Recorder<'a, T> {
    /// An empty recorder.
    pub const fn new(ring: &'a mut [u32]) -> Self {
        Self {
            ring,
            order: Order {
                selection: Selection::of(&[]),
                every: 1,
                trigger: Trigger::Now,
                before: 0,
            },
            columns: Vec::new(),
            progress: Progress::Empty,
            capacity: 0,
            rows: 0,
            next: 0,
            wait: 0,
            latest: 0,
            previous: None,
        }
    }

    /// Drops what was recorded and begins anew; false if no signal is selected.
    pub fn start(&mut self, order: Order<T>) -> bool {
        let width = order.selection.len() as u32;
        self.capacity = (self.ring.len() as u32).checked_div(width).unwrap_or(0);
        if self.capacity == 0 {
            return false;
        }
        self.columns = order.selection.iter().collect();
        self.order = Order {
            every: order.every.max(1),
            ..order
        };
        self.progress = match order.trigger {
            Trigger::Now => Progress::Running,
            Trigger::Rises(..) | Trigger::Falls(..) => Progress::Waiting,
        };
        (self.rows, self.next, self.wait, self.previous) = (0, 0, 0, None);
        true
    }

    /// Ends a recording where it is.
    pub fn stop(&mut self) {
        if self.progress != Progress::Empty {
            self.progress = Progress::Done;
        }
    }

    /// Takes the sample of a period.
    #[inline]
    pub fn sample(&mut self, snapshot: &Snapshot) {
        if matches!(self.progress, Progress::Empty | Progress::Done) {
            return;
        }
        if self.wait > 0 {
            self.wait -= 1;
            return;
        }
        self.wait = self.order.every.saturating_sub(1);
        if self.progress == Progress::Waiting {
            if self.triggered(snapshot) {
                self.progress = Progress::Running;
            } else {
                // Of the rows before the trigger only so many count.
                self.rows = self
                    .rows
                    .min(u32::from(self.order.before).saturating_sub(1));
            }
        }
        if self.progress == Progress::Running || self.order.before > 0 {
            self.put(snapshot);
        }
        if self.progress == Progress::Running && self.rows >= self.capacity {
            self.progress = Progress::Done;
        }
    }

    fn triggered(&mut self, snapshot: &Snapshot) -> bool {
        let (signal, level, rising) = match self.order.trigger {
            Trigger::Now => return true,
            Trigger::Rises(signal, level) => (signal, level, true),
            Trigger::Falls(signal, level) => (signal, level, false),
        };
        let word = snapshot.get(signal);
        let now = match signal {
            Signal::Position => T::from_i32(word as i32),
            _ => T::from_word(word),
        };
        let before = self.previous.replace(now);
        before.is_some_and(|before| {
            if rising {
                before < level && now >= level
            } else {
                before > level && now <= level
            }
        })
    }

    fn put(&mut self, snapshot: &Snapshot) {
        let start = self.next as usize * self.columns.len();
        let row = self.ring.get_mut(start..).unwrap_or_default();
        for (slot, signal) in row.iter_mut().zip(&self.columns) {
            *slot = snapshot.get(*signal);
        }
        self.next = if self.next + 1 >= self.capacity {
            0
        } else {
            self.next + 1
        };
        self.rows = (self.rows + 1).min(self.capacity);
        self.latest = snapshot.period;
    }

    /// How many words it can hold.
    pub const fn words(&self) -> usize {
        self.ring.len()
    }

    /// What there is to read. While the trigger is awaited nothing is.
    pub fn contents(&self) -> Contents {
        let rows = match self.progress {
            Progress::Empty | Progress::Waiting => 0,
            Progress::Running | Progress::Done => self.rows,
        };
        let span = rows.saturating_sub(1) * u32::from(self.order.every);
        Contents {
            progress: self.progress,
            selection: self.order.selection,
            rows,
            first: self.latest.wrapping_sub(span),
            every: self.order.every,
        }
    }

    /// The words from number `first` on, row after row, the oldest row first.
    pub fn read(&self, first: u32) -> impl Iterator<Item = u32> {
        let width = self.order.selection.len() as u32;
        let ring = self.capacity * width;
        let oldest = self.next + self.capacity - self.rows;
        let count = (self.contents().rows * width).saturating_sub(first);
        let start = oldest.wrapping_mul(width).wrapping_add(first);
        (0..count).filter_map(move |k| {
            let at = start.wrapping_add(k).checked_rem(ring)?;
            self.ring.get(at as usize).copied()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Order, Progress, Recorder, Trigger};
    use crate::drive::signal::{Selection, Signal, Snapshot};

    const TWO: Selection = Selection::of(&[Signal::Position, Signal::Input]);

    /// Sample `k` has the input `k` and the position `−k`.
    fn sample(k: u32) -> Snapshot {
        let mut snapshot = Snapshot {
            period: k,
            ..Snapshot::default()
        };
        snapshot.words[Signal::Input as usize] = (k as f32).to_bits();
        snapshot.words[Signal::Position as usize] = k.wrapping_neg();
        snapshot
    }

    /// The words of rows with these samples.
    fn rows(samples: impl Iterator<Item = u32>) -> std::vec::Vec<u32> {
        samples
            .flat_map(|k| [(k as f32).to_bits(), k.wrapping_neg()])
            .collect()
    }

    fn recorded(order: Order<f32>, samples: u32) -> (Recorder<'static, f32>, std::vec::Vec<u32>) {
        let mut recorder = Recorder::new(std::vec![0; 20].leak());
        assert!(recorder.start(order));
        (0..samples).for_each(|k| recorder.sample(&sample(k)));
        let values = recorder.read(0).collect();
        (recorder, values)
    }

    const NOW: Order<f32> = Order {
        selection: TWO,
        every: 1,
        trigger: Trigger::Now,
        before: 0,
    };

    #[test]
    fn a_recording_fills_the_ring_and_ends() {
        let (recorder, values) = recorded(NOW, 50);
        assert_eq!(values, rows(0..10));
        let contents = recorder.contents();
        assert_eq!(
            (contents.progress, contents.rows, contents.first),
            (Progress::Done, 10, 0)
        );
        assert!(recorder.read(18).eq(rows(9..10)));
        assert_eq!(recorder.read(17).count(), 3);
        assert_eq!(recorder.read(20).count(), 0);
    }

    #[test]
    fn every_third_period_is_taken() {
        let (recorder, values) = recorded(Order { every: 3, ..NOW }, 8);
        assert_eq!(values, rows([0, 3, 6].into_iter()));
        assert_eq!(
            (recorder.contents().first, recorder.contents().every),
            (0, 3)
        );
    }

    #[test]
    fn a_trigger_keeps_the_rows_asked_for_before_it() {
        for before in [0, 1, 4, 9] {
            let order = Order {
                trigger: Trigger::Rises(Signal::Input, 31.5),
                before,
                ..NOW
            };
            let (recorder, values) = recorded(order, 32);
            assert!(values.is_empty() && recorder.contents().progress == Progress::Waiting);
            let (recorder, values) = recorded(order, 200);
            let first = 32 - u32::from(before);
            assert_eq!(recorder.contents().first, first, "{before}");
            assert_eq!(values, rows(first..first + 10));
        }
        let falls = Order {
            trigger: Trigger::Falls(Signal::Position, -7.0),
            ..NOW
        };
        assert_eq!(recorded(falls, 100).0.contents().first, 7);
    }

    #[test]
    fn stopping_keeps_what_there_is_and_nothing_selected_is_refused() {
        let (mut recorder, _) = recorded(NOW, 3);
        recorder.stop();
        recorder.sample(&sample(3));
        assert_eq!(recorder.read(0).count(), 6);
        let none = Order {
            selection: Selection::default(),
            ..NOW
        };
        assert!(!recorder.start(none));
    }
}
