//! What all file formats share: columns of numbers that become a recording.

use std::collections::BTreeMap;
use std::path::Path;

use super::Recording;
use super::audit::Audit;
use super::header::{Column, Header};
use crate::error::{Error, Result};
use crate::model::Columns;
use crate::motion::Motion;

/// A file to read, and what the model file says about it.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub path: &'a Path,
    pub columns: &'a Columns,
    pub motion: Motion,
}

/// Loggers mark what they miss by numbers as large as they have.
pub(super) const LARGEST: f64 = 1e30;

impl Source<'_> {
    /// Makes a recording of a file that holds whole columns; `load` reads the one at an index.
    ///
    /// Messages count lines as if the table were text: the names on line 1, the first row on line 2.
    pub fn assemble(
        &self,
        names: Vec<&str>,
        mut load: impl FnMut(usize) -> Result<Vec<f64>>,
    ) -> Result<Recording> {
        let header = Header {
            source: self,
            names,
            line: 1,
        };
        let used = header.used()?;
        let mut values = Vec::new();
        for column in &used {
            let mut loaded = load(column.index)?;
            for (row, value) in loaded.iter_mut().enumerate() {
                if value.is_nan() || value.abs() >= LARGEST {
                    let what = format!(
                        "{value} is not a usable number; remove the row or repair the logger"
                    );
                    return Err(self.cell(row + 2, column, what));
                }
                *value *= column.factor;
            }
            values.push(loaded);
        }
        let rows = values[0].len();
        if let Some((column, other)) = used.iter().zip(&values).find(|(_, v)| v.len() != rows) {
            let what = format!(
                "{} values here but {rows} in {}; the columns of a recording have one length",
                other.len(),
                used[0].header
            );
            return Err(self.cell(rows.min(other.len()) + 2, column, what));
        }
        let mut audit = Audit::new(used[2].name);
        for row in 0..rows {
            let now = values[0][row];
            if let Some(earlier) = audit.now().filter(|earlier| now <= *earlier) {
                return Err(self.order(earlier, now, row + 2, &used[0]));
            }
            audit.push(now, values[1][row], values[2][row], row as u64);
        }
        audit.finish(self.path, |row| Ok(row.map_or(1, |row| row as usize + 2)))?;
        Ok(self.table(&used, values))
    }

    /// The recording that columns of SI values make.
    pub fn table(&self, used: &[Column], values: Vec<Vec<f64>>) -> Recording {
        let mut values: BTreeMap<&str, Vec<f64>> =
            used.iter().map(|column| column.name).zip(values).collect();
        let input = used.iter().find(|column| column.name == "u");
        Recording {
            input_unit: input.and_then(|column| column.unit.clone()),
            path: self.path.to_owned(),
            t: values.remove("t").unwrap_or_default(),
            u: values.remove("u").unwrap_or_default(),
            q: values.remove("q"),
            v: values.remove("v"),
            sampled: false,
            stamps: None,
            readings: None,
        }
    }

    /// The complaint about an instant that does not come after the one before it.
    pub fn order(&self, earlier: f64, now: f64, line: usize, time: &Column) -> Error {
        let what = format!(
            "time does not increase: {now} s comes after {earlier} s; remove the repeated or misplaced rows"
        );
        self.cell(line, time, what)
    }

    pub fn unreadable(&self, reason: std::io::Error) -> Error {
        Error::Unreadable {
            path: self.path.to_owned(),
            reason,
        }
    }

    pub fn cell(&self, line: usize, column: &Column, what: String) -> Error {
        Error::Cell {
            path: self.path.to_owned(),
            line,
            column: column.header.clone(),
            what,
        }
    }

    pub fn whole(&self, what: &str) -> Error {
        Error::Recording {
            path: self.path.to_owned(),
            what: what.to_owned(),
        }
    }
}
