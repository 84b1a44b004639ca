//! Recordings: what was applied to an axis and how it moved.

mod csv;
mod header;
mod matlab;
mod parquet;
mod table;
mod units;

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::model::Columns;
use crate::motion::Motion;
use table::Source;

/// One run of one axis, in SI units.
///
/// `u[k]` acts from `t[k]` until `t[k + 1]` (zero-order hold). At least one of `q` and `v` is present.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Where it was read from; the report and the messages name it.
    pub path: PathBuf,
    /// Time, s, strictly increasing.
    pub t: Vec<f64>,
    /// Drive: N·m, N, V or A, as the model file says.
    pub u: Vec<f64>,
    /// Measured position, rad or m.
    pub q: Option<Vec<f64>>,
    /// Measured velocity, rad/s or m/s.
    pub v: Option<Vec<f64>>,
    /// The unit that the header gives `u`, as it stands there.
    pub input_unit: Option<String>,
}

/// Fewer samples than this cannot carry a diagnosis.
const FEWEST_SAMPLES: usize = 200;
/// Time may span this many times what the samples cover at their own rate.
const LONGEST_GAP: f64 = 1000.0;

impl Recording {
    /// Reads a CSV, Parquet or MATLAB level-5 recording, renaming columns by `columns` and converting units for an axis that moves by `motion`.
    pub fn read(path: &Path, columns: &Columns, motion: Motion) -> Result<Self> {
        let extension = path
            .extension()
            .and_then(|e| e.to_str())
            .unwrap_or_default();
        let source = Source {
            path,
            columns,
            motion,
        };
        let table = match extension.to_ascii_lowercase().as_str() {
            "parquet" | "pq" => parquet::read(&source)?,
            "mat" => matlab::read(&source)?,
            _ => csv::read(&source)?,
        };
        table.recording.check(&table.lines)?;
        Ok(table.recording)
    }

    /// The measured quantity that the fit is judged on: position, or velocity where only that was measured.
    pub fn measured(&self) -> &[f64] {
        self.q.as_deref().or(self.v.as_deref()).unwrap_or_default()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether there is no sample at all.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// File name without folders, for messages and titles.
    pub fn file_name(&self) -> String {
        self.path.file_name().map_or_else(
            || self.path.display().to_string(),
            |n| n.to_string_lossy().into_owned(),
        )
    }

    /// Refuses what cannot carry a fit; `lines` are those of the header and of each sample.
    fn check(&self, lines: &[usize]) -> Result<()> {
        let fail = |what: String| {
            Err(Error::Recording {
                path: self.path.clone(),
                what,
            })
        };
        if self.len() < FEWEST_SAMPLES {
            return fail(format!(
                "line {}, column t: the recording ends after {} samples; at least {FEWEST_SAMPLES} are needed, so record for longer or at a higher rate",
                lines.last().unwrap_or(&1),
                self.len()
            ));
        }
        let (first, last) = (lines[1], lines[self.len()]);
        let mut steps: Vec<f64> = self.t.windows(2).map(|t| t[1] - t[0]).collect();
        let longest = (0..steps.len())
            .max_by(|&a, &b| steps[a].total_cmp(&steps[b]))
            .unwrap_or_default();
        let (from, to) = (self.t[longest], self.t[longest + 1]);
        steps.sort_by(f64::total_cmp);
        let recorded = steps[steps.len() / 2] * self.len() as f64;
        if self.t[self.len() - 1] - self.t[0] > LONGEST_GAP * recorded {
            return fail(format!(
                "line {}, column t: time jumps from {from} s to {to} s, far beyond what was recorded; repair the clock, or give the parts as recordings of their own",
                lines[longest + 2]
            ));
        }
        let constant = |x: &[f64]| x.iter().all(|&value| value == x[0]);
        if constant(&self.u) {
            return fail(format!(
                "lines {first} to {last}, column u: u is {} throughout; nothing drives the axis, so nothing can be learnt: check the column mapping, or record with an excitation",
                self.u[0]
            ));
        }
        if constant(self.measured()) {
            let name = if self.q.is_some() { "q" } else { "v" };
            return fail(format!(
                "lines {first} to {last}, column {name}: {name} never changes: the axis did not move; record with a drive above break-away"
            ));
        }
        Ok(())
    }
}
