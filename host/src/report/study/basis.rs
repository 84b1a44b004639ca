//! The test functions and the windows that they are laid over.

use super::{POINTS, lines};
use crate::dbi::{Laid, Shape, Study};
use crate::format::{quantity, significant, whole_percent};
use crate::report::page::{Band, Item, Plot, Role, Section, Style, Table};
use crate::report::points::{Points, dots};
use crate::report::runs::MOST_RECORDINGS;
use crate::report::subject::Subject;
use crate::report::thin::thin;

/// The response is shown down to this, dB.
const FLOOR: f64 = -80.0;

/// φ and what it passes.
pub(super) fn test_functions(study: &Study) -> Section {
    let mut items = vec![Item::text(
        "φ(τ) = c·(1 − (τ/T)²)⁶ on |τ| ≤ T, with c so that ∫φ dτ = 1: a functional is a weighted mean in the unit of its signal. φ and its first five derivatives vanish at both ends, so integration by parts leaves nothing there (weak form of distributions, L. Schwartz, Théorie des distributions, 1950; polynomial test functions as in M. Shinbrot, Trans. ASME 79, 1957). A functional of u passes a sine of frequency f by |Φ(f)|, one of velocity by 2πf·|Φ(f)| of position, one of acceleration by (2πf)²·|Φ(f)|.",
    )];
    for shape in &study.test_functions {
        items.push(Item::Plots {
            plots: plots(shape),
        });
    }
    Section {
        title: "Test function".to_owned(),
        items,
    }
}

fn plots(shape: &Shape) -> Vec<Plot> {
    let tau: Vec<f64> = shape.tau.iter().map(|t| 1e3 * t).collect();
    let over_time = |title: &str, unit: &str, y: &[f64]| Plot {
        title: format!("{title}, T = {}", quantity(1e3 * shape.half_width, "ms")),
        x_label: "time from the centre, τ [ms]".to_owned(),
        y_label: format!("{title} [{unit}]"),
        height: 190,
        ..lines(&tau, &[(title, Role::After, y.to_vec())])
    };
    let decibels: Vec<f64> = shape
        .response
        .iter()
        .map(|r| 20.0 * r.max(1e-12).log10())
        .collect();
    vec![
        over_time("φ", "1/s", &shape.value),
        over_time("φ̇", "1/s²", &shape.first_derivative),
        over_time("φ̈", "1/s³", &shape.second_derivative),
        Plot {
            title: "Frequency response of φ".to_owned(),
            x_label: "frequency [Hz]".to_owned(),
            y_label: "|Φ| [dB]".to_owned(),
            height: 190,
            limit: Some([FLOOR, 0.0]),
            marks: vec![shape.cutoff],
            caption: format!("Dotted line: −3 dB at {}.", quantity(shape.cutoff, "Hz")),
            ..lines(&shape.frequency, &[("|Φ|", Role::After, decibels)])
        },
    ]
}

/// How many windows, where, and why so wide.
pub(super) fn windows(study: &Study, subject: &Subject) -> Section {
    let tried = study.windows.tried.iter().map(|t| {
        vec![
            quantity(1e3 * t.half_width, "ms"),
            t.rows.to_string(),
            t.encoder_share
                .map_or_else(|| "too few windows to tell".to_owned(), whole_percent),
        ]
    });
    let laid = study.windows.recordings.iter().map(|l| {
        vec![
            l.recording.clone(),
            format!(
                "{} ({} samples)",
                quantity(1e3 * l.half_width, "ms"),
                l.reach
            ),
            quantity(1e3 * l.hop, "ms"),
            l.train.len().to_string(),
            l.held_out.len().to_string(),
            l.left_out.to_string(),
            whole_percent(l.rest),
        ]
    });
    let mut items = vec![
        Item::text(&study.windows.reason),
        Item::Table(Table {
            columns: [
                "Half-width tried",
                "Training windows",
                "Encoder noise in the residual variance",
            ]
            .map(str::to_owned)
            .to_vec(),
            rows: tried.collect(),
        }),
        Item::Table(Table {
            columns: [
                "Recording",
                "Half-width",
                "Hop",
                "Training windows",
                "Held-out windows",
                "Left out",
                "Time at rest",
            ]
            .map(str::to_owned)
            .to_vec(),
            rows: laid.collect(),
        }),
        Item::text(
            "Left out: windows mostly at rest, on a gap, or on the boundary between the training and the held-out part. At rest friction is whatever balances the drive, so both sides of the equation are masked there.",
        ),
    ];
    for (index, laid) in study
        .windows
        .recordings
        .iter()
        .enumerate()
        .take(MOST_RECORDINGS)
    {
        items.push(Item::Plots {
            plots: vec![placed(index, laid, subject)],
        });
    }
    Section {
        title: "Windows".to_owned(),
        items,
    }
}

/// The measured motion with a dot at the centre of every window.
fn placed(index: usize, laid: &Laid, subject: &Subject) -> Plot {
    let track = &subject.bench.problem.tracks[index];
    let nodes: Vec<f64> = (0..track.q.len())
        .map(|k| track.start + k as f64 * track.period)
        .collect();
    let (x, mut thinned) = thin(&nodes, std::slice::from_ref(&track.q), POINTS);
    let line = x
        .into_iter()
        .zip(thinned.swap_remove(0))
        .map(|(x, y)| [x, y, 0.0]);
    let at = |times: &[f64]| {
        let node =
            |t: &f64| (((t - track.start) / track.period).round() as usize).min(track.q.len() - 1);
        dots(times.iter().map(|t| (*t, track.q[node(t)])).collect())
    };
    let mut points = Points::default();
    points.add("position", Role::Measured, Style::Line, line.collect());
    points.add(
        "training windows",
        Role::After,
        Style::Dots,
        at(&laid.train),
    );
    points.add(
        "held-out windows",
        Role::Before,
        Style::Dots,
        at(&laid.held_out),
    );
    let band = |[from, to]: [f64; 2]| Band {
        from,
        to,
        held_out: false,
        label: "at rest".to_owned(),
    };
    let plot = points.plot();
    // A series without a point says nothing.
    let series = plot
        .series
        .into_iter()
        .filter(|s| s.y.iter().any(|y| y.is_finite()));
    Plot {
        title: format!("Centres of the windows, {}", laid.recording),
        x_label: "time [s]".to_owned(),
        y_label: format!("position [{}]", subject.motion_units().1),
        caption: format!(
            "A window reaches {} to either side of its centre.",
            quantity(1e3 * laid.half_width, "ms")
        ),
        height: 260,
        bands: laid.rests.iter().copied().map(band).collect(),
        x: plot.x,
        series: series.collect(),
        ..Plot::default()
    }
}

/// A duration in milliseconds, for tables.
pub(super) fn milliseconds(seconds: f64) -> String {
    significant(1e3 * seconds, 3)
}
