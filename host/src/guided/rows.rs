//! Recorded periods, and the recording that they make.

use crate::bench::Record;

/// What is recorded of a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Its number.
    pub period: u32,
    /// What drives the axis from here on, in the unit of `u`.
    pub input: f64,
    /// Measured position, rad or m.
    pub position: f64,
    /// Motor current, A; zero of an axis without a motor.
    pub current: f64,
}

/// Rows in the order of their periods.
#[derive(Clone, Debug, Default)]
pub struct Rows(pub Vec<Row>);

impl Rows {
    /// Drops what comes after the last period in which anything drove the axis: in it, the bridge was off, and no model of
    /// the axis under power says what the axis did.
    pub fn cut(&mut self) {
        let driven = self.0.iter().rposition(|row| row.input != 0.0);
        self.0.truncate(driven.map_or(0, |last| last + 1));
    }

    /// Drops what comes so many periods after a start, or after the first row if that is later: a telemetry frame that was on its
    /// way when the recording began tells of a period before it.
    pub fn end_after(&mut self, start: u32, periods: u32) {
        // Numbers wrap, and no recording is half as long as that takes.
        let since = |from: u32, period: u32| period.wrapping_sub(from) as i32;
        let first = self.0.first().map_or(start, |row| row.period);
        let from = if since(start, first) > 0 {
            first
        } else {
            start
        };
        self.0
            .retain(|row| since(from, row.period) < periods as i32);
    }

    /// The recording, of control periods of so many seconds.
    pub fn record(&self, period: f64) -> Record {
        let first = self.0.first().map_or(0, |row| row.period);
        let column = |f: fn(&Row) -> f64| -> Vec<f64> { self.0.iter().map(f).collect() };
        let mut current = column(|row| row.current);
        if current.iter().all(|&i| i == 0.0) {
            // An axis without a motor, or a converter that is not connected.
            current.clear();
        }
        let instant = |row: &Row| f64::from(row.period.wrapping_sub(first)) * period;
        Record {
            t: self.0.iter().map(instant).collect(),
            u: column(|row| row.input),
            q: column(|row| row.position),
            current,
            ..Record::default()
        }
    }

    /// From the first row to the last, s.
    pub fn seconds(&self, period: f64) -> f64 {
        match (self.0.first(), self.0.last()) {
            (Some(first), Some(last)) => f64::from(last.period.wrapping_sub(first.period)) * period,
            _ => 0.0,
        }
    }

    /// Rows that are not there, of a recording that has one every so many periods.
    pub fn missing(&self, every: u16) -> usize {
        let every = u32::from(every.max(1));
        let between = |pair: &[Row]| pair[1].period.wrapping_sub(pair[0].period) / every;
        let pairs = self.0.windows(2);
        pairs
            .map(|pair| between(pair).saturating_sub(1) as usize)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::{Row, Rows};

    fn rows(inputs: &[f64]) -> Rows {
        let row = |(k, input): (usize, &f64)| Row {
            // Over the end of the numbers.
            period: (2 * k as u32).wrapping_sub(4),
            input: *input,
            position: k as f64,
            current: 0.0,
        };
        Rows(inputs.iter().enumerate().map(row).collect())
    }

    #[test]
    fn what_comes_after_the_bridge_went_off_is_cut() {
        let mut all = rows(&[0.0, 0.5, 0.0, 0.5, 0.0, 0.0]);
        assert_eq!(all.record(0.5).t, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        all.cut();
        assert_eq!(all.record(0.5).u, [0.0, 0.5, 0.0, 0.5]);
        all.end_after(3_u32.wrapping_neg(), 3);
        assert_eq!(all.record(0.5).q, [0.0, 1.0]);
        let mut none = rows(&[0.0; 3]);
        none.cut();
        assert!(none.0.is_empty());
    }

    #[test]
    fn a_recording_that_begins_after_the_first_frame_is_as_long_as_the_run() {
        for start in [5_u32, 4].map(u32::wrapping_neg) {
            let mut all = rows(&[0.5; 6]);
            all.end_after(start, 8);
            assert_eq!(all.record(0.5).q, [0.0, 1.0, 2.0, 3.0]);
        }
    }

    #[test]
    fn gaps_are_counted() {
        let mut all = rows(&[0.5; 6]);
        assert_eq!(all.missing(2), 0);
        all.0.remove(3);
        all.0.remove(3);
        assert_eq!(all.missing(2), 2);
    }
}
