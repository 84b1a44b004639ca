//! Steady points: stretches of a recording in which the speed stays what it is.

use serde::Serialize;

use crate::effects::Path;
use crate::weak::Track;

/// Length of the pieces that a recording is cut into, s: well above the settling of a current loop, well below the
/// dwells of a staircase that a person drives.
const PIECE: f64 = 0.2;
/// Fewest cells in half a piece.
const FEWEST: usize = 8;
/// Change of speed over a piece that still counts as none, as a share of the speed.
const DRIFT: f64 = 0.02;
/// What noise alone does is within this many standard deviations.
const CERTAIN: f64 = 3.0;

/// One steady point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Dwell {
    /// Mean velocity, rad/s or m/s.
    pub velocity: f64,
    /// Mean input, in its own unit.
    pub input: f64,
    /// When it began, s.
    pub from: f64,
    /// How long it lasted, s.
    pub length: f64,
}

/// The steady points of a recording.
///
/// It is cut into pieces; the speed of a piece is steady if its two halves differ by no more than noise makes them, or
/// by 2 %. Pieces in a row with one speed are one dwell, whose first piece is left to the transient before it.
pub fn dwells(track: &Track) -> Vec<Dwell> {
    let half = ((0.5 * PIECE / track.period).round() as usize).max(FEWEST);
    let input = track.input(&Path::default());
    let count = input.len() / (2 * half);
    let pieces: Vec<Option<Dwell>> = (0..count)
        .map(|k| piece(track, &input, 2 * half * k, half))
        .collect();
    let noise = CERTAIN * track.position_noise / (half as f64 * track.period);
    let same = |a: &Option<Dwell>, b: &Option<Dwell>| match (a, b) {
        (Some(a), Some(b)) => {
            (a.velocity - b.velocity).abs() <= (DRIFT * a.velocity.abs()).max(noise)
        }
        _ => false,
    };
    let runs = pieces.chunk_by(same).filter(|run| run.len() > 1);
    runs.map(|run| join(run[1..].iter().flatten())).collect()
}

/// The piece that begins at a cell, if its speed is steady.
fn piece(track: &Track, input: &[f64], first: usize, half: usize) -> Option<Dwell> {
    let [a, b, c] = [first, first + half, first + 2 * half];
    let time = half as f64 * track.period;
    let (before, after) = (
        (track.q[b] - track.q[a]) / time,
        (track.q[c] - track.q[b]) / time,
    );
    let velocity = 0.5 * (before + after);
    // Standard deviation of one position over half a piece; √6 of it in the difference, 1/√2 in the mean.
    let noise = track.position_noise / time;
    let steady =
        (after - before).abs() <= (DRIFT * velocity.abs()).max(CERTAIN * 6f64.sqrt() * noise);
    let slides = velocity.abs() > CERTAIN * noise && before * after > 0.0;
    let whole = !track.barred[a..c].iter().any(|barred| *barred);
    (steady && slides && whole).then(|| Dwell {
        velocity,
        input: input[a..c].iter().sum::<f64>() / (c - a) as f64,
        from: track.start + a as f64 * track.period,
        length: 2.0 * time,
    })
}

fn join<'a>(pieces: impl Iterator<Item = &'a Dwell>) -> Dwell {
    let pieces: Vec<&Dwell> = pieces.collect();
    let mean =
        |f: fn(&Dwell) -> f64| pieces.iter().map(|d| f(d)).sum::<f64>() / pieces.len() as f64;
    Dwell {
        velocity: mean(|d| d.velocity),
        input: mean(|d| d.input),
        from: pieces[0].from,
        length: pieces.iter().map(|d| d.length).sum(),
    }
}
