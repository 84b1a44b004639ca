//! How well a model predicts: free runs over windows, driven by `u` alone.

use std::ops::Range;

use rayon::prelude::*;
use serde::Serialize;

use crate::axis::Axis;
use crate::effects::Moment;
use crate::error::Result;
use crate::model::{Causality, Model};
use crate::recording::Recording;
use crate::simulate::{self, Start, State};
use crate::weak::{Part, TRAIN_SHARE, Track};

/// Length of the free-run windows that the fit is judged on, s.
pub const HORIZON: f64 = 1.0;

/// Errors of one part of the recordings.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Error {
    /// RMS error over RMS of the measured change in the windows.
    pub nrmse: f64,
    /// RMS error in the unit of the measurement (of `u` for inverse recordings).
    pub rmse: f64,
    /// RMS of the measured change, or of `u`.
    pub signal: f64,
}

/// Errors of the training part and of the held-out part.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Fit {
    /// First 70 % of each recording.
    pub train: Error,
    /// Last 30 % of each recording.
    pub held_out: Error,
    /// One free run over each whole recording, from its first state: RMS error in the unit of the measurement. Not of
    /// recordings that are read piece by piece.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub free_run_rmse: Option<f64>,
}

/// Predicted position and velocity at every sample, restarted from the measured state every `horizon` seconds.
pub fn predict(
    axis: &Axis,
    recording: &Recording,
    track: &Track,
    horizon: f64,
    from: usize,
    to: usize,
) -> Vec<State> {
    let mut states = Vec::with_capacity(to - from);
    let along = Along::new(axis, track);
    for samples in windows(&recording.t, horizon, from..to) {
        let start = along.start(recording, track, samples.start);
        let last = samples.end - 1;
        states.extend(simulate::run_axis(
            axis,
            recording,
            samples.start,
            last,
            start,
        ));
    }
    states
}

/// What a measured motion carries along and no sensor shows: where the load stands and how far the bristles are bent.
#[derive(Default)]
pub struct Along {
    load: Vec<[f64; 2]>,
    bend: Vec<f64>,
}

impl Along {
    /// Follows the whole motion of a track.
    pub fn new(axis: &Axis, track: &Track) -> Self {
        let bend = axis.contact.bristles().map_or(Vec::new(), |law| {
            let bent = track.bend(law).into_iter().zip(&track.cells);
            bent.map(|(b, cell)| b.direction * law.level(cell.v) / law.stiffness())
                .collect()
        });
        Self {
            load: axis.carried(track),
            bend,
        }
    }

    /// Where a free run from a sample on starts. Before the first one nothing has been measured, so a load is at ease there, and
    /// bristles are as [`Track::bend`] has them; at rest only what follows would tell how they are bent.
    pub fn start(&self, recording: &Recording, track: &Track, sample: usize) -> Start {
        let (node, _) = node(recording, track, sample);
        let start = Start::from(measured_state(recording, track, sample));
        let slides = |cell: usize| track.sliding.get(cell).is_some_and(|s| *s > 0.0);
        let before = node.saturating_sub(1);
        let cells = self.bend.get(before).zip(self.bend.get(node));
        let bend = cells.filter(|_| slides(before) && slides(node));
        let load = self.load.get(node).filter(|_| node > 0);
        Start {
            load: load.copied(),
            bend: bend.map(|(before, after)| 0.5 * (before + after)),
            ..start
        }
    }
}

/// The node at or before a sample, and the rest of the way to the next one.
fn node(recording: &Recording, track: &Track, sample: usize) -> (usize, f64) {
    let node =
        ((recording.t[sample] - track.start) / track.period).clamp(0.0, (track.v.len() - 1) as f64);
    (node as usize, node.fract())
}

/// The measured state at a sample: its position and the smoothed velocity.
pub fn measured_state(recording: &Recording, track: &Track, sample: usize) -> State {
    let (k, r) = node(recording, track, sample);
    let right = track.v[(k + 1).min(track.v.len() - 1)];
    let smooth = track.v[k] + r * (right - track.v[k]);
    // An axis at rest starts at rest: quantisation must not push it.
    let v = if smooth.abs() <= 3.0 * track.velocity_noise
        && track.sliding[k.min(track.sliding.len() - 1)] == 0.0
    {
        0.0
    } else {
        smooth
    };
    State {
        q: recording
            .q
            .as_ref()
            .map_or_else(|| track.q[k], |q| q[sample]),
        v,
    }
}

/// Sums of squares over windows.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    error: f64,
    signal: f64,
    noise: f64,
    count: usize,
}

/// Larger relative errors are reported as this: a model that runs away is wrong, by however much.
const WORST: f64 = 1e6;

impl Sums {
    /// Sum of squared errors.
    pub fn squares(&self) -> f64 {
        self.error
    }

    /// Adds the sums over other windows.
    pub fn add(&mut self, other: &Self) {
        self.error += other.error;
        self.signal += other.signal;
        self.noise += other.noise;
        self.count += other.count;
    }

    /// The errors that they amount to.
    pub fn error(&self) -> Error {
        let count = self.count.max(1) as f64;
        // At rest all that is measured is noise.
        let signal = self.signal.max(self.noise).max(f64::MIN_POSITIVE);
        Error {
            nrmse: (self.error / signal).sqrt().min(WORST),
            rmse: (self.error / count).sqrt(),
            signal: (self.signal / count).sqrt(),
        }
    }
}

impl Error {
    /// Whether the squared error is less than half of what it was.
    pub fn halves(&self, before: &Self) -> bool {
        self.nrmse * self.nrmse < 0.5 * before.nrmse * before.nrmse
    }
}

/// Sums over each window of both parts of the recordings; over each sample where the motion is imposed.
pub struct Parts {
    /// First 70 % of each recording.
    pub train: Vec<Sums>,
    /// Last 30 % of each recording.
    pub held_out: Vec<Sums>,
}

impl Parts {
    /// The sums of one part.
    fn of(&self, part: Part) -> &[Sums] {
        match part {
            Part::Train => &self.train,
            Part::HeldOut => &self.held_out,
        }
    }

    /// The errors of one part.
    pub fn error(&self, part: Part) -> Error {
        total(self.of(part)).error()
    }

    /// The errors of the training part.
    pub fn train(&self) -> Error {
        self.error(Part::Train)
    }

    /// The errors of the held-out part.
    pub fn held_out(&self) -> Error {
        self.error(Part::HeldOut)
    }

    /// Spans of time, in s, of the fewest windows of a part that hold half of its squared error, of free runs along these recordings.
    pub fn worst(&self, part: Part, recordings: &[Recording]) -> Vec<[f64; 2]> {
        let sums = self.of(part);
        let spans = recordings.iter().flat_map(|recording| {
            let t = &recording.t;
            let windows = windows(t, HORIZON, samples_of(part, t.len()));
            windows.map(|samples| [t[samples.start], t[samples.end - 1]])
        });
        let mut worst: Vec<(f64, [f64; 2])> = sums.iter().map(Sums::squares).zip(spans).collect();
        worst.sort_by(|a, b| b.0.total_cmp(&a.0));
        let most = 0.5 * total(sums).squares();
        let mut sum = 0.0;
        let held = worst.iter().position(|(squares, _)| {
            sum += squares;
            sum >= most
        });
        worst.truncate(held.map_or(worst.len(), |last| last + 1));
        worst.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        let mut spans: Vec<[f64; 2]> = Vec::new();
        for (_, span) in worst {
            match spans.last_mut() {
                Some(last) if span[0] - last[1] < 0.5 * HORIZON => last[1] = last[1].max(span[1]),
                _ => spans.push(span),
            }
        }
        spans
    }

    /// The squared error of both.
    pub fn squares(&self) -> f64 {
        total(&self.train).squares() + total(&self.held_out).squares()
    }

    /// Whether that is less than half of what it was.
    pub fn halves(&self, before: &Self) -> bool {
        self.squares() < 0.5 * before.squares()
    }
}

fn total(windows: &[Sums]) -> Sums {
    let mut total = Sums::default();
    windows.iter().for_each(|window| total.add(window));
    total
}

/// Judges a complete model on its recordings.
pub fn judge(model: &Model, recordings: &[Recording], tracks: &[Track]) -> Result<Fit> {
    // The longest run beside all the short ones.
    let (whole, parts) = rayon::join(
        || {
            sums(model, recordings, tracks, f64::INFINITY, |samples| {
                0..samples
            })
        },
        || parts(model, recordings, tracks),
    );
    let parts = parts?;
    Ok(Fit {
        train: parts.train(),
        held_out: parts.held_out(),
        free_run_rmse: Some(total(&whole?).error().rmse),
    })
}

/// Runs a complete model over the windows alone.
pub fn parts(model: &Model, recordings: &[Recording], tracks: &[Track]) -> Result<Parts> {
    let of = |part| windows_of(part, model, recordings, tracks);
    Ok(Parts {
        train: of(Part::Train)?,
        held_out: of(Part::HeldOut)?,
    })
}

/// The error of a complete model over the windows of one part.
pub fn part(
    part: Part,
    model: &Model,
    recordings: &[Recording],
    tracks: &[Track],
) -> Result<Error> {
    let windows = windows_of(part, model, recordings, tracks)?;
    Ok(total(&windows).error())
}

fn windows_of(
    part: Part,
    model: &Model,
    recordings: &[Recording],
    tracks: &[Track],
) -> Result<Vec<Sums>> {
    sums(model, recordings, tracks, HORIZON, |samples| {
        samples_of(part, samples)
    })
}

/// Those of the samples of a recording that belong to a part.
fn samples_of(part: Part, samples: usize) -> Range<usize> {
    let boundary = (TRAIN_SHARE * samples as f64) as usize;
    match part {
        Part::Train => 0..boundary,
        Part::HeldOut => boundary..samples,
    }
}

/// The sums over windows of some length in a range of the samples of each recording.
fn sums(
    model: &Model,
    recordings: &[Recording],
    tracks: &[Track],
    horizon: f64,
    range: impl Fn(usize) -> Range<usize>,
) -> Result<Vec<Sums>> {
    let axis = Axis::new(model)?;
    let mut all = Vec::new();
    for (recording, track) in recordings.iter().zip(tracks) {
        let range = range(recording.len());
        if model.causality == Causality::Inverse {
            let force = inverse(&axis, recording, track);
            let samples = force[range.clone()].iter().zip(&recording.u[range]);
            all.extend(samples.map(|(f, u)| of_force(*f, *u)));
            continue;
        }
        let along = Along::new(&axis, track);
        let windows: Vec<_> = windows(&recording.t, horizon, range).collect();
        let sums = windows.into_par_iter();
        all.par_extend(sums.map(|samples| window(&axis, recording, track, &along, samples)));
    }
    Ok(all)
}

/// A range of samples cut into windows of a length in seconds.
fn windows(t: &[f64], horizon: f64, range: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let mut first = range.start;
    std::iter::from_fn(move || {
        let end = (first < range.end).then(|| window_end(t, first, horizon).min(range.end))?;
        Some(std::mem::replace(&mut first, end)..end)
    })
}

/// One past the last sample of the window that begins at a sample.
pub fn window_end(t: &[f64], first: usize, horizon: f64) -> usize {
    t.partition_point(|&at| at < t[first] + horizon - 1e-9)
        .max(first + 1)
}

/// Time constants of a lag after which less than a hundredth is left of what came before.
const PASSED: f64 = 5.0;

/// The samples of a window from which on all that drives the axis has been recorded: not those at the beginning of a recording at
/// which a delayed or lagging input from before it still acts, as far as the first half of the window.
fn driven(axis: &Axis, t: &[f64], samples: Range<usize>) -> Range<usize> {
    let path = &axis.path;
    let told = t[0] + path.delay + PASSED * path.lag;
    let first = t.partition_point(|&at| at < told);
    let middle = samples.start.midpoint(samples.end);
    samples.start.max(first.min(middle))..samples.end
}

/// A free run from the measured state over some samples.
pub fn window(
    axis: &Axis,
    recording: &Recording,
    track: &Track,
    along: &Along,
    samples: Range<usize>,
) -> Sums {
    let samples = driven(axis, &recording.t, samples);
    let positions = recording.q.is_some();
    let measured = recording.measured();
    let noise = if positions {
        track.position_noise
    } else {
        track.velocity_noise
    };
    let first = samples.start;
    let start = along.start(recording, track, first);
    let states = simulate::run_axis(axis, recording, first, samples.end - 1, start);
    let mut sums = Sums::default();
    for (state, x) in states.iter().zip(&measured[samples]) {
        let predicted = if positions {
            state.q - start.state.q
        } else {
            state.v - measured[first]
        };
        let change = x - measured[first];
        // A model that runs away counts as a large error, not as a missing one.
        let error = predicted - change;
        sums.error += if error.is_finite() {
            (error * error).min(1e12 * (1.0 + change * change))
        } else {
            1e12
        };
        sums.signal += change * change;
        sums.noise += noise * noise;
        sums.count += 1;
    }
    sums
}

/// A modelled force where another was measured.
pub fn of_force(modelled: f64, measured: f64) -> Sums {
    Sums {
        error: (modelled - measured).powi(2),
        signal: measured.powi(2),
        noise: 0.0,
        count: 1,
    }
}

/// Rounds that settle a resistance of half the input to a thousandth of it.
const ROUNDS: usize = 10;

/// The input that the model asks for along the measured motion, at every sample.
pub fn inverse(axis: &Axis, recording: &Recording, track: &Track) -> Vec<f64> {
    let last = track.v.len() - 1;
    let truth = |k: usize| {
        axis.truth(State {
            q: track.q[k],
            v: track.v[k],
        })
    };
    let positions: Vec<f64> = (0..=last).map(|k| truth(k).q).collect();
    let accelerations = track.acceleration(&positions);
    let bent = axis.contact.bristles().map(|law| (law, track.bend(law)));
    recording
        .t
        .iter()
        .map(|t| {
            let k = (((t - track.start) / track.period).round().max(0.0) as usize).min(last);
            let state = truth(k);
            let (s, bristles) = if let Some((law, bent)) = &bent {
                let bent = bent[k.min(bent.len() - 1)];
                let s = bent.direction;
                let force =
                    s * law.level(state.v) + law.damping() * bent.rate + law.viscosity() * state.v;
                (s, force)
            } else {
                // At rest friction balances whatever else acts, which no model of the motion says.
                let rests = track.sliding[k.min(track.sliding.len() - 1)] == 0.0;
                let still = rests || state.v == 0.0;
                (if still { 0.0 } else { state.v.signum() }, 0.0)
            };
            let needed = |u: f64| {
                let moment = Moment {
                    t: t - track.start,
                    dt: track.period,
                    u,
                };
                let friction = axis.contact.resistance(moment, state, s) + bristles;
                (axis.inertia * accelerations[k] + friction) / axis.gain + axis.back_emf * state.v
            };
            // Where the resistance depends on the input itself, less than one to one, iteration settles both.
            let rounds = if axis.contact.driven() { ROUNDS } else { 1 };
            (0..rounds).fold(0.0, |u, _| needed(u))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A recording may begin just as the axis sets off, with bristles that have hardly bent.
    #[test]
    fn an_axis_that_sets_off_has_straight_bristles() {
        let model = "[plant]\nmotion = \"rotary\"\ngain = 1.0\ninertia = 0.01\n\n[friction]\nmodel = \"dahl\"\n\
            coulomb = 0.3\nviscous = 0.0\nbristle_stiffness = 3.0\n";
        let model = Model::parse(model).unwrap();
        let t: Vec<f64> = (0..2000).map(|k| 1e-3 * f64::from(k)).collect();
        let recording = Recording {
            q: Some(t.iter().map(|t| 0.05 * t + 2.0 * t * t).collect()),
            u: vec![0.0; t.len()],
            t,
            ..Recording::default()
        };
        let track = Track::new(&recording, model.motion, None);
        let axis = Axis::new(&model).unwrap();
        let bend = |sample| {
            Along::new(&axis, &track)
                .start(&recording, &track, sample)
                .bend
        };
        // Sliding bends them by 0.1 rad.
        assert!(bend(0).unwrap() < 0.01, "{:?}", bend(0));
        assert!(bend(1500).unwrap() > 0.09, "{:?}", bend(1500));
    }
}
