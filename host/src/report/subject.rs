//! What a report is about, and the predictions that its plots and error figures share.

use std::ops::Range;

use crate::axis::Axis;
use crate::effects::Quantity;
use crate::error::Result;
use crate::fit::{self, Fit, HORIZON};
use crate::identify::Workbench;
use crate::model::{Causality, Model};
use crate::motion::Motion;
use crate::recording::Recording;
use crate::simulate::State;
use crate::weak::{TRAIN_SHARE, Track};

/// A model with the errors of its predictions.
#[derive(Clone, Copy)]
pub(super) struct Judged<'a> {
    /// All parameters have values.
    pub model: &'a Model,
    /// How it predicts.
    pub fit: Fit,
}

/// Recordings with the model they led to and, where something was added to it, the one before.
pub(super) struct Subject<'a> {
    /// Rows and tracks.
    pub bench: &'a Workbench,
    /// The recordings, one for each track.
    pub recordings: &'a [Recording],
    /// The baseline, if the final model differs from it.
    pub before: Option<Judged<'a>>,
    /// The final model.
    pub after: Judged<'a>,
}

/// What models make of one recording: one value for each sample.
pub(super) struct Prediction {
    /// What is compared: position, velocity, or the input of an inverse recording.
    pub measured: Vec<f64>,
    /// First sample of the held-out part.
    pub boundary: usize,
    /// Windows of the free runs, training part first.
    pub windows: Vec<Range<usize>>,
    /// By the baseline, over the windows.
    pub before: Option<Vec<f64>>,
    /// By the final model, over the windows.
    pub after: Vec<f64>,
}

impl Prediction {
    /// Sum of squared errors of a model's prediction over a window.
    pub fn squared_error(&self, predicted: &[f64], window: &Range<usize>) -> f64 {
        let pairs = predicted[window.clone()]
            .iter()
            .zip(&self.measured[window.clone()]);
        pairs.map(|(p, x)| (p - x).powi(2)).sum()
    }
}

impl Subject<'_> {
    /// Whether the motion is imposed and `u` is what a model predicts.
    pub fn inverse(&self) -> bool {
        self.after.model.causality == Causality::Inverse
    }

    /// What is compared: its name and its unit.
    pub fn compared(&self) -> (&'static str, &'static str) {
        let model = self.after.model;
        if self.inverse() {
            return match (model.input.as_str(), model.motion) {
                ("voltage", _) => ("Drive u", "V"),
                ("current", _) => ("Drive u", "A"),
                (_, Motion::Rotary) => ("Torque u", "N*m"),
                (_, Motion::Linear) => ("Force u", "N"),
            };
        }
        match (self.recordings[0].q.is_some(), model.motion) {
            (true, Motion::Rotary) => ("Position", "rad"),
            (true, Motion::Linear) => ("Position", "m"),
            (false, Motion::Rotary) => ("Velocity", "rad/s"),
            (false, Motion::Linear) => ("Velocity", "m/s"),
        }
    }

    /// Units of velocity and of position.
    pub fn motion_units(&self) -> (&'static str, &'static str) {
        let model = self.after.model;
        (model.unit(Quantity::Speed), model.unit(Quantity::Position))
    }

    /// `torque` or `force`, and its unit.
    pub fn torque(&self) -> (&'static str, &'static str) {
        match self.after.model.motion {
            Motion::Rotary => ("torque", "N*m"),
            Motion::Linear => ("force", "N"),
        }
    }

    /// The legend's names for the models.
    pub fn names(&self) -> (&'static str, &'static str) {
        (
            "baseline",
            if self.before.is_some() {
                "final model"
            } else {
                "model"
            },
        )
    }

    /// Predictions over windows restarted from the measured state, as `fit::judge` lays them.
    pub fn predict(&self, index: usize) -> Result<Prediction> {
        let recording = &self.recordings[index];
        let track = &self.bench.problem.tracks[index];
        let boundary = (TRAIN_SHARE * recording.len() as f64) as usize;
        let measured = if self.inverse() {
            recording.u.clone()
        } else {
            recording.measured().to_vec()
        };
        let run = |model: &Model| -> Result<Vec<f64>> {
            let axis = Axis::new(model)?;
            if self.inverse() {
                return Ok(fit::inverse(&axis, recording, track));
            }
            let mut states = fit::predict(&axis, recording, track, HORIZON, 0, boundary);
            states.extend(fit::predict(
                &axis,
                recording,
                track,
                HORIZON,
                boundary,
                recording.len(),
            ));
            Ok(compared_states(recording, &states))
        };
        Ok(Prediction {
            measured,
            boundary,
            windows: windows(recording, 0..boundary)
                .into_iter()
                .chain(windows(recording, boundary..recording.len()))
                .collect(),
            before: self.before.map(|b| run(b.model)).transpose()?,
            after: run(self.after.model)?,
        })
    }

    /// One free run of a model over a whole recording.
    pub fn free_run(&self, model: &Model, index: usize) -> Result<Vec<f64>> {
        let recording = &self.recordings[index];
        let track: &Track = &self.bench.problem.tracks[index];
        let axis = Axis::new(model)?;
        let states = fit::predict(&axis, recording, track, f64::INFINITY, 0, recording.len());
        Ok(compared_states(recording, &states))
    }
}

fn compared_states(recording: &Recording, states: &[State]) -> Vec<f64> {
    let positions = recording.q.is_some();
    states
        .iter()
        .map(|s| if positions { s.q } else { s.v })
        .collect()
}

/// The windows of [`HORIZON`] that a part of a recording is divided into.
fn windows(recording: &Recording, part: Range<usize>) -> Vec<Range<usize>> {
    let mut windows = Vec::new();
    let mut first = part.start;
    while first < part.end {
        let horizon = recording.t[first] + HORIZON - 1e-9;
        let end = recording
            .t
            .partition_point(|&t| t < horizon)
            .clamp(first + 1, part.end);
        windows.push(first..end);
        first = end;
    }
    windows
}
