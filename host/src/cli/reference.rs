//! The book's reference chapters, from the same text that `--help` and `explain` show.

use std::fmt::Write;

use bristle_core::drive::Fault;
use clap::CommandFactory;

use super::Cli;
use crate::effects::{self, Effect};
use crate::motion::Motion;

/// Said at the top of each page.
const NOTICE: &str =
    "<!-- Written by `bristle man --markdown host/book/src/reference`: change the source. -->\n";

/// Columns of the help texts.
const WIDTH: usize = 100;

/// The help of every command.
pub(super) fn commands() -> String {
    let mut whole = Cli::command().term_width(WIDTH);
    whole.build();
    let mut page = format!("# Commands\n\n{NOTICE}\nWhat `--help` says, on each of them.\n");
    let mut section = |title: &str, command: &mut clap::Command| {
        let help = command.render_long_help().to_string();
        let lines: Vec<&str> = help.lines().map(str::trim_end).collect();
        let _ = writeln!(page, "\n## {title}\n\n```text\n{}\n```", lines.join("\n"));
    };
    section("bristle", &mut whole);
    for verb in whole.get_subcommands_mut() {
        let title = format!("bristle {}", verb.get_name());
        if verb.get_name() != "help" {
            section(&title, verb);
        }
    }
    page
}

/// The documentation of every effect.
pub(super) fn effects() -> String {
    let mut page = format!(
        "# Effects\n\n{NOTICE}\nThe catalogue, as `bristle explain ID` shows it. The ids are stable: they stand in model files, in JSON and in\nreports.\n\n| id | what it is |\n| --- | --- |\n"
    );
    for effect in effects::ALL {
        let (id, name) = (effect.id(), effect.name());
        let _ = writeln!(page, "| [`{id}`](#{id}) | {name} |");
    }
    for effect in effects::ALL {
        let _ = writeln!(page, "\n## {}\n\n{}\n", effect.id(), effect.name());
        describe(*effect, &mut page);
    }
    page
}

/// An effect's own documentation, one heading level down, and its parameters.
fn describe(effect: &dyn Effect, page: &mut String) {
    for line in effect.doc().lines().map_while(|l| l.strip_prefix("//!")) {
        let line = line.strip_prefix(' ').unwrap_or(line);
        let _ = match line.strip_prefix("# ") {
            Some(heading) => writeln!(page, "**{heading}**\n"),
            None => writeln!(page, "{line}"),
        };
    }
    parameters(effect, "", page);
    for &form in effect.other_forms() {
        let when = if form.on_load_side() {
            ", with the encoder on the load"
        } else {
            ", or"
        };
        parameters(form, when, page);
    }
}

/// The table of an effect's parameters.
fn parameters(effect: &dyn Effect, when: &str, page: &mut String) {
    let _ = writeln!(
        page,
        "\n| parameter, under `[effects.{}]`{when} | unit, rotary | unit, linear |\n| --- | --- | --- |",
        effect.id()
    );
    for spec in effect.parameters() {
        let unit = |motion| spec.quantity.unit(motion);
        let (rotary, linear) = (unit(Motion::Rotary), unit(Motion::Linear));
        let _ = writeln!(page, "| `{}` | {rotary} | {linear} |", spec.name);
    }
}

/// The table of faults.
pub(super) fn faults() -> String {
    let mut page = format!(
        "# Faults\n\n{NOTICE}\nWhat a board turns its bridge off for, as `bristle explain ID` shows it. Telemetry carries the numbers, which are stable.\n"
    );
    for fault in Fault::ALL {
        let words = fault.page();
        let _ = writeln!(
            page,
            "\n## {} ({})\n\n**Raised when** {}.\n\n**The bridge is off in** {}.\n\n**What to do:** {}",
            words.id,
            fault.number(),
            words.detection.trim_end_matches('.'),
            words.reaction.trim_end_matches('.'),
            words.remedy
        );
    }
    page
}
