//! The page of an experiment: with and without adaptation, side by side.

mod drawn;
mod firmware;
mod plots;
mod words;

use super::page::{Figure, Item, Page, Section, Table};
use crate::format::{quantity, scaled_unit, significant, unit};
use crate::trials::{Campaign, Claim, OnBoard, Spread, Summary, Verdict};
use plots::plants;
use words::{Words, words};

/// The page.
pub(super) fn page(campaign: &Campaign, on_board: Option<&[OnBoard]>) -> Page {
    let words = words(campaign.experiment);
    let claims = campaign.claims();
    let summaries: Vec<Summary> = campaign
        .ways()
        .into_iter()
        .filter_map(|way| campaign.summary(way))
        .collect();
    Page {
        title: words.title.to_owned(),
        facts: vec![
            [
                "Plants".to_owned(),
                format!(
                    "{}, drawn from seed {}",
                    campaign.trials.len(),
                    campaign.seed
                ),
            ],
            [
                "Controller".to_owned(),
                format!(
                    "that of the firmware in single precision at {:.0} Hz",
                    1.0 / campaign.period
                ),
            ],
        ],
        verdict: None,
        warnings: Vec::new(),
        figures: figures(&summaries, &words),
        figures_note: "Medians over all plants.".to_owned(),
        sections: vec![
            Section {
                title: "What was to be reached".to_owned(),
                items: vec![Item::Table(claim_table(&claims))],
            },
            Section {
                title: "With and without, over all plants".to_owned(),
                items: over_plants(campaign, &summaries, &words),
            },
            Section {
                title: format!("Plant {}", campaign.drawn),
                items: drawn::items(campaign, &words)
                    .into_iter()
                    .chain(
                        on_board
                            .into_iter()
                            .flat_map(|runs| firmware::items(runs, &words)),
                    )
                    .collect(),
            },
            Section {
                title: "What DBI said".to_owned(),
                items: vec![dbi(campaign)],
            },
            method(&words),
        ],
    }
}

fn figures(summaries: &[Summary], words: &Words) -> Vec<Figure> {
    let Some((alone, rest)) = summaries.split_first() else {
        return Vec::new();
    };
    let in_unit = |x: f64| {
        let (factor, unit) = scaled_unit(x, words.si);
        quantity(factor * x, &unit)
    };
    rest.iter()
        .map(|s| Figure {
            label: format!("RMS error, {}", s.way.name()),
            before: Some(in_unit(alone.rms.median)),
            after: in_unit(s.rms.median),
            note: format!(
                "a factor of {}, plant by plant",
                significant(s.gain.median, 3)
            ),
        })
        .collect()
}

fn claim_table(claims: &[Claim]) -> Table {
    Table {
        columns: ["Friction", "Claim", "Found", "Verdict"]
            .map(str::to_owned)
            .to_vec(),
        rows: claims
            .iter()
            .map(|c| {
                let verdict = match c.verdict {
                    Verdict::Reached => "reached",
                    Verdict::Missed => "missed",
                };
                vec![
                    c.way.name().to_owned(),
                    c.claim.to_owned(),
                    c.found.clone(),
                    verdict.to_owned(),
                ]
            })
            .collect(),
    }
}

/// A row of the table over all plants: its name, and its text for each way.
type Row<'a> = (&'a str, &'a dyn Fn(&Summary) -> String);

fn over_plants(campaign: &Campaign, summaries: &[Summary], words: &Words) -> Vec<Item> {
    let spread = |s: Spread, si: &str| {
        let (factor, name) = scaled_unit(s.median, si);
        format!(
            "{} ({} to {}) {}",
            significant(factor * s.median, 3),
            significant(factor * s.least, 3),
            significant(factor * s.most, 3),
            unit(&name)
        )
    };
    let none = || "–".to_owned();
    let rows: [Row; 10] = [
        ("RMS error", &|s| spread(s.rms, words.si)),
        ("Peak error", &|s| spread(s.peak, words.si)),
        ("RMS error without over with", &|s| spread(s.gain, "")),
        ("The same throughout, changes and all", &|s| {
            spread(s.gain_throughout, "")
        }),
        ("RMS of the command", &|s| spread(s.effort, words.command)),
        ("Rise of a step, 10 to 90 %", &|s| {
            s.rise.map_or_else(none, |x| spread(x, "s"))
        }),
        ("Settling of a step within 2 %", &|s| {
            s.settling.map_or_else(none, |x| spread(x, "s"))
        }),
        ("Error at standstill", &|s| {
            s.standstill.map_or_else(none, |x| spread(x, "counts"))
        }),
        ("Plants that hunt", &|s| {
            s.hunting.map_or_else(none, |n| n.to_string())
        }),
        ("Time to converge", &|s| {
            s.convergence.map_or_else(none, |x| spread(x, "s"))
        }),
    ];
    let mut columns = vec!["Median (least to most)".to_owned()];
    columns.extend(summaries.iter().map(|s| s.way.name().to_owned()));
    let table = Table {
        columns,
        rows: rows
            .iter()
            .map(|(name, text)| {
                std::iter::once((*name).to_owned())
                    .chain(summaries.iter().map(text))
                    .collect()
            })
            .collect(),
    };
    let ways = campaign.ways().into_iter().skip(1);
    let plots = ways.map(|way| plants(campaign, way, words));
    vec![
        Item::Table(table),
        Item::Plots {
            plots: plots.collect(),
        },
    ]
}

fn dbi(campaign: &Campaign) -> Item {
    let asked = campaign
        .trials
        .iter()
        .map(|t| t.identified.len())
        .max()
        .unwrap_or(0);
    let rows = (0..asked).map(|k| {
        let all = || {
            campaign
                .trials
                .iter()
                .filter_map(move |t| t.identified.get(k))
        };
        let ratio = Spread::of(all().map(|(ratio, _)| *ratio).filter(|r| r.is_finite()));
        let identified = all().filter(|(_, status)| status == "identified").count();
        vec![
            format!("{}", k + 1),
            ratio.map_or_else(
                || "–".to_owned(),
                |r| {
                    format!(
                        "{} ({} to {})",
                        significant(r.median, 3),
                        significant(r.least, 3),
                        significant(r.most, 3)
                    )
                },
            ),
            format!("{identified} of {}", all().count()),
        ]
    });
    Item::Table(Table {
        columns: [
            "Asked",
            "Coulomb level over truth, median (least to most)",
            "Status: identified",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: rows.collect(),
    })
}

fn method(words: &Words) -> Section {
    Section {
        title: "Method".to_owned(),
        items: vec![Item::List {
            points: vec![
                words.what.to_owned(),
                words.without.to_owned(),
                "Errors are those of the plant's true motion, not of the encoder's.".to_owned(),
                "Converged: the level in the controller stays within 10 % of the truth until the next change.".to_owned(),
                "Standstill: the error by the encoder over the last second; an axis that still moves by more than a count in it hunts.".to_owned(),
                format!("Written by Bristle {}.", env!("CARGO_PKG_VERSION")),
            ],
        }],
    }
}
