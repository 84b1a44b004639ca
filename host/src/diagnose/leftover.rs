//! What a model leaves for functions that know no physics.

use rayon::prelude::*;

use super::select::{FLOOR, SOUGHT};
use super::trial::{Base, Generic};
use crate::dictionary::{Group, OVER_POSITION, SQUARES};
use crate::effects::Path;
use crate::error::Result;
use crate::identify::Workbench;
use crate::model::Model;
use crate::problem::{Direction, Response};
use crate::system;

/// Torque that no effect explains counts from this share of the drive's RMS on: a sixth of [`SOUGHT`], and about what
/// smoothing and sampling leave behind where the noise is very low.
const SMALLEST: f64 = SOUGHT / 6.0;
/// The instant of a reversal is uncertain by about this share of a sampling interval.
const TIMING: f64 = 0.1;
/// Share of what is left that a controller's answer to it may seem to explain: see [`beside_nothing`].
const MOST_ANSWERED: f64 = 0.5;

/// What generic functions of each coordinate gain on top of a model.
pub(super) struct Leftover {
    /// The largest gain of any look.
    pub gain: f64,
    /// The largest of whitened rows: what compares with the errors of models.
    pub whitened: f64,
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
        self.whitened = self.whitened.max(gain);
        self.coordinates.retain(|(name, _)| *name != coordinate);
        self.coordinates.insert(0, (coordinate, gain));
        self.certain = true;
    }
}

/// The name of a coordinate, and the whitened functions of it.
type Whitened = (&'static str, Vec<Vec<f64>>);

/// What functions of each coordinate gain, and all of them together.
type Look = (Vec<(&'static str, Generic)>, Generic);

/// What is left for generic functions on top of a model.
pub(super) fn of(bench: &Workbench, model: &Model) -> Result<Leftover> {
    let residual = system::residual(&bench.problem, model);
    let functions = functions(bench, &residual);
    under(bench, model, &residual, &functions)
}

/// The same beside no finding.
///
/// A controller answers the disturbance, which then depends on the input without any physics between them: `u = T − d`, where
/// the motion takes `T`. Seen from the other side of the equation, which has the input as its response, a function of `T` cannot
/// tell of `d` unless physics makes it. So what depends on the input must show there, too, unless it is more than half of all that
/// is left: the other side is rougher, with a single `T` for each window.
pub(super) fn beside_nothing(bench: &Workbench, model: &Model) -> Result<Leftover> {
    let leftover = of(bench, model)?;
    let first = leftover.coordinates.first();
    let by_input = first.is_some_and(|(coordinate, _)| coordinate.starts_with("input"));
    if !leftover.certain || !by_input || leftover.gain > MOST_ANSWERED {
        return Ok(leftover);
    }
    let other = bench.with_response(model, Response::Force)?;
    let (model, _) = other.estimate(model)?;
    let residual = system::residual(&other.problem, &model);
    let scale = system::torque_scale(&other.problem, &model) / model.gain.value.unwrap_or(1.0);
    let input = other.problem.input(&Path::default());
    let taken = input.iter().zip(&residual).map(|(u, r)| u + scale * r);
    let taken: Vec<f64> = taken.collect();
    let mut functions = functions(&other, &residual);
    functions.extend(other.dictionary.of_input(&other.problem, &taken));
    let seen = under(&other, &model, &residual, &functions)?;
    Ok(if seen.certain { leftover } else { seen })
}

/// What given functions of rows gain on top of a model.
fn under(
    bench: &Workbench,
    model: &Model,
    residual: &[f64],
    functions: &[Group],
) -> Result<Leftover> {
    let Some(base) = Base::new(bench, model)? else {
        return Ok(Leftover {
            gain: 0.0,
            whitened: 0.0,
            left: 0.0,
            certain: false,
            coordinates: Vec::new(),
        });
    };
    let friction = bench
        .problem
        .coulomb(&Direction::default(), &Path::default());
    let load = vec![1.0; friction.len()];
    let carriers = [
        (
            "time, as friction in spells",
            "time, as friction at random",
            friction.as_slice(),
        ),
        ("time, in spells", "time, at random", load.as_slice()),
    ];
    let spells = carriers.map(|(name, _, carrier)| (name, base.spells(carrier, residual)));
    let (mut alone, together) = look(&base, functions, &friction, spells);
    let left = relative(bench, model, residual);
    for (in_spells, at_random, carrier) in carriers {
        // What shows beside noise of its own kind needs no look without.
        let shows = |(name, generic): &(&str, Generic)| *name == in_spells && generic.certain;
        if !alone.iter().any(shows) {
            let wanders = base.wanders(carrier, residual, left);
            alone.extend(wanders.certain.then_some((at_random, wanders)));
        }
    }
    let mut looks = vec![(alone, together)];
    // What the dictionary does not follow has passed for noise, and whitening takes what is slow of that for noise of its kind. Without,
    // certain is what is as large as effects that are looked for: reversals leave less.
    let plain = bench.noise.without_colour();
    let unwhitened = Base::under(bench, model, &plain)?;
    let unwhitened = unwhitened.map(|base| look(&base, functions, &friction, []));
    looks.extend(unwhitened.filter(|look| certain(look) && gain(look).sqrt() * left >= SOUGHT));
    Ok(seen(bench, left, &looks))
}

/// Everything in a look.
fn all((alone, together): &Look) -> impl Iterator<Item = &Generic> {
    alone.iter().map(|(_, generic)| generic).chain([together])
}

/// Whether anything in a look is certain.
fn certain(look: &Look) -> bool {
    all(look).any(|generic| generic.certain)
}

/// The largest gain in a look.
fn gain(look: &Look) -> f64 {
    all(look).fold(f64::NEG_INFINITY, |most, generic| most.max(generic.gain))
}

/// What looks at what is left, of that size, come to. What it depends on is for the first to say that shows something.
fn seen(bench: &Workbench, left: f64, looks: &[Look]) -> Leftover {
    let telling = looks.iter().find(|look| certain(look)).unwrap_or(&looks[0]);
    let mut leftover = Leftover {
        gain: looks.iter().map(gain).fold(f64::NEG_INFINITY, f64::max),
        whitened: gain(&looks[0]),
        left,
        certain: looks.iter().any(certain),
        coordinates: ranked(telling),
    };
    // A blow at an end stop or a mass that changes late shows in a few blocks only; nothing of its size is chance elsewhere.
    let large = leftover.gain >= FLOOR && leftover.size() >= SOUGHT;
    leftover.certain |= large && !system::shortened(&bench.problem);
    leftover.certain &= leftover.size() >= smallest(bench);
    leftover
}

/// Gains by coordinate, best first; an inertia over position after what is a part of it, unless it clearly gains more.
fn ranked((alone, _): &Look) -> Vec<(&'static str, f64)> {
    let gains = alone.iter().map(|(name, generic)| (*name, generic.gain));
    let mut ranked: Vec<(&str, f64)> = gains.collect();
    ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
    let place = |name: &str| ranked.iter().position(|(other, _)| *other == name);
    if let (Some(whole), Some(part)) = (place(OVER_POSITION), place(SQUARES))
        && whole < part
        && ranked[whole].1 - ranked[part].1 < FLOOR
    {
        ranked[whole..=part].rotate_right(1);
    }
    ranked
}

/// What functions gain on top of a model, by their coordinates, and all of them together.
fn look(
    base: &Base,
    functions: &[Group],
    friction: &[f64],
    further: impl IntoIterator<Item = Whitened>,
) -> Look {
    let whitened = |group: &Group| {
        let columns = group.columns.iter().map(|c| c.as_slice());
        (group.coordinate, base.whiten(columns))
    };
    let periodic = [
        ("time, periodically", base.spectral_line(None)),
        (
            "time, as friction periodically",
            base.spectral_line(Some(friction)),
        ),
    ];
    let groups = functions.iter().map(whitened).chain(periodic);
    let groups: Vec<Whitened> = groups.chain(further).collect();
    let each = groups.par_iter().map(|(name, c)| (*name, base.generic(c)));
    let alone = each.collect();
    let all: Vec<Vec<f64>> = groups.into_iter().flat_map(|(_, c)| c).collect();
    (alone, base.generic(&all))
}

/// What a residual may depend on.
fn functions(bench: &Workbench, residual: &[f64]) -> Vec<Group> {
    let problem = &bench.problem;
    let acceleration: Vec<f64> = match problem.response {
        Response::Force => problem.acceleration.to_vec(),
        // As the model has it: the measured one is what is to be explained.
        Response::Acceleration => {
            let rows = problem.acceleration.iter().zip(residual);
            rows.map(|(a, r)| a - r).collect()
        }
    };
    let mut groups = bench.dictionary.all_groups(problem);
    groups.push(
        bench
            .dictionary
            .inertia_over_position(problem, &acceleration),
    );
    groups
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
pub(super) fn smallest(bench: &Workbench) -> f64 {
    let reaches = bench.problem.windows.iter().map(|w| w.reach as f64);
    let coarsest = reaches.map(|reach| TIMING / reach).fold(0.0, f64::max);
    SMALLEST.max(coarsest)
}

/// RMS of a residual torque over the RMS of the driving torque, both averaged by the test functions.
pub(super) fn relative(bench: &Workbench, model: &Model, residual: &[f64]) -> f64 {
    let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let scale = system::torque_scale(&bench.problem, model).abs();
    let drive = model.gain.value.unwrap_or(1.0).abs() * rms(&bench.problem.input(&Path::default()));
    scale * rms(residual) / drive.max(f64::MIN_POSITIVE)
}
