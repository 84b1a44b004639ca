//! Recordings as MATLAB level-5 files: one vector for each column, named like it.

use std::fs::File;

use matfile::{MatFile, NumericData};

use super::Recording;
use super::table::Source;
use crate::error::Result;

pub(super) fn read(source: &Source) -> Result<Recording> {
    let file = File::open(source.path).map_err(|e| source.unreadable(e))?;
    let table = MatFile::parse(file).map_err(|e| {
        source.whole(&format!(
            "not a readable MATLAB level-5 file ({e}); save it with save(…, \"-v7\")"
        ))
    })?;
    // Scalars beside the signals are settings of the experiment.
    let vectors: Vec<&matfile::Array> = table
        .arrays()
        .iter()
        .filter(|a| {
            let longest = a.size().iter().copied().max().unwrap_or(0);
            longest > 1 && a.size().iter().product::<usize>() == longest
        })
        .collect();
    let names = vectors.iter().map(|a| a.name()).collect();
    source.assemble(names, |index| {
        let vector = vectors[index];
        numbers(vector.data()).ok_or_else(|| {
            source.whole(&format!("{} is complex; store real numbers", vector.name()))
        })
    })
}

/// Real numbers as `f64`; `None` if they are complex.
fn numbers(data: &NumericData) -> Option<Vec<f64>> {
    macro_rules! real {
        ($($kind:ident),*) => {
            match data {
                $(NumericData::$kind { real, imag: None } => {
                    // Counts beyond 2^53 are no measurement.
                    #[allow(clippy::unnecessary_cast, clippy::cast_lossless)]
                    Some(real.iter().map(|&x| x as f64).collect())
                })*
                _ => None,
            }
        };
    }
    real!(
        Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64, Single, Double
    )
}
