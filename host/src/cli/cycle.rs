//! `bristle demo --loop`

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::diagnose::{self, json};
use super::emulate::chosen_image;
use super::output::Outputs;
use super::{DONE, Outcome, terminal};
use crate::bench::csv;
use crate::cycle::{self, Knowledge, Lap};
use crate::emulate::{Board, Launch, Transport};
use crate::error::Result;
use crate::format::significant;
use crate::image::F405;
use crate::report;
use crate::showcase;

/// What `loop.json` holds.
#[derive(Serialize)]
struct Turned<'a> {
    schema: &'static str,
    seed: u64,
    /// Ids of what the diagnosis found, strongest first.
    findings: &'a [String],
    laps: &'a [Lap],
    /// RMS error with the baseline over that with the diagnosis.
    factor: f64,
}

/// Records in the emulator, diagnoses, deploys and tracks again; everything goes into a folder that exists.
pub(super) fn run(folder: &Path, image: Option<&Path>, seed: u64) -> Outcome {
    let image = chosen_image(image, F405, false)?;
    let mut board: Board<f32> = Board::boot(&image, Launch::F405, Transport::Fast)?;
    let at = |name: &str| folder.join(name);
    let truth = cycle::truth()?;

    let recorded = cycle::record(&mut board, seed)?;
    let (recording, baseline) = (at("recording.csv"), at("baseline.toml"));
    write(&[
        (&recording, csv(&recorded, Some(&truth))),
        (&baseline, showcase::BASELINE.to_owned()),
    ])?;
    anstream::println!(
        "Recorded {:.0} s of an axis with concealed physics on the emulated board: {}\nDiagnosing it against a model of Coulomb and viscous friction: {}\n",
        recorded.t.len() as f64 * 1e-3,
        recording.display(),
        baseline.display()
    );
    let found = diagnose::Command::demo(recording, baseline, folder).diagnose()?;
    write(&[(&at("identified.toml"), found.before.to_toml())])?;

    anstream::println!("\nDeploying, and tracking the same task each time:");
    let mut laps = Vec::new();
    for (knowledge, model) in [
        (Knowledge::Nothing, &found.before),
        (Knowledge::Baseline, &found.before),
        (Knowledge::Diagnosis, &found.after),
    ] {
        let lap = cycle::track(&mut board, model, knowledge, seed)?;
        anstream::println!(
            "  {:<45} RMS error {:>7} mrad, largest {:>7} mrad",
            knowledge.name(),
            significant(1e3 * lap.rms, 3),
            significant(1e3 * lap.peak, 3)
        );
        laps.push(lap);
    }
    let findings = found.diagnosis.findings.iter().map(|f| f.id.to_string());
    let findings: Vec<String> = findings.collect();
    let factor = laps[1].rms / laps[2].rms;
    let turned = Turned {
        schema: "bristle.loop/1",
        seed,
        findings: &findings,
        laps: &laps,
        factor,
    };
    let written = write(&[
        (&at("before.csv"), csv(&laps[1].record, Some(&truth))),
        (&at("after.csv"), csv(&laps[2].record, Some(&truth))),
        (&at("loop.json"), json(&turned)?),
        (&at("loop.html"), report::cycle(&laps, &findings, seed)?),
    ])?;
    anstream::println!(
        "What was found makes the error {} times smaller than Coulomb and viscous friction alone.",
        significant(factor, 2)
    );
    terminal::written(&written);
    anstream::println!("\nOpen {} in a browser.", at("loop.html").display());
    Ok(DONE)
}

fn write(files: &[(&PathBuf, String)]) -> Result<Vec<PathBuf>> {
    let mut outputs = Outputs::default();
    for (path, text) in files {
        outputs.add(Some(path), || Ok(text.clone()))?;
    }
    outputs.write()
}
