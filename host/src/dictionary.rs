//! A generic dictionary of what a residual may depend on, without naming physics.
//!
//! Piecewise-linear functions of one coordinate at a time. A fit that includes them all follows whatever is
//! systematic, so its residual shows the noise; and the coordinate whose group helps most says where something
//! that no effect of the catalogue explains lives.

use std::f64::consts::TAU;
use std::sync::Arc;

use rayon::prelude::*;

use crate::effects::Path;
use crate::motion::Motion;
use crate::problem::{Column, Problem, Response, Row};
use crate::weak::{Track, roughness};

/// The functions of one coordinate.
pub struct Group {
    /// What the residual would depend on, for the reader.
    pub coordinate: &'static str,
    /// One column for each function.
    pub columns: Vec<Column>,
}

/// What the functions of all coordinates are made of; independent of the window width. Their signals are made when they
/// are asked for: all at once they would take more memory than all else.
pub struct Dictionary {
    grids: Grids,
}

/// What a residual may depend on. Its noise is what is left beside these.
const COORDINATES: [&str; 9] = [
    "velocity",
    "position",
    "position, as friction",
    "time",
    "time, as friction",
    "input",
    "input, as friction",
    "travel since reversal",
    "position and velocity",
];

/// What else it may depend on. With these as well, a fit to a short recording follows its noise too.
const RARER: [&str; 5] = [
    SQUARES,
    "position, in detail",
    "input, over time",
    "input, with a memory",
    INERTIA,
];

fn every_coordinate() -> impl Iterator<Item = &'static str> {
    COORDINATES.into_iter().chain(RARER)
}

/// What an inertia that changes along the travel brings with it.
pub const SQUARES: &str = "position and squared velocity";
/// All that such an inertia does.
pub const OVER_POSITION: &str = "position, as inertia";

/// The functions of the acceleration, which are left out where that is the response.
const INERTIA: &str = "time, as inertia";

/// Spans between the knots along a turn or a travel: ten degrees each of a turn.
const PLACES: usize = 36;
/// So many of them lie between the knots of an inertia, which a linkage changes a few times per turn.
const COARSE: usize = 3;

/// Half-widths of plays, as shares of an input's RMS.
const PLAYS: [f64; 4] = [0.1, 0.2, 0.4, 0.8];

/// Times in which an input can change by its RMS, s: ratios of √3 from a fast amplifier to a slow valve.
const SLEWS: [f64; 8] = [0.02, 0.035, 0.06, 0.1, 0.18, 0.31, 0.54, 0.94];

/// Knots of the input lie at least so many standard deviations of its noise apart: functions that follow the noise of readings of
/// which the axis knows nothing would take that for physics, and for less noise.
const BAND: f64 = 6.0;

/// Knots along velocity, position and input; a short recording carries fewer.
fn knots(samples: usize) -> usize {
    if samples > 4000 { 6 } else { 4 }
}

impl Dictionary {
    /// Lays the knots. They are common to all tracks, so that columns mean the same on each.
    pub fn new(tracks: &[Track], motion: Motion) -> Self {
        let every = |f: &dyn Fn(&Track, usize) -> f64| -> Vec<f64> {
            tracks
                .iter()
                .flat_map(|t| (0..t.cells.len()).step_by(7).map(move |k| f(t, k)))
                .collect()
        };
        let count = knots(tracks.iter().map(|t| t.cells.len()).sum());
        let path = Path::default();
        let inputs: Vec<Vec<f64>> = tracks.iter().map(|t| t.input(&path)).collect();
        let roughness = inputs.iter().map(|u| roughness(u)).fold(0.0, f64::max);
        let positions = every(&|t, k| t.cells[k].q);
        let grids = Grids {
            places: Places::new(&positions, motion),
            speed: quantiles(every(&|t, k| t.cells[k].v.abs()), count),
            position: quantiles(positions, count + 2),
            input: coarser(quantiles(inputs.concat(), count), BAND * roughness),
            travel: largest(every(&|t, k| t.cells[k].v.abs() * t.period)),
            times: count,
        };
        Self { grids }
    }

    /// The functionals of the dictionary on the windows of a problem.
    ///
    /// Functions of the input are left out where the input is the response, those of the acceleration where that is. Nothing here
    /// follows how fast the input changes: in closed loop it answers the disturbance within a window, which is not physics left
    /// out.
    ///
    /// # Panics
    /// With the problem of other recordings than the dictionary's.
    pub fn groups(&self, problem: &Problem) -> Vec<Group> {
        self.of(COORDINATES.into_iter(), problem)
    }

    /// Those and the functions of rarer coordinates, likewise.
    pub fn all_groups(&self, problem: &Problem) -> Vec<Group> {
        self.of(every_coordinate(), problem)
    }

    fn of(&self, coordinates: impl Iterator<Item = &'static str>, problem: &Problem) -> Vec<Group> {
        // A problem keeps the columns of a coordinate under its place among all.
        let place = |coordinate| every_coordinate().position(|other| other == coordinate);
        let kept = |coordinate: &'static str| match problem.response {
            Response::Acceleration => coordinate != INERTIA,
            Response::Force => !coordinate.starts_with("input"),
        };
        let kept = coordinates.filter(|c| kept(c));
        let kept: Vec<_> = kept.filter_map(|c| Some((place(c)?, c))).collect();
        kept.into_par_iter()
            .map(|(place, coordinate)| Group {
                coordinate,
                columns: problem.generic(place, || self.columns(coordinate, problem)),
            })
            .collect()
    }

    fn columns(&self, coordinate: &str, problem: &Problem) -> Vec<Vec<f64>> {
        if coordinate == INERTIA {
            return self.inertia_over_time(problem);
        }
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for (track, windows) in problem.tracks.iter().zip(&problem.windows) {
            let signals = signals(coordinate, track, &self.grids);
            columns.resize(signals.len(), Vec::new());
            for (column, signal) in columns.iter_mut().zip(&signals) {
                column.extend(windows.hold(track, signal));
            }
        }
        columns
    }

    /// The functions of the input, for one of which there is a value for every row of a problem.
    pub fn of_input(&self, problem: &Problem, input: &[f64]) -> Vec<Group> {
        let inputs = every_coordinate().filter(|c| c.starts_with("input"));
        let group = |coordinate| {
            let mut columns: Vec<Vec<f64>> = Vec::new();
            let mut from = 0;
            for (track, windows) in problem.tracks.iter().zip(&problem.windows) {
                let rows = &problem.rows[from..from + windows.centres.len()];
                let driven = Driven {
                    input: &input[from..from + rows.len()],
                    period: windows.hop as f64 * track.period,
                    sign: &|k| track.cells[rows[k].centre].s,
                    time: &|k| problem.time(rows[k]),
                };
                let signals = driven.signals(coordinate, track, &self.grids);
                columns.resize(signals.len(), Vec::new());
                for (column, signal) in columns.iter_mut().zip(signals) {
                    column.extend(signal);
                }
                from += rows.len();
            }
            Group {
                coordinate,
                columns: columns.into_iter().map(Arc::new).collect(),
            }
        };
        inputs.map(group).collect()
    }

    /// What an inertia over position would do, `J(q)·q̈ + J′(q)·q̇²/2`: `acceleration`, that of every row, times functions of
    /// position, which change little within a window, and the functions of position and squared velocity.
    pub fn inertia_over_position(&self, problem: &Problem, acceleration: &[f64]) -> Group {
        let Grids {
            position, places, ..
        } = &self.grids;
        let place = |row: &Row| problem.tracks[row.track].cells[row.centre].q;
        let rows = || problem.rows.iter().zip(acceleration);
        let table = |knots: &[f64], place: &dyn Fn(&Row) -> f64| -> Vec<Arc<Vec<f64>>> {
            let at = |j: usize| rows().map(move |(row, a)| a * hat(knots, j, place(row)));
            (0..knots.len())
                .map(|j| Arc::new(at(j).collect()))
                .collect()
        };
        let mut columns = table(position, &place);
        columns.extend(table(&places.turning(), &|row| places.of(place(row))));
        let squares = self.of([SQUARES].into_iter(), problem);
        columns.extend(squares.into_iter().flat_map(|group| group.columns));
        Group {
            coordinate: OVER_POSITION,
            columns,
        }
    }

    /// The inertial torque times functions of time, which hardly change within a window.
    fn inertia_over_time(&self, problem: &Problem) -> Vec<Vec<f64>> {
        let knots = problem.tracks.iter().map(|t| times(t, self.grids.times));
        let knots: Vec<Vec<f64>> = knots.collect();
        let rows = || problem.rows.iter().zip(problem.acceleration.iter());
        let at = |j: usize| {
            let column = rows().map(|(&row, a)| a * hat(&knots[row.track], j, problem.time(row)));
            column.collect()
        };
        (0..self.grids.times).map(at).collect()
    }
}

/// Knots along the time of a track.
fn times(track: &Track, count: usize) -> Vec<f64> {
    let duration = track.cells.len() as f64 * track.period;
    let knot = |k: usize| track.start + duration * k as f64 / (count - 1) as f64;
    (0..count).map(knot).collect()
}

struct Grids {
    speed: Vec<f64>,
    position: Vec<f64>,
    places: Places,
    input: Vec<f64>,
    travel: f64,
    times: usize,
}

/// Knots close to each other along a turn, or along a travel that is less.
struct Places {
    /// What a place comes back after, if the travel is so long.
    turn: Option<f64>,
    knots: Vec<f64>,
}

impl Places {
    fn new(positions: &[f64], motion: Motion) -> Self {
        let fold = |f: fn(f64, f64) -> f64| positions.iter().copied().reduce(f).unwrap_or_default();
        let (low, high) = (fold(f64::min), fold(f64::max));
        let turns = motion == Motion::Rotary && high - low > TAU;
        let (from, span) = if turns { (0.0, TAU) } else { (low, high - low) };
        let knot = |k: usize| from + span * k as f64 / PLACES as f64;
        Self {
            turn: turns.then_some(TAU),
            knots: (0..=PLACES).map(knot).collect(),
        }
    }

    fn of(&self, q: f64) -> f64 {
        self.turn.map_or(q, |turn| q.rem_euclid(turn))
    }

    /// Knots along a turn that an inertia may change over; none on a travel that is less.
    fn turning(&self) -> Vec<f64> {
        let knots = self.knots.iter().step_by(COARSE);
        knots.filter(|_| self.turn.is_some()).copied().collect()
    }
}

/// The signals of one coordinate in every cell of a track, one for each function.
fn signals(coordinate: &str, track: &Track, grids: &Grids) -> Vec<Vec<f64>> {
    let cells = &track.cells;
    let speed = |k: usize| cells[k].v.abs();
    let position = |k: usize| cells[k].q;
    let time = |k: usize| track.cell_time(k);
    let sign = |k: usize| cells[k].s;
    let one = |_: usize| 1.0;
    let table =
        |knots: &[f64], x: &dyn Fn(usize) -> f64, factor: &dyn Fn(usize) -> f64| -> Vec<Vec<f64>> {
            (0..knots.len())
                .map(|j| {
                    (0..cells.len())
                        .map(|k| factor(k) * hat(knots, j, x(k)))
                        .collect()
                })
                .collect()
        };
    let both = |mut a: Vec<Vec<f64>>, b: Vec<Vec<f64>>| {
        a.extend(b);
        a
    };
    match coordinate {
        "velocity" => both(
            table(&grids.speed, &speed, &sign),
            table(&grids.speed, &speed, &one),
        ),
        "position" => table(&grids.position, &position, &one),
        "position, as friction" => table(&grids.position, &position, &sign),
        "position and velocity" => table(&grids.position, &position, &|k| cells[k].v),
        "position and squared velocity" => {
            let square = |k: usize| cells[k].v * cells[k].v;
            let place = |k: usize| grids.places.of(cells[k].q);
            both(
                table(&grids.position, &position, &square),
                table(&grids.places.turning(), &place, &square),
            )
        }
        "position, in detail" => table(&grids.places.knots, &|k| grids.places.of(cells[k].q), &one),
        "time" => table(&times(track, grids.times), &time, &one),
        "time, as friction" => both(
            table(&times(track, grids.times), &time, &sign),
            table(&times(track, grids.times), &time, &|k| cells[k].v),
        ),
        "travel since reversal" => memories(track, grids.travel),
        _ => {
            let driven = Driven {
                input: &track.input(&Path::default()),
                period: track.period,
                sign: &sign,
                time: &time,
            };
            driven.signals(coordinate, track, grids)
        }
    }
}

/// An input at even times, with the direction of motion and the time of each value.
struct Driven<'a> {
    input: &'a [f64],
    period: f64,
    sign: &'a dyn Fn(usize) -> f64,
    time: &'a dyn Fn(usize) -> f64,
}

impl Driven<'_> {
    /// The signals of one coordinate of the input.
    fn signals(&self, coordinate: &str, track: &Track, grids: &Grids) -> Vec<Vec<f64>> {
        let each = |f: &dyn Fn(usize, f64) -> f64| -> Vec<f64> {
            let values = self.input.iter().enumerate();
            values.map(|(k, u)| f(k, *u)).collect()
        };
        match coordinate {
            "input, with a memory" => histories(self.input, self.period),
            "input, as friction" => vec![each(&|k, u| (self.sign)(k) * u.abs())],
            "input, over time" => {
                let times = times(track, grids.times);
                let share = |j, k| hat(&times, j, (self.time)(k));
                let at = |j| each(&|k, u| u * share(j, k));
                (0..times.len()).map(at).collect()
            }
            _ => {
                let knots = &grids.input;
                let at = |j| each(&|_, u| hat(knots, j, u));
                (0..knots.len()).map(at).collect()
            }
        }
    }
}

/// What an amplifier with a memory may make of an input: what is left of it behind plays of several widths, and what it becomes
/// if it cannot change faster than at several rates. Both are measured by its RMS. Under control the input answers the disturbance
/// as well; clean axes under control with a torque noise of 10 % remain adequate all the same (`concealed`, `validate`).
fn histories(input: &[f64], period: f64) -> Vec<Vec<f64>> {
    let rms = (input.iter().map(|u| u * u).sum::<f64>() / input.len() as f64).sqrt();
    let follow = |within: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        let mut y = input.first().copied().unwrap_or_default();
        let behind = input.iter().map(|u| {
            y = within(y, *u);
            y
        });
        behind.collect()
    };
    let play = |width: f64| follow(&|y, u| y.clamp(u - width * rms, u + width * rms));
    let slewed = |time: f64| {
        let step = rms * period / time;
        follow(&|y, u| u.clamp(y - step, y + step))
    };
    let plays = PLAYS.map(play).into_iter();
    plays.chain(SLEWS.map(slewed)).collect()
}

/// Direction with a memory of the travel since reversal: `h ← σ + (h − σ)·e^(−|Δq|/x₀)`, σ = sgn Δq.
fn memories(track: &Track, typical_step: f64) -> Vec<Vec<f64>> {
    // From a few typical steps of one cell to a few hundred of them.
    [3.0, 10.0, 30.0, 100.0]
        .map(|steps| {
            let length = steps * typical_step;
            let mut h = track.cells.first().map_or(0.0, |c| c.s);
            track
                .cells
                .iter()
                .map(|cell| {
                    let travel = cell.v.abs() * track.period;
                    h = cell.s + (h - cell.s) * (-travel / length).exp();
                    h
                })
                .collect()
        })
        .to_vec()
}

/// The hat function of knot `j`: 1 there, 0 at its neighbours; constant beyond the outer knots.
fn hat(knots: &[f64], j: usize, x: f64) -> f64 {
    let x = x.clamp(knots[0], knots[knots.len() - 1]);
    if j > 0 && x < knots[j] {
        ((x - knots[j - 1]) / (knots[j] - knots[j - 1]).max(f64::MIN_POSITIVE)).max(0.0)
    } else if j + 1 < knots.len() && x > knots[j] {
        ((knots[j + 1] - x) / (knots[j + 1] - knots[j]).max(f64::MIN_POSITIVE)).max(0.0)
    } else {
        1.0
    }
}

/// The 99 % point.
fn largest(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[(values.len() - 1) * 99 / 100].max(f64::MIN_POSITIVE)
}

/// At most `count` values that split the sample into equal shares, from its 1 % to its 99 % point; neighbours closer than
/// a hundredth of the range are one.
fn quantiles(mut values: Vec<f64>, count: usize) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let last = (values.len() - 1) as f64;
    let at = |share: f64| values[(last * (0.01 + 0.98 * share)) as usize];
    let apart = 0.01 * (at(1.0) - at(0.0)).max(f64::MIN_POSITIVE);
    let mut knots: Vec<f64> = Vec::new();
    for k in 0..count {
        let value = at(k as f64 / (count - 1) as f64);
        if knots.last().is_none_or(|before| value - before > apart) {
            knots.push(value);
        }
    }
    knots
}

/// Knots that lie no closer together than `apart`, or than half of what even ones would, the outer two among them.
fn coarser(knots: Vec<f64>, apart: f64) -> Vec<f64> {
    let (first, last) = (knots[0], knots[knots.len() - 1]);
    let even = (last - first) / (knots.len() - 1).max(1) as f64;
    let apart = apart.min(0.5 * even);
    let mut kept = vec![first];
    for knot in knots.into_iter().skip(1) {
        let before = kept[kept.len() - 1];
        if knot - before > apart && (knot == last || last - knot > apart) {
            kept.push(knot);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::hat;

    #[test]
    fn hats_sum_to_one_inside_and_outside_the_knots() {
        let knots = [0.0, 1.0, 3.0, 4.5];
        for k in -5..60 {
            let x = f64::from(k) * 0.1;
            let sum: f64 = (0..4).map(|j| hat(&knots, j, x)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{x}: {sum}");
        }
    }
}
