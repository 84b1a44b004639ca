//! Cuts a recording into pieces that overlap.

use std::ops::Range;

use crate::error::Result;
use crate::fit::{self, HORIZON};
use crate::recording::{Long, Reader, Recording};
use crate::weak::TRAIN_SHARE;

/// Samples that belong to one piece alone.
const CORE: usize = 1 << 15;
/// Overlap on either side, half-widths of windows: the noise of a row depends on rows up to 6 before it, and these on
/// rows as far before them, ever less; a window reaches over 1.
const OVERLAP: usize = 16;

/// Lengths of pieces, samples.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Half-width of the windows.
    pub reach: usize,
    core: usize,
    margin: usize,
}

impl Sizes {
    /// For windows of a half-width in seconds.
    pub fn new(long: &Long, half_width: f64) -> Self {
        let even = (long.end - long.start) / (long.samples - 1) as f64;
        // A few pauses leave the median as the rate.
        let period = if even < 1.01 * long.period {
            even
        } else {
            long.period
        };
        let reach = ((half_width / period).round() as usize).max(1);
        // Pieces begin where a window of the whole recording would, so that the windows of all are those of the whole.
        let hop = (reach / 4).max(1);
        let horizon = (1.2 * HORIZON / period) as usize;
        let even = |samples: usize| samples.next_multiple_of(hop);
        Self {
            reach,
            core: even(CORE.max(2 * OVERLAP * reach)),
            margin: even((OVERLAP * reach).max(horizon)),
        }
    }
}

/// A piece of a recording.
pub struct Piece {
    pub recording: Recording,
    /// Samples that belong to this piece.
    pub core: Range<usize>,
    /// Whether the recording begins and ends with it.
    pub outer: (bool, bool),
    /// First sample of the held-out part; the number of samples if that begins later.
    pub boundary: usize,
    /// Free runs that begin in the core, and whether they are held out.
    pub runs: Vec<(Range<usize>, bool)>,
    pub reach: usize,
    /// Samples of the whole recording, its first instant and the length of its training part, s.
    pub whole: usize,
    pub start: f64,
    pub training: f64,
}

/// Reads a recording piece by piece.
pub(super) struct Cutter<'a> {
    long: &'a Long,
    reader: Reader<'a>,
    sizes: Sizes,
    buffer: Recording,
    /// Sample at which the buffer begins.
    first: usize,
    /// Sample at which the next core begins.
    core: usize,
    /// Sample at which the next free run begins.
    run: usize,
}

impl<'a> Cutter<'a> {
    pub fn new(long: &'a Long, sizes: Sizes) -> Result<Self> {
        Ok(Self {
            long,
            reader: long.reader(0)?,
            sizes,
            buffer: long.blank(),
            first: 0,
            core: 0,
            run: 0,
        })
    }

    /// The next piece; `None` after the last.
    pub fn next(&mut self) -> Result<Option<Piece>> {
        let Sizes {
            core,
            margin,
            reach,
        } = self.sizes;
        let samples = self.long.samples;
        if self.core >= samples {
            return Ok(None);
        }
        let mut end = self.core + core;
        // What would be left is too short for a piece of its own.
        if end + margin >= samples {
            end = samples;
        }
        self.drop_before(self.core.saturating_sub(margin));
        let have = self.first + self.buffer.len();
        let want = (end + margin).min(samples);
        self.reader.append(&mut self.buffer, want - have)?;
        let boundary = (TRAIN_SHARE * samples as f64) as usize;
        let piece = Piece {
            core: self.core - self.first..end - self.first,
            outer: (self.core == 0, end == samples),
            boundary: boundary.clamp(self.first, want) - self.first,
            runs: self.runs(end, boundary),
            recording: self.buffer.clone(),
            reach,
            whole: samples,
            start: self.long.start,
            training: TRAIN_SHARE * (self.long.end - self.long.start),
        };
        self.core = end;
        Ok(Some(piece))
    }

    fn runs(&mut self, end: usize, boundary: usize) -> Vec<(Range<usize>, bool)> {
        let mut runs = Vec::new();
        while self.run < end {
            let held_out = self.run >= boundary;
            let latest = if held_out {
                usize::MAX
            } else {
                boundary - self.first
            };
            let first = self.run - self.first;
            let last = fit::window_end(&self.buffer.t, first, HORIZON).min(latest);
            runs.push((first..last, held_out));
            self.run = self.first + last;
        }
        runs
    }

    fn drop_before(&mut self, sample: usize) {
        let count = sample - self.first;
        let Recording { t, u, q, v, .. } = &mut self.buffer;
        for signal in [Some(t), Some(u), q.as_mut(), v.as_mut()]
            .into_iter()
            .flatten()
        {
            signal.drain(..count);
        }
        self.first = sample;
    }
}
