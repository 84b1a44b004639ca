//! `bristle explain`

use std::fmt::Write;

use anstyle::Style;
use bristle_core::drive::Fault;
use clap::Args;

use super::{DONE, Outcome};
use crate::effects::{self, Effect};
use crate::error::Error;

/// Explain an effect or a fault: what it is, what it looks like, what excites it, what it is confused with
///
/// Without an id it lists the catalogue of effects and the faults of the motor driver.
#[derive(Args, Debug)]
pub(super) struct Command {
    /// Id of an effect, such as stribeck, or of a fault, such as overcurrent
    id: Option<String>,
}

impl Command {
    pub fn run(&self) -> Outcome {
        let text = match &self.id {
            None => list(),
            Some(id) => explain(id)?,
        };
        anstream::print!("{text}");
        Ok(DONE)
    }
}

fn list() -> String {
    let mut text = String::from("Effects that bristle diagnoses:\n");
    for effect in effects::ALL {
        let _ = writeln!(text, "  {:<28}{}", effect.id(), effect.name());
    }
    text.push_str("\nFaults that a board turns its bridge off for:\n");
    for fault in Fault::ALL {
        let id = fault.page().id;
        let _ = writeln!(text, "  {:>2}  {id}", fault.number());
    }
    text.push_str(
        "\nbristle explain ID tells more about one of them; a fault goes by its number as well.\n",
    );
    text
}

fn explain(id: &str) -> Result<String, Error> {
    if let Some(effect) = effects::find(id) {
        return Ok(page(effect));
    }
    let asked = |f: &Fault| f.page().id == id || f.number().to_string() == id;
    if let Some(fault) = Fault::ALL.into_iter().find(asked) {
        return Ok(fault_page(fault));
    }
    let faults = Fault::ALL.iter().map(|f| f.page().id);
    let every = effects::ALL.iter().map(|e| e.id()).chain(faults);
    let close: Vec<&str> = every.filter(|known| related(known, id)).collect();
    let hint = if close.is_empty() {
        "bristle explain lists them all".to_owned()
    } else {
        format!("did you mean {}?", close.join(" or "))
    };
    Err(Error::Usage(format!(
        "there is no effect or fault {id:?}; {hint}"
    )))
}

/// Whether two ids share a word of at least four letters, or begin alike.
fn related(known: &str, asked: &str) -> bool {
    let asked = asked.to_lowercase().replace('_', "-");
    let begins = asked.len() >= 3 && known.starts_with(&asked[..asked.floor_char_boundary(3)]);
    begins
        || asked
            .split('-')
            .any(|word| word.len() >= 4 && known.contains(word))
}

/// What the motor driver's own table says about a fault.
fn fault_page(fault: Fault) -> String {
    let bold = Style::new().bold();
    let page = fault.page();
    let (number, id) = (fault.number(), page.id);
    let mut text = format!("{bold}Fault {number} ({id}){bold:#}\n");
    for (heading, words) in [
        ("Raised when", page.detection),
        ("The bridge is off in", page.reaction),
        ("What to do", page.remedy),
    ] {
        let _ = writeln!(text, "\n{bold}{heading}{bold:#}\n{words}");
    }
    text
}

/// The effect's own documentation, its headings in bold, followed by its parameters.
fn page(effect: &dyn Effect) -> String {
    let bold = Style::new().bold();
    let mut text = format!("{bold}{} ({}){bold:#}\n\n", effect.name(), effect.id());
    for line in effect.doc().lines().map_while(|l| l.strip_prefix("//!")) {
        let line = line.strip_prefix(' ').unwrap_or(line);
        let _ = match line.strip_prefix("# ") {
            Some(heading) => writeln!(text, "{bold}{heading}{bold:#}"),
            None => writeln!(text, "{line}"),
        };
    }
    let _ = writeln!(
        text,
        "\n{bold}Parameters{bold:#} (in the model file under [effects.{}])",
        effect.id()
    );
    parameters(effect, &mut text);
    for &form in effect.other_forms() {
        let when = if form.on_load_side() {
            "or, with the encoder on the load:"
        } else {
            "or:"
        };
        let _ = writeln!(text, "{when}");
        parameters(form, &mut text);
    }
    text
}

/// A line for each parameter.
fn parameters(effect: &dyn Effect, text: &mut String) {
    for spec in effect.parameters() {
        let (rotary, linear) = (
            spec.quantity.unit(crate::motion::Motion::Rotary),
            spec.quantity.unit(crate::motion::Motion::Linear),
        );
        let unit = if rotary == linear {
            rotary.to_owned()
        } else {
            format!("{rotary} or {linear}")
        };
        let _ = writeln!(text, "{}, {unit}", spec.name);
    }
}
