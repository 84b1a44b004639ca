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

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let option = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1)
    };
    let number = |name: &str| -> Option<usize> { option(name)?.parse().ok() };
    let done = match number("--seal") {
        Some(count) => labels::seal(count),
        None => run(
            number("--skip").unwrap_or(0),
            number("--first").unwrap_or(usize::MAX),
            option("--dump").map(Path::new),
        ),
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
    let cases: Vec<_> = labels.into_iter().skip(skip).take(first).collect();
    if let Some(folder) = dump {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    let answers = answers::all(&cases, dump);
    tables::print(&answers);
    dump.map_or(Ok(()), |folder| answers::write(&answers, folder))
}
