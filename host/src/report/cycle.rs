//! The page of the whole loop: the same task before and after the diagnosis was deployed.

use super::page::{Figure, Item, Page, Plot, Role, Section, Style, Table};
use super::thin::thin;
use crate::cycle::{Knowledge, Lap};
use crate::format::{quantity, scaled_unit, significant, unit};

/// Points of a series over time.
const POINTS: usize = 4000;

/// The page of laps in the order in which they were run; `findings` are the names that the diagnosis gave.
pub(super) fn page(laps: &[Lap], findings: &[String], seed: u64) -> Page {
    let lap = |knowledge| laps.iter().find(|lap| lap.knowledge == knowledge);
    let (before, after) = (lap(Knowledge::Baseline), lap(Knowledge::Diagnosis));
    let found = if findings.is_empty() {
        "nothing".to_owned()
    } else {
        findings.join(", ")
    };
    Page {
        title: "Record, diagnose, deploy, verify".to_owned(),
        facts: vec![
            ["Board".to_owned(), "the firmware's image in QEMU".to_owned()],
            ["Found by the diagnosis".to_owned(), found],
            ["Seed".to_owned(), seed.to_string()],
        ],
        verdict: None,
        warnings: Vec::new(),
        figures: figures(before, after),
        figures_note: "Before: with Coulomb and viscous friction as identified from the recording. After: with what the diagnosis found in it. Errors are those of the true motion, over the whole task.".to_owned(),
        sections: vec![
            Section {
                title: "The same task with more knowledge".to_owned(),
                items: std::iter::once(Item::Table(table(laps)))
                    .chain(plots(laps))
                    .collect(),
            },
            Section {
                title: "Method".to_owned(),
                items: vec![Item::List {
                    points: vec![
                        "The axis conceals a Stribeck curve and an unbalance, has a 16384-count encoder, and bears a random torque of 0.01 N·m RMS that no recording shows.".to_owned(),
                        "It is recorded while the board moves it with a controller that knows no more than the inertia of a data sheet; the diagnosis sees that recording and a model of Coulomb and viscous friction.".to_owned(),
                        "Before each run the board gets its parameters over the link, writes them to its flash, is restarted, and is asked for them: they are those sent, bit for bit.".to_owned(),
                        "The bandwidth asked for, the integral, acceleration feed-forward and limits are the same in all runs, as are the task and the random torque. With compensation, the Coulomb level is learned on line as well.".to_owned(),
                        format!("Written by Bristle {}.", env!("CARGO_PKG_VERSION")),
                    ],
                }],
            },
        ],
    }
}

fn figures(before: Option<&Lap>, after: Option<&Lap>) -> Vec<Figure> {
    let (Some(before), Some(after)) = (before, after) else {
        return Vec::new();
    };
    let figure = |label: &str, before: f64, after: f64| {
        let (factor, name) = scaled_unit(before, "rad");
        Figure {
            label: label.to_owned(),
            before: Some(quantity(factor * before, &name)),
            after: quantity(factor * after, &name),
            note: format!("a factor of {}", significant(before / after, 3)),
        }
    };
    vec![
        figure("RMS tracking error", before.rms, after.rms),
        figure("Largest tracking error", before.peak, after.peak),
    ]
}

fn table(laps: &[Lap]) -> Table {
    // One unit for a column, that of its largest value.
    let in_unit = |value: &dyn Fn(&Lap) -> f64, lap: &Lap, si: &str| {
        let largest = laps.iter().map(value).fold(0.0, f64::max);
        let (factor, name) = scaled_unit(largest, si);
        format!("{} {}", significant(factor * value(lap), 3), unit(&name))
    };
    Table {
        columns: [
            "Compensated",
            "RMS error",
            "Largest error",
            "RMS of the torque",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: laps
            .iter()
            .map(|lap| {
                vec![
                    lap.knowledge.name().to_owned(),
                    in_unit(&|l| l.rms, lap, "rad"),
                    in_unit(&|l| l.peak, lap, "rad"),
                    in_unit(&|l| l.effort, lap, "N*m"),
                ]
            })
            .collect(),
    }
}

fn plots(laps: &[Lap]) -> Vec<Item> {
    let role = |knowledge| match knowledge {
        Knowledge::Nothing => Role::Measured,
        Knowledge::Baseline => Role::Before,
        Knowledge::Diagnosis => Role::After,
    };
    let error = |lap: &Lap| -> Vec<f64> {
        let pairs = lap.record.set_point.iter().zip(&lap.record.truth);
        pairs.map(|(r, truth)| r - truth.q).collect()
    };
    let all = |value: &dyn Fn(&Lap) -> Vec<f64>| -> Vec<(&str, Role, Vec<f64>)> {
        let series = laps.iter();
        series
            .map(|l| (l.knowledge.name(), role(l.knowledge), value(l)))
            .collect()
    };
    let t = laps.first().map_or(&[][..], |lap| &lap.record.t);
    let position = laps.iter().find(|l| l.knowledge == Knowledge::Diagnosis);
    let position = position.map_or_else(Vec::new, |l| {
        vec![
            ("set point", Role::Measured, l.record.set_point.clone()),
            (
                "as diagnosed",
                Role::After,
                l.record.truth.iter().map(|x| x.q).collect(),
            ),
        ]
    });
    let plots = [
        over_time("tracking error", "rad", t, all(&error)),
        over_time("position", "rad", t, position),
        over_time("torque", "N*m", t, all(&|l| l.record.u.clone())),
    ];
    let wide = |plot| Item::Plots { plots: vec![plot] };
    plots.into_iter().map(wide).collect()
}

pub(super) fn over_time(
    title: &str,
    si: &str,
    t: &[f64],
    series: Vec<(&str, Role, Vec<f64>)>,
) -> Plot {
    let values = series.iter().flat_map(|(.., y)| y);
    let largest = values.fold(0.0_f64, |m, y| m.max(y.abs()));
    let (factor, name) = scaled_unit(largest, si);
    let values: Vec<Vec<f64>> = series
        .iter()
        .map(|(.., y)| y.iter().map(|y| factor * y).collect())
        .collect();
    let (x, values) = thin(t, &values, POINTS);
    let mut plot = Plot {
        title: format!("{}{}", title[..1].to_uppercase(), &title[1..]),
        x_label: "time [s]".to_owned(),
        y_label: format!("{title} [{}]", unit(&name)),
        height: 240,
        x,
        group: Some("time".to_owned()),
        ..Plot::default()
    };
    for ((label, role, _), y) in series.into_iter().zip(values) {
        plot.push(label, role, Style::Line, y);
    }
    plot
}
