//! Estimates against the width of the windows.

use super::basis::milliseconds;
use crate::dbi::{AtWidth, Study};
use crate::format::unit;
use crate::report::page::{Item, Plot, Role, Section, Style, Table};
use crate::report::points::Points;
use crate::report::tables::estimate_text;

/// Errors this many times the smallest one leave the ordinate to the better estimates.
const MOST_ERROR: f64 = 10.0;

/// All parameters over all widths.
pub(super) fn section(study: &Study) -> Section {
    let widths = &study.widths;
    let mut items = vec![
        Item::text(
            "The same recordings under windows of other widths. An estimate that rests on the physics does not care; one that encoder noise (narrow windows) or something left out biases moves with the width.",
        ),
        Item::List {
            points: study.agreement.iter().map(|a| a.text.clone()).collect(),
        },
    ];
    let estimated = estimated(widths);
    let plots = estimated.iter().map(|&k| plot(widths, k));
    items.push(Item::Plots {
        plots: plots.collect(),
    });
    items.push(Item::Table(table(widths, &estimated)));
    let failures = widths.iter().filter_map(|w| {
        let why = w.failure.as_ref()?;
        Some(format!("{} ms: no fit: {why}", milliseconds(w.half_width)))
    });
    let failures: Vec<String> = failures.collect();
    if !failures.is_empty() {
        items.push(Item::List { points: failures });
    }
    Section {
        title: "Estimates against the half-width".to_owned(),
        items,
    }
}

/// Positions of the parameters that were estimated at the chosen width.
fn estimated(widths: &[AtWidth]) -> Vec<usize> {
    let chosen = widths.iter().find(|w| w.chosen);
    let estimates = chosen.map_or(&[][..], |w| &w.estimates).iter().enumerate();
    estimates
        .filter(|(_, e)| e.estimate.se.is_some())
        .map(|(k, _)| k)
        .collect()
}

fn plot(widths: &[AtWidth], k: usize) -> Plot {
    let point = |w: &AtWidth| {
        let e = &w.estimates.get(k)?.estimate;
        let se = e.se.filter(|se| se.is_finite())?;
        e.value
            .is_finite()
            .then_some([1e3 * w.half_width, e.value, se])
    };
    let all: Vec<[f64; 3]> = widths.iter().filter_map(point).collect();
    let chosen: Vec<&AtWidth> = widths.iter().filter(|w| w.chosen).collect();
    let label = chosen[0].estimates[k].name.clone();
    let name = unit(chosen[0].estimates[k].estimate.unit);
    let own: Vec<[f64; 3]> = chosen.iter().filter_map(|w| point(w)).collect();
    let others: Vec<[f64; 3]> = all.iter().copied().filter(|p| !own.contains(p)).collect();
    let mut points = Points::default();
    points.add("other widths ± se", Role::Measured, Style::Bars, others);
    points.add("chosen width ± se", Role::After, Style::Bars, own);
    let mut plot = points.plot();
    plot.series.retain(|s| s.y.iter().any(|y| y.is_finite()));
    Plot {
        title: label.clone(),
        x_label: "half-width [ms]".to_owned(),
        y_label: format!("{label} [{name}]"),
        height: 220,
        limit: limit(&all),
        ..plot
    }
}

/// The range of all estimates with their bars, those with errors far beyond the smallest left out.
pub(super) fn limit(points: &[[f64; 3]]) -> Option<[f64; 2]> {
    let least = points.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
    let good = points.iter().filter(|p| p[2] <= MOST_ERROR * least);
    good.map(|p| [p[1] - p[2], p[1] + p[2]])
        .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

fn table(widths: &[AtWidth], estimated: &[usize]) -> Table {
    let names = widths
        .iter()
        .find(|w| w.chosen)
        .map_or(&[][..], |w| &w.estimates);
    let heading = ["Half-width [ms]", "Training windows"]
        .map(str::to_owned)
        .into_iter();
    let rows = widths.iter().filter(|w| w.failure.is_none()).map(|w| {
        let mark = if w.chosen { " (chosen)" } else { "" };
        let cells = estimated
            .iter()
            .map(|&k| estimate_text(&w.estimates[k].estimate));
        [
            format!("{}{mark}", milliseconds(w.half_width)),
            w.rows.to_string(),
        ]
        .into_iter()
        .chain(cells)
        .collect()
    });
    Table {
        columns: heading
            .chain(estimated.iter().map(|&k| names[k].name.clone()))
            .collect(),
        rows: rows.collect(),
    }
}
