//! Recordings: what was applied to an axis and how it moved.

mod audit;
mod csv;
mod header;
mod long;
mod matlab;
mod parquet;
mod table;
mod text;
mod units;

use std::path::{Path, PathBuf};

use crate::error::Result;
use crate::model::Columns;
use crate::motion::Motion;
pub use long::{Long, Reader};
use table::Source;

/// One run of one axis, in SI units.
///
/// `u[k]` acts from `t[k]` until `t[k + 1]` (zero-order hold) unless it is [`Recording::sampled`]. At least one of `q` and `v` is present.
#[derive(Clone, Debug, Default)]
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
    /// Whether `u` was measured at the instants of the samples, as the force of an imposed motion is, rather than held from each
    /// to the next, as a command is.
    pub sampled: bool,
    /// The unit that the header gives `u`, as it stands there.
    pub input_unit: Option<String>,
    /// The stamps of the samples, where these were not taken then and `t` is even time instead.
    pub stamps: Option<Vec<f64>>,
    /// The readings of the input, where their noise never reached the axis and `u` is the level that they scatter about instead.
    pub readings: Option<Vec<f64>>,
}

impl Recording {
    /// Reads a CSV, Parquet or MATLAB level-5 recording, renaming columns by `columns` and converting units for an axis that moves by `motion`.
    pub fn read(path: &Path, columns: &Columns, motion: Motion) -> Result<Self> {
        let source = Source {
            path,
            columns,
            motion,
        };
        match extension(path).as_str() {
            "parquet" | "pq" => parquet::read(&source),
            "mat" => matlab::read(&source),
            _ => csv::read(&source),
        }
    }

    /// The measured quantity that the fit is judged on: position, or velocity where only that was measured.
    pub fn measured(&self) -> &[f64] {
        self.q.as_deref().or(self.v.as_deref()).unwrap_or_default()
    }

    /// RMS of the noise that was taken off the readings of the input, as a share of the input's, if any was.
    pub fn noise_taken_off(&self) -> Option<f64> {
        let readings = self.readings.as_ref()?.iter().zip(&self.u);
        let noise: f64 = readings.map(|(r, u)| (r - u).powi(2)).sum();
        let input: f64 = self.u.iter().map(|u| u * u).sum();
        Some((noise / input.max(f64::MIN_POSITIVE)).sqrt())
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
}

fn extension(path: &Path) -> String {
    let extension = path.extension().and_then(|e| e.to_str());
    extension.unwrap_or_default().to_ascii_lowercase()
}

/// Whether a file is read as text, row by row.
fn is_text(path: &Path) -> bool {
    !matches!(extension(path).as_str(), "parquet" | "pq" | "mat")
}

/// Whether recordings have more than so many samples together, each one that is not read as text counting as few; the
/// shortest row takes six bytes.
pub fn may_exceed(paths: &[PathBuf], samples: usize) -> bool {
    const SHORTEST_ROW: u64 = 6;
    let size = |path: &PathBuf| std::fs::metadata(path).map_or(0, |file| file.len());
    let text = paths.iter().filter(|path| is_text(path));
    text.map(size).sum::<u64>() > SHORTEST_ROW.saturating_mul(samples as u64)
}
