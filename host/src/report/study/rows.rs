//! The algebraic problem: its columns, its rows as a check, and what they leave.

use super::lines;
use crate::dbi::Study;
use crate::format::{quantity, scaled_unit, shortest, significant, unit, whole_percent, with_unit};
use crate::report::page::{Band, Item, Plot, Role, Section, Table};
use crate::report::runs::MOST_RECORDINGS;

/// Rows of one recording, and where its held-out part begins.
struct Part<'a> {
    name: &'a str,
    rows: Vec<usize>,
    time: Vec<f64>,
    bands: Vec<(f64, f64)>,
}

fn parts(study: &Study) -> impl Iterator<Item = Part<'_>> {
    let f = &study.functionals;
    let recordings = study.windows.recordings.iter().enumerate();
    recordings.take(MOST_RECORDINGS).map(|(index, laid)| {
        let rows: Vec<usize> = (0..f.time.len())
            .filter(|k| f.recording[*k] == index)
            .collect();
        let held: Vec<f64> = rows
            .iter()
            .filter(|k| f.held_out[**k])
            .map(|k| f.time[*k])
            .collect();
        Part {
            name: &laid.recording,
            time: rows.iter().map(|k| f.time[*k]).collect(),
            bands: held
                .first()
                .zip(held.last())
                .map(|(a, b)| (*a, *b))
                .into_iter()
                .collect(),
            rows,
        }
    })
}

impl Part<'_> {
    fn of(&self, values: &[f64], factor: f64) -> Vec<f64> {
        self.rows.iter().map(|k| factor * values[*k]).collect()
    }

    /// A plot over this part's time.
    fn plot(&self, title: &str, y_label: String, series: &[(&str, Role, Vec<f64>)]) -> Plot {
        let band = |&(from, to): &(f64, f64)| Band {
            from,
            to,
            held_out: true,
            label: "held out".to_owned(),
        };
        Plot {
            title: title.to_owned(),
            x_label: "time [s]".to_owned(),
            y_label,
            bands: self.bands.iter().map(band).collect(),
            group: Some(format!("rows of {}", self.name)),
            ..lines(&self.time, series)
        }
    }
}

/// The columns of the problem over time.
pub(super) fn functionals(study: &Study) -> Section {
    let f = &study.functionals;
    let drive = f.terms[1].rms;
    let table = f.terms.iter().map(|t| {
        vec![
            t.name.clone(),
            t.formula.to_owned(),
            unit(t.unit),
            significant(t.coefficient, 4),
            quantity(t.rms, f.unit),
            whole_percent(t.rms / drive),
        ]
    });
    let mut items = vec![
        Item::text(
            "Each term of the equation of motion is one column, a functional of the recording, times a coefficient. B: what the term resists for a unit coefficient. The last columns say how much of the drive each term takes: one that takes next to nothing cannot be estimated well.",
        ),
        Item::Table(Table {
            columns: [
                "Term",
                "Functional",
                "Unit",
                "Coefficient (SI)",
                "RMS",
                "Of the drive",
            ]
            .map(str::to_owned)
            .to_vec(),
            rows: table.collect(),
        }),
    ];
    for part in parts(study) {
        items.push(Item::heading(part.name));
        let plots = f.terms.iter().map(|t| Plot {
            height: 190,
            ..part.plot(
                &format!("{}, {}", t.name, t.formula),
                format!("{} [{}]", t.formula, unit(t.unit)),
                &[(t.formula, Role::Measured, part.of(&t.values, 1.0))],
            )
        });
        items.push(Item::Plots {
            plots: plots.collect(),
        });
    }
    Section {
        title: "Functionals".to_owned(),
        items,
    }
}

/// Left side against right side.
pub(super) fn check(study: &Study) -> Section {
    let f = &study.functionals;
    let left = f.drive.iter().chain(&f.model);
    let (factor, name) = scaled_unit(left.fold(0.0, |a: f64, x| a.max(x.abs())), f.unit);
    let (fine, fine_name) = scaled_unit(
        f.residual.iter().fold(0.0, |a: f64, x| a.max(x.abs())),
        f.unit,
    );
    let rms = |x: &[f64], held_out: bool| {
        let own = || {
            x.iter()
                .zip(&f.held_out)
                .filter(move |(_, h)| **h == held_out)
        };
        (own().map(|(x, _)| x * x).sum::<f64>() / own().count().max(1) as f64).sqrt()
    };
    let share = |held_out| rms(&f.residual, held_out) / rms(&f.drive, held_out);
    let mut items = vec![Item::text(format!(
        "With the estimates in, the drive k·∫u φ must equal the model, J·∫q φ̈ + Fv·∫v φ + Fc·∫s φ + …, row by row. What is left has an RMS of {} in the training part ({} of the drive) and of {} in the held-out part ({}). Whitened, it should look alike everywhere.",
        quantity(rms(&f.residual, false), f.unit),
        with_unit(&significant(100.0 * share(false), 2), "%"),
        quantity(rms(&f.residual, true), f.unit),
        with_unit(&significant(100.0 * share(true), 2), "%"),
    ))];
    for part in parts(study) {
        let sides = [
            ("drive", Role::Measured, part.of(&f.drive, factor)),
            ("model", Role::After, part.of(&f.model, factor)),
        ];
        let residual = [("drive less model", Role::After, part.of(&f.residual, fine))];
        let whitened = [("whitened", Role::After, part.of(&f.whitened, 1.0))];
        let wide = Plot {
            height: 280,
            ..part.plot(
                &format!("Both sides, {}", part.name),
                format!("mean over a window [{name}]"),
                &sides,
            )
        };
        items.push(Item::Plots { plots: vec![wide] });
        items.push(Item::Plots {
            plots: vec![
                part.plot("Residual", format!("residual [{fine_name}]"), &residual),
                part.plot(
                    "Residual after whitening",
                    "whitened [sd]".to_owned(),
                    &whitened,
                ),
            ],
        });
    }
    Section {
        title: "The rows as a check".to_owned(),
        items,
    }
}

/// Autocorrelation of the residual.
pub(super) fn whiteness(study: &Study) -> Section {
    let w = &study.whiteness;
    let lags: Vec<f64> = (0..w.after.len()).map(|k| k as f64).collect();
    let level = |x: f64| vec![x; lags.len()];
    let count = lags.len() - 1;
    let expected = shortest(0.05 * count as f64, 2);
    let plot = Plot {
        title: "Autocorrelation of the residual".to_owned(),
        x_label: "lag [hops]".to_owned(),
        y_label: "autocorrelation [1]".to_owned(),
        height: 260,
        caption: "Windows overlap over 8 hops, so neighbouring rows share their noise. Whitening takes most of that out; the taper that keeps its covariance positive definite may leave some of it between nearest neighbours. Dark lines: the 95 % band of white noise.".to_owned(),
        ..lines(
            &lags,
            &[
                ("95 % band", Role::Measured, level(w.band)),
                ("95 % band, lower", Role::Measured, level(-w.band)),
                ("before whitening", Role::Before, w.before.clone()),
                ("after whitening", Role::After, w.after.clone()),
            ],
        )
    };
    Section {
        title: "Whiteness of the residual".to_owned(),
        items: vec![
            Item::text(format!(
                "Of {count} lags, {} lie outside the band ±{} before whitening and {} after; of white noise {expected} would. Many more after whitening mean structure that the model leaves out, or noise with a longer memory than the 24 hops that whitening reaches over; standard errors do not rest on whiteness alone, as they are at least those of independent blocks.",
                w.outside_before,
                significant(w.band, 2),
                w.outside_after,
            )),
            Item::Plots { plots: vec![plot] },
        ],
    }
}

/// Correlations of the estimates.
pub(super) fn correlation(study: &Study) -> Section {
    let c = &study.correlation;
    let condition = c.condition.map_or_else(
        || "The scaled normal matrix is singular: the recordings do not separate all parameters.".to_owned(),
        |condition| format!(
            "Condition number of the normal matrix of columns of unit norm: {}. 1 means parameters that are estimated as if each were alone; errors in the rows are amplified by its square root at most.",
            significant(condition, 3)
        ),
    );
    let rows = c.names.iter().zip(&c.matrix).map(|(name, row)| {
        let cells = row.iter().map(|r| format!("{r:.2}").replace('-', "−"));
        std::iter::once(name.clone()).chain(cells).collect()
    });
    Section {
        title: "Correlation of the estimates".to_owned(),
        items: vec![
            Item::text(format!(
                "{condition} Two estimates correlated by more than 0.95 in size trade off against each other: the recordings show little but a combination of both."
            )),
            Item::Table(Table {
                columns: std::iter::once(String::new())
                    .chain(c.names.iter().cloned())
                    .collect(),
                rows: rows.collect(),
            }),
        ],
    }
}
