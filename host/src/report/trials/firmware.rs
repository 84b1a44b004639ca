//! A plant under the firmware, beside the same one on the host.

use super::words::Words;
use crate::format::{quantity, scaled_unit};
use crate::report::page::{Item, Table};
use crate::trials::{Merit, OnBoard};

/// A figure of merit: its name, its value and its unit.
type Figured<'a> = (&'a str, &'a dyn Fn(&Merit) -> Option<f64>, &'a str);

/// The runs of the plant above under the firmware, beside those on the host.
pub(super) fn items(runs: &[OnBoard], words: &Words) -> Vec<Item> {
    let columns = [
        "Friction",
        "On this plant",
        "On the firmware",
        "On the host",
    ];
    vec![
        Item::text(
            "The same plant under the firmware in QEMU: it gets encoder counts and set points period by period, its commands move the plant, DBI sees what came of it, and what is identified goes to the board while the axis runs. Equal are the periods in which counts, command and Coulomb level are the host's, bit for bit.",
        ),
        Item::Table(Table {
            columns: columns.map(str::to_owned).to_vec(),
            rows: runs.iter().flat_map(|run| rows(run, words)).collect(),
        }),
    ]
}

/// The rows of one way to control the plant.
fn rows(run: &OnBoard, words: &Words) -> Vec<Vec<String>> {
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
    let row = |name: &str, firmware: String, host: String| {
        vec![run.way.name().to_owned(), name.to_owned(), firmware, host]
    };
    let told = merits.iter().filter_map(|(name, merit, si)| {
        let both = [merit(&run.firmware), merit(&run.host)];
        let [firmware, host] = both.map(|x| x.map_or_else(|| "–".to_owned(), |x| scaled(x, si)));
        (both != [None, None]).then(|| row(name, firmware, host))
    });
    let counted = [
        row(
            "Equal periods",
            run.equal.to_string(),
            format!("of {}", run.periods),
        ),
        row(
            "Sets of parameters while running",
            run.sets.to_string(),
            "–".to_owned(),
        ),
    ];
    told.chain(counted).collect()
}

fn scaled(x: f64, si: &str) -> String {
    let (factor, unit) = scaled_unit(x, si);
    quantity(factor * x, &unit)
}
