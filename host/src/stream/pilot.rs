//! What is found on a bounded selection of long recordings.

use std::ops::Range;

use crate::error::Result;
use crate::identify::{Options, Workbench};
use crate::model::Model;
use crate::noise::Law;
use crate::problem::Response;
use crate::recording::{Long, Recording};
use crate::weak::{Balance, Smoothing, TRAIN_SHARE, Track};

/// Samples of the selection.
const SAMPLES: usize = 1 << 17;
/// Stretches of the selection: enough to see slow changes, long enough for the motions of an axis.
const STRETCHES: usize = 16;

/// What all pieces of all recordings have in common.
pub struct Plan {
    /// Half-width of the windows, s.
    pub half_width: f64,
    pub response: Response,
    pub law: Law,
    pub balance: Option<Balance>,
    pub smoothing: Option<Smoothing>,
}

pub(super) struct Pilot {
    pub stretches: Vec<Recording>,
    pub bench: Workbench,
    pub model: Model,
    /// By how much χ² is less under the rational Stribeck curve, where the model has got that.
    pub less: Option<f64>,
    pub plan: Plan,
}

impl Pilot {
    /// Identifies stretches of the training parts.
    pub fn new(recordings: &[Long], model: &Model, options: Options) -> Result<Self> {
        let (stretches, wholes): (Vec<Recording>, Vec<usize>) =
            read(recordings, TRAIN_SHARE)?.into_iter().unzip();
        let alone = |r| Track::new(r, model.motion, None);
        let alone: Vec<Track> = stretches.iter().map(alone).collect();
        let smoothing = Smoothing::of(&alone, stretches.iter().any(|r| r.q.is_none()));
        drop(alone);
        let bench = Workbench::of(model, options, |balance| {
            let track = |(r, &whole): (&Recording, &usize)| {
                let track = Track::smoothed(r, model.motion, balance, smoothing);
                // All of a stretch is for training; the held-out parts are elsewhere.
                track.piece_of(whole, usize::MAX)
            };
            stretches.iter().zip(&wholes).map(track).collect()
        })?;
        let (found, chi2) = bench.estimate(model)?;
        let (model, less) = match bench.curved(model, chi2) {
            Some((rational, less)) => (bench.estimate(&rational)?.0, Some(less)),
            None => (found, None),
        };
        let problem = &bench.problem;
        let plan = Plan {
            half_width: problem.half_width(),
            response: problem.response,
            law: bench.noise.law.clone(),
            balance: bench.balance,
            smoothing,
        };
        Ok(Self {
            stretches,
            bench,
            model,
            less,
            plan,
        })
    }
}

/// A bounded selection of long recordings: stretches spread evenly over all of their samples.
pub fn stretches(recordings: &[Long]) -> Result<Vec<Recording>> {
    let read = read(recordings, 1.0)?;
    Ok(read.into_iter().map(|(stretch, _)| stretch).collect())
}

/// The stretches over the first `share` of every recording, each with the length of the recording that it is from.
fn read(recordings: &[Long], share: f64) -> Result<Vec<(Recording, usize)>> {
    let parts: Vec<usize> = recordings
        .iter()
        .map(|r| (share * r.samples as f64) as usize)
        .collect();
    select(&parts)
        .into_iter()
        .map(|(index, samples)| {
            let long = &recordings[index];
            let mut stretch = long.part(samples)?;
            let place = format!("{} from {:.0} s", long.path.display(), stretch.t[0]);
            stretch.path = place.into();
            Ok((stretch, long.samples))
        })
        .collect()
}

/// Which samples of which part to read.
fn select(parts: &[usize]) -> Vec<(usize, Range<usize>)> {
    let all: usize = parts.iter().sum();
    let length = SAMPLES.min(all) / STRETCHES;
    let mut selected: Vec<(usize, Range<usize>)> = Vec::new();
    for k in 0..STRETCHES {
        let mut from = (all - length) / (STRETCHES - 1) * k;
        let mut index = 0;
        while from >= parts[index] {
            from -= parts[index];
            index += 1;
        }
        // Whole stretches, moved towards the beginning at the end of a part; the whole of a part that is shorter.
        let from = from.min(parts[index].saturating_sub(length));
        let range = from..(from + length).min(parts[index]);
        match selected.last_mut() {
            Some((last, before)) if *last == index && range.start <= before.end => {
                before.end = range.end.max(before.end);
            }
            _ => selected.push((index, range)),
        }
    }
    selected
}

#[cfg(test)]
mod tests {
    use super::{SAMPLES, STRETCHES, select};

    #[test]
    fn stretches_lie_evenly_in_all_parts_and_nowhere_twice() {
        let selected = select(&[3_000_000, 1_000_000]);
        assert_eq!(selected.len(), STRETCHES);
        let count = |index| selected.iter().filter(|(k, _)| *k == index).count();
        assert_eq!((count(0), count(1)), (12, 4));
        let samples: usize = selected.iter().map(|(_, range)| range.len()).sum();
        assert_eq!(samples, SAMPLES);
        assert!(selected[11].1.end <= 3_000_000 && selected[15].1.end <= 1_000_000);
        assert!(
            selected
                .windows(2)
                .all(|w| w[0].0 < w[1].0 || w[0].1.end < w[1].1.start)
        );
    }

    #[test]
    fn stretches_that_meet_are_one() {
        assert_eq!(select(&[SAMPLES]), [(0, 0..SAMPLES)]);
    }
}
