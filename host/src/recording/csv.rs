//! Recordings as comma, semicolon or tab separated text.

use super::header::Header;
use super::table::{LARGEST, Source, Table};
use crate::error::{Error, Result};

pub(super) fn read(source: &Source) -> Result<Table> {
    let path = source.path;
    let bytes = std::fs::read(path).map_err(|reason| Error::Unreadable {
        path: path.to_owned(),
        reason,
    })?;
    let not_text = |valid: &[u8]| Error::Recording {
        path: path.to_owned(),
        what: format!(
            "line {}: not text in UTF-8; give a CSV file, or save this one as UTF-8",
            valid.split(|&b| b == b'\n').count()
        ),
    };
    // A NUL is valid UTF-8 but no table has one: it marks binary files and UTF-16.
    if let Some(nul) = bytes.iter().position(|&b| b == 0) {
        return Err(not_text(&bytes[..nul]));
    }
    let text = String::from_utf8(bytes)
        .map_err(|e| not_text(&e.as_bytes()[..e.utf8_error().valid_up_to()]))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    source.parse(text)
}

impl Source<'_> {
    fn parse(&self, text: &str) -> Result<Table> {
        let delimiter = delimiter(first_line(text));
        let mut table = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .flexible(true)
            .trim(csv::Trim::All)
            .comment(Some(COMMENT as u8))
            .from_reader(text.as_bytes());
        let header = table.headers().map_err(|e| self.malformed(&e))?.clone();
        let mut header = Header {
            source: self,
            names: header.iter().collect(),
            line: header.position().map_or(1, |p| line_of(text, p)),
        };
        // A delimiter at the end of the line makes one more column without a name.
        while header.names.pop_if(|name| name.is_empty()).is_some() {}
        if header.names.is_empty() {
            return Err(self.whole(
                "line 1: the file is empty; its first line must name the columns, as in t[s],u[N*m],q[rad]",
            ));
        }
        let used = header.used()?;
        let mut values: Vec<Vec<f64>> = used.iter().map(|_| Vec::new()).collect();
        // With another delimiter than the comma, a comma inside a number can only be a decimal comma.
        let decimal_comma = delimiter != b',';
        let mut lines = vec![header.line];
        let mut row = csv::StringRecord::new();
        while table
            .read_record(&mut row)
            .map_err(|e| self.malformed(&e))?
        {
            if row.iter().all(str::is_empty) {
                continue;
            }
            let line = row.position().map_or(0, |p| line_of(text, p));
            self.check_width(&row, &header.names, line)?;
            for (column, values) in used.iter().zip(&mut values) {
                let cell = row.get(column.index).unwrap_or_default();
                let value =
                    number(cell, decimal_comma).map_err(|what| self.cell(line, column, what))?;
                values.push(value * column.factor);
            }
            if let [.., earlier, now] = values[0][..] {
                self.check_order(earlier, now, line, &used[0])?;
            }
            lines.push(line);
        }
        Ok(self.table(&used, values, lines))
    }

    /// Refuses a row with more or fewer cells than the header, as its values may stand under the wrong names.
    /// Empty cells beyond the header, from a delimiter at the end of the line, are harmless.
    fn check_width(&self, row: &csv::StringRecord, headers: &[&str], line: usize) -> Result<()> {
        let beyond = row.iter().skip(headers.len()).any(|cell| !cell.is_empty());
        if row.len() >= headers.len() && !beyond {
            return Ok(());
        }
        let last = row.len().min(headers.len() - 1);
        Err(Error::Cell {
            path: self.path.to_owned(),
            line,
            column: headers[last].to_owned(),
            what: format!(
                "this row has {} cells and the first line names {} columns; complete the row or remove it, and write decimal points, not commas, where commas part the cells",
                row.len(),
                headers.len()
            ),
        })
    }

    fn malformed(&self, error: &csv::Error) -> Error {
        self.whole(&format!("not a readable table: {error}"))
    }
}

/// Lines that begin so are not part of the table.
const COMMENT: char = '#';

fn skipped(line: &str) -> bool {
    line.trim().is_empty() || line.starts_with(COMMENT)
}

fn first_line(text: &str) -> &str {
    text.lines().find(|line| !skipped(line)).unwrap_or_default()
}

/// The line that a record stands on: its position is that of the empty and comment lines before it, if any.
fn line_of(text: &str, position: &csv::Position) -> usize {
    let from = text.get(position.byte() as usize..).unwrap_or_default();
    position.line() as usize + from.lines().take_while(|line| skipped(line)).count()
}

/// The beginning of a cell, fit to be shown on one line.
pub(super) fn excerpt(cell: &str) -> String {
    const LONGEST: usize = 40;
    let short: String = cell.chars().take(LONGEST).collect();
    let end = if short.len() < cell.len() { "…" } else { "" };
    // A cell may hold control characters, which are not for the terminal.
    short.replace(char::is_control, "?") + end
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
        Ok(value) if value.abs() < LARGEST => Ok(value),
        Ok(value) if value.is_finite() => Err(format!(
            "{cell} is beyond anything an axis does; if it marks a missing value, remove the row"
        )),
        Ok(_) => Err(format!(
            "{cell} is not a finite number; remove the row or repair the logger"
        )),
        Err(_) => Err(format!(
            "\"{}\" is not a number; repair the cell or remove the row",
            excerpt(cell)
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::delimiter;
    use crate::model::Columns;
    use crate::motion::Motion;
    use crate::recording::Recording;
    use crate::recording::table::Source;
    use std::path::Path;

    fn parse(text: &str, columns: &Columns) -> crate::error::Result<Recording> {
        Source {
            path: Path::new("run.csv"),
            columns,
            motion: Motion::Rotary,
        }
        .parse(text)
        .map(|table| table.recording)
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
        assert!(message("t,u,q\n0,1,\n").contains("line 2, column q: the cell is empty"));
        assert!(message("t,u,q\n0,1\n").contains("line 2, column q: this row has 2 cells"));
        assert!(message("t,u,q\n0,1,2,3\n").contains("line 2, column q: this row has 4 cells"));
        assert!(message("").contains("the file is empty"));
        assert!(parse("t,u,q,\n0,1,2,\n1,2,3\n", &Columns::new()).is_ok());
        assert!(message("# a;b\n\nt,u,q\n\n# c\n0,1,x\n").contains("line 6, column q"));
        assert!(message("t,u,u,q\n0,1,2,3\n").contains("column u: 2 columns have this name"));
        assert!(message("t,u\n0,1\n").contains("line 1, column q: no such column (or v)"));
        assert!(message("0.0,1.0,2.0\n0,1,2\n").contains("must name the columns"));
        assert!(
            message("t,u,q[furlong]\n0,1,2\n")
                .contains("line 1, column q[furlong]: the unit [furlong]")
        );
    }

    #[test]
    fn finds_the_delimiter() {
        assert_eq!(delimiter("t\tu\tq"), b'\t');
        assert_eq!(delimiter("t;u;q"), b';');
    }
}
