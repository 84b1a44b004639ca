//! Recordings as commands get them: in memory, or read piece by piece.

use std::path::{Path, PathBuf};

use super::terminal::Meter;
use crate::check::evened;
use crate::error::{Error, Result};
use crate::model::{Causality, Model};
use crate::recording::{Long, Recording, may_exceed};
use crate::stream;

/// All recordings of a command.
pub(super) enum Input {
    Memory(Vec<Recording>),
    Files(Vec<Long>),
}

impl Input {
    /// Opens recordings: into memory unless they have more than `most` samples together, and there over even time where that is
    /// when their samples were taken.
    pub fn open(paths: &[PathBuf], model: &Model, most: usize, meter: &Meter) -> Result<Self> {
        let sampled = model.causality == Causality::Inverse;
        if may_exceed(paths, most) {
            meter.count("reading", None);
            let scan =
                |path: &PathBuf| Long::scan(path, &model.columns, model.motion, &|n| meter.add(n));
            let mut long = paths.iter().map(scan).collect::<Result<Vec<Long>>>()?;
            long.iter_mut().for_each(|r| r.sampled = sampled);
            if long.iter().map(|r| r.samples).sum::<usize>() > most {
                return Ok(Self::Files(long));
            }
        }
        meter.say("reading");
        let read = |path: &PathBuf| -> Result<Recording> {
            let recording = evened(Recording::read(path, &model.columns, model.motion)?);
            Ok(Recording {
                sampled,
                ..recording
            })
        };
        paths
            .iter()
            .map(read)
            .collect::<Result<_>>()
            .map(Self::Memory)
    }

    /// Samples of all recordings together.
    pub fn samples(&self) -> usize {
        match self {
            Self::Memory(recordings) => recordings.iter().map(Recording::len).sum(),
            Self::Files(recordings) => recordings.iter().map(|r| r.samples).sum(),
        }
    }
}

/// Stretches of recordings that are read piece by piece, over even time as those in memory.
pub(super) fn stretches(files: &[Long]) -> Result<Vec<Recording>> {
    let stretches = stream::stretches(files)?;
    Ok(stretches.into_iter().map(evened).collect())
}

/// Names the files that a failed fit was made of.
pub(super) fn named(error: Error, recordings: &[PathBuf], model: &Path) -> Error {
    let Error::NotIdentifiable(what) = error else {
        return error;
    };
    let recordings: Vec<String> = recordings.iter().map(|p| p.display().to_string()).collect();
    Error::NotIdentifiable(format!(
        "{} with {}: {what}",
        recordings.join(", "),
        model.display()
    ))
}
