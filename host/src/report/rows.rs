//! The weak-form rows as maps: residual torque against time, velocity and position, and the friction curve.

use super::format::{scaled_unit, unit};
use super::page::{Band, Item, Plot, Role, Section, Series, Style};
use super::runs::MOST_RECORDINGS;
use super::subject::Subject;
use crate::axis::Axis;
use crate::diagnose::Where;
use crate::error::Result;
use crate::model::Model;
use crate::motion::Motion;
use crate::system;

/// Dots of one map; more would only hide each other.
const DOTS: usize = 6000;
/// Rows with less of one direction than this lie around a reversal: their friction is a mean of both levels.
const SLIDING: f64 = 0.98;
/// Points of a friction curve for each direction.
const CURVE: usize = 120;
/// Bins of measured friction for each direction, with equal numbers of rows.
const BINS: usize = 12;
/// A bin needs this many rows.
const FEWEST_IN_BIN: usize = 6;

/// The rows of all recordings with the residual torque that each model leaves.
pub(super) struct Rows {
    track: Vec<usize>,
    time: Vec<f64>,
    velocity: Vec<f64>,
    position: Vec<f64>,
    sliding: Vec<bool>,
    before: Option<Vec<f64>>,
    after: Vec<f64>,
}

impl Rows {
    /// Evaluates the rows.
    pub fn new(subject: &Subject) -> Self {
        let problem = &subject.bench.problem;
        let residual = |model: &Model| -> Vec<f64> {
            let scale = system::torque_scale(problem, model);
            system::residual(problem, model)
                .iter()
                .map(|r| r * scale)
                .collect()
        };
        Self {
            track: problem.rows.iter().map(|r| r.track).collect(),
            time: problem.rows.iter().map(|r| problem.time(*r)).collect(),
            velocity: problem.velocity().to_vec(),
            position: problem
                .rows
                .iter()
                .map(|r| problem.tracks[r.track].q[r.centre])
                .collect(),
            sliding: problem
                .coulomb()
                .iter()
                .map(|s| s.abs() > SLIDING)
                .collect(),
            before: subject.before.map(|b| residual(b.model)),
            after: residual(subject.after.model),
        }
    }

    fn scale(&self, si: &str) -> (f64, String) {
        let all = self.after.iter().chain(self.before.iter().flatten());
        scaled_unit(all.fold(0.0, |a: f64, b| a.max(b.abs())), si)
    }

    /// Residual torque over one coordinate of some rows.
    fn map(&self, subject: &Subject, coordinate: &[f64], keep: impl Fn(usize) -> bool) -> Plot {
        let (factor, unit) = self.scale(subject.torque().1);
        let mut order: Vec<usize> = (0..coordinate.len()).filter(|&k| keep(k)).collect();
        let step = order.len().div_ceil(DOTS).max(1);
        order = order.into_iter().step_by(step).collect();
        order.sort_by(|&a, &b| coordinate[a].total_cmp(&coordinate[b]));
        let pick = |y: &[f64]| order.iter().map(|&k| factor * y[k]).collect::<Vec<f64>>();
        let mut plot = Plot {
            x: order.iter().map(|&k| coordinate[k]).collect(),
            y_label: format!("residual {} [{unit}]", subject.torque().0),
            height: 260,
            ..Plot::default()
        };
        let names = subject.names();
        if let Some(before) = &self.before {
            plot.push(names.0, Role::Before, Style::Dots, pick(before));
        }
        plot.push(names.1, Role::After, Style::Dots, pick(&self.after));
        plot
    }
}

/// The residual maps; `place` is the located region, if there is something to locate.
pub(super) fn residual_section(subject: &Subject, rows: &Rows, place: Option<&Where>) -> Section {
    let (torque, _) = subject.torque();
    let motion = subject.after.model.motion;
    let (speed, length) = if motion == Motion::Rotary {
        ("rad/s", "rad")
    } else {
        ("m/s", "m")
    };
    let region = place.map_or_else(
        || "Nothing significant is left, so no region is marked.".to_owned(),
        |place| format!("Shaded: where it lives. {}", place.text),
    );
    let mut items = vec![Item::text(format!(
        "The {torque} that drives the axis beyond what the model says, as a weighted mean over each window of the weak form; no noisy signal is differentiated. {region}"
    ))];
    let mut over_time = Vec::new();
    for index in 0..subject.recordings.len().min(MOST_RECORDINGS) {
        let mut plot = rows.map(subject, &rows.time, |k| rows.track[k] == index);
        plot.title = if subject.recordings.len() > 1 {
            format!("Against time, {}", subject.recordings[index].file_name())
        } else {
            "Against time".to_owned()
        };
        plot.x_label = "time [s]".to_owned();
        plot.bands = place.map_or_else(Vec::new, |p| p.time.iter().map(|t| band(*t)).collect());
        over_time.push(plot);
    }
    items.extend(
        over_time
            .into_iter()
            .map(|plot| Item::Plots { plots: vec![plot] }),
    );
    let mut velocity = rows.map(subject, &rows.velocity, |_| true);
    velocity.title = "Against velocity".to_owned();
    velocity.x_label = format!("velocity [{speed}]");
    velocity.bands = place.iter().map(|p| band(p.velocity)).collect();
    let mut position = rows.map(subject, &rows.position, |_| true);
    position.title = "Against position".to_owned();
    position.x_label = format!("position [{length}]");
    position.bands = place.iter().map(|p| band(p.position)).collect();
    items.push(Item::Plots {
        plots: vec![velocity, position],
    });
    Section {
        title: format!("Residual {torque}"),
        items,
    }
}

fn band([from, to]: [f64; 2]) -> Band {
    Band {
        from,
        to,
        held_out: false,
        label: String::new(),
    }
}

/// The friction curves of the models, with what the recordings ask for at each speed.
///
/// The dots are the final model's curve plus the residual of each row: a component-plus-residual plot (W. A. Larsen
/// and S. J. McCleary, Technometrics 14, 1972). What other parts of the model explain is thus taken out.
pub(super) fn friction_section(subject: &Subject, rows: &Rows) -> Result<Section> {
    let (torque, si) = subject.torque();
    let survey = subject.bench.problem.survey();
    let middle = 0.5 * (survey.travel.0 + survey.travel.1);
    let after = Axis::new(subject.after.model)?;
    // Mean resisting torque of a row: the residual drives the axis, so it is friction that is missing.
    let measured: Vec<(f64, f64)> = (0..rows.after.len())
        .filter(|&k| rows.sliding[k])
        .map(|k| {
            let v = rows.velocity[k];
            (v, after.resistance(middle, v, v.signum()) - rows.after[k])
        })
        .collect();
    let (factor, torque_unit) =
        scaled_unit(measured.iter().fold(0.0, |a: f64, b| a.max(b.1.abs())), si);
    let mut points = Points::default();
    let names = subject.names();
    let step = measured.len().div_ceil(DOTS / 2).max(1);
    points.add(
        "measured",
        Role::Measured,
        Style::Dots,
        measured.iter().step_by(step).map(|&(v, f)| [v, f, 0.0]),
    );
    points.add(
        "mean ± standard deviation",
        Role::Measured,
        Style::Bars,
        bins(&measured),
    );
    if let Some(before) = subject.before {
        points.add(
            names.0,
            Role::Before,
            Style::Line,
            curve(&Axis::new(before.model)?, middle, survey.top_speed),
        );
    }
    points.add(
        names.1,
        Role::After,
        Style::Line,
        curve(&after, middle, survey.top_speed),
    );
    let mut plot = points.plot(factor);
    let (speed, length) = if survey.motion == Motion::Rotary {
        ("rad/s", "rad")
    } else {
        ("m/s", "m")
    };
    plot.title = format!("Resisting {torque} against velocity, at the middle of the travel");
    plot.x_label = format!("velocity [{speed}]");
    plot.y_label = format!("resisting {torque} [{}]", unit(&torque_unit));
    plot.height = 360;
    plot.caption = format!(
        "Curves: all that resists motion at position {middle:.3} {length}, in steady sliding. Dots: the {} plus the residual {torque} of each weak-form row without a reversal in its window. Bars: one standard deviation of the rows of a bin; bins hold equal numbers of rows.",
        if subject.before.is_some() {
            "final model's curve"
        } else {
            "model's curve"
        },
    );
    Ok(Section {
        title: "Friction curve".to_owned(),
        items: vec![Item::Plots { plots: vec![plot] }],
    })
}

/// Curve of an axis from minus to plus top speed; dense where friction changes most, near zero.
fn curve(axis: &Axis, q: f64, top: f64) -> Vec<[f64; 3]> {
    let side = |s: f64| {
        (0..=CURVE).map(move |k| {
            let v = s * top * (k as f64 / CURVE as f64).powi(2);
            [v, axis.resistance(q, v, s), 0.0]
        })
    };
    side(-1.0).rev().chain(side(1.0)).collect()
}

/// Mean velocity, mean torque and its standard deviation in bins that do not reach across zero.
fn bins(measured: &[(f64, f64)]) -> Vec<[f64; 3]> {
    let mut bins = Vec::new();
    for s in [-1.0, 1.0] {
        let mut side: Vec<(f64, f64)> = measured
            .iter()
            .copied()
            .filter(|(v, _)| v * s > 0.0)
            .collect();
        side.sort_by(|a, b| a.0.total_cmp(&b.0));
        let size = side.len().div_ceil(BINS).max(FEWEST_IN_BIN);
        for bin in side.chunks(size).filter(|b| b.len() >= FEWEST_IN_BIN) {
            let n = bin.len() as f64;
            let mean = |f: &dyn Fn(&(f64, f64)) -> f64| bin.iter().map(f).sum::<f64>() / n;
            let (v, force) = (mean(&|p| p.0), mean(&|p| p.1));
            let variance = mean(&|p| (p.1 - force).powi(2)) * n / (n - 1.0);
            bins.push([v, force, variance.sqrt()]);
        }
    }
    bins
}

/// Series with abscissas of their own, merged into one.
#[derive(Default)]
struct Points {
    series: Vec<(&'static str, Role, Style)>,
    points: Vec<(usize, [f64; 3])>,
}

impl Points {
    fn add(
        &mut self,
        label: &'static str,
        role: Role,
        style: Style,
        points: impl IntoIterator<Item = [f64; 3]>,
    ) {
        let index = self.series.len();
        self.series.push((label, role, style));
        self.points.extend(points.into_iter().map(|p| (index, p)));
    }

    fn plot(mut self, factor: f64) -> Plot {
        self.points.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        let column = |index: usize, part: usize| -> Vec<f64> {
            let value = |(i, p): &(usize, [f64; 3])| {
                if *i == index {
                    factor * p[part]
                } else {
                    f64::NAN
                }
            };
            self.points.iter().map(value).collect()
        };
        let series = self
            .series
            .iter()
            .enumerate()
            .map(|(index, (label, role, style))| Series {
                label: (*label).to_owned(),
                role: *role,
                style: *style,
                y: column(index, 1),
                bar: if *style == Style::Bars {
                    column(index, 2)
                } else {
                    Vec::new()
                },
            });
        Plot {
            x: self.points.iter().map(|(_, p)| p[0]).collect(),
            series: series.collect(),
            ..Plot::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::bins;

    #[test]
    fn bins_hold_the_mean_and_do_not_reach_across_zero() {
        let measured: Vec<(f64, f64)> = (-60..60)
            .map(|k| f64::from(k) + 0.5)
            .map(|v| (v, v.signum() * 2.0))
            .collect();
        let bins = bins(&measured);
        assert!(bins.len() >= 16);
        assert!(
            bins.iter()
                .all(|[v, f, sd]| *f == v.signum() * 2.0 && *sd == 0.0)
        );
    }
}
