//! Recordings as Parquet files: one column of numbers for each column of the recording.

use std::fs::File;

use parquet::basic::{LogicalType, TimeUnit};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::Recording;
use super::table::Source;
use crate::error::Result;

pub(super) fn read(source: &Source) -> Result<Recording> {
    let file = File::open(source.path).map_err(|e| source.unreadable(e))?;
    let broken = |e: ParquetError| {
        source.whole(&format!(
            "not a readable Parquet file ({e}); write it anew, or give the recording as CSV"
        ))
    };
    let table = SerializedFileReader::new(file).map_err(broken)?;
    let schema = table.metadata().file_metadata().schema_descr_ptr();
    let names = schema.columns().iter().map(|c| c.name()).collect();
    source.assemble(names, |index| {
        let column = schema.column(index);
        let scale = match column.logical_type_ref() {
            Some(LogicalType::Timestamp(time)) => match time.unit {
                TimeUnit::MILLIS => 1e-3,
                TimeUnit::MICROS => 1e-6,
                TimeUnit::NANOS => 1e-9,
            },
            _ => 1.0,
        };
        let mut values = Vec::new();
        for group in 0..table.num_row_groups() {
            let reader = table
                .get_row_group(group)
                .and_then(|g| g.get_column_reader(index))
                .map_err(broken)?;
            let rows = table.metadata().row_group(group).num_rows() as usize;
            let missing = append(reader, rows, &mut values)
                .map_err(broken)?
                .map_err(|what| source.whole(&format!("column {}: {what}", column.name())))?;
            if let Some(row) = missing {
                return Err(source.whole(&format!(
                    "line {}, column {}: the value is missing; fill it or remove the row",
                    row + 2,
                    column.name()
                )));
            }
        }
        values.iter_mut().for_each(|v| *v *= scale);
        Ok(values)
    })
}

/// Appends the values of one row group; gives the row of the first missing one.
fn append(
    reader: ColumnReader,
    rows: usize,
    to: &mut Vec<f64>,
) -> std::result::Result<std::result::Result<Option<usize>, &'static str>, ParquetError> {
    Ok(Ok(match reader {
        ColumnReader::Int32ColumnReader(r) => load(r, rows, to, f64::from)?,
        // Counts beyond 2^53 are no measurement.
        ColumnReader::Int64ColumnReader(r) => load(r, rows, to, |x| x as f64)?,
        ColumnReader::FloatColumnReader(r) => load(r, rows, to, f64::from)?,
        ColumnReader::DoubleColumnReader(r) => load(r, rows, to, |x| x)?,
        _ => return Ok(Err("not numbers; store it as integers or floating point")),
    }))
}

fn load<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    rows: usize,
    to: &mut Vec<f64>,
    convert: impl Fn(T::T) -> f64,
) -> std::result::Result<Option<usize>, ParquetError> {
    let first = to.len();
    let mut values = Vec::new();
    // Of a column that may hold gaps: 0 where there is one, whose value is left out.
    let mut levels = Vec::new();
    while reader
        .read_records(rows, Some(&mut levels), None, &mut values)?
        .0
        > 0
    {}
    let missing = if values.len() < rows {
        Some(first + levels.iter().position(|l| *l == 0).unwrap_or(values.len()))
    } else {
        None
    };
    to.extend(values.into_iter().map(convert));
    Ok(missing)
}
