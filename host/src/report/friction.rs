//! The friction curve: what the models say resists motion, and what the recordings ask for at each speed.

use super::page::{Item, Plot, Role, Section, Style};
use super::points::{Points, bins, dots};
use super::rows::Rows;
use super::subject::Subject;
use crate::axis::{Axis, State};
use crate::error::Result;
use crate::format::{quantity, scaled_unit};

/// Points of a friction curve for each direction.
const CURVE: usize = 120;
/// Bins for each direction, with equal numbers of rows.
const BINS: usize = 12;

/// The friction curves of the models, with what the recordings ask for at each speed.
///
/// The dots are the final model's curve plus the residual of each row: a component-plus-residual plot (W. A. Larsen
/// and S. J. `McCleary`, Technometrics 14, 1972). What other parts of the model explain is thus taken out.
pub(super) fn section(subject: &Subject, rows: &Rows) -> Result<Section> {
    let (torque, si) = subject.torque();
    let (speed, length) = subject.motion_units();
    let survey = subject.bench.problem.survey(subject.after.model);
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
            let state = State { q: middle, v };
            (v, after.contact.steady(state, v.signum()) - rows.after[k])
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
    let means = [back, forth].map(|side| bins(side, BINS)).concat();
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
            (v, axis.contact.steady(State { q, v }, s))
        })
    };
    side(-1.0).rev().chain(side(1.0)).collect()
}
