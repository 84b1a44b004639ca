//! The weak form of one axis over all its recordings: rows, and the columns of every term.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use crate::effects::{self, Carried, Effect, Gap, Inner, Path, Point, Survey, Wave};
use crate::model::Model;
use crate::motion::Motion;
use crate::phasor;
use crate::recording::Recording;
use crate::slack::{Forces, Slack};
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
pub type Column = Arc<Vec<f64>>;

/// Bits of what the bristles of a model depend on; zeros without bristles.
type Bristled = [u64; 5];

/// Key of a cached column set: what it is, and the bits of all that it depends on.
type Key = (&'static str, Vec<u64>);

/// The direction in which friction acts in every cell of every track: that of sliding, or that of bristles.
#[derive(Clone, Default)]
pub struct Direction {
    bristled: Bristled,
    bent: Option<Arc<Vec<Vec<Bent>>>>,
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

/// Signals in the cells, by track.
type Signals = Arc<Vec<Vec<Vec<f64>>>>;

/// What the columns of an effect, in one of its forms, are cached by.
fn key(effect: &'static dyn Effect, inner: Inner, direction: &Direction, path: &Path) -> Key {
    let mut key = inner.map(f64::to_bits).to_vec();
    key.push(effects::form(effect) as u64);
    key.extend(direction.bristled);
    key.extend(if effect.driven() {
        path.bits()
    } else {
        path.spring().bits()
    });
    (effect.id(), key)
}

/// What a mutex guards; entries are written whole, so a panic elsewhere leaves none half-made.
fn hold<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What was asked for lately, the last first.
struct Recent<const MOST: usize, K, V>(Mutex<Vec<(K, V)>>);

impl<const MOST: usize, K: PartialEq, V: Clone> Recent<MOST, K, V> {
    /// What was asked for under a key, or what it is computed to be now.
    fn recall(&self, key: K, compute: impl FnOnce() -> V) -> V {
        let mut kept = hold(&self.0);
        if let Some(at) = kept.iter().position(|(k, _)| *k == key) {
            kept[..=at].rotate_right(1);
            return kept[0].1.clone();
        }
        drop(kept);
        let value = compute();
        let mut kept = hold(&self.0);
        kept.truncate(MOST - 1);
        kept.insert(0, (key, value.clone()));
        value
    }
}

/// Tracks, windows and rows, with the columns computed so far.
pub struct Problem {
    /// One track for each recording.
    pub tracks: Arc<[Track]>,
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
    cache: Mutex<Cache>,
    /// What columns under one input, or behind many springs, are made of, the last asked for first.
    recent: Recent<MOST_SIGNALS, Key, Signals>,
    /// How bristles bend, the last asked for first: those of one model serve all its columns, and while it is moved in what does
    /// not bend them, all those.
    bent: Recent<MOST_BENT, Bristled, Arc<Vec<Vec<Bent>>>>,
    survey: OnceLock<Survey>,
    training: OnceLock<Box<Problem>>,
}

impl Problem {
    /// Lays windows of `reach[track]` samples over prepared tracks.
    pub fn new(tracks: Vec<Track>, reach: &[usize], motion: Motion, response: Response) -> Self {
        let windows = tracks.iter().zip(reach);
        let windows = windows.map(|(t, &r)| Windows::new(t, r)).collect();
        Self::on(tracks.into(), windows, motion, response)
    }

    fn on(tracks: Arc<[Track]>, windows: Vec<Windows>, motion: Motion, response: Response) -> Self {
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
            acceleration: Arc::default(),
            cache: Mutex::default(),
            recent: Recent(Mutex::default()),
            bent: Recent(Mutex::default()),
            survey: OnceLock::new(),
            training: OnceLock::new(),
        };
        problem.acceleration = Arc::new(problem.stack(|t, w| w.acceleration(&t.q)));
        problem
    }

    /// The same rows with functionals over those of the training part alone, and zeros in the held-out part: what a fit asks for,
    /// in less time. The side whose error is minimised is the one at the first call.
    pub fn training(&self) -> &Self {
        if self.windows.iter().all(Windows::of_training_alone) {
            return self;
        }
        self.training.get_or_init(|| {
            let windows = self.windows.iter().map(Windows::training).collect();
            let tracks = self.tracks.clone();
            Box::new(Self::on(tracks, windows, self.motion, self.response))
        })
    }

    /// The share of the recordings that is for training.
    pub fn training_share(&self) -> f64 {
        let shares = self.tracks.iter().map(Track::training_share);
        shares.fold(0.0, f64::max)
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
            let cells: Vec<f64> = (0..w.cells(t)).map(|k| signal(t, k)).collect();
            w.hold(t, &cells)
        })
    }

    /// `∫u φ` of what a path makes of the input.
    pub fn input(&self, path: &Path) -> Column {
        // What a gap keeps back is a column of its own.
        let path = Path {
            gap: Gap::default(),
            ..*path
        };
        self.cached(("input", path.bits().to_vec()), || {
            let mut inputs = if path.swings() {
                self.inputs(&path).to_vec()
            } else {
                self.inputs_of(&path)
            };
            for (track, signals) in self.tracks.iter().zip(&mut inputs) {
                signals.iter_mut().for_each(|signal| track.slide(signal));
            }
            self.functionals(&inputs, &path)
        })
        .remove(0)
    }

    /// The direction in which a model's friction acts.
    pub fn direction(&self, model: &Model) -> Direction {
        let Some(law) = model.bristles() else {
            return Direction::default();
        };
        let bristled = model.bristle_key();
        let bend = || {
            let tracks = self.tracks.iter().zip(&self.windows);
            let bent = tracks.map(|(t, w)| t.bend_of(w.cells(t), law.as_ref()));
            Arc::new(bent.collect())
        };
        Direction {
            bristled,
            bent: Some(self.bent.recall(bristled, bend)),
        }
    }

    /// `∫s φ`, `s` being the direction in which friction acts: `sgn v` without bristles. As all torques, it passes the
    /// spring of the path, if there is one.
    pub fn coulomb(&self, direction: &Direction, path: &Path) -> Column {
        let mut key = direction.bristled.to_vec();
        key.extend(path.spring().bits());
        self.cached(("coulomb", key), || {
            let before = ("coulomb", direction.bristled.to_vec());
            self.signals(before, direction, (path, false), 1, |points, signals| {
                signals[0].extend(points.iter().map(|at| at.s));
            })
        })
        .remove(0)
    }

    /// `−∫q φ̇`, or `∫v φ` of what the spring of the path passes, if there is one.
    pub fn velocity(&self, path: &Path) -> Column {
        let key = path.spring().bits().to_vec();
        self.cached(("velocity", key), || {
            vec![self.stack(|t, w| {
                if !path.swings() {
                    return w.velocity(&t.q);
                }
                let steps =
                    t.q.windows(2)
                        .take(w.cells(t))
                        .map(|pair| pair[1] - pair[0]);
                let speeds: Vec<f64> = steps.map(|step| step / t.period).collect();
                w.hold_through(t, &speeds, path)
            })]
        })
        .remove(0)
    }

    /// `∫y φ`, `y` being what the gap on a path keeps from the load.
    pub fn slack(&self, path: &Path, forces: &Forces) -> Column {
        let mut key = path.bits().to_vec();
        key.extend(forces.bits());
        self.cached(("slack", key), || {
            let inputs = self.inputs(path);
            let mut inputs = inputs.iter().flatten();
            let missing = |track: &Track, windows: &Windows| {
                let input = inputs.next().map_or(&[][..], Vec::as_slice);
                let missing = Slack::new(track, input, forces, path).missing;
                windows.apply(windows.hold_weights(), &missing)
            };
            vec![self.stack(missing)]
        })
        .remove(0)
    }

    /// The columns of an effect's torque for values of its inner parameters, with friction in a direction and under the
    /// input that a path passes.
    pub fn effect(
        &self,
        effect: &'static dyn Effect,
        inner: Inner,
        direction: &Direction,
        path: &Path,
    ) -> Vec<Column> {
        if effect.width() == 0 {
            return Vec::new();
        }
        self.cached(key(effect, inner, direction, path), || {
            let bases = |points: &[Point], signals: &mut [Vec<f64>]| {
                effect.bases(inner, points, signals);
            };
            let before = key(effect, inner, direction, &path.of_input());
            let way = (path, effect.driven());
            self.signals(before, direction, way, effect.width(), bases)
        })
    }

    /// Has the columns of an effect that is a wave ready for many values of its inner parameters.
    pub fn waves(
        &self,
        effect: &'static dyn Effect,
        inners: &[Inner],
        direction: &Direction,
        path: &Path,
    ) {
        let key = |inner: Inner| key(effect, inner, direction, path);
        let most = self.most_kept();
        let known = |inner: Inner| hold(&self.cache).get(&key(inner), most).is_some();
        let waves = inners.iter().filter(|inner| !known(**inner));
        let waves = waves.filter_map(|&inner| Some((inner, effect.wave(inner)?)));
        let (inners, waves): (Vec<Inner>, Vec<Wave>) = waves.unzip();
        let Some(first) = waves.first() else { return };
        let numbers: Vec<f64> = waves.iter().map(|wave| wave.number).collect();
        let mut columns = vec![[Vec::new(), Vec::new()]; numbers.len()];
        for (index, (track, windows)) in self.tracks.iter().zip(&self.windows).enumerate() {
            let cells = self.points(index, direction, (path, effect.driven()));
            let (x, mut carrier): (Vec<f64>, Vec<f64>) = cells
                .map(|at| ((first.coordinate)(&at), (first.carrier)(&at)))
                .unzip();
            track.slide(&mut carrier);
            let carried = |wave: &[f64]| {
                let cells: Vec<f64> = wave.iter().zip(&carrier).map(|(w, c)| c * w).collect();
                windows.hold_sliding(&cells, track.period, path)
            };
            let pairs = phasor::each(&numbers, &x, |sin, cos| [carried(sin), carried(cos)]);
            for (columns, pair) in columns.iter_mut().zip(pairs) {
                columns.iter_mut().zip(pair).for_each(|(c, p)| c.extend(p));
            }
        }
        for (inner, columns) in inners.into_iter().zip(columns) {
            self.cached(key(inner), || columns.into());
        }
    }

    /// The cells of a track as effects see them, under the input that a path passes if they are driven.
    fn points(
        &self,
        index: usize,
        direction: &Direction,
        (path, driven): (&Path, bool),
    ) -> impl Iterator<Item = Point> {
        let track = &self.tracks[index];
        let inputs = driven.then(|| self.inputs(path));
        let cells = track.cells[..self.windows[index].cells(track)].iter();
        cells.enumerate().map(move |(k, &cell)| {
            let input = inputs.as_ref().map(|inputs| inputs[index][0][k]);
            let at = input.map_or(cell, |u| track.driven(k, u));
            direction.point(index, k, at)
        })
    }

    /// The middle of each training row as effects see it, under the input that a path passes, where there is any.
    pub fn points_of_training(&self, direction: &Direction, path: &Path) -> Vec<Point> {
        let inputs = self.inputs(path);
        let rows = self.rows.iter().filter(|row| row.part == Part::Train);
        let points = rows.map(|row| {
            let (track, k) = (row.track, row.centre);
            let at = self.tracks[track].driven(k, inputs[track][0][k]);
            direction.point(track, k, at)
        });
        points.filter(|at| at.moment.u != 0.0).collect()
    }

    /// Functionals of so many signals of the cells as effects see them, under the input that a path passes if they are
    /// driven, behind the spring of the path. `before` is what the signals depend on before the spring.
    fn signals(
        &self,
        before: Key,
        direction: &Direction,
        (path, driven): (&Path, bool),
        width: usize,
        bases: impl Fn(&[Point], &mut [Vec<f64>]),
    ) -> Vec<Vec<f64>> {
        let of_track = |index: usize| {
            let count = self.windows[index].cells(&self.tracks[index]);
            let mut signals = vec![Vec::with_capacity(count); width];
            if driven || direction.bent.is_some() {
                let points = self.points(index, direction, (path, driven));
                bases(&points.collect::<Vec<_>>(), &mut signals);
            } else {
                bases(&self.tracks[index].cells[..count], &mut signals);
            }
            signals.iter_mut().for_each(|s| self.tracks[index].slide(s));
            signals
        };
        let all = || (0..self.tracks.len()).map(of_track).collect();
        if path.swings() {
            self.functionals(&self.recent.recall(before, || Arc::new(all())), path)
        } else {
            self.functionals(&all(), path)
        }
    }

    /// Functionals of signals of the sliding part of the cells behind the spring of a path.
    fn functionals(&self, signals: &[Vec<Vec<f64>>], path: &Path) -> Vec<Vec<f64>> {
        let mut columns = vec![Vec::with_capacity(self.rows.len()); signals[0].len()];
        for ((track, windows), signals) in self.tracks.iter().zip(&self.windows).zip(signals) {
            for (column, signal) in columns.iter_mut().zip(signals) {
                column.extend(windows.hold_sliding(signal, track.period, path));
            }
        }
        columns
    }

    /// What a path makes of the input, before a spring and a gap, in the cells that functionals need and one more, which a blow
    /// at the end of a gap may be shared with.
    fn inputs(&self, path: &Path) -> Signals {
        let path = path.of_input();
        let key = ("input", path.bits().to_vec());
        self.recent.recall(key, || Arc::new(self.inputs_of(&path)))
    }

    fn inputs_of(&self, path: &Path) -> Vec<Vec<Vec<f64>>> {
        let input = |(track, windows): (&Track, &Windows)| {
            let count = (windows.cells(track) + 1).min(track.cells.len());
            vec![track.input_of(count, path)]
        };
        self.tracks.iter().zip(&self.windows).map(input).collect()
    }

    /// Mean acceleration, relative to the measured position, of the load that an effect hangs on the axis, with what its own
    /// friction adds.
    pub fn load(&self, effect: &'static dyn Effect, inner: Inner) -> Vec<Column> {
        self.cached((effect.id(), inner.map(f64::to_bits).to_vec()), || {
            vec![self.stack(|t, w| {
                let Carried { ahead, resisting } = effect.load(inner, &t.q, &t.v, t.period);
                let mut sum = w.acceleration(&ahead);
                if !resisting.is_empty() {
                    let friction = w.hold(t, &resisting[..w.cells(t)]);
                    sum.iter_mut().zip(friction).for_each(|(s, f)| *s += f);
                }
                sum
            })]
        })
    }

    /// Mean acceleration and mean velocity of the error in the measured position, for each unit coefficient of an effect: at the
    /// position that is behind the measured one if these are its coefficients.
    pub fn errors(&self, effect: &'static dyn Effect, coefficients: &[f64]) -> Vec<[Column; 2]> {
        let columns = self.cached(of_error(effect, Whole::Not, coefficients), || {
            let behind = self.behind(effect, coefficients);
            let unit = |j: usize| {
                let value = |q: f64| {
                    let mut out = [(0.0, 0.0); effects::WIDEST];
                    effect.error(q, &mut out);
                    out[j].0
                };
                let signal = |places: &Vec<f64>| places.iter().copied().map(value).collect();
                self.means(behind.iter().map(signal))
            };
            (0..effect.width()).flat_map(unit).collect()
        });
        let pairs = columns.chunks(2);
        pairs.map(|two| [two[0].clone(), two[1].clone()]).collect()
    }

    /// The same of the whole error that an effect of these coefficients makes.
    pub fn error(&self, effect: &'static dyn Effect, coefficients: &[f64]) -> [Column; 2] {
        let columns = self.cached(of_error(effect, Whole::Yes, coefficients), || {
            let places = self.behind(effect, coefficients).into_iter();
            let signals = places.zip(self.tracks.iter()).map(|(places, track)| {
                let pairs = track.q.iter().zip(places);
                pairs.map(|(shown, q)| shown - q).collect()
            });
            self.means(signals).into()
        });
        [columns[0].clone(), columns[1].clone()]
    }

    /// The positions of every track that are behind the measured ones if an effect of these coefficients makes an error, which hardly
    /// changes from one to the next.
    fn behind(&self, effect: &dyn Effect, coefficients: &[f64]) -> Vec<Vec<f64>> {
        let error = |q: f64| effects::error(effect, coefficients, q);
        let of_track = |track: &Track| {
            let behind = |[before, last]: &mut [f64; 2], &shown: &f64| {
                let q = effects::behind(shown, shown - (2.0 * *last - *before), error);
                (*before, *last) = (*last, shown - q);
                Some(q)
            };
            let first = error(track.q.first().copied().unwrap_or_default()).0;
            track.q.iter().scan([first; 2], behind).collect()
        };
        self.tracks.iter().map(of_track).collect()
    }

    /// Mean acceleration and mean velocity of a signal at the nodes of every track.
    fn means(&self, signals: impl Iterator<Item = Vec<f64>>) -> [Vec<f64>; 2] {
        let mut means = [Vec::new(), Vec::new()];
        for (windows, signal) in self.windows.iter().zip(signals) {
            means[0].extend(windows.acceleration(&signal));
            means[1].extend(windows.velocity(&signal));
        }
        means
    }

    /// The columns of a group of generic functions.
    pub fn generic(&self, group: usize, compute: impl FnOnce() -> Vec<Vec<f64>>) -> Vec<Column> {
        self.cached(("generic", vec![group as u64]), compute)
    }

    /// What all recordings together cover, for a model whose Coulomb level is known so far.
    ///
    /// # Panics
    /// Without a single recording.
    pub fn survey(&self, model: &Model) -> Survey {
        let inertia = model.parameters()[model.moving_inertia()].value;
        let inertia = inertia.unwrap_or(f64::INFINITY);
        Survey {
            level: model.level_at_rest(),
            deceleration: model.level_at_rest() / inertia.max(f64::MIN_POSITIVE),
            ..*self.survey.get_or_init(|| self.all_tracks())
        }
    }

    /// A model whose Coulomb level, if a fit is to find it, is the RMS of what drives the axis: what the motion does to bristles
    /// depends on the ratio of their stiffness to it alone, and a level found without them can be anything, none among it, where
    /// most of the motion is bending.
    pub fn levelled(&self, mut model: Model) -> Model {
        if !model.coulomb.known {
            let (input, _) = self.survey.get_or_init(|| self.all_tracks()).input;
            model.coulomb.value = Some(model.gain.value.unwrap_or(1.0).abs() * input);
        }
        model
    }

    fn all_tracks(&self) -> Survey {
        let widths = self.half_widths();
        let surveys = self.tracks.iter().zip(widths);
        let surveys = surveys.map(|(t, half_width)| t.survey(self.motion, half_width));
        surveys
            .reduce(|a, b| Survey {
                motion: a.motion,
                period: a.period.min(b.period),
                duration: a.duration.max(b.duration),
                half_width: a.half_width.max(b.half_width),
                top_speed: a.top_speed.max(b.top_speed),
                usual_speed: a.usual_speed.min(b.usual_speed),
                slow: a.slow.min(b.slow),
                travel: (a.travel.0.min(b.travel.0), a.travel.1.max(b.travel.1)),
                input: (a.input.0.max(b.input.0), a.input.1.max(b.input.1)),
                position_noise: a.position_noise.max(b.position_noise),
                level: a.level,
                deceleration: a.deceleration,
            })
            .expect("at least one recording")
    }

    /// Time at the centre of a row, s.
    pub fn time(&self, row: Row) -> f64 {
        let track = &self.tracks[row.track];
        track.start + row.centre as f64 * track.period
    }

    /// Half-width of the windows of each track, s.
    pub fn half_widths(&self) -> impl Iterator<Item = f64> {
        let tracks = self.tracks.iter().zip(&self.windows);
        tracks.map(|(t, w)| w.reach as f64 * t.period)
    }

    /// Half-width of the widest windows, s.
    pub fn half_width(&self) -> f64 {
        self.half_widths().fold(0.0, f64::max)
    }

    /// Number of rows in a part.
    pub fn count(&self, part: Part) -> usize {
        self.rows.iter().filter(|r| r.part == part).count()
    }

    fn cached(&self, key: Key, compute: impl FnOnce() -> Vec<Vec<f64>>) -> Vec<Column> {
        if let Some(columns) = hold(&self.cache).get(&key, self.most_kept()) {
            return columns;
        }
        let columns: Vec<Column> = compute().into_iter().map(Arc::new).collect();
        hold(&self.cache).insert(key, columns.clone(), self.most_kept());
        columns
    }

    /// Entries of a generation of the cache.
    fn most_kept(&self) -> usize {
        (MOST_VALUES / self.rows.len().max(1)).max(FEWEST_KEPT)
    }
}

/// Whether columns are those of a whole error, or of its parts.
#[derive(Clone, Copy)]
enum Whole {
    Yes,
    Not,
}

/// What columns of the error of a sensor depend on.
fn of_error(effect: &dyn Effect, whole: Whole, coefficients: &[f64]) -> Key {
    let form = [whole as u64, effect.width() as u64];
    let bits = coefficients.iter().map(|c| c.to_bits());
    (effect.id(), form.into_iter().chain(bits).collect())
}

/// Signals that are kept: those of the input and of all terms of a model, and as many again.
const MOST_SIGNALS: usize = 16;
/// Bends that are kept: those of a model, and of what a few threads move it to.
const MOST_BENT: usize = 4;
/// Values that a generation of the cache holds of each column, …
const MOST_VALUES: usize = 4_000_000;
/// … but at least so many columns: those that the widest grids make and a search asks for again in each round.
const FEWEST_KEPT: usize = 1000;

/// Columns by what they depend on. Of two generations, the older is forgotten when the younger is full; what is asked for again
/// is young again.
#[derive(Default)]
struct Cache {
    young: HashMap<Key, Vec<Column>>,
    old: HashMap<Key, Vec<Column>>,
}

impl Cache {
    fn get(&mut self, key: &Key, most: usize) -> Option<Vec<Column>> {
        if let Some((key, columns)) = self.old.remove_entry(key) {
            self.insert(key, columns, most);
        }
        self.young.get(key).cloned()
    }

    fn insert(&mut self, key: Key, columns: Vec<Column>, most: usize) {
        if self.young.len() >= most {
            self.old = std::mem::take(&mut self.young);
        }
        self.young.insert(key, columns);
    }
}
