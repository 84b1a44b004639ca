//! Where the windows lie, and what they leave out.

use serde::Serialize;

use crate::identify::{Tried, Workbench};
use crate::recording::Recording;
use crate::weak::{Part, Track, Windows};

/// The windows of all recordings, and why they are as wide as they are.
#[derive(Clone, Debug, Serialize)]
pub struct Layout {
    /// The choice of the width in a sentence.
    pub reason: String,
    /// Half-widths that were tried, the last of them chosen.
    pub tried: Vec<Tried>,
    /// Window by window, recording by recording.
    pub recordings: Vec<Laid>,
}

/// The windows of one recording.
#[derive(Clone, Debug, Serialize)]
pub struct Laid {
    /// File name.
    pub recording: String,
    /// Half-width, s.
    pub half_width: f64,
    /// Samples on either side of a centre.
    pub reach: usize,
    /// Between neighbouring centres, s.
    pub hop: f64,
    /// Instants of the centres in the training part, s.
    pub train: Vec<f64>,
    /// Instants of the centres in the held-out part, s.
    pub held_out: Vec<f64>,
    /// Centres at which no window was laid, as most of it would lie at rest, or some of it on a gap or on the boundary
    /// between the parts.
    pub left_out: usize,
    /// Share of the time at rest, which windows mask.
    pub rest: f64,
    /// Stretches at rest, s.
    pub rests: Vec<[f64; 2]>,
}

impl Layout {
    /// The windows of a workbench.
    pub fn new(bench: &Workbench, recordings: &[Recording]) -> Self {
        let problem = &bench.problem;
        let laid = recordings
            .iter()
            .zip(problem.tracks.iter())
            .zip(&problem.windows);
        Self {
            reason: bench.width.reason(),
            tried: bench.width.tried.clone(),
            recordings: laid.map(|((r, t), w)| Laid::new(r, t, w)).collect(),
        }
    }
}

impl Laid {
    fn new(recording: &Recording, track: &Track, windows: &Windows) -> Self {
        let time = |node: usize| track.start + node as f64 * track.period;
        let of = |part: Part| {
            let centres = windows.centres.iter().zip(&windows.parts);
            let own = centres.filter(|(_, p)| **p == part);
            own.map(|(c, _)| time(*c)).collect()
        };
        let room = track.q.len().saturating_sub(2 * windows.reach);
        let sliding: f64 = track.sliding.iter().sum();
        Self {
            recording: recording.file_name(),
            half_width: windows.reach as f64 * track.period,
            reach: windows.reach,
            hop: windows.hop as f64 * track.period,
            train: of(Part::Train),
            held_out: of(Part::HeldOut),
            left_out: room.div_ceil(windows.hop) - windows.centres.len(),
            rest: 1.0 - sliding / track.sliding.len() as f64,
            rests: rests(track),
        }
    }
}

fn rests(track: &Track) -> Vec<[f64; 2]> {
    let mut rests: Vec<[f64; 2]> = Vec::new();
    let mut last = None;
    for (k, _) in track.sliding.iter().enumerate().filter(|(_, s)| **s == 0.0) {
        let node = |k: usize| track.start + k as f64 * track.period;
        match rests.last_mut() {
            Some(rest) if last == Some(k.wrapping_sub(1)) => rest[1] = node(k + 1),
            _ => rests.push([node(k), node(k + 1)]),
        }
        last = Some(k);
    }
    rests
}
