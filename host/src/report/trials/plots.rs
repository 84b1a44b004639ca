//! Plots of an experiment.

use crate::format::{scaled_unit, unit};
use crate::report::page::{Band, Plot, Role, Style};
use crate::report::thin::thin;
use crate::servo::Sample;
use crate::trials::{Campaign, Shown, Way};

use super::Words;

/// Points of a series over time.
const POINTS: usize = 4000;

/// RMS errors plant by plant, ordered by that without.
pub(super) fn plants(campaign: &Campaign, way: Way, words: &Words) -> Plot {
    let mut pairs: Vec<(f64, f64)> = campaign
        .trials
        .iter()
        .filter_map(|t| {
            Some((
                t.merits.first()?.rms,
                t.merits.iter().find(|m| m.way == way)?.rms,
            ))
        })
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let largest = pairs.iter().map(|p| p.0.max(p.1)).fold(0.0, f64::max);
    let (factor, name) = scaled_unit(largest, words.si);
    let mut plot = Plot {
        title: way.name().to_owned(),
        caption: "RMS error of each plant, ordered by that without.".to_owned(),
        x_label: "plant".to_owned(),
        y_label: format!("RMS error [{}]", unit(&name)),
        height: 240,
        x: (1..=pairs.len()).map(|k| k as f64).collect(),
        limit: Some([0.0, 1.05 * factor * largest]),
        ..Plot::default()
    };
    plot.push(
        "without",
        Role::Before,
        Style::Dots,
        pairs.iter().map(|p| factor * p.0).collect(),
    );
    plot.push(
        "with",
        Role::After,
        Style::Dots,
        pairs.iter().map(|p| factor * p.1).collect(),
    );
    plot
}

/// What an error of tracking spans, in the unit of its plot.
pub(super) fn tracking_range(
    campaign: &Campaign,
    shown: &Shown,
    error: &dyn Fn(&Sample) -> f64,
) -> Option<[f64; 2]> {
    let end = campaign.judged.last()?[1];
    let tracked = shown.samples.iter().take((end / campaign.period) as usize);
    let most = tracked.map(|s| error(s).abs()).fold(0.0, f64::max);
    let all = shown
        .samples
        .iter()
        .map(|s| error(s).abs())
        .fold(0.0, f64::max);
    let (factor, _) = scaled_unit(all, "rad");
    Some([-1.1 * factor * most, 1.1 * factor * most])
}

/// A plot over time, thinned, in a convenient unit.
pub(super) fn over_time(
    campaign: &Campaign,
    title: &str,
    si: &str,
    series: &[(&str, Role, Vec<f64>)],
) -> Plot {
    let largest = series
        .iter()
        .flat_map(|(.., y)| y)
        .fold(0.0_f64, |m, y| m.max(y.abs()));
    let (factor, name) = scaled_unit(largest, si);
    let n = series.iter().map(|(.., y)| y.len()).min().unwrap_or(0);
    let t: Vec<f64> = (0..n).map(|k| k as f64 * campaign.period).collect();
    let values: Vec<Vec<f64>> = series
        .iter()
        .map(|(.., y)| y[..n].iter().map(|y| factor * y).collect())
        .collect();
    let (x, values) = thin(&t, &values, POINTS);
    let mut plot = Plot {
        title: title.to_owned(),
        x_label: "time [s]".to_owned(),
        y_label: format!("{title} [{}]", unit(&name)),
        height: 200,
        x,
        group: Some("time".to_owned()),
        bands: campaign
            .judged
            .iter()
            .map(|&[from, to]| Band {
                from,
                to,
                held_out: true,
                label: "judged".to_owned(),
            })
            .collect(),
        ..Plot::default()
    };
    for ((label, role, _), y) in series.iter().zip(values) {
        plot.push(label, *role, Style::Line, y);
    }
    plot
}
