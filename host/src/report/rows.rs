//! The weak-form rows as maps: residual torque against time, velocity, position and input.

use super::page::{Band, Item, Plot, Role, Section, Style};
use super::points::{Points, bins, dots};
use super::runs::MOST_RECORDINGS;
use super::subject::Subject;
use crate::diagnose::Where;
use crate::effects::Path;
use crate::format::{scaled_unit, whole_percent};
use crate::model::Model;
use crate::problem::Direction;
use crate::system;

/// Rows with less of one direction than this lie around a reversal: their friction is a mean of both levels.
const SLIDING: f64 = 0.98;
/// Bins of a map, with equal numbers of rows.
const BINS: usize = 24;

/// The rows of all recordings with the residual torque that each model leaves.
pub(super) struct Rows {
    track: Vec<usize>,
    time: Vec<f64>,
    position: Vec<f64>,
    input: Vec<f64>,
    before: Option<Vec<f64>>,
    /// Mean velocity.
    pub velocity: Vec<f64>,
    /// Whether no reversal lies inside.
    pub sliding: Vec<bool>,
    /// Residual torque of the final model, positive where it drives the axis.
    pub after: Vec<f64>,
}

impl Rows {
    /// Evaluates the rows.
    pub fn new(subject: &Subject) -> Self {
        let problem = &subject.bench.problem;
        let residual = |model: &Model| -> Vec<f64> {
            let scale = system::torque_scale(problem, model);
            let residual = system::residual(problem, model);
            residual.iter().map(|r| r * scale).collect()
        };
        let rows = problem.rows.iter();
        let coulomb = problem.coulomb(&Direction::default(), &Path::default());
        Self {
            track: rows.clone().map(|r| r.track).collect(),
            time: rows.clone().map(|r| problem.time(*r)).collect(),
            velocity: problem.velocity(&Path::default()).to_vec(),
            position: rows.map(|r| problem.tracks[r.track].q[r.centre]).collect(),
            input: problem.input(&Path::default()).to_vec(),
            sliding: coulomb.iter().map(|s| s.abs() > SLIDING).collect(),
            before: subject.before.map(|b| residual(b.model)),
            after: residual(subject.after.model),
        }
    }

    fn scale(&self, si: &str) -> (f64, String) {
        let all = self.after.iter().chain(self.before.iter().flatten());
        scaled_unit(all.fold(0.0, |a: f64, b| a.max(b.abs())), si)
    }

    /// Residual torque over one coordinate of some rows, if wanted with the means of bins.
    fn map(
        &self,
        subject: &Subject,
        coordinate: &[f64],
        means: bool,
        keep: impl Fn(usize) -> bool,
    ) -> Plot {
        let (factor, unit) = self.scale(subject.torque().1);
        let rows: Vec<usize> = (0..coordinate.len()).filter(|&k| keep(k)).collect();
        let names = subject.names();
        let models = [
            (self.before.as_ref(), names.0, Role::Before),
            (Some(&self.after), names.1, Role::After),
        ];
        let pairs = |y: &[f64]| -> Vec<(f64, f64)> {
            rows.iter()
                .map(|&k| (coordinate[k], factor * y[k]))
                .collect()
        };
        let mut points = Points::default();
        for (y, name, role) in models {
            if let Some(y) = y {
                points.add(name, role, Style::Dots, dots(pairs(y)));
            }
        }
        for (y, name, role) in models {
            if let Some(y) = y.filter(|_| means) {
                let label = format!("{name}, mean");
                points.add(&label, role, Style::Line, bins(pairs(y), BINS));
            }
        }
        Plot {
            y_label: format!("residual [{unit}]"),
            height: 260,
            ..points.plot()
        }
    }
}

/// The residual maps with the located region, or with the reason why none is marked.
pub(super) fn section(
    subject: &Subject,
    rows: &Rows,
    place: std::result::Result<&Where, &str>,
) -> Section {
    let (torque, _) = subject.torque();
    let (speed, length) = subject.motion_units();
    let several = subject.recordings.len() > 1;
    let region = place.map_or_else(
        str::to_owned,
        |place| {
            format!(
                "Shaded: the times{} at which the mismatch is above its average, and the narrowest ranges of velocity, of position and of u that hold {} of it each. {}",
                if several { ", all recordings taken together," } else { "" },
                whole_percent(Where::SHARE),
                place.text
            )
        },
    );
    let mut items = vec![Item::text(format!(
        "The {torque} that drives the axis beyond what the model says, as a weighted mean over each window of the weak form; no noisy signal is differentiated. A model that leaves nothing out has a residual that looks alike everywhere. {region}"
    ))];
    let holds = format!("{} of the mismatch", whole_percent(Where::SHARE));
    let bands = |label: &str, band: &dyn Fn(&Where) -> Vec<[f64; 2]>| -> Vec<Band> {
        let bands = place.map_or_else(|_| Vec::new(), band).into_iter();
        let located = |[from, to]: [f64; 2]| Band {
            from,
            to,
            held_out: false,
            label: label.to_owned(),
        };
        bands.map(located).collect()
    };
    for (index, recording) in subject.recordings.iter().enumerate().take(MOST_RECORDINGS) {
        let of = if several {
            format!(", {}", recording.file_name())
        } else {
            String::new()
        };
        let plot = Plot {
            title: format!("Against time{of}"),
            x_label: "time [s]".to_owned(),
            bands: bands("most of the mismatch", &|p| p.time.clone()),
            ..rows.map(subject, &rows.time, false, |k| rows.track[k] == index)
        };
        items.push(Item::Plots { plots: vec![plot] });
    }
    items.push(Item::Plots {
        plots: vec![
            Plot {
                title: "Against velocity".to_owned(),
                x_label: format!("velocity [{speed}]"),
                bands: bands(&holds, &|p| vec![p.velocity]),
                ..rows.map(subject, &rows.velocity, true, |_| true)
            },
            Plot {
                title: "Against position".to_owned(),
                x_label: format!("position [{length}]"),
                bands: bands(&holds, &|p| vec![p.position]),
                ..rows.map(subject, &rows.position, true, |_| true)
            },
            Plot {
                title: "Against input".to_owned(),
                x_label: format!("u [{}]", subject.after.model.input_unit()),
                bands: bands(&holds, &|p| vec![p.input]),
                ..rows.map(subject, &rows.input, true, |_| true)
            },
        ],
    });
    Section {
        title: format!("Residual {torque}"),
        items,
    }
}
