//! The page of an experiment: with and without adaptation, side by side.

mod plots;

use super::page::{Figure, Item, Page, Role, Section, Table};
use crate::format::{quantity, scaled_unit, significant, unit};
use crate::servo::{Aim, Sample};
use crate::trials::{Campaign, Claim, Experiment, Merit, OnBoard, Shown, Spread, Summary, Verdict};
use plots::{over_time, plants, tracking_range};

/// Where adaptation is all that differs.
const SAME: &str = "Without: the same controller, gains and observer, with no torque against friction and nothing learned. Both have the same integral action, acceleration feed-forward, encoder, disturbance and limits.";

/// What an experiment is called and measured in.
struct Words {
    title: &'static str,
    what: &'static str,
    /// What the controller does without adaptation, and what both have in common.
    without: &'static str,
    /// What is tracked, its unit, and those of command and friction level.
    tracked: &'static str,
    si: &'static str,
    command: &'static str,
    level: &'static str,
}

fn words(experiment: Experiment) -> Words {
    match experiment {
        Experiment::Srv02 => Words {
            title: "Angular position of the SRV02 with on-line Coulomb estimation",
            what: "A geared servo from the public data of the Quanser SRV02, each with a load, a viscous coefficient and a friction level of its own around 30 % of rated torque. Friction changes twice. A slow sine, then a slow triangle, a step, and a move back to a standstill.",
            without: SAME,
            tracked: "position",
            si: "rad",
            command: "V",
            level: "N*m",
        },
        Experiment::DcMotor => Words {
            title: "Angular velocity of a DC motor with Dahl friction, adapted by DBI off-line",
            what: "A motor under voltage whose friction, around 30 % of rated torque, acts through bristles of known stiffness. Friction changes with the second of three stretches of a slow sine and a slow triangle in velocity; DBI sees the second stretch, and the third is judged.",
            without: SAME,
            tracked: "velocity",
            si: "rad/s",
            command: "V",
            level: "N*m",
        },
        Experiment::MassSpring => Words {
            title: "A mass on a spring with friction, tuned by its own identification",
            what: "A controller that starts from catalogue values. DBI sees each stretch, and where its status allows, both the friction model and the gains are computed anew. Mass, spring and friction change after the second stretch; the last stretch is judged.",
            without: "Without: the controller as it starts, with gains for the catalogue's mass, no spring and no friction. Tuned again, friction left alone: with the gains and the spring of its own identification, and no torque against friction. All have the same integral action, encoder, disturbance and limits.",
            tracked: "position",
            si: "m",
            command: "N",
            level: "N",
        },
    }
}

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
                items: one_plant(campaign, &words)
                    .into_iter()
                    .chain(
                        on_board
                            .map(|runs| firmware(runs, &words))
                            .into_iter()
                            .flatten(),
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

/// A figure of merit, by name.
type Figured<'a> = (&'a str, &'a dyn Fn(&Merit) -> Option<f64>, &'a str);

/// The runs of the plant above under the firmware, beside those on the host.
fn firmware(runs: &[OnBoard], words: &Words) -> Vec<Item> {
    let note = "The same plant under the firmware in QEMU: it gets encoder counts and set points period by period, its commands move the plant, DBI sees what came of it, and what is identified goes to the board while the axis runs. Equal are the periods in which counts, command and Coulomb level are the host's, bit for bit.";
    let merits: [Figured; 6] = [
        ("RMS error", &|m| Some(m.rms), words.si),
        ("Peak error", &|m| Some(m.peak), words.si),
        ("RMS of the command", &|m| Some(m.effort), words.command),
        (
            "Settling of a step within 2 %",
            &|m| Some(m.step?.settling),
            "s",
        ),
        ("Error at standstill", &|m| m.standstill, "counts"),
        ("Time to converge", &|m| m.convergence, "s"),
    ];
    let mut rows = Vec::new();
    for run in runs {
        for (name, merit, si) in merits {
            let both = [merit(&run.firmware), merit(&run.host)];
            if both == [None, None] {
                continue;
            }
            let told = |x: Option<f64>| {
                x.map_or_else(
                    || "–".to_owned(),
                    |x| {
                        let (factor, unit) = scaled_unit(x, si);
                        quantity(factor * x, &unit)
                    },
                )
            };
            let [firmware, host] = both.map(told);
            rows.push(vec![
                run.way.name().to_owned(),
                name.to_owned(),
                firmware,
                host,
            ]);
        }
        rows.push(vec![
            run.way.name().to_owned(),
            "Equal periods".to_owned(),
            run.equal.to_string(),
            format!("of {}", run.periods),
        ]);
        rows.push(vec![
            run.way.name().to_owned(),
            "Sets of parameters while running".to_owned(),
            run.sets.to_string(),
            "–".to_owned(),
        ]);
    }
    vec![
        Item::Text {
            text: note.to_owned(),
        },
        Item::Table(Table {
            columns: [
                "Friction",
                "On this plant",
                "On the firmware",
                "On the host",
            ]
            .map(str::to_owned)
            .to_vec(),
            rows,
        }),
    ]
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

fn one_plant(campaign: &Campaign, words: &Words) -> Vec<Item> {
    let Some((alone, rest)) = campaign.shown.split_first() else {
        return vec![Item::text("No plant was run.")];
    };
    let mut items = vec![Item::text(format!(
        "{} Shaded: the times that are judged. Friction changes at {}.",
        words.what,
        campaign
            .changes
            .iter()
            .map(|t| format!("{t:.0} s"))
            .collect::<Vec<_>>()
            .join(" and ")
    ))];
    let aim = |s: &Sample| match s.aim {
        Aim::Position { q, .. } => q,
        Aim::Velocity { v, .. } => v,
    };
    let did = |s: &Sample| match s.aim {
        Aim::Position { .. } => s.truth.q,
        Aim::Velocity { .. } => s.truth.v,
    };
    for shown in rest {
        let what = shown.way.name();
        items.push(Item::heading(format!(
            "{}{}",
            what[..1].to_uppercase(),
            &what[1..]
        )));
        let mut plots = vec![
            over_time(
                campaign,
                words.tracked,
                words.si,
                &[
                    ("set point", Role::Measured, series(shown, aim)),
                    ("without", Role::Before, series(alone, did)),
                    ("with", Role::After, series(shown, did)),
                ],
            ),
            over_time(
                campaign,
                &format!("{} error", words.tracked),
                words.si,
                &[
                    ("without", Role::Before, series(alone, |s| aim(s) - did(s))),
                    ("with", Role::After, series(shown, |s| aim(s) - did(s))),
                ],
            ),
            over_time(
                campaign,
                "command",
                words.command,
                &[
                    (
                        "without",
                        Role::Before,
                        series(alone, |s| f64::from(s.act.command)),
                    ),
                    (
                        "with",
                        Role::After,
                        series(shown, |s| f64::from(s.act.command)),
                    ),
                ],
            ),
            over_time(
                campaign,
                "Coulomb level",
                words.level,
                &[
                    ("truth", Role::Measured, campaign.truth.clone()),
                    (
                        "in the controller",
                        Role::After,
                        series(shown, |s| f64::from(s.act.coulomb)),
                    ),
                ],
            ),
        ];
        // Steps of the set point would leave nothing of the rest to see.
        if let Some(error) = plots.get_mut(1) {
            error.limit = tracking_range(campaign, alone, &|s| aim(s) - did(s));
        }
        items.extend(
            plots
                .into_iter()
                .map(|plot| Item::Plots { plots: vec![plot] }),
        );
    }
    items
}

fn series(shown: &Shown, value: impl Fn(&Sample) -> f64) -> Vec<f64> {
    shown.samples.iter().map(value).collect()
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
