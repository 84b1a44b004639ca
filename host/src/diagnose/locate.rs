//! Where a model fails: when, at which speeds, positions and directions, near reversals or not.

use serde::Serialize;

use crate::effects::Path;
use crate::format;
use crate::identify::Workbench;
use crate::model::Model;
use crate::motion::Motion;
use crate::problem::Direction;

/// The region in which most of a mismatch lives.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Where {
    /// Time intervals, s.
    pub time: Vec<[f64; 2]>,
    /// Velocity band, rad/s or m/s.
    pub velocity: [f64; 2],
    /// Position band, rad or m.
    pub position: [f64; 2],
    /// Band of the input, in its own unit.
    pub input: [f64; 2],
    /// `both`, `positive` or `negative`.
    pub direction: &'static str,
    /// Whether it lives around reversals.
    pub near_reversal: bool,
    /// The same in one sentence.
    pub text: String,
}

impl Where {
    /// The bands of velocity, position and input are the narrowest that hold this share of the mismatch.
    pub const SHARE: f64 = 0.8;
}

/// Rows are divided into this many cells along a coordinate.
const CELLS: usize = 20;
/// Time is divided into this many blocks.
const BLOCKS: usize = 40;

/// Coordinates of one row.
struct Place {
    time: f64,
    velocity: f64,
    position: f64,
    input: f64,
    reversal: bool,
    excess: f64,
}

/// The coordinate on which outliers, the rows that are not 0, depend most: the one along which they are the furthest from being spread
/// like all rows, by their divergence (Kullback and Leibler, Annals of Mathematical Statistics 22, 1951) over cells of equally many
/// rows. Each counts alike, as the largest alone is at one place of every coordinate.
pub(super) fn coordinate(bench: &Workbench, rows: &[f64]) -> &'static str {
    let marks: Vec<f64> = rows.iter().map(|r| f64::from(*r != 0.0)).collect();
    let places = places(bench, &marks, &vec![0.0; rows.len()]);
    // Of equals the last one: the input may but answer what happens at a place.
    let divergences = [
        ("time", divergence(&places, |p| p.time)),
        ("input", divergence(&places, |p| p.input)),
        ("velocity", divergence(&places, |p| p.velocity)),
        ("position", divergence(&places, |p| p.position)),
    ];
    let furthest = divergences.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    furthest.map_or("time", |(name, _)| name)
}

/// How far the excess is from being spread like rows.
fn divergence(places: &[Place], coordinate: fn(&Place) -> f64) -> f64 {
    let mut sorted: Vec<(f64, f64)> = places.iter().map(|p| (coordinate(p), p.excess)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = places.iter().map(|p| p.excess).sum();
    let cells = sorted.chunks(sorted.len().div_ceil(CELLS));
    let parts = cells.map(|cell| {
        let share = cell.iter().map(|(_, excess)| excess).sum::<f64>() / total;
        let expected = cell.len() as f64 / sorted.len() as f64;
        if share > 0.0 {
            share * (share / expected).ln()
        } else {
            0.0
        }
    });
    parts.sum()
}

/// Locates the excess of squared whitened residuals `before` over `after`, both one for each row.
pub(super) fn locate(bench: &Workbench, model: &Model, before: &[f64], after: &[f64]) -> Where {
    let places = places(bench, before, after);
    let total: f64 = places
        .iter()
        .map(|p| p.excess.max(0.0))
        .sum::<f64>()
        .max(f64::MIN_POSITIVE);
    let share = |keep: &dyn Fn(&Place) -> bool| {
        places
            .iter()
            .filter(|p| keep(p))
            .map(|p| p.excess.max(0.0))
            .sum::<f64>()
            / total
    };
    let reversing = places.iter().filter(|p| p.reversal).count() as f64 / places.len() as f64;
    let forward = share(&|p| p.velocity > 0.0);
    let mut found = Where {
        time: intervals(&places),
        velocity: band(&places, total, |p| p.velocity),
        position: band(&places, total, |p| p.position),
        input: band(&places, total, |p| p.input),
        direction: if forward > Where::SHARE {
            "positive"
        } else if forward < 1.0 - Where::SHARE {
            "negative"
        } else {
            "both"
        },
        // Around reversals if most of it is there although the axis mostly is not.
        near_reversal: share(&|p| p.reversal) > Where::SHARE && reversing < 0.75 * Where::SHARE,
        text: String::new(),
    };
    found.text = sentence(&found, model, &places);
    found
}

/// Where rows are, with the excess of their squares `before` over `after`.
fn places(bench: &Workbench, before: &[f64], after: &[f64]) -> Vec<Place> {
    let problem = &bench.problem;
    let velocity = problem.velocity(&Path::default());
    let sign = problem.coulomb(&Direction::default(), &Path::default());
    let input = problem.input(&Path::default());
    let place = |k: usize| {
        let row = problem.rows[k];
        Place {
            time: problem.time(row),
            velocity: velocity[k],
            position: problem.tracks[row.track].q[row.centre],
            input: input[k],
            reversal: sign[k].abs() < 0.98,
            excess: before[k] * before[k] - after[k] * after[k],
        }
    };
    (0..problem.rows.len()).map(place).collect()
}

/// Narrowest interval of a coordinate that holds the given share of the excess.
fn band(places: &[Place], total: f64, coordinate: impl Fn(&Place) -> f64) -> [f64; 2] {
    let mut sorted: Vec<(f64, f64)> = places
        .iter()
        .map(|p| (coordinate(p), p.excess.max(0.0)))
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best = [sorted[0].0, sorted[sorted.len() - 1].0];
    let (mut low, mut sum) = (0, 0.0);
    for high in 0..sorted.len() {
        sum += sorted[high].1;
        while sum - sorted[low].1 >= Where::SHARE * total {
            sum -= sorted[low].1;
            low += 1;
        }
        if sum >= Where::SHARE * total && sorted[high].0 - sorted[low].0 < best[1] - best[0] {
            best = [sorted[low].0, sorted[high].0];
        }
    }
    best
}

/// Blocks of time whose excess is above the average block's, neighbours merged.
fn intervals(places: &[Place]) -> Vec<[f64; 2]> {
    let (start, end) = places
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
            (a.min(p.time), b.max(p.time))
        });
    let width = (end - start).max(f64::MIN_POSITIVE) / BLOCKS as f64;
    let mut sums = [0.0; BLOCKS];
    for place in places {
        sums[(((place.time - start) / width) as usize).min(BLOCKS - 1)] += place.excess.max(0.0);
    }
    let mean = sums.iter().sum::<f64>() / BLOCKS as f64;
    let mut found: Vec<[f64; 2]> = Vec::new();
    for (k, _) in sums.iter().enumerate().filter(|(_, s)| **s > mean) {
        let block = [start + k as f64 * width, start + (k + 1) as f64 * width];
        match found.last_mut() {
            Some(last) if (last[1] - block[0]).abs() < 0.5 * width => last[1] = block[1],
            _ => found.push(block),
        }
    }
    found
}

fn sentence(found: &Where, model: &Model, places: &[Place]) -> String {
    let (speed, position) = if model.motion == Motion::Rotary {
        ("rad/s", "rad")
    } else {
        ("m/s", "m")
    };
    let range = |coordinate: &dyn Fn(&Place) -> f64| {
        places
            .iter()
            .map(coordinate)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
                (a.min(x), b.max(x))
            })
    };
    let narrow = |band: [f64; 2], (low, high): (f64, f64)| band[1] - band[0] < 0.7 * (high - low);
    let mut parts = Vec::new();
    if found.near_reversal {
        parts.push("around reversals".to_owned());
    }
    if narrow(found.velocity, range(&|p| p.velocity)) {
        parts.push(format!(
            "at velocities from {}",
            format::range(found.velocity, speed)
        ));
    }
    if narrow(found.position, range(&|p| p.position)) {
        parts.push(format!(
            "at positions from {}",
            format::range(found.position, position)
        ));
    }
    if narrow(found.input, range(&|p| p.input)) {
        parts.push(format!(
            "at u from {}",
            format::range(found.input, model.input_unit())
        ));
    }
    if found.direction != "both" {
        parts.push(format!("while moving in the {} direction", found.direction));
    }
    if parts.is_empty() {
        "The mismatch is spread over the whole recording.".to_owned()
    } else {
        format!(
            "{:.0} % of the mismatch lives {}.",
            100.0 * Where::SHARE,
            parts.join("; as much ")
        )
    }
}
