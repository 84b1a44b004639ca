//! Tables of parameters and of prediction errors, and how their entries read.

use super::page::{Item, Section, Table};
use super::spread::Spreads;
use super::subject::Subject;
use crate::diagnose::{self, Estimate};
use crate::format::{self, percent, scaled_unit, value, with_unit};
use crate::model::Model;

/// All parameters, baseline beside final model, and those of a model from the whole recordings if there is one.
pub(super) fn parameters(subject: &Subject, whole: Option<&Model>) -> Section {
    let cells = |model: &Model| -> Vec<(String, String)> {
        let labels = model.labels().into_iter().zip(model.parameters());
        labels
            .map(|(label, p)| {
                let estimate = diagnose::estimate(p, label.unit);
                (label.to_string(), estimate_text(&estimate))
            })
            .collect()
    };
    let before = subject.before.map(|b| cells(b.model));
    let all = whole.map(cells);
    let rows = cells(subject.after.model).into_iter().map(|(name, value)| {
        let other = |cells: &Vec<(String, String)>| {
            let same = cells.iter().find(|(n, _)| *n == name);
            same.map_or("–", |(_, v)| v).to_owned()
        };
        let (old, all) = (before.as_ref().map(other), all.as_ref().map(other));
        [Some(name), old, Some(value), all]
            .into_iter()
            .flatten()
            .collect()
    });
    let mut columns = columns(subject, "Parameter", "Value");
    let mut items = Vec::new();
    if whole.is_some() {
        columns.push("From the whole recordings".to_owned());
        items.push(Item::text(
            "The model file has the values from the whole recordings. The plots and errors on this page are those of the values from the training part, which the rest of the recordings can judge.",
        ));
    }
    let rows = rows.collect();
    items.push(Item::Table(Table { columns, rows }));
    Section {
        title: "Parameters".to_owned(),
        items,
    }
}

/// Heading of the first column, then one for each model; a model alone is called `single`.
fn columns(subject: &Subject, first: &str, single: &str) -> Vec<String> {
    let models: &[&str] = if subject.before.is_some() {
        &["Baseline", "Final model"]
    } else {
        &[single]
    };
    let all = std::iter::once(first).chain(models.iter().copied());
    all.map(str::to_owned).collect()
}

/// A parameter as tables show it; one that was not estimated says so.
pub(super) fn estimate_text(estimate: &Estimate) -> String {
    let text = format::parameter(estimate.value, estimate.se, estimate.unit);
    if estimate.status == "identified" {
        text
    } else {
        format!("{text} ({})", estimate.status)
    }
}

/// Prediction errors of both parts.
pub(super) fn errors(subject: &Subject, spreads: &Spreads) -> Section {
    let (_, si) = subject.compared();
    let models = [
        subject
            .before
            .map(|b| (b.fit, spreads.train.before, spreads.held_out.before)),
        Some((
            subject.after.fit,
            spreads.train.after,
            spreads.held_out.after,
        )),
    ];
    let mut rows = [
        "Training part, NRMSE",
        "Training part, RMS error",
        "Held-out part, NRMSE",
        "Held-out part, RMS error",
    ]
    .map(|title| vec![title.to_owned()]);
    for (fit, train, held_out) in models.into_iter().flatten() {
        rows[0].push(nrmse(fit.train.nrmse, train.nrmse));
        rows[1].push(rms(fit.train.rmse, train.rmse, si));
        rows[2].push(nrmse(fit.held_out.nrmse, held_out.nrmse));
        rows[3].push(rms(fit.held_out.rmse, held_out.rmse, si));
    }
    Section {
        title: "Prediction errors".to_owned(),
        items: vec![Item::Table(Table {
            columns: columns(subject, "", "Model"),
            rows: rows.to_vec(),
        })],
    }
}

/// An RMS error in a convenient unit.
pub(super) fn rms(rmse: f64, se: Option<f64>, si: &str) -> String {
    let (factor, unit) = scaled_unit(rmse, si);
    let se = telling(rmse, se).map(|se| factor * se);
    with_unit(&value(factor * rmse, se), &unit)
}

/// An NRMSE as a percentage.
pub(super) fn nrmse(nrmse: f64, se: Option<f64>) -> String {
    percent(nrmse, telling(nrmse, se))
}

/// The standard error of an error figure, unless it exceeds the figure: then the few samples of a model that ran away
/// rule both, and the windows tell nothing.
fn telling(figure: f64, se: Option<f64>) -> Option<f64> {
    se.filter(|se| *se <= figure)
}

#[cfg(test)]
mod tests {
    use super::{nrmse, rms};

    #[test]
    fn an_error_larger_than_its_figure_is_left_out() {
        assert_eq!(nrmse(0.05, Some(0.01)), "5.0 ± 1.0 %");
        assert_eq!(nrmse(0.05, Some(1e14)), "5.00 %");
        assert_eq!(rms(0.005, Some(0.001), "m"), "5.0 ± 1.0 mm");
        assert_eq!(rms(0.005, Some(0.1), "m"), "5.00 mm");
    }
}
