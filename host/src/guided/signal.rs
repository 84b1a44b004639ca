//! What an axis is driven with: a test signal, or a file that somebody has made.

use std::path::Path;

use crate::error::{Error, Result};
use crate::excite::{Excitation, Shape};
use crate::model::Columns;
use crate::motion::Motion;
use crate::recording::Recording;

/// What `diagnose --next-experiment` calls the position that it predicts.
const PREDICTED: &str = "q_predicted";
/// A multisine does not begin at zero: it rises from there and falls back within this time, s.
const FADE: f64 = 0.25;

/// Values at every control period, and where they come from.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// In the unit of what follows it.
    pub values: Vec<f64>,
    /// Whether it has rates worth feeding forward.
    pub smooth: bool,
    /// The position that its file predicts, as it is there, rad or m.
    pub predicted: Option<Vec<f64>>,
}

impl Signal {
    /// A test signal, at `rate` values a second.
    pub fn made(excitation: &Excitation, rate: f64) -> Self {
        let t: Vec<f64> = (0..(excitation.duration * rate).round() as usize)
            .map(|k| k as f64 / rate)
            .collect();
        let mut values = excitation.values(&t);
        if excitation.shape == Shape::Multisine {
            let fade = FADE.min(0.5 * excitation.duration);
            for (value, t) in values.iter_mut().zip(&t) {
                *value *= (t / fade).min((excitation.duration - t) / fade).min(1.0);
            }
        }
        Self {
            values,
            smooth: excitation.shape.is_smooth(),
            predicted: None,
        }
    }

    /// The `u` of a recording, or of what `diagnose --next-experiment` has written, at `rate` values a second: each acts until
    /// the next row's.
    pub fn read(path: &Path, columns: &Columns, motion: Motion, rate: f64) -> Result<Self> {
        let is_next = heads(path)?.iter().any(|name| name == PREDICTED);
        let mut columns = columns.clone();
        if is_next {
            // Written by this program, under its own names.
            columns.clear();
            columns.insert("q".to_owned(), PREDICTED.to_owned());
        }
        let file = Recording::read(path, &columns, motion)?;
        let start = file.t.first().copied().unwrap_or_default();
        let end = file.t.last().copied().unwrap_or_default();
        let periods = ((end - start) * rate).round() as usize;
        // Rounding must not make a value come a period late.
        let grain = 1e-6 / rate;
        let row = |k: usize| {
            let t = start + k as f64 / rate + grain;
            file.t.partition_point(|&row| row <= t).saturating_sub(1)
        };
        let rows: Vec<usize> = (0..periods).map(row).collect();
        Ok(Self {
            values: rows.iter().map(|&k| file.u[k]).collect(),
            smooth: false,
            predicted: file.q.filter(|_| is_next),
        })
    }

    /// The largest value, either way.
    pub fn largest(&self) -> f64 {
        self.values.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
    }

    /// Where the prediction begins, and how far it goes from there either way; none without one.
    pub fn predicted_travel(&self) -> Option<(f64, f64)> {
        let predicted = self.predicted.as_ref()?;
        let start = *predicted.first()?;
        let most = predicted
            .iter()
            .fold(0.0, |m: f64, q| m.max((q - start).abs()));
        Some((start, most))
    }
}

/// The names in the first line of a text file, without their units.
fn heads(path: &Path) -> Result<Vec<String>> {
    use std::io::{BufRead, BufReader};
    let unreadable = |reason| Error::Unreadable {
        path: path.to_owned(),
        reason,
    };
    let file = std::fs::File::open(path).map_err(unreadable)?;
    let mut line = Vec::new();
    BufReader::new(file)
        .read_until(b'\n', &mut line)
        .map_err(unreadable)?;
    let line = String::from_utf8_lossy(&line);
    let names = line.split(',').filter_map(|cell| cell.split('[').next());
    Ok(names.map(|name| name.trim().to_owned()).collect())
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::Signal;
    use crate::excite::{Excitation, Shape};
    use crate::model::Columns;
    use crate::motion::Motion;

    #[test]
    fn a_file_is_held_from_row_to_row_at_any_rate() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("next.csv");
        let mut text = "t[s],u[N*m],q_predicted[rad]\n".to_owned();
        for k in 0..300 {
            let _ = writeln!(text, "{},{},{}", 5.0 + 0.01 * f64::from(k), k % 7, 2 - k);
        }
        std::fs::write(&path, text).unwrap();
        let own = Columns::from([("u".to_owned(), "torque".to_owned())]);
        let signal = Signal::read(&path, &own, Motion::Rotary, 400.0).unwrap();
        assert_eq!(signal.values.len(), 4 * 299);
        let held = |k: usize| f64::from((k as u32 / 4) % 7);
        assert!((0..4 * 299).all(|k| signal.values[k] == held(k)));
        assert_eq!(signal.predicted_travel(), Some((2.0, 299.0)));
        assert_eq!(signal.largest(), 6.0);
    }

    #[test]
    fn a_multisine_rises_from_zero_and_falls_back() {
        let excitation = Excitation {
            shape: Shape::Multisine,
            amplitude: 0.5,
            band: (0.5, 8.0),
            duration: 4.0,
            seed: 1,
        };
        let signal = Signal::made(&excitation, 1000.0);
        assert_eq!((signal.values.len(), signal.values[0]), (4000, 0.0));
        assert!(signal.values[3999].abs() < 0.003 && signal.largest() > 0.4);
    }
}
