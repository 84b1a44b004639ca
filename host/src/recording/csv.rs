//! Recordings as comma, semicolon or tab separated text.

use std::path::Path;

use super::{Recording, units};
use crate::error::{Error, Result};
use crate::model::Columns;
use crate::motion::Motion;

/// A column that the recording uses: where it stands, what it is called there, and its factor to SI.
struct Column {
    index: usize,
    header: String,
    factor: f64,
}

pub(super) fn read(path: &Path, columns: &Columns, motion: Motion) -> Result<Recording> {
    let bytes = std::fs::read(path).map_err(|reason| Error::Unreadable {
        path: path.to_owned(),
        reason,
    })?;
    let text = String::from_utf8(bytes).map_err(|e| Error::Recording {
        path: path.to_owned(),
        what: format!(
            "line {}: not text in UTF-8; is this really a CSV file?",
            1 + e.as_bytes()[..e.utf8_error().valid_up_to()]
                .iter()
                .filter(|&&b| b == b'\n')
                .count()
        ),
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    Reader {
        path,
        columns,
        motion,
    }
    .parse(text)
}

struct Reader<'a> {
    path: &'a Path,
    columns: &'a Columns,
    motion: Motion,
}

impl Reader<'_> {
    fn parse(&self, text: &str) -> Result<Recording> {
        let delimiter = delimiter(text.lines().next().unwrap_or_default());
        let mut table = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .flexible(true)
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let header = table.headers().map_err(|e| self.malformed(&e))?.clone();
        let headers: Vec<&str> = header.iter().collect();
        let t = self
            .column(&headers, "t")?
            .ok_or_else(|| self.missing("t", &headers))?;
        let u = self
            .column(&headers, "u")?
            .ok_or_else(|| self.missing("u", &headers))?;
        let q = self.column(&headers, "q")?;
        let v = self.column(&headers, "v")?;
        if q.is_none() && v.is_none() {
            return Err(self.missing("q", &headers));
        }
        let used: Vec<&Column> = [Some(&t), Some(&u), q.as_ref(), v.as_ref()]
            .into_iter()
            .flatten()
            .collect();
        let mut values: Vec<Vec<f64>> = used.iter().map(|_| Vec::new()).collect();
        // With another delimiter than the comma, a comma inside a number can only be a decimal comma.
        let decimal_comma = delimiter != b',';
        let mut row = csv::StringRecord::new();
        while table
            .read_record(&mut row)
            .map_err(|e| self.malformed(&e))?
        {
            let line = row.position().map_or(0, |p| p.line() as usize);
            if row.iter().all(str::is_empty) {
                continue;
            }
            for (column, values) in used.iter().zip(&mut values) {
                let cell = row.get(column.index).unwrap_or_default();
                let value =
                    number(cell, decimal_comma).map_err(|what| self.cell(line, column, what))?;
                values.push(value * column.factor);
            }
            if let [.., earlier, now] = values[0][..]
                && now <= earlier
            {
                let what = format!(
                    "time does not increase: {now} s comes after {earlier} s; remove the repeated or misplaced rows"
                );
                return Err(self.cell(line, &t, what));
            }
        }
        let mut values = values.into_iter();
        let mut take = |present: bool| if present { values.next() } else { None };
        Ok(Recording {
            path: self.path.to_owned(),
            t: take(true).unwrap_or_default(),
            u: take(true).unwrap_or_default(),
            q: take(q.is_some()),
            v: take(v.is_some()),
        })
    }

    /// Finds the column that the model file maps to `name`, or the one so called.
    fn column(&self, headers: &[&str], name: &str) -> Result<Option<Column>> {
        let mapped = self.columns.get(name);
        let wanted = mapped.map_or(name, String::as_str);
        let found = headers.iter().enumerate().find(|(_, header)| {
            let (bare, _) = split_unit(header);
            **header == wanted || bare == wanted
        });
        let Some((index, header)) = found else {
            return match mapped {
                None => Ok(None),
                Some(wanted) => Err(Error::Cell {
                    path: self.path.to_owned(),
                    line: 1,
                    column: wanted.clone(),
                    what: format!(
                        "the model file maps {name} to a column that is not here; the file has {}",
                        headers.join(", ")
                    ),
                }),
            };
        };
        let factor = match split_unit(header).1 {
            None => 1.0,
            Some(unit) => units::factor(name, unit, self.motion).map_err(|what| Error::Cell {
                path: self.path.to_owned(),
                line: 1,
                column: (*header).to_owned(),
                what,
            })?,
        };
        Ok(Some(Column {
            index,
            header: (*header).to_owned(),
            factor,
        }))
    }

    fn missing(&self, name: &str, headers: &[&str]) -> Error {
        let or = if name == "q" { " (or v)" } else { "" };
        let first = headers.first().copied().unwrap_or_default();
        let what = if headers.iter().all(|h| h.parse::<f64>().is_ok()) {
            format!(
                "the first line must name the columns, as in t[s],u[N*m],q[rad]; it begins with {first:?}"
            )
        } else {
            format!(
                "no such column{or}; the file has {}. Rename one, or map it under [columns] in the model file: {name} = \"…\"",
                headers.join(", ")
            )
        };
        Error::Cell {
            path: self.path.to_owned(),
            line: 1,
            column: name.to_owned(),
            what,
        }
    }

    fn cell(&self, line: usize, column: &Column, what: String) -> Error {
        Error::Cell {
            path: self.path.to_owned(),
            line,
            column: column.header.clone(),
            what,
        }
    }

    fn malformed(&self, error: &csv::Error) -> Error {
        Error::Recording {
            path: self.path.to_owned(),
            what: format!("not a readable table: {error}"),
        }
    }
}

/// The delimiter that splits the header into most parts.
fn delimiter(header: &str) -> u8 {
    let count = |delimiter: char| header.matches(delimiter).count();
    if count('\t') > 0 {
        b'\t'
    } else if count(';') > 0 {
        b';'
    } else {
        b','
    }
}

/// `q[rad]` is the column `q` with the unit `rad`.
fn split_unit(header: &str) -> (&str, Option<&str>) {
    match header.split_once('[') {
        Some((name, rest)) => (name.trim(), Some(rest.trim_end_matches(']').trim())),
        None => (header.trim(), None),
    }
}

fn number(cell: &str, decimal_comma: bool) -> std::result::Result<f64, String> {
    if cell.is_empty() {
        return Err("the cell is empty; fill it or remove the row".to_owned());
    }
    let parsed = if decimal_comma && cell.contains(',') {
        cell.replace(',', ".").parse::<f64>()
    } else {
        cell.parse::<f64>()
    };
    match parsed {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(format!(
            "{cell} is not a finite number; remove the row or repair the logger"
        )),
        Err(_) => Err(format!("{cell:?} is not a number")),
    }
}

#[cfg(test)]
mod tests {
    use super::{Reader, delimiter, split_unit};
    use crate::model::Columns;
    use crate::motion::Motion;
    use std::path::Path;

    fn parse(text: &str, columns: &Columns) -> crate::error::Result<super::Recording> {
        Reader {
            path: Path::new("run.csv"),
            columns,
            motion: Motion::Rotary,
        }
        .parse(text)
    }

    #[test]
    fn reads_units_semicolons_and_decimal_commas() {
        let r = parse(
            "t[ms];u[mN*m];q[deg]\n0;1,5;180\n1;2,5;90\n",
            &Columns::new(),
        )
        .unwrap();
        assert_eq!(r.t, [0.0, 1e-3]);
        assert_eq!(r.u, [1.5e-3, 2.5e-3]);
        assert!((r.q.unwrap()[0] - std::f64::consts::PI).abs() < 1e-12);
    }

    #[test]
    fn maps_columns_and_keeps_velocity_only_recordings() {
        let columns = Columns::from([("u".to_owned(), "vir".to_owned())]);
        let r = parse("t,vir,v,extra\n0,1,2,x\n1,2,3,y\n", &columns).unwrap();
        assert_eq!(r.u, [1.0, 2.0]);
        assert!(r.q.is_none() && r.v == Some(vec![2.0, 3.0]));
    }

    #[test]
    fn messages_name_line_and_column() {
        let message = |text: &str| parse(text, &Columns::new()).unwrap_err().to_string();
        assert!(
            message("t,u,q\n0,1,2\n1,abc,2\n")
                .starts_with("run.csv, line 3, column u: \"abc\" is not a number")
        );
        assert!(
            message("t,u,q\n0,1,2\n1,nan,2\n").contains("line 3, column u: nan is not a finite")
        );
        assert!(
            message("t,u,q\n0,1,2\n0,1,2\n").contains("line 3, column t: time does not increase")
        );
        assert!(message("t,u,q\n0,1\n").contains("line 2, column q: the cell is empty"));
        assert!(message("t,u\n0,1\n").contains("line 1, column q: no such column (or v)"));
        assert!(message("0.0,1.0,2.0\n0,1,2\n").contains("must name the columns"));
        assert!(
            message("t,u,q[furlong]\n0,1,2\n")
                .contains("line 1, column q[furlong]: the unit [furlong]")
        );
    }

    #[test]
    fn finds_delimiter_and_unit() {
        assert_eq!(delimiter("t\tu\tq"), b'\t');
        assert_eq!(delimiter("t;u;q"), b';');
        assert_eq!(split_unit("u [N*m]"), ("u", Some("N*m")));
    }
}
