//! The page of a study of DBI: everything between the samples and the estimates.

mod basis;
mod linear;
mod rows;
mod widths;

use super::data;
use super::page::{Figure, Item, Page, Plot, Role, Section, Style};
use super::subject::{Judged, Subject};
use super::thin::thin;
use crate::dbi::Study;
use crate::format::{quantity, shortest, significant};
use crate::identify::{Identified, Workbench};
use crate::recording::Recording;

/// Points of a series over time.
const POINTS: usize = 3000;

/// The page.
pub(super) fn page(
    study: &Study,
    identified: &Identified,
    bench: &Workbench,
    recordings: &[Recording],
) -> Page {
    let subject = Subject {
        bench,
        recordings,
        before: None,
        after: Judged {
            model: &identified.model,
            fit: identified.fit,
        },
    };
    let mut sections = vec![
        widths::section(study),
        basis::test_functions(study),
        basis::windows(study, &subject),
        rows::functionals(study),
        rows::check(study),
        rows::whiteness(study),
        rows::correlation(study),
    ];
    sections.extend(linear::section(study));
    sections.push(method());
    Page {
        title: format!("DBI study of {}", data::named(&identified.model)),
        facts: data::facts(&subject),
        verdict: None,
        warnings: data::texts(&study.warnings),
        figures: figures(study),
        figures_note: String::new(),
        sections,
    }
}

fn figures(study: &Study) -> Vec<Figure> {
    let figure = |label: &str, after: String, note: &str| Figure {
        label: label.to_owned(),
        before: None,
        after,
        note: note.to_owned(),
    };
    let agreeing = study.agreement.iter().filter(|a| a.agree).count();
    let lags = study.whiteness.after.len() - 1;
    let mut figures = vec![figure(
        "Parameters that agree over the widths",
        format!("{agreeing} of {}", study.agreement.len()),
        "from half to double the chosen half-width",
    )];
    if let Some(shape) = study.test_functions.last() {
        figures.push(figure(
            "Half-width",
            quantity(1e3 * shape.half_width, "ms"),
            &format!(
                "passes motion up to {} (−3 dB)",
                quantity(shape.cutoff, "Hz")
            ),
        ));
    }
    figures.push(figure(
        "Whitened residual",
        format!("{} of {lags} lags", study.whiteness.outside_after),
        &format!(
            "outside the 95 % band of white noise; {} expected by chance",
            shortest(0.05 * lags as f64, 2)
        ),
    ));
    figures.push(figure(
        "Condition number",
        study
            .correlation
            .condition
            .map_or_else(|| "singular".to_owned(), |c| significant(c, 2)),
        "of the normal matrix of columns of unit norm",
    ));
    figures
}

/// A plot of lines over one abscissa, thinned.
fn lines(x: &[f64], series: &[(&str, Role, Vec<f64>)]) -> Plot {
    let values: Vec<Vec<f64>> = series.iter().map(|(_, _, y)| y.clone()).collect();
    let (x, values) = thin(x, &values, POINTS);
    let mut plot = Plot {
        x,
        height: 220,
        ..Plot::default()
    };
    for ((label, role, _), y) in series.iter().zip(values) {
        plot.push(label, *role, Style::Line, y);
    }
    plot
}

fn method() -> Section {
    Section {
        title: "Method".to_owned(),
        items: vec![Item::List {
            points: vec![
                "Distribution-based identification: the equation of motion J·q̈ = k·u − Fc·s − Fv·v − … is multiplied by a test function φ and integrated by parts, J·∫q φ̈ = k·∫u φ − Fc·∫s φ + Fv·∫q φ̇ − …, so that no noisy signal is differentiated. Each window gives one row.".to_owned(),
                "Rows are whitened by the covariance of their noise, estimated from the residual of a fit that follows everything generic functions can follow; estimates minimise the whitened training residual.".to_owned(),
                "Errors: one standard error, the larger of the model-based one and of a block sandwich estimate (Liang and Zeger 1986).".to_owned(),
                "Agreement over the widths: estimates from the same data are correlated, so the variance of their difference is summed over blocks of time from what each block adds to the one and to the other (the sandwich variance of the difference); it is compared with Student's t at a level that keeps a false alarm below 5 % over all widths compared. A difference may be certain and yet small beside the error of the estimate: both sizes are given.".to_owned(),
                "Long series are thinned for drawing; the smallest and the largest value of each stretch are kept.".to_owned(),
                format!("Written by Bristle {}.", env!("CARGO_PKG_VERSION")),
            ],
        }],
    }
}
