//! Measured against simulated: one part for each recording.

use super::format::{scaled_unit, unit};
use super::page::{Band, Item, Plot, Role, Section, Style};
use super::subject::{Prediction, Subject};
use super::thin::thin;
use crate::error::Result;

/// Recordings that get plots of their own.
pub(super) const MOST_RECORDINGS: usize = 6;
/// Points of all main plots together; two screens' width for one recording.
const POINTS: usize = 12_000;

/// The section with all runs.
pub(super) fn section(subject: &Subject, predictions: &[Prediction]) -> Result<Section> {
    let count = subject.recordings.len();
    let shown = count.min(MOST_RECORDINGS);
    let points = (POINTS / shown).min(4000);
    let mut items = vec![Item::text(explanation(subject))];
    if count > shown {
        items.push(Item::text(format!(
            "The first {shown} of {count} recordings are shown; all of them count in every number of this report."
        )));
    }
    for index in 0..shown {
        if count > 1 {
            items.push(Item::heading(subject.recordings[index].file_name()));
        }
        items.extend(run(subject, &predictions[index], index, points)?);
    }
    Ok(Section {
        title: "Measured against simulated".to_owned(),
        items,
    })
}

fn explanation(subject: &Subject) -> String {
    if subject.inverse() {
        "The motion of this recording is imposed: the model says which u it takes, along the measured motion. The last 30 % of the recording (shaded) were held out from the fit.".to_owned()
    } else {
        "The model is driven by the recorded u alone and restarted from the measured state every second. The last 30 % of the recording (shaded) were held out from the fit. Drag over a plot to zoom in, double-click to see all of it again.".to_owned()
    }
}

fn run(
    subject: &Subject,
    prediction: &Prediction,
    index: usize,
    points: usize,
) -> Result<Vec<Item>> {
    let group = Some(format!("run-{index}"));
    let mut items = vec![
        Item::Plots {
            plots: vec![over_time(subject, prediction, index, points, group.clone())],
        },
        Item::Plots {
            plots: vec![errors(subject, prediction, index, points, group.clone())],
        },
    ];
    if !subject.inverse() {
        items.push(Item::Plots {
            plots: vec![free_run(subject, prediction, index, points / 2)?],
        });
    }
    Ok(items)
}

fn over_time(
    subject: &Subject,
    prediction: &Prediction,
    index: usize,
    points: usize,
    group: Option<String>,
) -> Plot {
    let (name, si) = subject.compared();
    let (factor, unit) = scaled_unit(largest(&prediction.measured), si);
    let mut plot = time_plot(subject, prediction, index);
    plot.title = if subject.inverse() {
        format!("{name} along the measured motion")
    } else {
        format!("{name}, restarted every second")
    };
    plot.y_label = format!("{} [{unit}]", name.to_lowercase());
    plot.height = 300;
    plot.limit = Some(around(&prediction.measured, 0.5).map(|x| x * factor));
    plot.group = group;
    let models = [prediction.before.as_ref(), Some(&prediction.after)];
    draw(
        &mut plot,
        subject,
        Some(&prediction.measured),
        models,
        factor,
        points,
        index,
    );
    plot
}

fn errors(
    subject: &Subject,
    prediction: &Prediction,
    index: usize,
    points: usize,
    group: Option<String>,
) -> Plot {
    let (name, si) = subject.compared();
    let error = |predicted: &Vec<f64>| -> Vec<f64> {
        predicted
            .iter()
            .zip(&prediction.measured)
            .map(|(p, x)| p - x)
            .collect()
    };
    let (before, after) = (
        prediction.before.as_ref().map(error),
        error(&prediction.after),
    );
    let [low, high] = around(&prediction.measured, 0.0);
    let greatest = largest(&after)
        .max(before.as_deref().map_or(0.0, largest))
        .min(high - low);
    let (factor, unit) = scaled_unit(greatest, si);
    let mut plot = time_plot(subject, prediction, index);
    plot.title = "Error: simulated less measured".to_owned();
    plot.y_label = format!("error of {} [{unit}]", name.to_lowercase());
    plot.height = 220;
    plot.limit = Some([-1.1 * greatest * factor, 1.1 * greatest * factor]);
    plot.group = group;
    draw(
        &mut plot,
        subject,
        None,
        [before.as_ref(), Some(&after)],
        factor,
        points,
        index,
    );
    plot
}

fn free_run(
    subject: &Subject,
    prediction: &Prediction,
    index: usize,
    points: usize,
) -> Result<Plot> {
    let (name, si) = subject.compared();
    let before = subject
        .before
        .map(|b| subject.free_run(b.model, index))
        .transpose()?;
    let after = subject.free_run(subject.after.model, index)?;
    let (factor, unit) = scaled_unit(largest(&prediction.measured), si);
    let mut plot = time_plot(subject, prediction, index);
    plot.title = "One free run over the whole recording".to_owned();
    plot.caption = "Never restarted: small errors of torque add up to large errors of position, so this is the harder test. The axis ends at the measured span and once more to either side.".to_owned();
    plot.y_label = format!("{} [{unit}]", name.to_lowercase());
    plot.height = 200;
    plot.limit = Some(around(&prediction.measured, 1.0).map(|x| x * factor));
    draw(
        &mut plot,
        subject,
        Some(&prediction.measured),
        [before.as_ref(), Some(&after)],
        factor,
        points,
        index,
    );
    Ok(plot)
}

/// A plot over the time of a recording, its held-out part shaded.
fn time_plot(subject: &Subject, prediction: &Prediction, index: usize) -> Plot {
    let t = &subject.recordings[index].t;
    Plot {
        x_label: format!("time [{}]", unit("s")),
        bands: vec![Band {
            from: t[prediction.boundary],
            to: t[t.len() - 1],
            held_out: true,
            label: "held out".to_owned(),
        }],
        ..Plot::default()
    }
}

/// Adds the measured series and those of the models, in the plot's unit and thinned.
fn draw(
    plot: &mut Plot,
    subject: &Subject,
    measured: Option<&Vec<f64>>,
    models: [Option<&Vec<f64>>; 2],
    factor: f64,
    points: usize,
    index: usize,
) {
    let names = subject.names();
    let all = [
        (measured, "measured", Role::Measured),
        (models[0], names.0, Role::Before),
        (models[1], names.1, Role::After),
    ];
    let present: Vec<_> = all
        .into_iter()
        .filter_map(|(y, name, role)| Some((y?, name, role)))
        .collect();
    let series: Vec<Vec<f64>> = present
        .iter()
        .map(|(y, ..)| y.iter().map(|y| y * factor).collect())
        .collect();
    let (x, thinned) = thin(&subject.recordings[index].t, &series, points);
    plot.x = x;
    for ((_, name, role), y) in present.into_iter().zip(thinned) {
        plot.push(name, role, Style::Line, y);
    }
}

fn largest(values: &[f64]) -> f64 {
    values
        .iter()
        .filter(|x| x.is_finite())
        .fold(0.0, |a: f64, b| a.max(b.abs()))
}

/// The span of finite values, widened on both sides by a share of itself.
fn around(values: &[f64], share: f64) -> [f64; 2] {
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| {
            (a.min(x), b.max(x))
        });
    let margin = share * (high - low);
    [low - margin, high + margin]
}
