//! Recordings that are read piece by piece.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::Recording;
use super::audit::Audit;
use super::csv::{Layout, Rows};
use super::table::Source;
use crate::error::{Error, Result};
use crate::model::Columns;
use crate::motion::Motion;

/// A recording that has been read through once, so that it is known to be in order, and can be read again from anywhere.
///
/// Of a CSV file nothing stays in memory but some places to go on from; files of other formats are loaded whole.
pub struct Long {
    /// Where it is read from.
    pub path: PathBuf,
    /// Number of samples.
    pub samples: usize,
    /// Time of the first sample, s.
    pub start: f64,
    /// Time of the last sample, s.
    pub end: f64,
    /// Median pause between samples, s.
    pub period: f64,
    /// See [`Recording::sampled`].
    pub sampled: bool,
    columns: Columns,
    motion: Motion,
    content: Content,
}

enum Content {
    Text { layout: Layout, marks: Marks },
    Loaded(Recording),
}

/// Places in a file at which reading can begin: those of every so many samples, a bounded number of them.
struct Marks {
    places: Vec<u64>,
    stride: usize,
}

impl Marks {
    const MOST: usize = 4096;

    fn new() -> Self {
        Self {
            places: Vec::new(),
            stride: 256,
        }
    }

    fn push(&mut self, sample: usize, place: u64) {
        if !sample.is_multiple_of(self.stride) {
            return;
        }
        if self.places.len() == Self::MOST {
            let mut index = 0;
            self.places.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.stride *= 2;
        }
        if sample.is_multiple_of(self.stride) {
            self.places.push(place);
        }
    }
}

/// How often a scan reports, samples.
const TICK: usize = 1 << 16;

impl Long {
    /// Reads a recording through; `tick` is told how many samples have been read since it was last told.
    pub fn scan(
        path: &Path,
        columns: &Columns,
        motion: Motion,
        tick: &dyn Fn(usize),
    ) -> Result<Self> {
        let source = Source {
            path,
            columns,
            motion,
        };
        if super::is_text(path) {
            return Self::scan_text(source, tick);
        }
        let recording = Recording::read(path, columns, motion)?;
        let mut audit = Audit::new("");
        let rows = recording.t.iter().zip(&recording.u);
        rows.for_each(|(&t, &u)| audit.push(t, u, 0.0, 0));
        tick(audit.count);
        Ok(Self::new(source, &audit, Content::Loaded(recording)))
    }

    fn scan_text(source: Source, tick: &dyn Fn(usize)) -> Result<Self> {
        let mut rows = Rows::open(source)?;
        let layout = rows.layout().clone();
        let mut audit = Audit::new(layout.used[2].name);
        let mut marks = Marks::new();
        let mut values = vec![0.0; layout.used.len()];
        while let Some(place) = rows.next(&mut values, audit.now())? {
            marks.push(audit.count, place);
            audit.push(values[0], values[1], values[2], place);
            if audit.count.is_multiple_of(TICK) {
                tick(TICK);
            }
        }
        tick(audit.count % TICK);
        audit.finish(source.path, |place| rows.line_of(place))?;
        Ok(Self::new(source, &audit, Content::Text { layout, marks }))
    }

    fn new(source: Source, audit: &Audit, content: Content) -> Self {
        let (start, end, period) = audit.clock();
        Self {
            path: source.path.to_owned(),
            samples: audit.count,
            start,
            end,
            period,
            sampled: false,
            columns: source.columns.clone(),
            motion: source.motion,
            content,
        }
    }

    /// A reader that begins at a sample.
    pub fn reader(&self, from: usize) -> Result<Reader<'_>> {
        let source = Source {
            path: &self.path,
            columns: &self.columns,
            motion: self.motion,
        };
        let mut reader = Reader {
            long: self,
            next: from,
            rows: None,
            now: None,
        };
        if let Content::Text { layout, marks } = &self.content {
            let mark = (from / marks.stride).min(marks.places.len() - 1);
            let mut rows = Rows::resume(source, layout, marks.places[mark])?;
            let mut values = vec![0.0; layout.used.len()];
            for _ in mark * marks.stride..from {
                rows.next(&mut values, None)?;
            }
            reader.rows = Some(rows);
        }
        Ok(reader)
    }

    /// Samples of a part of the recording.
    pub fn part(&self, samples: std::ops::Range<usize>) -> Result<Recording> {
        let mut part = self.blank();
        self.reader(samples.start)?
            .append(&mut part, samples.len())?;
        Ok(part)
    }

    /// A recording without samples that has the columns of this one.
    pub fn blank(&self) -> Recording {
        let has = |name: &str| match &self.content {
            Content::Text { layout, .. } => layout.used.iter().any(|c| c.name == name),
            Content::Loaded(r) => (name == "q" && r.q.is_some()) || (name == "v" && r.v.is_some()),
        };
        let input_unit = match &self.content {
            Content::Text { layout, .. } => {
                let input = layout.used.iter().find(|c| c.name == "u");
                input.and_then(|c| c.unit.clone())
            }
            Content::Loaded(r) => r.input_unit.clone(),
        };
        Recording {
            path: self.path.clone(),
            t: Vec::new(),
            u: Vec::new(),
            q: has("q").then(Vec::new),
            v: has("v").then(Vec::new),
            sampled: self.sampled,
            input_unit,
            stamps: None,
            readings: None,
        }
    }
}

/// Reads a long recording in order.
pub struct Reader<'a> {
    long: &'a Long,
    next: usize,
    rows: Option<Rows<'a, File>>,
    now: Option<f64>,
}

impl Reader<'_> {
    /// Appends the next `count` samples to a recording made by [`Long::blank`].
    pub fn append(&mut self, to: &mut Recording, count: usize) -> Result<()> {
        let Some(rows) = &mut self.rows else {
            return self.copy(to, count);
        };
        let mut values = [0.0; 4];
        for _ in 0..count {
            if rows.next(&mut values, self.now)?.is_none() {
                return Err(self.changed());
            }
            self.now = Some(values[0]);
            to.t.push(values[0]);
            to.u.push(values[1]);
            let measured = to.q.iter_mut().chain(to.v.iter_mut());
            measured
                .zip(&values[2..])
                .for_each(|(x, value)| x.push(*value));
        }
        self.next += count;
        Ok(())
    }

    fn copy(&mut self, to: &mut Recording, count: usize) -> Result<()> {
        let Content::Loaded(all) = &self.long.content else {
            return Err(Error::Internal("no rows to read".to_owned()));
        };
        let range = self.next..self.next + count;
        to.t.extend_from_slice(&all.t[range.clone()]);
        to.u.extend_from_slice(&all.u[range.clone()]);
        for (to, all) in [(&mut to.q, &all.q), (&mut to.v, &all.v)] {
            if let (Some(to), Some(all)) = (to, all) {
                to.extend_from_slice(&all[range.clone()]);
            }
        }
        self.next += count;
        Ok(())
    }

    fn changed(&self) -> Error {
        Error::Recording {
            path: self.long.path.clone(),
            what: "the file became shorter while it was read; wait until the logger has closed it"
                .to_owned(),
        }
    }
}
