//! The `bristle` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(bristle::cli::run())
}
