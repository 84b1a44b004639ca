//! How a recording comes to the host: out of the ring in the board's memory, or as telemetry.

use bristle_core::drive::signal::Selection;

use crate::link::frames_carried;

/// Telemetry that only tells the time, Hz.
const CLOCK: f64 = 200.0;

/// A way for a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Whether the board records by itself, in its memory.
    pub by_ring: bool,
    /// Control periods from row to row.
    pub every: u16,
    /// Control periods from telemetry frame to telemetry frame.
    pub frames: u16,
}

impl Line {
    /// The way with the finest rows for `periods` at `rate` a second of the signals in `selection`: the ring of `ring` words,
    /// from which nothing is lost, or a line of `capacity` bytes a second, if its rows are finer.
    pub fn finest(
        periods: usize,
        rate: f64,
        selection: Selection,
        ring: u32,
        capacity: Option<f64>,
    ) -> Self {
        let width = selection.len();
        let most = f64::from(u16::MAX);
        let carried = |words: usize, wanted: f64| {
            let frames = capacity.map_or(wanted, |bytes| wanted.min(frames_carried(bytes, words)));
            (rate / frames).ceil().clamp(1.0, most) as u16
        };
        let telemetry = carried(width, rate);
        let rows = f64::from(ring) / width as f64;
        let by_ring = (rows >= 1.0).then(|| (periods as f64 / rows).ceil().clamp(1.0, most) as u16);
        match by_ring {
            Some(every) if every <= telemetry => Self {
                by_ring: true,
                every,
                frames: carried(1, CLOCK),
            },
            _ => Self {
                by_ring: false,
                every: telemetry,
                frames: telemetry,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use bristle_core::drive::signal::{Selection, Signal};

    use super::Line;

    const TWO: Selection = Selection::of(&[Signal::Input, Signal::Position]);
    const RING: u32 = 22_528;
    /// Of 115,200 bits a second.
    const PORT: Option<f64> = Some(11_520.0);

    #[test]
    fn the_ring_is_taken_where_the_run_fits_and_the_line_where_its_rows_are_finer() {
        let line = |periods, rate, ring, capacity| {
            let line = Line::finest(periods, rate, TWO, ring, capacity);
            (line.by_ring, line.every)
        };
        // 11.264 s of two signals at 1 kHz.
        assert_eq!(line(11_264, 1000.0, RING, PORT), (true, 1));
        assert_eq!(line(11_265, 1000.0, RING, PORT), (true, 2));
        assert_eq!(line(11_265, 1000.0, RING, None), (false, 1));
        // 8640 bytes a second are 332 frames of 26 bytes: every fourth period.
        assert_eq!(line(60_000, 1000.0, RING, PORT), (false, 4));
        assert_eq!(line(1000, 1000.0, 0, PORT), (false, 4));
        assert_eq!(line(1000, 1000.0, 1, None), (false, 1));
        let clock = Line::finest(8000, 8000.0, TWO, RING, PORT);
        assert_eq!((clock.by_ring, clock.every, clock.frames), (true, 1, 40));
    }
}
