//! Whether drive and motion belong together: their signs, their timing, and values that the model file gives.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use super::Warning;
use crate::effects::Path;
use crate::format::{quantity, significant, whole_percent};
use crate::identify::Workbench;
use crate::linear;
use crate::model::{Causality, Model};
use crate::problem::Direction;
use crate::system;
use crate::weak::{Track, Windows};

/// Estimates of the inertia from either side of the equation agree within this factor where the recording shows it.
const AGREE: f64 = 1.5;
/// A given inertia off by more than this is no matter of what else the model leaves out.
const OFF: f64 = 3.0;
/// Share of the drive that the plainest model must explain before it may judge anything.
const EXPLAINED: f64 = 0.5;
/// Share of the squared error that a shift in time must take away.
const SHIFT_GAIN: f64 = 0.2;
/// Steps of the search for a shift, in each direction.
const SHIFTS: i32 = 12;
/// Relative ridge on columns some of which nearly depend on each other.
const RIDGE: f64 = 1e-6;
/// Delay of a drive and its bus together that is no longer believed, s: a hundred times a usual control period.
const LONG: f64 = 0.02;

pub(super) fn check(bench: &Workbench, fitted: &Model) -> Vec<Warning> {
    if fitted.causality == Causality::Inverse {
        return Vec::new();
    }
    let mut warnings = Vec::new();
    let rows = Rows::new(bench);
    let delay = system::path(fitted).delay;
    if let Some(plain) = rows.inertia(delay) {
        warnings.extend(sign(plain, fitted));
        warnings.extend(given(plain, fitted));
    }
    if delay > 0.0 {
        warnings.extend(long(delay, bench));
    } else {
        warnings.extend(rows.shift(bench));
    }
    warnings
}

/// The plainest weak form: inertia, Coulomb and viscous friction, and any function of the position, such as gravity, which
/// would pass for inertia or for a shift.
struct Rows<'a> {
    bench: &'a Workbench,
    acceleration: Vec<f64>,
    resisting: Vec<Vec<f64>>,
}

impl<'a> Rows<'a> {
    fn new(bench: &'a Workbench) -> Self {
        let problem = &bench.problem;
        let whiten = |column: &[f64]| bench.noise.whiten(column);
        let mut resisting = vec![
            whiten(&problem.coulomb(&Direction::default(), &Path::default())),
            whiten(&problem.velocity(&Path::default())),
        ];
        let groups = bench.dictionary.groups(problem).into_iter();
        let position = groups.filter(|group| group.coordinate == "position");
        resisting.extend(position.flat_map(|g| g.columns).map(|c| whiten(&c)));
        Self {
            bench,
            acceleration: whiten(&problem.acceleration),
            resisting,
        }
    }

    /// The input as if it acted so many seconds later than recorded.
    fn input(&self, delay: f64) -> Vec<f64> {
        let late = Path {
            delay,
            ..Path::default()
        };
        let windows = |track: &Track, windows: &Windows| windows.hold(track, &track.input(&late));
        self.bench.noise.whiten(&self.bench.problem.stack(windows))
    }

    /// Inertia over gain, if both sides of the equation agree on it and it explains most of the drive.
    fn inertia(&self, delay: f64) -> Option<f64> {
        let input = self.input(delay);
        let fit = |response: &[f64], first: &[f64]| {
            let mut columns = vec![first];
            columns.extend(self.resisting.iter().map(Vec::as_slice));
            linear::score(response, &columns, &self.bench.blocks, RIDGE, None)
        };
        let force = fit(&input, &self.acceleration)?;
        let by_force = force.beta[0];
        let by_motion = 1.0 / fit(&self.acceleration, &input)?.beta[0];
        let rows = input.iter().zip(&self.bench.blocks);
        let drive: f64 = rows.filter(|(_, f)| f.is_some()).map(|(u, _)| u * u).sum();
        let ratio = by_motion / by_force;
        let trusted =
            (1.0 / AGREE..AGREE).contains(&ratio) && force.chi2 < (1.0 - EXPLAINED) * drive;
        trusted.then_some((by_force * by_motion).sqrt() * by_force.signum())
    }

    /// A shift of the drive in time that explains the motion far better than none.
    fn shift(&self, bench: &Workbench) -> Option<Warning> {
        let period = bench.problem.tracks.iter().map(|t| t.period);
        let period = period.fold(0.0, f64::max);
        let most = bench.problem.half_width().max(2.0 * period);
        let error = |delay: f64| {
            let input = self.input(delay);
            let mut columns = vec![input.as_slice()];
            columns.extend(self.resisting.iter().map(Vec::as_slice));
            let score = linear::score(&self.acceleration, &columns, &bench.blocks, RIDGE, None);
            // All shifts have as many unknowns. A block that alone visits a position says nothing of what it leaves out.
            score.map_or(f64::INFINITY, |s| s.chi2)
        };
        let none = error(0.0);
        let (best, least) = (-SHIFTS..=SHIFTS)
            .into_par_iter()
            .map(|k| most * f64::from(k) / f64::from(SHIFTS))
            .map(|delay| (delay, error(delay)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        let gain = 1.0 - least / none;
        // The best at the edge of the search is a trend, not a shift.
        let inside = best.abs() < most * (1.0 - 0.5 / f64::from(SHIFTS));
        let far = if best < 0.0 {
            -best > 1.5 * period
        } else {
            best > LONG
        };
        (inside && far && gain > SHIFT_GAIN).then(|| {
            let what = if best < 0.0 {
                format!("The motion comes about {} before the drive that causes it", quantity(-1e3 * best, "ms"))
            } else {
                format!("The drive acts about {} later than recorded", quantity(1e3 * best, "ms"))
            };
            Warning::suspect(
                "channels-shifted",
                format!(
                    "{what}: such a shift takes {} of the squared error away. The channels were probably logged by different clocks or filtered differently; align them, or log them in one task.",
                    whole_percent(gain)
                ),
            )
        })
    }
}

fn sign(plain: f64, fitted: &Model) -> Option<Warning> {
    let gain = fitted.gain.value?;
    // Where the gain is free, a fit with a given inertia makes it negative instead.
    let against = if fitted.gain.known {
        plain * gain < 0.0
    } else {
        gain < 0.0
    };
    against.then(|| {
        Warning::suspect(
            "sign-of-input",
            "The axis accelerates against u: u and q count in opposite directions. Change the sign of one column, or of plant.gain.".to_owned(),
        )
    })
}

/// What a factor between the given and the observed inertia betrays.
const FACTORS: [(f64, &str); 6] = [
    (180.0 / PI, "q in degrees instead of rad"),
    (1.0 / TAU, "q in turns instead of rad"),
    (TAU, "a factor of 2π"),
    (60.0 / TAU, "speeds in turns a minute instead of rad/s"),
    (TAU / 60.0, "speeds in turns a minute instead of rad/s"),
    (9.81, "a torque or force in kgf instead of N"),
];

fn given(plain: f64, fitted: &Model) -> Option<Warning> {
    let (inertia, gain) = (&fitted.inertia, &fitted.gain);
    if !(inertia.known && gain.known) {
        return None;
    }
    let (given, ratio) = (inertia.value?, inertia.value? / gain.value? / plain);
    if ratio < 0.0 || (1.0 / OFF..OFF).contains(&ratio) {
        return None;
    }
    let near = |factor: f64| (ratio / factor).ln().abs() < 0.1;
    let power = ratio.log10().round() as i32;
    let cause = match FACTORS.iter().find(|(factor, _)| near(*factor)) {
        _ if power != 0 && near(10f64.powi(power)) => {
            format!("That is about 10 to the power {power}: look for a prefix (g or kg, mm or m, ms or s, mN·m or N·m)")
        }
        Some((_, what)) => format!("That looks like {what}"),
        None => "Look at the units of u and q, at a gear between them (its ratio counts squared), and at plant.gain".to_owned(),
    };
    let unit = fitted.unit(crate::effects::Quantity::Inertia);
    Some(Warning::suspect(
        "given-inertia",
        format!(
            "The model file gives an inertia of {} and a gain of {}, but the recording accelerates as if the inertia were {}: a factor of {}. {cause}.",
            quantity(given, unit),
            significant(gain.value?, 3),
            quantity(plain * gain.value?, unit),
            significant(ratio, 3)
        ),
    ))
}

fn long(delay: f64, bench: &Workbench) -> Option<Warning> {
    let periods = bench.problem.tracks.iter().map(|t| delay / t.period);
    let periods = periods.fold(f64::INFINITY, f64::min);
    (delay > LONG && periods > 2.0).then(|| {
        Warning::suspect(
            "long-delay",
            format!(
                "The model delays the drive by {}, {} samples, longer than drives and buses take: check that u and q were logged by one clock.",
                quantity(1e3 * delay, "ms"),
                significant(periods, 2)
            ),
        )
    })
}
