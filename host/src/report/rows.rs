//! The weak-form rows as maps: residual torque against time, velocity and position, and the friction curve.

use super::page::{Band, Item, Plot, Role, Section, Series, Style};
use super::runs::MOST_RECORDINGS;
use super::subject::Subject;
use super::thin::thin;
use crate::axis::Axis;
use crate::diagnose::Where;
use crate::error::Result;
use crate::format::{quantity, scaled_unit, whole_percent};
use crate::model::Model;
use crate::system;

/// Dots of one series; more would only hide each other.
const DOTS: usize = 3000;
/// Rows with less of one direction than this lie around a reversal: their friction is a mean of both levels.
const SLIDING: f64 = 0.98;
/// Points of a friction curve for each direction.
const CURVE: usize = 120;
/// Bins of the friction curve for each direction, and of a map, with equal numbers of rows.
const BINS: (usize, usize) = (12, 24);
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
            let residual = system::residual(problem, model);
            residual.iter().map(|r| r * scale).collect()
        };
        let rows = problem.rows.iter();
        let coulomb = problem.coulomb();
        Self {
            track: rows.clone().map(|r| r.track).collect(),
            time: rows.clone().map(|r| problem.time(*r)).collect(),
            velocity: problem.velocity().to_vec(),
            position: rows.map(|r| problem.tracks[r.track].q[r.centre]).collect(),
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
                points.add(&label, role, Style::Line, bins(pairs(y), BINS.1));
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
pub(super) fn residual_section(
    subject: &Subject,
    rows: &Rows,
    place: std::result::Result<&Where, &str>,
) -> Section {
    let (torque, _) = subject.torque();
    let (speed, length) = subject.motion_units();
    let region = place.map_or_else(
        str::to_owned,
        |place| {
            format!(
                "Shaded: the times at which the mismatch is above its average, and the narrowest ranges of velocity and of position that hold {} of it. {}",
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
    let several = subject.recordings.len() > 1;
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
        ],
    });
    Section {
        title: format!("Residual {torque}"),
        items,
    }
}

/// The friction curves of the models, with what the recordings ask for at each speed.
///
/// The dots are the final model's curve plus the residual of each row: a component-plus-residual plot (W. A. Larsen
/// and S. J. `McCleary`, Technometrics 14, 1972). What other parts of the model explain is thus taken out.
pub(super) fn friction_section(subject: &Subject, rows: &Rows) -> Result<Section> {
    let (torque, si) = subject.torque();
    let (speed, length) = subject.motion_units();
    let survey = subject.bench.problem.survey();
    // Rounded to a hundredth of the travel's decade: nobody needs to know that the middle is at −1.02·10⁻⁶ m.
    let (low, high) = survey.travel;
    let step = 10f64.powf((high - low).max(f64::MIN_POSITIVE).log10().floor() - 2.0);
    let middle = (0.5 * (low + high) / step).round() * step;
    let after = Axis::new(subject.after.model)?;
    // Mean resisting torque of a row: the residual drives the axis, so it is friction that is missing.
    let measured: Vec<(f64, f64)> = (0..rows.after.len())
        .filter(|&k| rows.sliding[k])
        .map(|k| {
            let v = rows.velocity[k];
            (v, after.resistance(middle, v, v.signum()) - rows.after[k])
        })
        .collect();
    let top = rows.velocity.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
    let (factor, unit) = scaled_unit(measured.iter().fold(0.0, |a: f64, b| a.max(b.1.abs())), si);
    let measured: Vec<(f64, f64)> = measured.iter().map(|(v, f)| (*v, factor * f)).collect();
    let curve = |axis: &Axis| -> Vec<[f64; 3]> {
        let points = curve(axis, middle, top).into_iter();
        points.map(|(v, f)| [v, factor * f, 0.0]).collect()
    };
    let names = subject.names();
    let mut points = Points::default();
    let (back, forth): (Vec<_>, Vec<_>) = measured.iter().partition(|(v, _)| *v < 0.0);
    let means = [back, forth].map(|side| bins(side, BINS.0)).concat();
    points.add("measured", Role::Measured, Style::Dots, dots(measured));
    points.add("mean ± sd", Role::Measured, Style::Bars, means);
    if let Some(before) = subject.before {
        let before = curve(&Axis::new(before.model)?);
        points.add(names.0, Role::Before, Style::Line, before);
    }
    points.add(names.1, Role::After, Style::Line, curve(&after));
    let plot = Plot {
        title: format!("Resisting {torque} against velocity"),
        x_label: format!("velocity [{speed}]"),
        y_label: format!("resisting {torque} [{unit}]"),
        height: 360,
        caption: format!(
            "Lines: all that resists motion in steady sliding, at the middle of the travel ({}). Dots: the {}'s line plus the residual {torque} of each weak-form window without a reversal inside. Bars: one standard deviation of the dots in a bin; bins hold equal numbers of dots and do not reach across zero.",
            quantity(middle, length),
            names.1,
        ),
        ..points.plot()
    };
    Ok(Section {
        title: "Friction curve".to_owned(),
        items: vec![Item::Plots { plots: vec![plot] }],
    })
}

/// Curve of an axis from minus to plus top speed; dense where friction changes most, near zero.
fn curve(axis: &Axis, q: f64, top: f64) -> Vec<(f64, f64)> {
    let side = |s: f64| {
        (0..=CURVE).map(move |k| {
            let v = s * top * (k as f64 / CURVE as f64).powi(2);
            (v, axis.resistance(q, v, s))
        })
    };
    side(-1.0).rev().chain(side(1.0)).collect()
}

/// Dots in ascending order, thinned.
fn dots(mut points: Vec<(f64, f64)>) -> Vec<[f64; 3]> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
    let (x, mut thinned) = thin(&x, &[y], DOTS);
    let y = thinned.swap_remove(0);
    x.into_iter().zip(y).map(|(x, y)| [x, y, 0.0]).collect()
}

/// Mean abscissa, mean ordinate and its standard deviation in at most `most` bins with equal numbers of points.
fn bins(mut points: Vec<(f64, f64)>, most: usize) -> Vec<[f64; 3]> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = points.len().div_ceil(most).max(FEWEST_IN_BIN);
    let full = points.chunks(size).filter(|b| b.len() >= FEWEST_IN_BIN);
    full.map(|bin| {
        let n = bin.len() as f64;
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| bin.iter().map(f).sum::<f64>() / n;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let variance = mean(&|p| (p.1 - y).powi(2)) * n / (n - 1.0);
        [x, y, variance.sqrt()]
    })
    .collect()
}

/// Series with abscissas of their own, merged into one plot; a point is abscissa, ordinate and bar.
#[derive(Default)]
struct Points {
    series: Vec<(String, Role, Style)>,
    points: Vec<(usize, [f64; 3])>,
}

impl Points {
    fn add(&mut self, label: &str, role: Role, style: Style, points: Vec<[f64; 3]>) {
        let index = self.series.len();
        self.series.push((label.to_owned(), role, style));
        self.points.extend(points.into_iter().map(|p| (index, p)));
    }

    fn plot(mut self) -> Plot {
        self.points.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        let column = |index: usize, part: usize| -> Vec<f64> {
            let value = |(i, p): &(usize, [f64; 3])| if *i == index { p[part] } else { f64::NAN };
            self.points.iter().map(value).collect()
        };
        let series = self.series.iter().enumerate();
        Plot {
            x: self.points.iter().map(|(_, p)| p[0]).collect(),
            series: series
                .map(|(index, (label, role, style))| Series {
                    label: label.clone(),
                    role: *role,
                    style: *style,
                    y: column(index, 1),
                    bar: if *style == Style::Bars {
                        column(index, 2)
                    } else {
                        Vec::new()
                    },
                })
                .collect(),
            ..Plot::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Points, Role, Style, bins, dots};

    #[test]
    fn bins_hold_mean_and_standard_deviation() {
        // Each bin of 10 holds as many +1 as −1 around 2: variance 10/9.
        let points = (0..120).rev().map(|k| {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            (f64::from(k), 2.0 + sign)
        });
        let bins = bins(points.collect(), 12);
        assert_eq!(bins.len(), 12);
        assert_eq!(bins[0][0], 4.5);
        let sd = (10.0_f64 / 9.0).sqrt();
        assert!(
            bins.iter()
                .all(|[_, y, s]| *y == 2.0 && (s - sd).abs() < 1e-12)
        );
    }

    #[test]
    fn few_points_make_no_bin_and_series_keep_their_own_abscissas() {
        assert!(bins(vec![(0.0, 1.0); 5], 12).is_empty());
        let mut points = Points::default();
        points.add("a", Role::Before, Style::Dots, dots(vec![(2.0, 20.0)]));
        points.add("b", Role::After, Style::Line, vec![[1.0, 10.0, 0.0]]);
        let plot = points.plot();
        assert_eq!(plot.x, [1.0, 2.0]);
        assert!(plot.series[0].y[0].is_nan() && plot.series[0].y[1] == 20.0);
        assert!(plot.series[1].y[0] == 10.0 && plot.series[1].y[1].is_nan());
    }
}
