//! `bristle ports`

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::diagnose::json;
use super::output::{self, Outputs};
use super::{DONE, Outcome, terminal};
use crate::ports::{self, Port};

/// List the serial ports, and what answers on them
///
/// Each port is opened and asked whether a board with Bristle's firmware is at its other end; a board goes on as it was.
/// Other devices get some twenty bytes that they may not expect: --list opens no port.
/// Where a port cannot be used, it says why, and what to do.
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  bristle ports
  bristle ports /dev/ttyUSB0
  bristle ports --list")]
pub(super) struct Command {
    /// The ports to look at [default: all]
    #[arg(value_name = "PORT")]
    ports: Vec<String>,
    /// Name the ports and open none
    #[arg(long)]
    list: bool,
    /// Where to write what was found
    #[arg(long, value_name = "OUT.json")]
    json: Option<PathBuf>,
}

/// What `--json` holds.
#[derive(Serialize)]
struct Listed<'a> {
    schema: &'static str,
    ports: &'a [Port],
}

impl Command {
    pub fn run(&self) -> Outcome {
        output::check(&[], &[self.json.as_ref()])?;
        let mut ports = if self.ports.is_empty() {
            ports::list()?
        } else {
            self.ports.iter().map(|name| ports::named(name)).collect()
        };
        for port in &mut ports {
            anstream::println!("{}: {}", port.name, port.device);
            if !self.list {
                port.ask();
            }
            if let Some(found) = &port.found {
                anstream::println!("  {found}");
            }
        }
        if ports.is_empty() {
            anstream::println!(
                "There is no serial port. Plug the board or its adapter in; in a virtual machine or a container it has to be handed through."
            );
        }
        let mut outputs = Outputs::default();
        outputs.add(self.json.as_ref(), || {
            json(&Listed {
                schema: "bristle.ports/1",
                ports: &ports,
            })
        })?;
        terminal::written(&outputs.write()?);
        Ok(DONE)
    }
}
