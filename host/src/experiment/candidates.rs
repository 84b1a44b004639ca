//! Excitations that stay within what the recordings have shown to be safe, as all models predict.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use crate::axis::Axis;
use crate::error::Result;
use crate::excite::{Excitation, Shape};
use crate::fit;
use crate::identify::Workbench;
use crate::model::Model;
use crate::recording::Recording;
use crate::simulate::{self, State};
use crate::weak::Track;

/// Length of a candidate, s.
const DURATION: f64 = 12.0;
/// Ends over which u rises from zero and falls back, s.
const FADE: f64 = 0.25;
/// Speed may exceed the recorded one by this share, and travel each end of the recorded range by this share of it.
const MARGIN: f64 = 0.1;
/// An unsafe candidate is tried again at this share of its amplitude, so often.
const LESS: f64 = 0.7;
const TRIES: i32 = 6;

/// What recordings have shown to be safe.
pub(super) struct Safe {
    period: f64,
    input: f64,
    speed: f64,
    travel: (f64, f64),
}

/// An excitation, and the motion that the final model predicts.
pub(super) struct Candidate {
    pub shape: String,
    pub t: Vec<f64>,
    pub u: Vec<f64>,
    pub states: Vec<State>,
}

impl Safe {
    /// Largest input and speed, and the range of positions, of all recordings together.
    pub fn of(bench: &Workbench, recordings: &[Recording]) -> Self {
        let tracks = &bench.problem.tracks;
        let largest = |x: &[f64]| x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let positions = || tracks.iter().flat_map(|t| t.q.iter().copied());
        Self {
            period: tracks
                .iter()
                .map(|t| t.period)
                .fold(f64::INFINITY, f64::min),
            input: recordings.iter().map(|r| largest(&r.u)).fold(0.0, f64::max),
            speed: tracks.iter().map(|t| largest(&t.v)).fold(0.0, f64::max),
            travel: (
                positions().fold(f64::INFINITY, f64::min),
                positions().fold(f64::NEG_INFINITY, f64::max),
            ),
        }
    }

    fn span(&self) -> f64 {
        self.travel.1 - self.travel.0
    }

    fn allows(&self, state: &State) -> bool {
        let margin = MARGIN * self.span();
        let (low, high) = (self.travel.0 - margin, self.travel.1 + margin);
        (low..=high).contains(&state.q) && state.v.abs() <= (1.0 + MARGIN) * self.speed
    }
}

impl Candidate {
    fn range(&self) -> (f64, f64) {
        self.states
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| {
                (low.min(s.q), high.max(s.q))
            })
    }

    /// Greatest minus least position.
    pub fn travel(&self) -> f64 {
        self.range().1 - self.range().0
    }

    /// Middle of the motion.
    pub fn middle(&self) -> f64 {
        0.5 * (self.range().0 + self.range().1)
    }

    /// The excitation as a recording without measurements.
    pub fn recording(&self) -> Recording {
        unmeasured(self.t.clone(), self.u.clone())
    }
}

fn unmeasured(t: Vec<f64>, u: Vec<f64>) -> Recording {
    Recording {
        path: "next experiment".into(),
        t,
        u,
        ..Recording::default()
    }
}

/// Velocities over time, at most one in magnitude.
type Profile = fn(f64) -> f64;

/// Motions that the final model is driven through, and the shares of the recorded speed at which they are tried.
const MOTIONS: [(&str, Profile, &[f64]); 5] = [
    (
        "steady speeds, fast to slow, in both directions",
        staircase,
        &[1.0, 0.5],
    ),
    (
        "slow speed ramps through zero",
        |t| triangle(t / 4.0),
        &[1.0, 0.3, 0.1],
    ),
    (
        "a sweep of the position from 0.2 to 8 Hz",
        sweep,
        &[1.0, 0.3],
    ),
    (
        "short moves of several lengths with stops",
        moves,
        &[1.0, 0.3, 0.1],
    ),
    ("long slow strokes", |t| (TAU * t / 6.0).sin(), &[1.0, 0.3]),
];

/// Ten legs: each speed forwards, then backwards.
fn staircase(t: f64) -> f64 {
    const SPEEDS: [f64; 5] = [1.0, 0.5, 0.25, 0.1, 0.05];
    let leg = (10.0 * t / DURATION) as usize;
    let forwards = leg.is_multiple_of(2);
    SPEEDS[(leg / 2).min(4)] * if forwards { 1.0 } else { -1.0 }
}

fn triangle(turns: f64) -> f64 {
    1.0 - 4.0 * ((turns + 0.25).fract() - 0.5).abs()
}

fn sweep(t: f64) -> f64 {
    let rate = 40f64.ln() / DURATION;
    (TAU * 0.2 * (rate * t).exp_m1() / rate).sin()
}

/// Half-sine pulses of velocity, each there and back.
fn moves(t: f64) -> f64 {
    const LENGTHS: [f64; 6] = [1.0, 0.05, 0.5, 0.1, 0.3, 0.2];
    let (pulse, within) = ((t / 0.5) as usize, (t % 0.5) / 0.25);
    let size = LENGTHS[(pulse / 2) % LENGTHS.len()];
    let side = if pulse.is_multiple_of(2) { 1.0 } else { -1.0 };
    if within < 1.0 {
        side * size * (PI * within).sin()
    } else {
        0.0
    }
}

/// Name, shape, band in Hz, shares.
type Signal = (&'static str, Shape, (f64, f64), &'static [f64]);

/// Test signals that are applied as they are, and the shares of the recorded input at which they are tried.
const SIGNALS: [Signal; 4] = [
    (
        "a multisine of u from 0.2 to 8 Hz",
        Shape::Multisine,
        (0.2, 8.0),
        &[1.0, 0.5],
    ),
    (
        "a chirp of u from 0.5 to 20 Hz",
        Shape::Chirp,
        (0.5, 20.0),
        &[1.0, 0.5],
    ),
    ("random steps of u", Shape::Steps, (0.5, 4.0), &[1.0, 0.5]),
    (
        "slow ramps of u up and down",
        Shape::Triangle,
        (0.25, 1.0),
        &[1.0, 0.5, 0.25],
    ),
];

/// All safe candidates.
pub(super) fn all(model: &Model, rivals: &[Model], safe: &Safe) -> Result<Vec<Candidate>> {
    let t: Vec<f64> = (0..=(DURATION / safe.period) as usize)
        .map(|k| k as f64 * safe.period)
        .collect();
    let axes: Vec<Axis> = std::iter::once(model)
        .chain(rivals)
        .map(Axis::new)
        .collect::<Result<_>>()?;
    let maker = Maker {
        t,
        axes,
        safe,
        model,
    };
    let maker = &maker;
    let motions = MOTIONS.par_iter().flat_map(|&(shape, profile, shares)| {
        let along =
            move |share: &f64| maker.tried(shape, |scale| maker.along(profile, share * scale));
        shares.par_iter().filter_map(along)
    });
    let middle = 0.5 * (safe.travel.0 + safe.travel.1);
    let signals = SIGNALS.par_iter().flat_map(|&(shape, kind, band, shares)| {
        let signal = maker.signal(kind, band);
        let applied = move |share: &f64| {
            maker.tried(shape, |scale| {
                let size = share * scale * safe.input;
                (middle, signal.iter().map(|x| size * x).collect())
            })
        };
        shares.par_iter().filter_map(applied)
    });
    Ok(motions.chain(signals).collect())
}

struct Maker<'a> {
    t: Vec<f64>,
    /// The final model first.
    axes: Vec<Axis>,
    safe: &'a Safe,
    model: &'a Model,
}

impl Maker<'_> {
    /// The largest version of a candidate, from a scale of one down, that is safe under all models.
    fn tried(&self, shape: &str, make: impl Fn(f64) -> (f64, Vec<f64>)) -> Option<Candidate> {
        (0..TRIES).find_map(|k| {
            let (start, u) = make(LESS.powi(k));
            let u = self.faded(&u);
            let strong = |u: &f64| u.is_nan() || u.abs() > self.safe.input;
            if u.iter().any(strong) {
                return None;
            }
            let recording = unmeasured(self.t.clone(), u);
            let from = State { q: start, v: 0.0 };
            let last = self.t.len() - 1;
            let mut runs = self.axes.iter().map(|axis| {
                let allowed = |state: &State| self.safe.allows(state);
                simulate::run_axis_while(axis, &recording, (0, last), from, allowed)
            });
            let states = runs.next()??;
            runs.all(|states| states.is_some()).then(|| Candidate {
                shape: shape.to_owned(),
                t: self.t.clone(),
                u: recording.u,
                states,
            })
        })
    }

    /// A test signal that peaks at one.
    fn signal(&self, shape: Shape, band: (f64, f64)) -> Vec<f64> {
        let top = 0.4 / self.safe.period;
        let signal = Excitation {
            shape,
            amplitude: 1.0,
            band: (band.0.min(top), band.1.min(top)),
            duration: DURATION + self.safe.period,
            seed: 1,
        };
        signal.values(&self.t)
    }

    fn faded(&self, u: &[f64]) -> Vec<f64> {
        let end = self.t[self.t.len() - 1];
        let rise = |t: f64| (t / FADE).min((end - t) / FADE).clamp(0.0, 1.0);
        u.iter().zip(&self.t).map(|(u, t)| u * rise(*t)).collect()
    }

    /// The input that drives the final model along a profile of velocity, and where to start, so that the motion lies in
    /// the middle of the recorded range.
    fn along(&self, profile: Profile, share: f64) -> (f64, Vec<f64>) {
        let period = self.safe.period;
        let speed: Vec<f64> = self.t.iter().map(|&t| profile(t)).collect();
        let smooth = averaged(
            &averaged(&speed, (0.02 / period) as usize),
            (0.02 / period) as usize,
        );
        let mut q = 0.0;
        let way: Vec<f64> = smooth
            .iter()
            .map(|v| {
                q += v * period;
                q
            })
            .collect();
        let (low, high) = way
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), q| {
                (a.min(*q), b.max(*q))
            });
        let scale = share
            * self
                .safe
                .speed
                .min(self.safe.span() / (high - low).max(f64::MIN_POSITIVE));
        let start = 0.5 * (self.safe.travel.0 + self.safe.travel.1) - 0.5 * scale * (low + high);
        let reference = Recording {
            q: Some(way.iter().map(|q| start + scale * q).collect()),
            ..unmeasured(self.t.clone(), vec![0.0; self.t.len()])
        };
        let track = Track::new(&reference, self.model.motion, None);
        (start, fit::inverse(&self.axes[0], &reference, &track))
    }
}

/// Centred moving average over `2·half + 1` samples.
fn averaged(x: &[f64], half: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    for x in x {
        sums.push(sums[sums.len() - 1] + x);
    }
    (0..x.len())
        .map(|k| {
            let (a, b) = (k.saturating_sub(half), (k + half + 1).min(x.len()));
            (sums[b] - sums[a]) / (b - a) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{DURATION, MOTIONS, averaged};

    #[test]
    fn profiles_end_where_they_began_and_keep_to_one() {
        for (name, profile, _) in MOTIONS {
            let values: Vec<f64> = (0..12_000).map(|k| profile(f64::from(k) * 1e-3)).collect();
            assert!(values.iter().all(|v| v.abs() <= 1.0), "{name}");
            let way = values.iter().sum::<f64>() * 1e-3;
            assert!(way.abs() < 0.1 * DURATION, "{name}: {way}");
        }
        assert_eq!(averaged(&[0.0, 3.0, 0.0], 1), [1.5, 1.0, 1.5]);
    }
}
