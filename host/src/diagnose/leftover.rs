//! What a model leaves for functions that know no physics.

use rayon::prelude::*;

use super::select::{FLOOR, SOUGHT};
use super::trial::{Base, Generic};
use crate::effects::Path;
use crate::error::Result;
use crate::identify::Workbench;
use crate::model::Model;
use crate::problem::Direction;
use crate::system;

/// Torque that no effect explains counts from this share of the drive's RMS on: a sixth of [`SOUGHT`], and about what
/// smoothing and sampling leave behind where the noise is very low.
const SMALLEST: f64 = SOUGHT / 6.0;
/// The instant of a reversal is uncertain by about this share of a sampling interval.
const TIMING: f64 = 0.1;

/// What generic functions of each coordinate gain on top of a model.
pub(super) struct Leftover {
    /// Gain of the whole dictionary.
    pub gain: f64,
    /// RMS torque of all that is left, over the RMS of the drive.
    left: f64,
    /// Whether something is certainly left: large enough to matter, and no chance of a few blocks, or as large as effects that
    /// are looked for.
    pub certain: bool,
    /// Gain of each group alone, best first.
    pub coordinates: Vec<(&'static str, f64)>,
}

impl Leftover {
    /// RMS torque that goes with the gain, over the RMS of the drive.
    pub fn size(&self) -> f64 {
        self.gain.max(0.0).sqrt() * self.left
    }

    /// Has one coordinate certainly come first, with its gain.
    pub fn is_told_by(&mut self, coordinate: &'static str, gain: f64) {
        self.gain = self.gain.max(gain);
        self.coordinates.retain(|(name, _)| *name != coordinate);
        self.coordinates.insert(0, (coordinate, gain));
        self.certain = true;
    }
}

/// What is left for generic functions on top of a model.
pub(super) fn of(bench: &Workbench, model: &Model) -> Result<Leftover> {
    let Some(base) = Base::new(bench, model)? else {
        return Ok(Leftover {
            gain: 0.0,
            left: 0.0,
            certain: false,
            coordinates: Vec::new(),
        });
    };
    let mut groups: Vec<(&'static str, Vec<Vec<f64>>)> = bench
        .dictionary
        .all_groups(&bench.problem)
        .into_iter()
        .map(|g| {
            (
                g.coordinate,
                bench
                    .noise
                    .whiten_all(g.columns.iter().map(|c| c.as_slice())),
            )
        })
        .collect();
    groups.push(("time, periodically", base.spectral_line()));
    let friction = bench
        .problem
        .coulomb(&Direction::default(), &Path::default());
    let residual = system::residual(&bench.problem, model);
    let load = vec![1.0; friction.len()];
    let carriers = [
        (
            "time, as friction in spells",
            "time, as friction at random",
            friction.as_slice(),
        ),
        ("time, in spells", "time, at random", load.as_slice()),
    ];
    for (in_spells, _, carrier) in carriers {
        groups.push((in_spells, base.spells(carrier, &residual)));
    }
    let mut alone: Vec<(&'static str, Generic)> = groups
        .par_iter()
        .map(|(name, c)| (*name, base.generic(c)))
        .collect();
    let left = relative(bench, model, &residual);
    for (in_spells, at_random, carrier) in carriers {
        // What shows beside noise of its own kind needs no look without.
        let shows = |(name, generic): &(&str, Generic)| *name == in_spells && generic.certain;
        if !alone.iter().any(shows) {
            let wanders = base.wanders(carrier, &residual, left);
            alone.extend(wanders.certain.then_some((at_random, wanders)));
        }
    }
    alone.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
    let all: Vec<Vec<f64>> = groups.into_iter().flat_map(|(_, c)| c).collect();
    let together = base.generic(&all);
    let each = alone.iter().map(|g| g.1).chain([together]);
    let shares = each.clone().map(|g| g.gain);
    let gain = shares.fold(f64::NEG_INFINITY, f64::max);
    let mut leftover = Leftover {
        gain,
        left,
        certain: each.into_iter().any(|g| g.certain),
        coordinates: alone.iter().map(|(name, g)| (*name, g.gain)).collect(),
    };
    // A blow at an end stop or a mass that changes late shows in a few blocks only; nothing of its size is chance elsewhere.
    let large = leftover.gain >= FLOOR && leftover.size() >= SOUGHT;
    leftover.certain |= large && !system::shortened(&bench.problem);
    leftover.certain &= leftover.size() >= smallest(bench);
    Ok(leftover)
}

/// Whether what a model leaves of the torque is large enough to count.
pub(super) fn counts(bench: &Workbench, model: &Model) -> bool {
    relative(bench, model, &system::residual(&bench.problem, model)) >= smallest(bench)
}

/// Whether the torque by which two models differ is large enough to count.
pub(super) fn differs(bench: &Workbench, model: &Model, other: &Model) -> bool {
    let own = system::residual(&bench.problem, model);
    let others = system::residual(&bench.problem, other);
    let difference: Vec<f64> = own.iter().zip(others).map(|(a, b)| a - b).collect();
    relative(bench, model, &difference) >= smallest(bench)
}

/// The size from which on something unexplained counts: [`SMALLEST`], or what uncertain reversals leave where few samples
/// lie under a window.
fn smallest(bench: &Workbench) -> f64 {
    let reaches = bench.problem.windows.iter().map(|w| w.reach as f64);
    let coarsest = reaches.map(|reach| TIMING / reach).fold(0.0, f64::max);
    SMALLEST.max(coarsest)
}

/// RMS of a residual torque over the RMS of the driving torque, both averaged by the test functions.
fn relative(bench: &Workbench, model: &Model, residual: &[f64]) -> f64 {
    let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let scale = system::torque_scale(&bench.problem, model).abs();
    let drive = model.gain.value.unwrap_or(1.0).abs() * rms(&bench.problem.input(&Path::default()));
    scale * rms(residual) / drive.max(f64::MIN_POSITIVE)
}
