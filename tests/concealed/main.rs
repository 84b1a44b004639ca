//! The proof on concealed physics: recordings whose labels are sealed.
//!
//! `cargo run --release --example concealed [-- --skip N --first N]` makes the recordings that `labels.csv` describes, lets the
//! diagnosis see nothing of each but the recording and a baseline, and only then opens the labels and prints what it got
//! right; `--dump FOLDER` keeps each recording with its baseline, and all answers in `answers.csv`, to look at. The file's SHA-256 must be the one in
//! `labels.sha256`, which was committed before the first run. `-- --seal N` draws N more cases from the operating system's
//! randomness, which come after those that are there, and writes both files.
//!
//! The plants of `tests/plants` share no code with the diagnosis: other formulation, other integrator, finer step.

mod answers;
mod labels;
#[path = "../plants/mod.rs"]
mod plants;
mod tables;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;

/// Diagnose recordings whose labels are sealed, then open the labels and print what was right
#[derive(Parser)]
struct Options {
    /// Leave out this many from the beginning
    #[arg(long, value_name = "N", default_value_t = 0)]
    skip: usize,
    /// Take this many at most [default: all]
    #[arg(long, value_name = "N")]
    first: Option<usize>,
    /// Keep each recording with its baseline, and all answers in answers.csv
    #[arg(long, value_name = "FOLDER")]
    dump: Option<PathBuf>,
    /// Draw this many new cases instead, and add them to those that are there
    #[arg(long, value_name = "N", conflicts_with_all = ["skip", "first", "dump"])]
    seal: Option<usize>,
}

fn main() -> ExitCode {
    let options = Options::parse();
    let first = options.first.unwrap_or(usize::MAX);
    let done = match options.seal {
        Some(count) => labels::seal(count),
        None => run(options.skip, first, options.dump.as_deref()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("error: {what}");
            ExitCode::FAILURE
        }
    }
}

fn run(skip: usize, first: usize, dump: Option<&Path>) -> Result<(), String> {
    let labels = labels::open()?;
    let sealed = labels.len();
    let cases: Vec<_> = labels.into_iter().skip(skip).take(first).collect();
    if cases.is_empty() {
        return Err(format!(
            "nothing to diagnose: --skip {skip} of {sealed} sealed cases. Skip fewer, or draw more with --seal N."
        ));
    }
    if let Some(folder) = dump {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    let answers = answers::all(&cases, dump);
    tables::print(&answers);
    dump.map_or(Ok(()), |folder| answers::write(&answers, folder))
}
