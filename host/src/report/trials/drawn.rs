//! The plant that is drawn: every way to control it against leaving friction alone.

use super::plots::{over_time, tracking_range};
use super::words::Words;
use crate::report::page::{Item, Role};
use crate::servo::{Aim, Sample};
use crate::trials::{Campaign, Shown};

pub(super) fn items(campaign: &Campaign, words: &Words) -> Vec<Item> {
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
