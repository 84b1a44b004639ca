//! The first line of a recording: which of its columns are used, and their units.

use super::csv::excerpt;
use super::table::Source;
use super::units;
use crate::error::{Error, Result};

/// A column that the recording uses: where it stands, what it is called there, and its factor to SI.
#[derive(Clone)]
pub(super) struct Column {
    pub name: &'static str,
    pub index: usize,
    pub header: String,
    pub factor: f64,
    /// The unit in its header, if there is one.
    pub unit: Option<String>,
}

/// The names that the first line gives.
pub(super) struct Header<'a> {
    pub source: &'a Source<'a>,
    pub names: Vec<&'a str>,
    pub line: usize,
}

impl Header<'_> {
    /// The columns that the recording uses; time comes first.
    pub fn used(&self) -> Result<Vec<Column>> {
        let mut used = Vec::new();
        for name in ["t", "u", "q", "v"] {
            used.extend(self.column(name)?);
        }
        let has = |name: &str| used.iter().any(|column: &Column| column.name == name);
        match ["t", "u"].into_iter().find(|name| !has(name)) {
            Some(name) => Err(self.missing(name)),
            None if !has("q") && !has("v") => Err(self.missing("q")),
            None => Ok(used),
        }
    }

    /// Finds the column that the model file maps to `name`, or the one so called.
    fn column(&self, name: &'static str) -> Result<Option<Column>> {
        let mapped = self.source.columns.get(name);
        let wanted = mapped.map_or(name, String::as_str);
        let Some(index) = self.index(wanted)? else {
            return match mapped {
                None => Ok(None),
                Some(wanted) => Err(self.refuse(
                    wanted,
                    format!(
                        "the model file maps {name} to a column that is not here; the file has {}",
                        self.listed()
                    ),
                )),
            };
        };
        let header = self.names[index];
        let unit = split_unit(header).1;
        let factor = match unit {
            None => 1.0,
            Some(unit) => units::factor(name, unit, self.source.motion)
                .map_err(|what| self.refuse(header, what))?,
        };
        Ok(Some(Column {
            name,
            index,
            header: header.to_owned(),
            factor,
            unit: unit.map(str::to_owned),
        }))
    }

    /// Where the column `wanted` stands. A name with its unit picks one of several that differ in nothing else.
    fn index(&self, wanted: &str) -> Result<Option<usize>> {
        let called = |same: &dyn Fn(&str) -> bool| -> Vec<usize> {
            (0..self.names.len())
                .filter(|&k| same(self.names[k]))
                .collect()
        };
        let mut found = called(&|header| header == wanted);
        if found.is_empty() {
            found = called(&|header| split_unit(header).0 == wanted);
        }
        match found[..] {
            [] => Ok(None),
            [index] => Ok(Some(index)),
            _ => Err(self.refuse(
                wanted,
                format!(
                    "{} columns have this name; rename all but one of them, or map one under [columns] in the model file",
                    found.len()
                ),
            )),
        }
    }

    fn missing(&self, name: &str) -> Error {
        let or = if name == "q" { " (or v)" } else { "" };
        let first = self.names.first().copied().unwrap_or_default();
        let what = if self.names.iter().all(|h| h.parse::<f64>().is_ok()) {
            format!(
                "the first line must name the columns, as in t[s],u[N*m],q[rad]; it begins with \"{}\"",
                excerpt(first)
            )
        } else {
            format!(
                "no such column{or}; the file has {}. Rename one, or map it under [columns] in the model file: {name} = \"…\"",
                self.listed()
            )
        };
        self.refuse(name, what)
    }

    fn refuse(&self, column: &str, what: String) -> Error {
        Error::Cell {
            path: self.source.path.to_owned(),
            line: self.line,
            column: column.to_owned(),
            what,
        }
    }

    /// The names, for a message of one line.
    fn listed(&self) -> String {
        const MOST: usize = 20;
        let mut names: Vec<String> = self.names.iter().take(MOST).map(|h| excerpt(h)).collect();
        if self.names.len() > MOST {
            names.push(format!("and {} more", self.names.len() - MOST));
        }
        names.join(", ")
    }
}

/// `q[rad]` is the column `q` with the unit `rad`.
fn split_unit(header: &str) -> (&str, Option<&str>) {
    match header.split_once('[') {
        Some((name, rest)) => (name.trim(), Some(rest.trim_end_matches(']').trim())),
        None => (header.trim(), None),
    }
}

#[cfg(test)]
mod tests {
    use super::split_unit;

    #[test]
    fn splits_name_and_unit() {
        assert_eq!(split_unit("u [N*m]"), ("u", Some("N*m")));
        assert_eq!(split_unit("u"), ("u", None));
    }
}
