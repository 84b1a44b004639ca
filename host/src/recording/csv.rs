//! Recordings as comma, semicolon or tab separated text.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use super::Recording;
use super::audit::Audit;
use super::header::{Column, Header};
use super::table::{LARGEST, Source};
use super::text::{COMMENT, Checked, NotText, first_line, line_at};
use crate::error::{Error, Result};

pub(super) fn read(source: &Source) -> Result<Recording> {
    Rows::open(*source)?.table()
}

/// The rows of a table in text, one after the other.
pub(super) struct Rows<'a, R> {
    source: Source<'a>,
    table: csv::Reader<Checked<R>>,
    layout: Layout,
    /// Byte of the file at which `table` began.
    from: u64,
    row: csv::ByteRecord,
}

/// What the first line says about all others.
#[derive(Clone)]
pub(super) struct Layout {
    names: Vec<String>,
    /// The columns that a recording uses; time comes first.
    pub used: Vec<Column>,
    /// Byte of the first line.
    header: u64,
    delimiter: u8,
}

impl<'a> Rows<'a, File> {
    /// Opens a file and reads its first line.
    pub fn open(source: Source<'a>) -> Result<Self> {
        Self::new(source, file(&source)?)
    }

    /// Opens a file to go on at the record that begins at byte `from`.
    pub fn resume(source: Source<'a>, layout: &Layout, from: u64) -> Result<Self> {
        let mut file = file(&source)?;
        file.seek(SeekFrom::Start(from))
            .map_err(|e| source.unreadable(e))?;
        let table = builder(layout.delimiter)
            .has_headers(false)
            .from_reader(Checked::new(file, from));
        Ok(Self {
            source,
            table,
            layout: layout.clone(),
            from,
            row: csv::ByteRecord::new(),
        })
    }
}

fn file(source: &Source) -> Result<File> {
    File::open(source.path).map_err(|e| source.unreadable(e))
}

fn builder(delimiter: u8) -> csv::ReaderBuilder {
    let mut builder = csv::ReaderBuilder::new();
    builder
        .delimiter(delimiter)
        .flexible(true)
        .trim(csv::Trim::Headers)
        .comment(Some(COMMENT))
        .buffer_capacity(1 << 17);
    builder
}

impl<'a, R: Read + Seek> Rows<'a, R> {
    pub fn new(source: Source<'a>, mut file: R) -> Result<Self> {
        let unreadable = |e| source.unreadable(e);
        let from = byte_order_mark(&mut file).map_err(unreadable)?;
        let mut checked = Checked::new(&mut file, from);
        // Enough to tell a table from anything else before its first line is looked for.
        let looked = io::copy(&mut (&mut checked).take(1 << 16), &mut io::sink());
        if let Err(error) = looked {
            return Err(refused(&source, error, &mut file));
        }
        let first = first_line(&mut file, from).map_err(unreadable)?.1;
        file.seek(SeekFrom::Start(from)).map_err(unreadable)?;
        let delimiter = delimiter(&first);
        let mut rows = Self {
            source,
            table: builder(delimiter).from_reader(Checked::new(file, from)),
            layout: Layout {
                names: Vec::new(),
                used: Vec::new(),
                header: from,
                delimiter,
            },
            from,
            row: csv::ByteRecord::new(),
        };
        rows.read_header()?;
        Ok(rows)
    }

    fn read_header(&mut self) -> Result<()> {
        let header = match self.table.byte_headers() {
            Ok(header) => header.clone(),
            Err(error) => return Err(self.malformed(error)),
        };
        let mut names: Vec<String> = header
            .iter()
            .map(|name| String::from_utf8_lossy(name).trim().to_owned())
            .collect();
        // A delimiter at the end of the line makes one more column without a name.
        while names.pop_if(|name| name.is_empty()).is_some() {}
        if names.is_empty() {
            return Err(self.source.whole(
                "line 1: the file is empty; its first line must name the columns, as in t[s],u[N*m],q[rad]",
            ));
        }
        self.layout.header = self.from + header.position().map_or(0, csv::Position::byte);
        let line = self.line(self.layout.header)?;
        let header = Header {
            source: &self.source,
            names: names.iter().map(String::as_str).collect(),
            line,
        };
        self.layout.used = header.used()?;
        self.layout.names = names;
        Ok(())
    }

    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Reads the values of the next row in SI units, in the order of the used columns, and gives its place: the byte that
    /// it begins at. `None` at the end.
    pub fn next(&mut self, values: &mut [f64], earlier: Option<f64>) -> Result<Option<u64>> {
        loop {
            match self.table.read_byte_record(&mut self.row) {
                Ok(true) => {}
                Ok(false) => return Ok(None),
                Err(error) => return Err(self.malformed(error)),
            }
            if !self.row.iter().all(|cell| cell.trim_ascii().is_empty()) {
                break;
            }
        }
        let place = self.from + self.row.position().map_or(0, csv::Position::byte);
        match self.values(values, earlier) {
            Ok(()) => Ok(Some(place)),
            Err(complaint) => {
                let line = self.line(place)?;
                Err(self.complain(line, complaint))
            }
        }
    }

    fn values(
        &self,
        values: &mut [f64],
        earlier: Option<f64>,
    ) -> std::result::Result<(), Complaint> {
        self.check_width()?;
        // With another delimiter than the comma, a comma inside a number can only be a decimal comma.
        let decimal_comma = self.layout.delimiter != b',';
        for (k, column) in self.layout.used.iter().enumerate() {
            let cell = self.row.get(column.index).unwrap_or_default();
            let value = number(cell, decimal_comma).map_err(|what| Complaint::Cell(k, what))?;
            values[k] = value * column.factor;
        }
        match earlier {
            Some(earlier) if values[0] <= earlier => Err(Complaint::Order(earlier, values[0])),
            _ => Ok(()),
        }
    }

    /// Refuses a row with more or fewer cells than the header, as its values may stand under the wrong names.
    /// Empty cells beyond the header, from a delimiter at the end of the line, are harmless.
    fn check_width(&self) -> std::result::Result<(), Complaint> {
        let names = self.layout.names.len();
        let beyond = |cell: &[u8]| !cell.trim_ascii().is_empty();
        if self.row.len() == names
            || self.row.len() > names && !self.row.iter().skip(names).any(beyond)
        {
            return Ok(());
        }
        Err(Complaint::Width(self.row.len()))
    }

    fn complain(&self, line: usize, complaint: Complaint) -> Error {
        let Layout { names, used, .. } = &self.layout;
        match complaint {
            Complaint::Cell(column, what) => self.source.cell(line, &used[column], what),
            Complaint::Order(earlier, now) => self.source.order(earlier, now, line, &used[0]),
            Complaint::Width(cells) => Error::Cell {
                path: self.source.path.to_owned(),
                line,
                column: names[cells.min(names.len() - 1)].clone(),
                what: format!(
                    "this row has {cells} cells and the first line names {} columns; complete the row or remove it, and write decimal points, not commas, where commas part the cells",
                    names.len()
                ),
            },
        }
    }

    /// The line of the record that begins at a byte. The table cannot be read on after that.
    pub fn line(&mut self, place: u64) -> Result<usize> {
        let source = self.source;
        // Position and file belong to a reader that looks ahead; what it has not handed out yet is not needed any more
        // once a line is asked for, but for the header's.
        let file = &mut self.table.get_mut().file;
        let ahead = file.stream_position().map_err(|e| source.unreadable(e))?;
        let found = first_line(file, place).map_err(|e| source.unreadable(e))?.0;
        file.seek(SeekFrom::Start(ahead))
            .map_err(|e| source.unreadable(e))?;
        Ok(found)
    }

    /// The line of a place, or of the header.
    pub fn line_of(&mut self, place: Option<u64>) -> Result<usize> {
        self.line(place.unwrap_or(self.layout.header))
    }

    fn malformed(&mut self, error: csv::Error) -> Error {
        match error.into_kind() {
            csv::ErrorKind::Io(error) => {
                refused(&self.source, error, &mut self.table.get_mut().file)
            }
            other => self
                .source
                .whole(&format!("not a readable table: {other:?}")),
        }
    }

    /// All rows as a recording that has passed its audit.
    fn table(mut self) -> Result<Recording> {
        let used = self.layout.used.clone();
        let mut columns: Vec<Vec<f64>> = used.iter().map(|_| Vec::new()).collect();
        let mut audit = Audit::new(used[2].name);
        let mut values = vec![0.0; used.len()];
        while let Some(place) = self.next(&mut values, audit.now())? {
            audit.push(values[0], values[1], values[2], place);
            for (column, value) in columns.iter_mut().zip(&values) {
                column.push(*value);
            }
        }
        audit.finish(self.source.path, |place| self.line_of(place))?;
        Ok(self.source.table(&used, columns))
    }
}

/// What is wrong with a row.
enum Complaint {
    /// With the cell of a used column.
    Cell(usize, String),
    /// Its instant does not come after the one before it.
    Order(f64, f64),
    /// With the number of its cells.
    Width(usize),
}

/// The failure of a file that does not go on as text, or not at all.
fn refused(source: &Source, error: io::Error, file: &mut (impl Read + Seek)) -> Error {
    let not_text = error.get_ref().and_then(|e| e.downcast_ref::<NotText>());
    let Some(&NotText(at)) = not_text else {
        return source.unreadable(error);
    };
    match line_at(file, at) {
        Ok(line) => source.whole(&format!(
            "line {line}: not text in UTF-8; give a CSV file, or save this one as UTF-8"
        )),
        Err(error) => source.unreadable(error),
    }
}

/// Length of the mark that some programs put before UTF-8; the file is left behind it.
fn byte_order_mark(file: &mut (impl Read + Seek)) -> io::Result<u64> {
    const MARK: &[u8] = "\u{feff}".as_bytes();
    let mut start = Vec::new();
    file.take(MARK.len() as u64).read_to_end(&mut start)?;
    let length = if start == MARK { MARK.len() as u64 } else { 0 };
    file.seek(SeekFrom::Start(length))
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

fn number(cell: &[u8], decimal_comma: bool) -> std::result::Result<f64, String> {
    let text = std::str::from_utf8(cell).map_or_else(|_| String::from_utf8_lossy(cell), Cow::from);
    let cell = text.trim();
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
    use super::{Rows, delimiter};
    use crate::model::Columns;
    use crate::motion::Motion;
    use crate::recording::table::Source;
    use std::io::Cursor;
    use std::path::Path;

    /// Instants, drives and motions.
    type Signals = (Vec<f64>, Vec<f64>, Vec<f64>);

    /// The rows of a text too short for a recording, with the name of the measured column.
    fn parse(text: &str, columns: &Columns) -> crate::error::Result<(Signals, &'static str)> {
        let source = Source {
            path: Path::new("run.csv"),
            columns,
            motion: Motion::Rotary,
        };
        let mut rows = Rows::new(source, Cursor::new(text))?;
        let measured = rows.layout().used[2].name;
        let (mut signals, mut values) = (Signals::default(), [0.0; 4]);
        while rows.next(&mut values, signals.0.last().copied())?.is_some() {
            signals.0.push(values[0]);
            signals.1.push(values[1]);
            signals.2.push(values[2]);
        }
        Ok((signals, measured))
    }

    #[test]
    fn reads_units_semicolons_and_decimal_commas() {
        let ((t, u, q), _) = parse(
            "t[ms];u[mN*m];q[deg]\n0;1,5;180\n1;2,5;90\n",
            &Columns::new(),
        )
        .unwrap();
        assert_eq!(t, [0.0, 1e-3]);
        assert_eq!(u, [1.5e-3, 2.5e-3]);
        assert!((q[0] - std::f64::consts::PI).abs() < 1e-12);
    }

    #[test]
    fn maps_columns_and_keeps_velocity_only_recordings() {
        let columns = Columns::from([("u".to_owned(), "vir".to_owned())]);
        let ((_, u, v), measured) = parse("t,vir,v,extra\n0,1,2,x\n1,2,3,y\n", &columns).unwrap();
        assert_eq!(u, [1.0, 2.0]);
        assert!(measured == "v" && v == [2.0, 3.0]);
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
