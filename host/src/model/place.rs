//! Where in a model file something is wrong.

use toml_edit::{Document, TableLike, TomlError};

/// What is wrong with a model file, and under which key.
#[derive(Debug)]
pub(super) struct Problem {
    keys: Vec<String>,
    what: String,
}

/// A problem under a dotted key such as `plant.gain`; the message names the key by itself.
pub(super) fn at(key: &str, what: impl Into<String>) -> Problem {
    Problem {
        keys: key.split('.').map(str::to_owned).collect(),
        what: what.into(),
    }
}

impl Problem {
    /// The message, led by the line that holds the key, or else the section that lacks it.
    pub fn message(&self, text: &str) -> String {
        match self.line(text) {
            Some(line) => format!("line {line}: {}", self.what),
            None => self.what.clone(),
        }
    }

    fn line(&self, text: &str) -> Option<usize> {
        let document = Document::parse(text).ok()?;
        let mut table: &dyn TableLike = document.as_table();
        let mut found = None;
        for key in &self.keys {
            let Some((key, item)) = table.get_key_value(key) else {
                break;
            };
            found = key.span().or(found);
            match item.as_table_like() {
                Some(inner) => table = inner,
                None => break,
            }
        }
        Some(line_of(text, found?.start))
    }
}

/// Where and why a text is not TOML, on one line.
pub(super) fn syntax(text: &str, error: &TomlError) -> String {
    let what = error.message().replace('\n', "; ");
    let Some(span) = error.span() else {
        return format!("not valid TOML: {what}");
    };
    let start = span.start.min(text.len());
    let before = text.get(..start).unwrap_or_default();
    let column = 1 + before.chars().rev().take_while(|c| *c != '\n').count();
    format!(
        "line {}, column {column}: not valid TOML: {what}",
        line_of(text, start)
    )
}

fn line_of(text: &str, byte: usize) -> usize {
    text.as_bytes()[..byte.min(text.len())]
        .split(|&b| b == b'\n')
        .count()
}
