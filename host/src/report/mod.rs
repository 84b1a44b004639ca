//! The report: one HTML file that holds its data, its script and its styles, and asks no network for anything.
//!
//! The page shows what the diagnosis and the identification found; the script only draws. Plots are drawn by uPlot
//! 1.6.32 (MIT), which is part of the file.

#[cfg(unix)]
mod cycle;
mod data;
#[cfg(unix)]
mod emulation;
mod findings;
mod friction;
mod page;
mod points;
mod rows;
mod runs;
mod spread;
mod study;
mod subject;
mod tables;
mod thin;
mod trials;

#[cfg(test)]
mod tests;

#[cfg(unix)]
pub use emulation::Emulation;

use crate::check::Warning;
use crate::dbi::Study;
use crate::diagnose::Outcome;
use crate::error::{Error, Result};
use crate::experiment::NextExperiment;
use crate::identify::{Identified, Workbench};
use crate::model::Model;
use crate::recording::Recording;
use crate::trials::{Campaign, OnBoard};
use page::Page;

/// The HTML text of a diagnosis. Fails only if a model has no values, or on a defect.
pub fn diagnosis(
    outcome: &Outcome,
    next: Option<&NextExperiment>,
    bench: &Workbench,
    recordings: &[Recording],
) -> Result<String> {
    render(&data::diagnosis(outcome, next, bench, recordings)?)
}

/// The HTML text of an identification, with the parameters of a model from the whole recordings if there is one. Fails only if a
/// model has no values, or on a defect.
pub fn identification(
    identified: &Identified,
    whole: Option<&Model>,
    warnings: &[Warning],
    bench: &Workbench,
    recordings: &[Recording],
) -> Result<String> {
    render(&data::identification(
        identified, whole, warnings, bench, recordings,
    )?)
}

/// The HTML text of a study of DBI. Fails only on a defect.
pub fn study(
    study: &Study,
    identified: &Identified,
    bench: &Workbench,
    recordings: &[Recording],
) -> Result<String> {
    render(&study::page(study, identified, bench, recordings))
}

/// The HTML text of an experiment, and of what the firmware made of a plant where it was asked. Fails only on a
/// defect.
pub fn experiment(campaign: &Campaign, on_board: Option<&[OnBoard]>) -> Result<String> {
    render(&trials::page(campaign, on_board))
}

/// The HTML text of the whole loop. Fails only on a defect.
#[cfg(unix)]
pub fn cycle(laps: &[crate::cycle::Lap], findings: &[String], seed: u64) -> Result<String> {
    render(&cycle::page(laps, findings, seed))
}

/// The HTML text of a run in the emulator. Fails only on a defect.
#[cfg(unix)]
pub fn emulation(run: &Emulation) -> Result<String> {
    render(&emulation::page(run))
}

fn render(page: &Page) -> Result<String> {
    let data = serde_json::to_string(page)
        .map_err(|e| Error::Internal(format!("cannot write the report's data: {e}")))?;
    Ok(fill(include_str!("page.html"), |name| match name {
        "title" => escape_html(&page.title),
        "style" => format!(
            "{}\n{}",
            include_str!("vendor/uPlot.min.css"),
            include_str!("page.css")
        ),
        "licence" => include_str!("vendor/uPlot-LICENSE").to_owned(),
        "plotter" => include_str!("vendor/uPlot.iife.min.js").to_owned(),
        "script" => include_str!("page.js").to_owned(),
        "data" => escape_json(&data),
        _ => String::new(),
    }))
}

/// Puts a text for every `{{name}}` of the template; what is put in is not searched again.
fn fill(template: &str, text: impl Fn(&str) -> String) -> String {
    let mut out = String::with_capacity(template.len());
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        let Some((name, after)) = after.split_once("}}") else {
            break;
        };
        out.push_str(before);
        out.push_str(&text(name));
        rest = after;
    }
    out + rest
}

/// JSON that can stand inside a script element: no tag begins or ends in it. In JSON `<` occurs only inside strings.
fn escape_json(json: &str) -> String {
    json.replace('<', "\\u003c")
}

fn escape_html(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
