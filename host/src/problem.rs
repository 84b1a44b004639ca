//! The weak form of one axis over all its recordings: rows, and the columns of every term.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use crate::effects::{Effect, Inner, Path, Survey};
use crate::motion::Motion;
use crate::recording::Recording;
use crate::weak::{Balance, Part, Track, Windows};

/// One row: a window of one track.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Index of the track.
    pub track: usize,
    /// Node at the window's centre.
    pub centre: usize,
    /// Train or held out.
    pub part: Part,
}

/// The side of the equation of motion whose error a fit minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// `∫q φ̈`: right where `u` is imposed and the motion answers, disturbances included.
    Acceleration,
    /// `k·∫u φ`: right where the motion is imposed, by a stiff position loop or by another machine, and `u` answers.
    Force,
}

/// A column of functionals, one for each row.
pub type Column = Rc<Vec<f64>>;

/// Key of a cached column set: what it is, and the bits of all that it depends on.
type Key = (&'static str, Vec<u64>);

/// Tracks, windows and rows, with the columns computed so far.
pub struct Problem {
    /// One track for each recording.
    pub tracks: Vec<Track>,
    /// The windows of each track.
    pub windows: Vec<Windows>,
    /// All rows, track by track in time order.
    pub rows: Vec<Row>,
    /// Rotary or linear.
    pub motion: Motion,
    /// The side whose error is minimised.
    pub response: Response,
    /// `∫q φ̈` of every row.
    pub acceleration: Column,
    cache: RefCell<HashMap<Key, Vec<Column>>>,
}

impl Problem {
    /// Lays windows of `reach[track]` samples over prepared tracks.
    pub fn new(tracks: Vec<Track>, reach: &[usize], motion: Motion, response: Response) -> Self {
        let windows: Vec<Windows> = tracks
            .iter()
            .zip(reach)
            .map(|(t, &r)| Windows::new(t, r))
            .collect();
        let rows = windows
            .iter()
            .enumerate()
            .flat_map(|(track, w)| {
                w.centres
                    .iter()
                    .zip(&w.parts)
                    .map(move |(&centre, &part)| Row {
                        track,
                        centre,
                        part,
                    })
            })
            .collect();
        let mut problem = Self {
            tracks,
            windows,
            rows,
            motion,
            response,
            acceleration: Rc::default(),
            cache: RefCell::default(),
        };
        problem.acceleration = Rc::new(problem.stack(|t, w| w.acceleration(&t.q)));
        problem
    }

    /// Prepares the tracks of all recordings.
    pub fn tracks(
        recordings: &[Recording],
        motion: Motion,
        balance: Option<Balance>,
    ) -> Vec<Track> {
        let track = |r| Track::new(r, motion, balance);
        recordings.iter().map(track).collect()
    }

    /// One functional of every track, stacked in the order of the rows.
    pub fn stack(&self, mut functional: impl FnMut(&Track, &Windows) -> Vec<f64>) -> Vec<f64> {
        self.tracks
            .iter()
            .zip(&self.windows)
            .flat_map(|(t, w)| functional(t, w))
            .collect()
    }

    /// Functional of a signal given in every cell of a track.
    pub fn cells(&self, signal: impl Fn(&Track, usize) -> f64) -> Vec<f64> {
        self.stack(|t, w| {
            w.hold(
                t,
                &(0..t.cells.len()).map(|k| signal(t, k)).collect::<Vec<_>>(),
            )
        })
    }

    /// `∫u φ` of what a path makes of the input.
    pub fn input(&self, path: &Path) -> Column {
        self.cached(("input", path.bits().to_vec()), || {
            vec![self.stack(|t, w| w.hold(t, &t.input(path)))]
        })
        .remove(0)
    }

    /// `∫sgn(v) φ`.
    pub fn coulomb(&self) -> Column {
        self.cached(("coulomb", Vec::new()), || {
            vec![self.cells(|t, k| t.cells[k].s)]
        })
        .remove(0)
    }

    /// `−∫q φ̇`.
    pub fn velocity(&self) -> Column {
        self.cached(("velocity", Vec::new()), || {
            vec![self.stack(|t, w| w.velocity(&t.q))]
        })
        .remove(0)
    }

    /// The columns of an effect's torque for values of its inner parameters, under the input that a path passes.
    pub fn effect(&self, effect: &'static dyn Effect, inner: Inner, path: &Path) -> Vec<Column> {
        if effect.width() == 0 {
            return Vec::new();
        }
        let driven = effect.driven();
        let mut key = inner.map(f64::to_bits).to_vec();
        if driven {
            key.extend(path.bits());
        }
        self.cached((effect.id(), key), || {
            let mut columns = vec![Vec::with_capacity(self.rows.len()); effect.width()];
            let mut basis = vec![0.0; effect.width()];
            for (track, windows) in self.tracks.iter().zip(&self.windows) {
                let input = if driven {
                    track.input(path)
                } else {
                    Vec::new()
                };
                let mut signals = vec![Vec::with_capacity(track.cells.len()); effect.width()];
                for (k, &cell) in track.cells.iter().enumerate() {
                    let at = input.get(k).map_or(cell, |&u| track.driven(k, u));
                    effect.basis(inner, at, &mut basis);
                    signals.iter_mut().zip(&basis).for_each(|(s, b)| s.push(*b));
                }
                for (column, signal) in columns.iter_mut().zip(&signals) {
                    column.extend(windows.hold(track, signal));
                }
            }
            columns
        })
    }

    /// Mean acceleration and mean velocity of the error in the measured position, for each unit coefficient of an effect.
    pub fn errors(&self, effect: &'static dyn Effect) -> Vec<[Column; 2]> {
        let columns = self.cached((effect.id(), Vec::new()), || {
            let of = |j: usize, functional: fn(&Windows, &[f64]) -> Vec<f64>| {
                self.stack(|track, windows| {
                    let mut out = vec![(0.0, 0.0); effect.width()];
                    let error = |&q: &f64| {
                        effect.error(q, &mut out);
                        out[j].0
                    };
                    functional(windows, &track.q.iter().map(error).collect::<Vec<f64>>())
                })
            };
            (0..effect.width())
                .flat_map(|j| [of(j, Windows::acceleration), of(j, Windows::velocity)])
                .collect()
        });
        columns
            .chunks(2)
            .map(|pair| [pair[0].clone(), pair[1].clone()])
            .collect()
    }

    /// The columns of a group of generic functions.
    pub fn generic(&self, group: usize, compute: impl FnOnce() -> Vec<Vec<f64>>) -> Vec<Column> {
        self.cached(("generic", vec![group as u64]), compute)
    }

    /// What all recordings together cover.
    ///
    /// # Panics
    /// Without a single recording.
    pub fn survey(&self) -> Survey {
        let surveys = self
            .tracks
            .iter()
            .zip(&self.windows)
            .map(|(t, w)| t.survey(self.motion, w.reach as f64 * t.period));
        surveys
            .reduce(|a, b| Survey {
                motion: a.motion,
                period: a.period.min(b.period),
                duration: a.duration.max(b.duration),
                half_width: a.half_width.max(b.half_width),
                top_speed: a.top_speed.max(b.top_speed),
                slow: a.slow.min(b.slow),
                travel: (a.travel.0.min(b.travel.0), a.travel.1.max(b.travel.1)),
                input: (a.input.0.max(b.input.0), a.input.1.max(b.input.1)),
            })
            .expect("at least one recording")
    }

    /// Time at the centre of a row, s.
    pub fn time(&self, row: Row) -> f64 {
        let track = &self.tracks[row.track];
        track.start + row.centre as f64 * track.period
    }

    /// Number of rows in a part.
    pub fn count(&self, part: Part) -> usize {
        self.rows.iter().filter(|r| r.part == part).count()
    }

    /// Bounded: a scan or a refinement that fills the cache starts it anew.
    fn cached(&self, key: Key, compute: impl FnOnce() -> Vec<Vec<f64>>) -> Vec<Column> {
        const MOST: usize = 2000;
        if let Some(columns) = self.cache.borrow().get(&key) {
            return columns.clone();
        }
        let columns: Vec<Column> = compute().into_iter().map(Rc::new).collect();
        let mut cache = self.cache.borrow_mut();
        if cache.len() >= MOST {
            cache.clear();
        }
        cache.insert(key, columns.clone());
        columns
    }
}
