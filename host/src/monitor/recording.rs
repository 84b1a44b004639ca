//! What the monitor writes down: the telemetry as a recording that `diagnose` reads.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use bristle_core::drive::signal::Signal;

use super::view::Sample;
use crate::bench;
use crate::error::{Error, Result};
use crate::guided::{Row, Rows};
use crate::model::Model;

/// More than anybody means to record; the monitor ends a recording there.
const MOST: usize = 10_000_000;

/// A recording that is being made.
#[derive(Default)]
pub(super) struct Recording {
    rows: Vec<Sample>,
}

/// What a recording is written with.
#[derive(Clone)]
pub(super) struct Form {
    /// Where to.
    pub folder: PathBuf,
    /// Units and names of the columns.
    pub model: Option<Model>,
    /// Of a control period, s.
    pub period: f64,
    /// Control periods from row to row.
    pub every: u16,
}

/// What became of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Saved {
    pub path: PathBuf,
    pub rows: usize,
    /// Rows that are not in it as their telemetry was lost.
    pub missing: usize,
}

impl Recording {
    /// Takes a row; false if there are as many as there may be.
    pub fn push(&mut self, sample: Sample) -> bool {
        self.rows.push(sample);
        self.rows.len() < MOST
    }

    pub const fn len(&self) -> usize {
        self.rows.len()
    }

    /// Writes the file on a thread of its own, as set points must not wait for a disk.
    pub fn save(self, form: Form) -> JoinHandle<Result<Saved>> {
        std::thread::spawn(move || self.write(&form))
    }

    fn write(&self, form: &Form) -> Result<Saved> {
        let rows = self.recorded();
        let text = bench::csv(&rows.record(form.period), form.model.as_ref());
        let unwritable = |path: &Path, reason| Error::Unwritable {
            path: path.to_owned(),
            reason,
        };
        let folder = form.folder.as_path();
        let mut file = tempfile::Builder::new()
            .permissions(readable())
            .tempfile_in(folder)
            .map_err(|e| unwritable(folder, e))?;
        let written = file.write_all(text.as_bytes());
        written.map_err(|e| unwritable(folder, e))?;
        for number in 1.. {
            let path = folder.join(format!("monitor-{number}.csv"));
            match file.persist_noclobber(&path) {
                Ok(_) => {
                    return Ok(Saved {
                        path,
                        rows: self.rows.len(),
                        missing: rows.missing(form.every),
                    });
                }
                Err(e) if e.error.kind() == std::io::ErrorKind::AlreadyExists => file = e.file,
                Err(e) => return Err(unwritable(&path, e.error)),
            }
        }
        Err(Error::Internal("there are no more numbers".to_owned()))
    }

    /// The rows as every recording of a board has them.
    fn recorded(&self) -> Rows {
        let row = |sample: &Sample| {
            let value = |signal: Signal| sample.values[signal as usize];
            Row {
                period: sample.period,
                input: value(Signal::Input),
                position: value(Signal::Position),
                current: value(Signal::Current),
            }
        };
        Rows(self.rows.iter().map(row).collect())
    }
}

/// Results are ordinary files, but for what the user's mask takes.
fn readable() -> std::fs::Permissions {
    use std::os::unix::fs::PermissionsExt;
    std::fs::Permissions::from_mode(0o666)
}

#[cfg(test)]
mod tests {
    use super::{Form, Recording, Sample};

    #[test]
    fn rows_become_a_file_under_a_new_name_and_gaps_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let form = Form {
            folder: folder.path().to_owned(),
            model: None,
            period: 1e-3,
            every: 2,
        };
        let make = || {
            let mut recording = Recording::default();
            for period in [100, 102, 108] {
                let mut values = [0.0; 8];
                (values[0], values[1]) = (0.5, f64::from(period));
                assert!(recording.push(Sample { period, values }));
            }
            recording.save(form.clone()).join().unwrap().unwrap()
        };
        let (one, two) = (make(), make());
        assert_eq!((one.rows, one.missing), (3, 2));
        assert_eq!(one.path, folder.path().join("monitor-1.csv"));
        assert_eq!(two.path, folder.path().join("monitor-2.csv"));
        let text = std::fs::read_to_string(one.path).unwrap();
        assert_eq!(
            text,
            "t,u,q\n0.0,0.5,100.0\n0.002,0.5,102.0\n0.008,0.5,108.0\n"
        );
    }
}
