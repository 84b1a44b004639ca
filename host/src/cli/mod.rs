//! The command line: one verb, one file.

mod bench;
#[cfg(unix)]
mod briefing;
mod completions;
mod curve;
#[cfg(unix)]
mod cycle;
mod dbi;
mod demo;
#[cfg(unix)]
mod deploy;
mod diagnose;
#[cfg(unix)]
mod emulate;
mod experiment;
mod explain;
mod flash;
mod identify;
mod input;
#[cfg(unix)]
mod interrupt;
mod man;
mod method;
#[cfg(unix)]
mod monitor;
mod output;
#[cfg(unix)]
mod place;
mod ports;
#[cfg(unix)]
mod record;
mod reference;
mod simulate;
mod terminal;
mod tune;
mod windows;

use clap::{Parser, Subcommand};

use crate::error::{Error, Result};

/// Finds the physics that a servo axis model leaves out, models it and proves that the fit improves.
///
/// A recording is a CSV file whose first line names its columns, as in `t[s],u[N*m],q[rad]`: time, what drives the
/// axis (torque, force, voltage or current), and the measured position (or v, velocity); Parquet and MATLAB level-5
/// files with such columns do as well. A model file (TOML) says
/// what is known of the axis; every "?" in it is estimated.
///
/// Start with `bristle demo`, then `bristle diagnose run.csv --model axis.toml --report report.html`.
///
/// Exit status: 0 done, 1 internal failure or a failure of the board, 2 unusable input or arguments, 3 the model leaves something
/// out (`diagnose --check`), the board holds other parameters (`deploy --check`), or a run was cut short (`record`).
#[derive(Debug, Parser)]
#[command(name = "bristle", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Demo(demo::Command),
    Diagnose(diagnose::Command),
    Identify(identify::Command),
    Dbi(dbi::Command),
    Simulate(simulate::Command),
    #[cfg(unix)]
    Emulate(emulate::Emulate),
    #[cfg(unix)]
    Record(record::Command),
    Explain(explain::Command),
    Tune(tune::Command),
    #[cfg(unix)]
    Deploy(deploy::Command),
    #[cfg(unix)]
    Monitor(monitor::Command),
    Ports(ports::Command),
    Experiment(experiment::Command),
    Flash(flash::Command),
    Completions(completions::Command),
    Man(man::Command),
}

/// Runs the command line of this process and returns its exit status.
pub fn run() -> u8 {
    let verb = Cli::parse().verb;
    // A panic has printed its message already; what is left is the exit status.
    let outcome = std::panic::catch_unwind(|| match verb {
        Verb::Demo(command) => command.run(),
        Verb::Diagnose(command) => command.run(),
        Verb::Identify(command) => command.run(),
        Verb::Dbi(command) => command.run(),
        Verb::Simulate(command) => command.run(),
        #[cfg(unix)]
        Verb::Emulate(command) => command.run(),
        #[cfg(unix)]
        Verb::Record(command) => command.run(),
        Verb::Explain(command) => command.run(),
        Verb::Tune(command) => command.run(),
        #[cfg(unix)]
        Verb::Deploy(command) => command.run(),
        #[cfg(unix)]
        Verb::Monitor(command) => command.run(),
        Verb::Ports(command) => command.run(),
        Verb::Experiment(command) => command.run(),
        Verb::Flash(command) => command.run(),
        Verb::Completions(command) => command.run(),
        Verb::Man(command) => command.run(),
    })
    .unwrap_or_else(|_| Err(Error::Internal("the program stopped at a panic".to_owned())));
    outcome.unwrap_or_else(|error| {
        terminal::error(&error);
        error.exit_status()
    })
}

/// The exit status of a command that did what it was asked.
const DONE: u8 = 0;

/// What every verb returns: an exit status, or the error that decides it.
type Outcome = Result<u8>;

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        super::Cli::command().debug_assert();
    }
}
