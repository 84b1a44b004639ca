//! What was found, what stays unexplained, and the experiment to do next.

use super::page::{Item, Section, Table};
use super::spread::Spread;
use super::subject::Subject;
use super::tables::{estimate_text, nrmse};
use crate::diagnose::{Diagnosis, Finding, Unexplained, Verdict};
use crate::effects;
use crate::experiment::NextExperiment;
use crate::format::{percent, quantity, range, significant, whole_percent};

/// The findings with their evidence and rivals, and what stays unexplained.
pub(super) fn section(diagnosis: &Diagnosis, held_out: &Spread) -> Section {
    let mut items = Vec::new();
    if diagnosis.findings.is_empty() {
        items.push(Item::text(match diagnosis.verdict {
            Verdict::Unknown => "No effect of the catalogue explains the mismatch.",
            _ => "None: no effect of the catalogue lowers the error by more than chance and a practical floor allow.",
        }));
    } else {
        items.push(overview(diagnosis, held_out));
        for (k, finding) in diagnosis.findings.iter().enumerate() {
            items.extend(details(k + 1, finding));
        }
    }
    match (&diagnosis.unexplained, diagnosis.verdict) {
        (Some(unexplained), _) => items.extend(leftover(unexplained, true)),
        (None, _) => items.extend(leftover(&diagnosis.leftover, false)),
    }
    Section {
        title: "Findings".to_owned(),
        items,
    }
}

fn overview(diagnosis: &Diagnosis, held_out: &Spread) -> Item {
    let last = diagnosis.findings.len() - 1;
    let rows = diagnosis.findings.iter().enumerate().map(|(k, f)| {
        // The spread between windows is that of the final model; models on the way to it have no predictions here.
        let se = held_out.after.nrmse.filter(|_| k == last);
        vec![
            (k + 1).to_string(),
            f.name.to_owned(),
            f.id.to_owned(),
            whole_percent(f.confidence),
            whole_percent(f.evidence.share_of_residual),
            significant(f.evidence.delta_bic, 3),
            nrmse(f.fit.held_out.nrmse, se),
        ]
    });
    let titles = [
        "",
        "Effect",
        "Id",
        "Confidence",
        "Share of the squared error",
        "ΔBIC",
        "Held-out NRMSE with it and those above",
    ];
    Item::Table(Table {
        columns: titles.map(str::to_owned).to_vec(),
        rows: rows.collect(),
    })
}

fn details(number: usize, finding: &Finding) -> Vec<Item> {
    let parameters = finding.parameters.iter();
    let mut items = vec![
        Item::heading(format!("{number}. {} ({})", finding.name, finding.id)),
        Item::text(finding.text.clone()),
        Item::text(format!("Where: {}", finding.place.text)),
        Item::Table(Table {
            columns: ["Parameter", "Value"].map(str::to_owned).to_vec(),
            rows: parameters
                .map(|(name, value)| vec![name.clone(), estimate_text(value)])
                .collect(),
        }),
    ];
    let named = |separated: bool| -> String {
        let of = finding.rivals.iter().filter(|r| r.separated == separated);
        let names = of.map(|r| format!("{} (ΔBIC {})", r.id, significant(r.delta_bic, 3)));
        names.collect::<Vec<_>>().join(", ")
    };
    let (rivals, worse) = (named(false), named(true));
    if !rivals.is_empty() {
        items.push(Item::text(format!(
            "Rivals that would explain much the same: {rivals}. The next experiment below tells them apart."
        )));
    }
    if !worse.is_empty() {
        items.push(Item::text(format!(
            "Runners-up, which leave a larger error in its place: {worse}."
        )));
    }
    items
}

/// Coordinates that generic functions would follow.
fn leftover(unexplained: &Unexplained, significant: bool) -> Vec<Item> {
    let summary = format!(
        "{}: generic functions of all coordinates together would take away {} of the cross-validated squared error that is left; their RMS is {} of the drive's.",
        if significant {
            "What stays unexplained"
        } else {
            "What is left is not significant"
        },
        whole_percent(unexplained.gain),
        percent(unexplained.size, None),
    );
    let mut items = vec![Item::text(summary)];
    if significant {
        let telling = unexplained
            .coordinates
            .iter()
            .filter(|(_, gain)| *gain > 0.01);
        let rows = telling.map(|(coordinate, gain)| {
            vec![
                (*coordinate).to_owned(),
                whole_percent(*gain),
                advice(coordinate).to_owned(),
            ]
        });
        items.push(Item::Table(Table {
            columns: [
                "Depends on",
                "Share that functions of it alone take away",
                "What to do next",
            ]
            .map(str::to_owned)
            .to_vec(),
            rows: rows.collect(),
        }));
    }
    items
}

/// What a dependence on a coordinate that no effect explains may be, and the recording that would show it.
fn advice(coordinate: &str) -> &'static str {
    match coordinate {
        "velocity" => {
            "Friction of an unusual shape: record slow ramps through zero, and at least five steady speeds in each direction, and look at the friction curve."
        }
        "position" | "position, in detail" => {
            "A force that changes along the travel: move slowly over the whole travel in both directions and look at the residual against position."
        }
        "position, as friction" => {
            "Friction that varies along the travel (position-dependent-friction): check guides, seals and alignment where the residual is large, and record slow passes over the whole travel."
        }
        "time" => {
            "A load that changed during the run (load-step, periodic-disturbance): look at the residual against time, then repeat the run; what comes back at another time is not the axis."
        }
        "time, as friction" => {
            "Friction that changed during the run (thermal-drift): record the same motion cold and warm."
        }
        "input" => {
            "The drive is not proportional to u (saturation, input-dead-zone): record with half and with twice the amplitude, and log the current if the drive offers it."
        }
        "input, with a memory" => {
            "A drive that cannot follow u at once, or sticks to what it gave (a limit on its rate, hysteresis of a valve or an amplifier): step u by several sizes up and down, and log the current or the pressure."
        }
        "input, as friction" => {
            "Friction that grows with the transmitted torque (load-dependent-friction): repeat the motion with another load."
        }
        "travel since reversal" => {
            "Elastic deflection or lost motion after each reversal (presliding, backlash): record small steps of several amplitudes with many reversals, if possible with a second encoder on the load."
        }
        "position and velocity" => {
            "Friction that depends on position and speed together: record several steady speeds over the same travel."
        }
        "position and squared velocity" | "position, as inertia" => {
            "An inertia that changes along the travel (crank, linkage, swinging load): record fast and slow passes over the same travel."
        }
        "input, over time" | "time, as inertia" => {
            "A drive whose gain, or a load whose inertia, changed during the run: log supply voltage and temperature, and repeat the same motion early and late."
        }
        "time, as friction in spells"
        | "time, as friction at random"
        | "time, as friction periodically" => {
            "Friction that comes and goes (dirt, chips, a cable that rubs): look at the residual against time, then repeat the run; what comes back at another time is loose."
        }
        "time, in spells" => {
            "A load that comes and goes: look at the residual against time, then repeat the run; what comes back at another time is not the axis."
        }
        "time, at random" => {
            "A load that wanders slowly and follows nothing else that was recorded (wind, a process force, a hand): measure it as well, or repeat the run without it."
        }
        "time, periodically" => {
            "Something that oscillates at a fixed frequency (periodic-disturbance): record with the drive enabled and the axis held, and look for the line in the spectrum."
        }
        _ => {
            "Record again so that this coordinate varies while the others stay the same, and compare."
        }
    }
}

/// Held-out nrmse from which on an adequate model is not yet a good one.
const POOR: f64 = 0.1;

/// The held-out nrmse of an adequate model that predicts poorly all the same.
pub(super) fn poor(diagnosis: &Diagnosis) -> Option<f64> {
    let error = diagnosis.fit.after.held_out.nrmse;
    (diagnosis.verdict == Verdict::Adequate && error > POOR).then_some(error)
}

/// The experiment that would decide most.
pub(super) fn next_experiment(
    subject: &Subject,
    diagnosis: &Diagnosis,
    next: Option<&NextExperiment>,
) -> Section {
    let mut points: Vec<String> = Vec::new();
    for finding in &diagnosis.findings {
        let rivals = || finding.rivals.iter().filter(|r| !r.separated);
        for rival in rivals() {
            points.push(format!(
                "{} or {}? {}.",
                finding.name,
                rival.id,
                capitalised(&rival.tell_apart_by)
            ));
        }
        if rivals().next().is_none() {
            points.extend(
                effects::find(finding.id)
                    .and_then(|e| effects::section(e.doc(), "What excites it"))
                    .map(|text| format!("{}: to pin its values down: {text}", finding.name)),
            );
        }
    }
    let unexplained = diagnosis.unexplained.as_ref();
    if let Some((coordinate, _)) = unexplained.and_then(|u| u.coordinates.first()) {
        points.push(format!("What stays unexplained: {}", advice(coordinate)));
    }
    let item = if poor(diagnosis).is_some() {
        Item::text(
            "The recordings are too short, too noisy or too much disturbed to tell what the model misses: record for longer, at more speeds and positions, with as little noise as possible, and diagnose again.",
        )
    } else if points.is_empty() {
        Item::text(covered(subject))
    } else {
        Item::List { points }
    };
    Section {
        title: "Next experiment".to_owned(),
        items: next
            .map(|next| {
                Item::text(format!(
                    "{} bristle diagnose --next-experiment writes it as a file.",
                    next.text
                ))
            })
            .into_iter()
            .chain([item])
            .collect(),
    }
}

/// A clause as a sentence, without its full stop.
fn capitalised(clause: &str) -> String {
    let mut letters = clause.trim_end_matches('.').chars();
    letters
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().chain(letters).collect())
}

/// What an adequate model was tested on.
fn covered(subject: &Subject) -> String {
    let survey = subject.bench.problem.survey(subject.after.model);
    let (speed, length) = subject.motion_units();
    format!(
        "None is needed at these conditions: speeds up to {} and positions from {}. To be surer, record outside of them, above all slow reversals, the full travel, and the load of normal use, and diagnose again.",
        quantity(survey.top_speed, speed),
        range([survey.travel.0, survey.travel.1], length),
    )
}

#[cfg(test)]
mod tests {
    use super::advice;

    #[test]
    fn an_unheard_of_coordinate_still_gets_advice() {
        assert!(advice("phase of the moon").starts_with("Record again"));
    }
}
