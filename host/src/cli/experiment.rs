//! `bristle experiment`

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::diagnose::json;
use super::output::{self, Outputs};
use super::terminal::Meter;
use super::{DONE, Outcome, terminal};
use crate::error::{Error, Result};
use crate::format::significant;
use crate::report;
use crate::trials::{self, Campaign, Claim, Experiment, Replayed, Summary, Trial, Verdict};

/// Run one of the source's experiments on many plants, with and without adaptation of friction
///
/// Each plant is drawn from the seed, its friction changes under way, and every way to control it runs on the same plant
/// with the same disturbance, under the controller of the firmware. Prints and reports tracking errors, settling,
/// standstill, effort and time of convergence, and what was reached.
#[derive(Args, Debug)]
pub(super) struct Command {
    /// Which experiment
    #[arg(value_enum)]
    experiment: Experiment,
    /// How many plants
    #[arg(long, value_name = "N", default_value_t = 50)]
    plants: u64,
    /// What plants and disturbances are drawn from
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Run the first plant once more on the firmware in QEMU, and compare every command
    #[cfg(unix)]
    #[arg(long)]
    qemu: bool,
    /// Image of the firmware for --qemu [default: built from the sources by cargo]
    #[cfg(unix)]
    #[arg(long, value_name = "ELF", requires = "qemu")]
    image: Option<PathBuf>,
    /// Where to write the report
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    /// Where to write all figures
    #[arg(long, value_name = "OUT.json")]
    json: Option<PathBuf>,
}

/// What `--json` holds.
#[derive(Serialize)]
struct Experimented<'a> {
    schema: &'static str,
    experiment: Experiment,
    seed: u64,
    claims: Vec<Claim>,
    summaries: Vec<Summary>,
    plants: &'a [Trial],
    /// What the firmware made of the first plant, with `--qemu`.
    on_board: Option<Vec<Replayed>>,
}

impl Command {
    pub fn run(&self) -> Outcome {
        output::check(&self.inputs(), &[self.report.as_ref(), self.json.as_ref()])?;
        if self.plants == 0 {
            return Err(Error::Usage(
                "--plants 0 runs nothing; ask for at least one".to_owned(),
            ));
        }
        let progress = Meter::new();
        let (campaign, on_board) = self.campaign(&progress)?;
        progress.finish();
        let experimented = Experimented {
            schema: "bristle.experiment/1",
            experiment: self.experiment,
            seed: self.seed,
            claims: campaign.claims(),
            summaries: summaries(&campaign),
            plants: &campaign.trials,
            on_board,
        };
        let mut outputs = Outputs::default();
        outputs.add(self.json.as_ref(), || json(&experimented))?;
        outputs.add(self.report.as_ref(), || {
            let on_board = experimented.on_board.as_deref();
            report::experiment(&campaign, on_board, self.seed)
        })?;
        let written = outputs.write()?;
        print(&experimented);
        terminal::written(&written);
        Ok(DONE)
    }

    #[cfg(unix)]
    fn inputs(&self) -> Vec<&Path> {
        self.image.as_deref().into_iter().collect()
    }

    /// All plants, and the runs of the first one on the firmware if asked for.
    #[cfg(unix)]
    fn campaign(&self, progress: &Meter) -> Result<(Campaign, Option<Vec<Replayed>>)> {
        use crate::emulate::{Board, Launch, Transport};
        use crate::image::F405;
        if !self.qemu {
            return Ok((self.plants(progress)?, None));
        }
        // What is wrong with the image shows before all plants have run.
        let image = super::emulate::chosen_image(self.image.as_deref(), F405, false)?;
        let mut board = Board::boot(&image, Launch::F405, Transport::Fast)?;
        let campaign = self.plants(progress)?;
        progress.say("running the firmware");
        let replayed = trials::replay(&campaign, &mut board)?;
        Ok((campaign, Some(replayed)))
    }

    /// There is no emulated board here.
    #[cfg(not(unix))]
    fn inputs(&self) -> Vec<&Path> {
        Vec::new()
    }

    #[cfg(not(unix))]
    fn campaign(&self, progress: &Meter) -> Result<(Campaign, Option<Vec<Replayed>>)> {
        Ok((self.plants(progress)?, None))
    }

    fn plants(&self, progress: &Meter) -> Result<Campaign> {
        progress.say("running plants");
        trials::run(self.experiment, self.plants, self.seed)
    }
}

fn summaries(campaign: &Campaign) -> Vec<Summary> {
    let ways = campaign.ways();
    ways.into_iter()
        .filter_map(|way| campaign.summary(way))
        .collect()
}

fn print(e: &Experimented) {
    anstream::println!(
        "{} plants, seed {}; medians over all plants",
        e.plants.len(),
        e.seed
    );
    anstream::println!(
        "{:<30} {:>11} {:>11} {:>8} {:>9} {:>9} {:>9}",
        "friction",
        "RMS error",
        "peak error",
        "factor",
        "rise",
        "settling",
        "effort"
    );
    let or_none = |x: Option<trials::Spread>| {
        x.map_or_else(
            || "–".to_owned(),
            |x| format!("{} s", significant(x.median, 3)),
        )
    };
    for s in &e.summaries {
        anstream::println!(
            "{:<30} {:>11} {:>11} {:>8} {:>9} {:>9} {:>9}",
            s.way.name(),
            significant(s.rms.median, 3),
            significant(s.peak.median, 3),
            significant(s.gain.median, 3),
            or_none(s.rise),
            or_none(s.settling),
            significant(s.effort.median, 3)
        );
    }
    for claim in &e.claims {
        let mark = match claim.verdict {
            Verdict::Reached => "reached",
            Verdict::Missed => "MISSED ",
        };
        anstream::println!(
            "{mark}  {} — {}: {}",
            claim.way.name(),
            claim.claim,
            claim.found
        );
    }
    for run in e.on_board.iter().flatten() {
        anstream::println!(
            "firmware in QEMU, first plant, {}: {} of {} commands are the host's, bit for bit",
            run.way.name(),
            run.equal,
            run.periods
        );
    }
}
