//! The page of a run in the emulator: what was asked of the axis, what it did, and what the board applied.

use super::cycle::over_time;
use super::page::{Figure, Item, Page, Role, Section};
use crate::bench::Record;
use crate::format::{quantity, scaled_unit, significant};

/// A run, as its page shows it.
pub struct Emulation<'a> {
    /// As the driver recorded it, with the truth behind it.
    pub record: &'a Record,
    /// The name of the axis.
    pub axis: &'a str,
    /// What drove it, in words.
    pub board: String,
    /// What the board was told, in words.
    pub told: String,
    /// Units of `u` and of the position.
    pub units: [&'static str; 2],
    /// RMS and largest distance between set point and measured position, if a position was asked for.
    pub tracking: Option<(f64, f64)>,
    /// When the bridge went off, s, and for which faults.
    pub trip: Option<(f64, Vec<&'static str>)>,
    /// What the test signal was drawn from.
    pub seed: u64,
}

pub(super) fn page(run: &Emulation) -> Page {
    let fact = |name: &str, value: &str| [name.to_owned(), value.to_owned()];
    let warnings = run.trip.iter().map(|(t, faults)| {
        format!(
            "The board turned its bridge off at t = {} s: {}. `bristle explain` tells about each.",
            significant(*t, 6),
            faults.join(", ")
        )
    });
    Page {
        title: "A run in the emulator".to_owned(),
        facts: vec![
            fact("Axis", run.axis),
            fact("Board", &run.board),
            fact("Told", &run.told),
            fact("Samples", &run.record.t.len().to_string()),
            fact("Seed", &run.seed.to_string()),
        ],
        verdict: None,
        warnings: warnings.collect(),
        figures: figures(run),
        figures_note: "Errors are those between set point and encoder.".to_owned(),
        sections: vec![
            Section {
                title: "The run".to_owned(),
                items: plots(run),
            },
            Section {
                title: "Method".to_owned(),
                items: vec![Item::List {
                    points: vec![
                        "Each control period, the axis moves under the last input, and its encoder, current and bus voltage go to the board as the converters would read them; the board answers with what its bridge applies. Neither side goes on before the other has answered, so the same options give the same bytes.".to_owned(),
                        format!("Written by Bristle {}.", env!("CARGO_PKG_VERSION")),
                    ],
                }],
            },
        ],
    }
}

fn figures(run: &Emulation) -> Vec<Figure> {
    let figure = |label: &str, value: f64, si: &str| {
        let (factor, name) = scaled_unit(value, si);
        Figure {
            label: label.to_owned(),
            before: None,
            after: quantity(factor * value, &name),
            note: String::new(),
        }
    };
    let [drive, position] = run.units;
    let input = run.record.u.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    let errors = run.tracking.iter().flat_map(|(rms, most)| {
        [
            figure("RMS tracking error", *rms, position),
            figure("Largest tracking error", *most, position),
        ]
    });
    errors
        .chain([figure("Largest input", input, drive)])
        .collect()
}

fn plots(run: &Emulation) -> Vec<Item> {
    let record = run.record;
    let [drive, position] = run.units;
    let asked = &record.set_point;
    let mut moved = vec![("encoder", Role::After, record.q.clone())];
    let mut plots = Vec::new();
    if !asked.is_empty() {
        moved.insert(0, ("set point", Role::Measured, asked.clone()));
        let error = asked.iter().zip(&record.q).map(|(r, q)| r - q).collect();
        let error = vec![("set point less encoder", Role::After, error)];
        plots.push(over_time("tracking error", position, &record.t, error));
    }
    plots.push(over_time("position", position, &record.t, moved));
    let velocity = record.truth.iter().map(|x| x.v).collect();
    plots.push(over_time(
        "velocity",
        &format!("{position}/s"),
        &record.t,
        vec![("as it is", Role::After, velocity)],
    ));
    plots.push(over_time(
        "input",
        drive,
        &record.t,
        vec![("u", Role::After, record.u.clone())],
    ));
    let wide = |plot| Item::Plots { plots: vec![plot] };
    plots.into_iter().map(wide).collect()
}
