//! What a recording must be to carry a fit, checked sample by sample.

use std::path::Path;

use crate::error::{Error, Result};

/// Fewer samples than this cannot carry a diagnosis.
const FEWEST_SAMPLES: usize = 200;
/// Time may span this many times what the samples cover at their own rate.
const LONGEST_GAP: f64 = 1000.0;

/// Gathers, in memory that does not grow, what [`Audit::finish`] decides on.
///
/// A sample's place is whatever tells its line in the file.
#[derive(Debug)]
pub(super) struct Audit {
    /// The measured quantity: `q` or `v`.
    measured: &'static str,
    /// Samples so far.
    pub count: usize,
    first: Sample,
    last: Sample,
    u_varies: bool,
    motion_varies: bool,
    longest: (f64, Jump),
    steps: Thinned,
}

/// What is kept of a sample.
#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    t: f64,
    u: f64,
    x: f64,
    place: u64,
}

/// The samples before and after the longest pause.
#[derive(Clone, Copy, Debug, Default)]
struct Jump {
    from: f64,
    to: f64,
    place: u64,
}

impl Audit {
    pub fn new(measured: &'static str) -> Self {
        Self {
            measured,
            count: 0,
            first: Sample::default(),
            last: Sample::default(),
            u_varies: false,
            motion_varies: false,
            longest: (f64::NEG_INFINITY, Jump::default()),
            steps: Thinned::default(),
        }
    }

    /// Takes in the next sample: its instant, drive and measured motion.
    pub fn push(&mut self, t: f64, u: f64, x: f64, place: u64) {
        let sample = Sample { t, u, x, place };
        if self.count == 0 {
            self.first = sample;
        } else {
            let step = t - self.last.t;
            if step > self.longest.0 {
                let from = self.last.t;
                self.longest = (step, Jump { from, to: t, place });
            }
            self.steps.push(step);
        }
        self.u_varies |= u != self.first.u;
        self.motion_varies |= x != self.first.x;
        self.last = sample;
        self.count += 1;
    }

    /// The instant of the last sample.
    pub fn now(&self) -> Option<f64> {
        (self.count > 0).then_some(self.last.t)
    }

    /// First and last instant, and the median pause between samples (of a long recording that of an even selection).
    pub fn clock(&self) -> (f64, f64, f64) {
        (self.first.t, self.last.t, self.steps.median())
    }

    /// Refuses what cannot carry a fit; `line` tells the line of a place, or of the header.
    pub fn finish(
        &self,
        path: &Path,
        mut line: impl FnMut(Option<u64>) -> Result<usize>,
    ) -> Result<()> {
        let fail = |what: String| {
            Err(Error::Recording {
                path: path.to_owned(),
                what,
            })
        };
        if self.count < FEWEST_SAMPLES {
            let last = (self.count > 0).then_some(self.last.place);
            return fail(format!(
                "line {}, column t: the recording ends after {} samples; at least {FEWEST_SAMPLES} are needed, so record for longer or at a higher rate",
                line(last)?,
                self.count
            ));
        }
        let recorded = self.steps.median() * self.count as f64;
        if self.last.t - self.first.t > LONGEST_GAP * recorded {
            let Jump { from, to, place } = self.longest.1;
            return fail(format!(
                "line {}, column t: time jumps from {from} s to {to} s, far beyond what was recorded; repair the clock, or give the parts as recordings of their own",
                line(Some(place))?
            ));
        }
        if self.u_varies && self.motion_varies {
            return Ok(());
        }
        let (first, last) = (line(Some(self.first.place))?, line(Some(self.last.place))?);
        if !self.u_varies {
            return fail(format!(
                "lines {first} to {last}, column u: u is {} throughout; nothing drives the axis, so nothing can be learnt: check the column mapping, or record with an excitation",
                self.first.u
            ));
        }
        let name = self.measured;
        fail(format!(
            "lines {first} to {last}, column {name}: {name} never changes: the axis did not move; record with a drive above break-away"
        ))
    }
}

/// Every so many of a sequence of numbers: all of a short one, at most [`Thinned::MOST`] of a long one.
#[derive(Debug)]
struct Thinned {
    kept: Vec<f64>,
    stride: usize,
    seen: usize,
}

impl Default for Thinned {
    fn default() -> Self {
        Self {
            kept: Vec::new(),
            stride: 1,
            seen: 0,
        }
    }
}

impl Thinned {
    const MOST: usize = 1 << 16;

    fn push(&mut self, value: f64) {
        if self.seen.is_multiple_of(self.stride) {
            if self.kept.len() == Self::MOST {
                let mut index = 0;
                self.kept.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.stride *= 2;
            }
            self.kept.push(value);
        }
        self.seen += 1;
    }

    fn median(&self) -> f64 {
        let mut sorted = self.kept.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::Thinned;

    #[test]
    fn the_median_of_a_long_sequence_needs_no_more_memory() {
        let mut thinned = Thinned::default();
        (0..1_000_000).for_each(|k| thinned.push(f64::from(k % 1000)));
        assert!(thinned.kept.len() <= Thinned::MOST);
        assert!((thinned.median() - 500.0).abs() < 10.0);
    }
}
