//! The weak form of one axis over all its recordings: rows, and the columns of every term.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use crate::effects::{Effect, Inner, Point, Survey};
use crate::model::Model;
use crate::motion::Motion;
use crate::recording::Recording;
use crate::weak::{Balance, Bent, Part, Track, Windows};

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

/// Bits of what the bristles of a model depend on; zeros without bristles.
type Bristled = [u64; 5];

/// Key of a cached column set: effect id, the bits of its inner parameters, and those of the bristles.
type Key = (&'static str, [u64; 2], Bristled);

/// The direction in which friction acts in every cell of every track: that of sliding, or that of bristles.
#[derive(Clone, Default)]
pub struct Direction {
    bristled: Bristled,
    bent: Option<Rc<Vec<Vec<Bent>>>>,
}

impl Direction {
    /// The cell of a track as effects see it.
    fn point(&self, track: usize, cell: usize, at: Point) -> Point {
        match &self.bent {
            None => at,
            Some(bent) => Point {
                s: bent[track][cell].direction,
                bending: bent[track][cell].rate,
                ..at
            },
        }
    }
}

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
    /// The last direction asked for: that of one set of bristles serves all columns of a model.
    direction: RefCell<Direction>,
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
            direction: RefCell::default(),
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

    /// `∫u(t − delay) φ`.
    pub fn input(&self, delay: f64) -> Column {
        self.cached(("input", [delay.to_bits(), 0], [0; 5]), || {
            vec![self.stack(|t, w| w.hold(t, &t.input(delay)))]
        })
        .remove(0)
    }

    /// The direction in which a model's friction acts.
    pub fn direction(&self, model: &Model) -> Direction {
        let Some(law) = model.bristles() else {
            return Direction::default();
        };
        let bristled = model.bristle_key();
        if self.direction.borrow().bristled == bristled {
            return self.direction.borrow().clone();
        }
        let bent = self.tracks.iter().map(|t| t.bend(law.as_ref())).collect();
        let direction = Direction {
            bristled,
            bent: Some(Rc::new(bent)),
        };
        self.direction.replace(direction.clone());
        direction
    }

    /// `∫s φ`, `s` being the direction in which friction acts: `sgn v` without bristles.
    pub fn coulomb(&self, direction: &Direction) -> Column {
        self.cached(("coulomb", [0; 2], direction.bristled), || {
            vec![self.signals(direction, |_, at| at.s)]
        })
        .remove(0)
    }

    /// `−∫q φ̇`.
    pub fn velocity(&self) -> Column {
        self.cached(("velocity", [0; 2], [0; 5]), || {
            vec![self.stack(|t, w| w.velocity(&t.q))]
        })
        .remove(0)
    }

    /// The columns of an effect for values of its inner parameters.
    pub fn effect(
        &self,
        effect: &'static dyn Effect,
        inner: Inner,
        direction: &Direction,
    ) -> Vec<Column> {
        if effect.width() == 0 {
            return Vec::new();
        }
        let key = (effect.id(), inner.map(f64::to_bits), direction.bristled);
        self.cached(key, || {
            let mut basis = vec![0.0; effect.width()];
            (0..effect.width())
                .map(|k| {
                    self.signals(direction, |_, at| {
                        effect.basis(inner, at, &mut basis);
                        basis[k]
                    })
                })
                .collect()
        })
    }

    /// Functional of a signal of the cells as effects see them.
    fn signals(
        &self,
        direction: &Direction,
        mut signal: impl FnMut(&Track, Point) -> f64,
    ) -> Vec<f64> {
        let mut tracks = 0..;
        self.stack(|track, windows| {
            let index = tracks.next().unwrap_or_default();
            let cells = track.cells.iter().enumerate();
            let signal: Vec<f64> = cells
                .map(|(k, &at)| signal(track, direction.point(index, k, at)))
                .collect();
            windows.hold(track, &signal)
        })
    }

    /// The columns of a group of generic functions.
    pub fn generic(&self, group: usize, compute: impl FnOnce() -> Vec<Vec<f64>>) -> Vec<Column> {
        self.cached(("generic", [group as u64, 0], [0; 5]), compute)
    }

    /// What all recordings together cover, for a model whose Coulomb level is known so far.
    ///
    /// # Panics
    /// Without a single recording.
    pub fn survey(&self, model: &Model) -> Survey {
        let surveys = self
            .tracks
            .iter()
            .zip(&self.windows)
            .map(|(t, w)| t.survey(self.motion, w.reach as f64 * t.period));
        let all = surveys
            .reduce(|a, b| Survey {
                motion: a.motion,
                period: a.period.min(b.period),
                half_width: a.half_width.max(b.half_width),
                top_speed: a.top_speed.max(b.top_speed),
                slow: a.slow.min(b.slow),
                travel: (a.travel.0.min(b.travel.0), a.travel.1.max(b.travel.1)),
                position_noise: a.position_noise.max(b.position_noise),
                coulomb: a.coulomb,
            })
            .expect("at least one recording");
        Survey {
            coulomb: model.coulomb.value.unwrap_or_default(),
            ..all
        }
    }

    /// Time at the centre of a row, s.
    pub fn time(&self, row: Row) -> f64 {
        let track = &self.tracks[row.track];
        track.start + row.centre as f64 * track.period
    }

    /// Half-width of the widest windows, s.
    pub fn half_width(&self) -> f64 {
        let tracks = self.tracks.iter().zip(&self.windows);
        tracks.fold(0.0, |widest, (t, w)| widest.max(w.reach as f64 * t.period))
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
