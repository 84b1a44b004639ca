//! A recording on a uniform time grid, with smoothed velocity and the direction of sliding.

use std::ops::Range;

use super::TRAIN_SHARE;
use super::reversal::{Drive, Reversal};
use super::smooth::Differentiator;
use crate::effects::{Moment, Path, Point, Survey};
use crate::motion::Motion;
use crate::recording::Recording;

/// A recording ready for the weak form. Node `k` is the instant `start + k·period`; cell `k` lies between
/// nodes `k` and `k + 1`.
#[derive(Clone, Debug)]
pub struct Track {
    /// Time of the first node, s.
    pub start: f64,
    /// Grid interval, s.
    pub period: f64,
    /// Position at the nodes; the integral of velocity where only that was measured.
    pub q: Vec<f64>,
    /// Smoothed velocity at the nodes.
    pub v: Vec<f64>,
    /// State in the middle of the cells.
    pub cells: Vec<Point>,
    /// Share of each cell in which the axis slides. At rest friction is whatever balances the other forces, so both
    /// sides of the equation of motion are left out there.
    pub sliding: Vec<f64>,
    /// Cells that no window may lie on: those that bridge a gap in the recording, and what [`Track::bar_unresolved`] adds.
    pub barred: Vec<bool>,
    /// Standard deviation of the position noise: quantisation, or what a smooth curve cannot follow.
    pub position_noise: f64,
    /// Step of the quantiser that the measurements have gone through, in their own unit; 0 if none shows.
    pub quantum: f64,
    /// Standard deviation of the smoothed velocity.
    pub velocity_noise: f64,
    /// How velocity is smoothed.
    pub smoothing: Smoothing,
    /// Share of the time in which the axis may rest at reversals without its positions showing it.
    pub doubt: f64,
    /// First node of the held-out part.
    pub boundary: usize,
    /// Nodes of the whole recording, of which this may be a piece.
    pub whole: usize,
    /// Whether positions are the integral of a measured velocity.
    pub(super) summed: bool,
    input: Held,
}

/// How the velocity of all pieces of a recording is smoothed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Smoothing {
    /// Half-width of the filter, s.
    half_width: f64,
    /// Standard deviation of the position noise.
    position_noise: f64,
}

impl Smoothing {
    /// Half-width of the filter at a sampling interval, in samples.
    fn half(&self, period: f64) -> usize {
        (self.half_width / period).round() as usize
    }

    /// By a filter of half the width.
    #[must_use]
    pub fn finer(&self) -> Self {
        Self {
            half_width: 0.5 * self.half_width,
            ..*self
        }
    }

    /// What some stretches of recordings together ask for, by the rule for a recording. `None` without any.
    pub fn of(tracks: &[Track], velocity_only: bool) -> Option<Self> {
        let mut noises: Vec<f64> = tracks.iter().map(|t| t.position_noise).collect();
        noises.sort_by(f64::total_cmp);
        let position_noise = *noises.get(noises.len() / 2)?;
        let period = tracks.first()?.period;
        let squares = tracks.iter().flat_map(|t| &t.v).map(|v| v * v).sum::<f64>();
        let nodes = tracks.iter().map(|t| t.v.len()).sum::<usize>();
        let limit = tolerated(velocity_only) * (squares / nodes as f64).sqrt();
        let most = (WIDEST_FILTER / period) as usize;
        let quiet = |half: &usize| {
            position_noise * gain(&Differentiator::new(*half), velocity_only) / period <= limit
        };
        let usable = || FILTERS.iter().copied().filter(|half| *half <= most);
        let half = usable()
            .find(quiet)
            .or(usable().next_back())
            .unwrap_or(FILTERS[0]);
        Some(Self {
            half_width: half as f64 * period,
            position_noise,
        })
    }
}

/// Standard deviation of a filtered derivative per sampling interval, for positions with noise of unit variance. Noise of
/// a measured velocity runs up in its integral.
fn gain(filter: &Differentiator, velocity_only: bool) -> f64 {
    if velocity_only {
        filter.summed_noise_gain()
    } else {
        filter.noise_gain()
    }
}

/// Velocity noise that a filter may leave, as a share of the RMS speed.
fn tolerated(velocity_only: bool) -> f64 {
    if velocity_only {
        VELOCITY_NOISE_ALONE
    } else {
        VELOCITY_NOISE
    }
}

/// What it takes to move an axis, in units of `u`: known roughly before anything is fitted in earnest.
#[derive(Clone, Copy, Debug)]
pub struct Balance {
    /// `J/k`.
    pub inertia: f64,
    /// `Fc/k`.
    pub coulomb: f64,
}

/// A signal held from each sample to the next: see [`held_like`].
#[derive(Clone, Debug)]
struct Held {
    t: Vec<f64>,
    u: Vec<f64>,
    /// Whether nothing acted before the first sample, rather than its value.
    fresh: bool,
}

/// Half-widths of the velocity filter that are tried, in samples.
const FILTERS: [usize; 14] = [3, 4, 6, 8, 11, 15, 21, 30, 42, 60, 85, 120, 170, 240];
/// Half-width of the velocity filter at most, s: below that of the narrowest test functions (0.07 s), so that the filter
/// follows what they pass.
const WIDEST_FILTER: f64 = 0.05;
/// Velocity noise that a filter may leave, as a share of the RMS speed. Half a percent keeps the error of a
/// quadratic regressor at a percent, below the smallest effects that are looked for.
const VELOCITY_NOISE: f64 = 0.005;
/// The same of a measured velocity, whose integral wanders at rest where positions stay: nothing else says when a slow axis halts
/// and which way it moves. Speeds within [`SLOW`] times as much are of unknown direction.
const VELOCITY_NOISE_ALONE: f64 = 0.002;
/// Velocities within this many standard deviations of zero have no certain direction.
const SLOW: f64 = 3.0;
/// Recordings of which one may have a rest that the noise of a measured velocity breaks.
const CHANCE: f64 = 20.0;
/// Standard deviations of the position noise in half a step of a quantiser: `½·√12`.
const HALF_A_STEP: f64 = 1.732;
/// Travel of this many standard deviations of the position noise is certain: more than one step of a quantiser.
const CERTAIN_TRAVEL: f64 = 4.0;
/// How many times as long an axis may move before its positions tell as it takes from a certain travel to four times as much: as
/// long if it moves off evenly, 1.7 times if a drive that rises evenly sets it free.
const HIDDEN: usize = 2;
/// How many times as long as that a rest must be to be plain: four fifths of it are rest at least.
const PLAINLY: usize = 5;
/// Speed at the first sample, beyond its noise, up to which the axis begins at rest, as a share of the RMS speed: one that
/// passes by at random is as slow in about one of fifty cases.
const AT_REST: f64 = 0.02;
/// Time of unknown direction that windows bear, as a share of their half-width. A reversal somewhere within it is misplaced by
/// its √12th, and friction, twice as large across it, errs by a sixth or so in a window: more than most that is looked for.
const UNRESOLVED: f64 = 0.25;
/// A pause between samples longer than this many intervals is a gap that nothing is interpolated across.
const GAP: f64 = 5.0;
/// Timing within this share of an interval counts as uniform.
const JITTER: f64 = 0.02;

/// Multiples of a quantiser's step up to this are counted: those of one that a file gives with three digits stay within …
const MULTIPLES: f64 = 50.0;
/// … this of whole numbers.
const OF_A_STEP: f64 = 0.05;
/// Steps that a quantiser is told by.
const FEWEST_STEPS: usize = 20;

/// What to hold from each sample to the next: the input itself, or its mean there if that is a straight line between samples.
fn held_like(recording: &Recording) -> Vec<f64> {
    let mut u = recording.u.clone();
    if recording.sampled {
        for (k, pair) in recording.u.windows(2).enumerate() {
            u[k] = 0.5 * (pair[0] + pair[1]);
        }
    }
    u
}

impl Track {
    /// Resamples and smooths a recording of an axis that moves by `motion`. Where something is known of its `balance`,
    /// the drive tells how long it rests.
    pub fn new(recording: &Recording, motion: Motion, balance: Option<Balance>) -> Self {
        Self::smoothed(recording, motion, balance, None)
    }

    /// The same with a filter that is given rather than chosen.
    pub fn smoothed(
        recording: &Recording,
        motion: Motion,
        balance: Option<Balance>,
        smoothing: Option<Smoothing>,
    ) -> Self {
        let t = &recording.t;
        let position = match (&recording.q, &recording.v) {
            (Some(q), _) => q.clone(),
            (None, v) => integrate(t, v.as_deref().unwrap_or_default()),
        };
        let even = (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64;
        let uniform = |period: f64| {
            t.iter()
                .enumerate()
                .all(|(k, t_k)| (t_k - t[0] - k as f64 * period).abs() < JITTER * period)
        };
        // Of the samples as they are: interpolation hides the steps of a quantiser.
        let velocity_only = recording.q.is_none();
        let quantum = quantum(recording.measured());
        let sample_noise = white_noise(recording.measured()).max(quantum / 12f64.sqrt());
        let (period, q) = if uniform(even) {
            (even, position)
        } else {
            let median = median(t.windows(2).map(|w| w[1] - w[0]).collect());
            (median, resample(t, &position, median))
        };
        let input = Held {
            t: t.clone(),
            u: held_like(recording),
            fresh: false,
        };
        let mut track = Self {
            boundary: (TRAIN_SHARE * q.len() as f64) as usize,
            whole: q.len(),
            start: t[0],
            period,
            position_noise: sample_noise,
            quantum,
            q,
            v: Vec::new(),
            cells: Vec::new(),
            sliding: Vec::new(),
            barred: Vec::new(),
            velocity_noise: 0.0,
            smoothing: Smoothing::default(),
            doubt: 0.0,
            summed: velocity_only,
            input,
        };
        if velocity_only {
            track.position_noise *= period;
        }
        // Nothing is told from the rounding of what a filter sums up, or rest would look like motion where there is no noise.
        let rounding = f64::EPSILON * largest(&track.q);
        track.position_noise = track.position_noise.max(rounding);
        let filter = match smoothing {
            None => track.differentiate(),
            Some(smoothing) => track.differentiate_as(smoothing),
        };
        track.input.fresh = track.begins_at_rest(&filter);
        let half = filter.half();
        track.smoothing = Smoothing {
            half_width: half as f64 * period,
            position_noise: track.position_noise,
        };
        let reversals = track.reversals(&filter, balance);
        track.doubt = reversals.iter().map(|r| r.doubt).sum::<f64>() / track.q.len() as f64;
        for reversal in &reversals {
            track.sharpen(reversal, half);
        }
        track.fill_cells(motion);
        track.find_rest();
        if track.summed {
            track.rest_on();
        }
        for reversal in &reversals {
            track.place(reversal);
        }
        track.bar_gaps(t);
        track
    }

    /// The track of a piece of a recording of `whole` samples, which is for training up to its node `boundary`.
    #[must_use]
    pub fn piece_of(self, whole: usize, boundary: usize) -> Self {
        Self {
            boundary,
            whole,
            ..self
        }
    }

    /// The same track with nothing held out.
    #[must_use]
    pub fn trained_on_whole(self) -> Self {
        Self {
            boundary: self.whole,
            ..self
        }
    }

    /// The share of its recording that is for training.
    pub fn training_share(&self) -> f64 {
        if self.boundary == self.whole {
            1.0
        } else {
            TRAIN_SHARE
        }
    }

    /// Mean over every cell of the input that reaches the axis by a path.
    pub fn input(&self, path: &Path) -> Vec<f64> {
        self.input_of(self.q.len() - 1, path)
    }

    /// The same over the first cells alone.
    pub fn input_of(&self, cells: usize, path: &Path) -> Vec<f64> {
        let nodes = (0..=cells).map(|k| self.start + k as f64 * self.period);
        let integral = self.input.integral(path, nodes);
        integral
            .windows(2)
            .map(|w| (w[1] - w[0]) / self.period)
            .collect()
    }

    /// Cell `k` with the input that acts there.
    pub fn driven(&self, k: usize, u: f64) -> Point {
        let cell = self.cells[k];
        cell.at(Moment { u, ..cell.moment })
    }

    /// Takes out of a signal given by its mean in each of the first cells what is not of their sliding part.
    pub fn slide(&self, cells: &mut [f64]) {
        let parts = cells.iter_mut().zip(&self.sliding);
        parts.for_each(|(x, s)| *x *= s);
    }

    /// Time in the middle of cell `k`.
    pub fn cell_time(&self, k: usize) -> f64 {
        self.start + (k as f64 + 0.5) * self.period
    }

    /// What this track covers.
    pub fn survey(&self, motion: Motion, half_width: f64) -> Survey {
        let mut speeds: Vec<f64> = self.v.iter().map(|v| v.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        let fold = |f: fn(f64, f64) -> f64| self.q.iter().copied().reduce(f).unwrap_or_default();
        let slow = SLOW * self.velocity_noise;
        let moving = &speeds[speeds.partition_point(|speed| *speed <= slow)..];
        let inputs = self.input.u.iter().map(|u| u.abs());
        let power = inputs.clone().map(|u| u * u).sum::<f64>() / self.input.u.len() as f64;
        Survey {
            motion,
            period: self.period,
            duration: self.cells.len() as f64 * self.period,
            input: (power.sqrt(), inputs.fold(0.0, f64::max)),
            half_width,
            top_speed: speeds[(speeds.len() - 1) * 98 / 100],
            usual_speed: moving.get(moving.len() / 2).copied().unwrap_or_default(),
            slow,
            travel: (fold(f64::min), fold(f64::max)),
            position_noise: self.position_noise,
            level: 0.0,
            deceleration: 0.0,
        }
    }

    /// Whether the axis does not move yet at the first sample. What drives it off then was not there before.
    fn begins_at_rest(&self, filter: &Differentiator) -> bool {
        let power = self.v.iter().map(|v| v * v).sum::<f64>() / self.v.len() as f64;
        let noise = self.position_noise * filter.noise_gain_at_end() / self.period;
        self.v[0].abs() <= AT_REST * power.sqrt() + 2.0 * noise
    }

    /// Smooths with the narrowest filter that leaves little enough noise, and returns it. Positions that are sums of a
    /// measured velocity carry its noise, times the period, in every step.
    fn differentiate(&mut self) -> Differentiator {
        let most = ((WIDEST_FILTER / self.period) as usize).min(self.q.len() / 8);
        let mut filters = FILTERS.iter().filter(|half| **half <= most).peekable();
        loop {
            let half = filters.next().copied().unwrap_or(FILTERS[0]);
            let filter = Differentiator::new(half);
            self.v = filter
                .apply(&self.q)
                .iter()
                .map(|d| d / self.period)
                .collect();
            let gain = gain(&filter, self.summed);
            self.velocity_noise = self.position_noise * gain / self.period;
            let power = self.v.iter().map(|v| v * v).sum::<f64>() / self.v.len() as f64;
            if self.velocity_noise <= tolerated(self.summed) * power.sqrt()
                || filters.peek().is_none()
            {
                return filter;
            }
        }
    }

    /// Smooths with a given filter, and returns it.
    fn differentiate_as(&mut self, smoothing: Smoothing) -> Differentiator {
        let half = smoothing.half(self.period);
        let filter = Differentiator::new(half.max(FILTERS[0]).min((self.q.len() - 1) / 2));
        let slopes = filter.apply(&self.q);
        self.v = slopes.iter().map(|d| d / self.period).collect();
        self.position_noise = smoothing.position_noise;
        self.velocity_noise = self.position_noise * gain(&filter, self.summed) / self.period;
        filter
    }

    fn fill_cells(&mut self, motion: Motion) {
        self.cells = self
            .q
            .windows(2)
            .zip(self.v.windows(2))
            .enumerate()
            .map(|(k, (q, v))| {
                let moment = Moment {
                    t: (k as f64 + 0.5) * self.period,
                    dt: self.period,
                    u: 0.0,
                };
                Point::new(
                    motion,
                    0.5 * (q[0] + q[1]),
                    0.5 * (v[0] + v[1]),
                    mean_sign(v[0], v[1]),
                )
                .at(moment)
            })
            .collect();
    }

    /// Samples of a velocity that cannot be told from zero that are a rest: more than the filter reaches to one side.
    fn rest(&self) -> usize {
        self.smoothing.half(self.period) + 1
    }

    /// Rest in stretches in which velocity cannot be told from zero.
    fn find_rest(&mut self) {
        let shortest = self.rest();
        let slow = SLOW * self.velocity_noise;
        self.sliding = vec![1.0; self.cells.len()];
        let mut run = 0;
        for k in 0..=self.cells.len() {
            if k < self.cells.len() && self.cells[k].v.abs() <= slow {
                run += 1;
                continue;
            }
            if run >= shortest {
                self.sliding[k - run..k].fill(0.0);
            }
            run = 0;
        }
    }

    /// Goes on resting where a measured velocity leaves zero next to a rest, in one direction, by no more than its noise may.
    fn rest_on(&mut self) {
        let most = self.velocity_noise * self.extreme();
        let cells: Vec<(bool, f64)> = (self.sliding.iter().zip(&self.cells))
            .map(|(sliding, cell)| (*sliding > 0.0, cell.v))
            .collect();
        let one_way = cells.chunk_by(|a, b| a.0 == b.0 && (!a.0 || a.1.signum() == b.1.signum()));
        let runs: Vec<&[(bool, f64)]> = one_way.collect();
        let rests = |k: usize| runs.get(k).is_some_and(|run| !run[0].0);
        let mut from = 0;
        for (k, run) in runs.iter().enumerate() {
            let beside = k > 0 && rests(k - 1) || rests(k + 1);
            if beside && run.iter().all(|(_, v)| v.abs() <= most) {
                self.sliding[from..from + run.len()].fill(0.0);
            }
            from += run.len();
        }
    }

    /// What noise of a measured velocity comes to in one of [`CHANCE`] recordings, in its standard deviations: a normal deviate lies
    /// beyond `x` with a probability of `e^(−x²/2)` at most, and there are as many as the filter has room beside itself.
    fn extreme(&self) -> f64 {
        let wide = 2 * self.smoothing.half(self.period) + 1;
        let deviates = (self.q.len() / wide).max(1) as f64;
        (2.0 * (CHANCE * deviates).ln()).sqrt()
    }

    /// Stretches of certain direction.
    fn stretches(&self) -> Vec<Stretch> {
        let (slow, rest) = (SLOW * self.velocity_noise, self.rest());
        let mut pieces: Vec<(usize, usize, f64)> = Vec::new();
        for (k, v) in self.v.iter().enumerate().filter(|(_, v)| v.abs() > slow) {
            match pieces.last_mut() {
                Some(last) if last.2 == v.signum() && k - last.1 < rest => last.1 = k + 1,
                _ => pieces.push((k, k + 1, v.signum())),
            }
        }
        let travel = |&(from, to, direction): &(usize, usize, f64)| {
            // Noise of a measured velocity adds up in its integral.
            let steps = if self.summed { to - from } else { 1 };
            let noise = self.position_noise * (steps as f64).sqrt();
            direction * (self.q[to - 1] - self.q[from]) / noise
        };
        let [some, enough] = if self.summed {
            [self.extreme(); 2]
        } else {
            [HALF_A_STEP, CERTAIN_TRAVEL]
        };
        // A filter overshoots where an axis stops short, and before it sets off; there, positions stay where they are.
        let moves = |one_way: &[(usize, usize, f64)]| {
            let moving = |piece: &(usize, usize, f64)| travel(piece) > some;
            let first = one_way.iter().position(moving)?;
            let last = one_way.iter().rposition(moving)?;
            let certain = one_way[first].0..one_way[last].1;
            let (mut from, mut to) = (certain.start, certain.end);
            if first > 0 && from - one_way[first - 1].1 <= self.hidden(from, true) {
                from = one_way[0].0;
            }
            if let Some(next) = one_way.get(last + 1)
                && next.0 - to <= self.hidden(to - 1, false)
            {
                to = one_way[one_way.len() - 1].1;
            }
            let direction = one_way[0].2;
            (travel(&(from, to, direction)) > enough).then_some(Stretch {
                nodes: from..to,
                certain,
                direction,
            })
        };
        let one_way = pieces.chunk_by(|a, b| a.2 == b.2);
        one_way.filter_map(moves).collect()
    }

    /// Nodes up to which a stretch of unknown motion before a node, `ahead` of which an axis moves off, or behind one that it comes up
    /// to, is not [`PLAINLY`] rest: positions may hide that it moves for [`HIDDEN`] times as many as it takes from a certain travel to
    /// four times as much.
    fn hidden(&self, node: usize, ahead: bool) -> usize {
        let certain = CERTAIN_TRAVEL * self.position_noise;
        let off = |travel: f64| self.first_off(self.q[node], travel, node, ahead);
        PLAINLY * HIDDEN * off(4.0 * certain).abs_diff(off(certain))
    }

    /// The first node from one on, or back, that is off a place by a travel, or the last on that side.
    fn first_off(&self, place: f64, travel: f64, from: usize, ahead: bool) -> usize {
        let off = |k: &usize| (self.q[*k] - place).abs() >= travel;
        let last = self.q.len() - 1;
        if ahead {
            (from..=last).find(off).unwrap_or(last)
        } else {
            (0..=from).rev().find(off).unwrap_or(0)
        }
    }

    /// Bars the cells around reversals at which friction is of unknown direction, or none at all, for longer than a share of
    /// `reach` samples, and says how many reversals those are.
    ///
    /// Within a certain travel `x` of where the axis turns, positions do not say whether it still moves. An axis that brakes
    /// evenly takes `√(2x/a)` for that, as long as it has taken from `4x` to `x`, which does show; likewise on the other side.
    /// A rest in between is none of it.
    pub fn bar_unresolved(&mut self, reach: usize) -> usize {
        let travel = CERTAIN_TRAVEL * self.position_noise;
        let longest = UNRESOLVED * reach as f64;
        let stretches = self.stretches();
        let turns = stretches
            .windows(2)
            .filter(|pair| pair[0].direction != pair[1].direction);
        let mut barred = 0;
        for pair in turns {
            let (halt, start) = (pair[0].nodes.end - 1, pair[1].nodes.start);
            let place = 0.5 * (self.q[halt] + self.q[start]);
            let before = |travel| self.first_off(place, travel, halt, false);
            let after = |travel| self.first_off(place, travel, start, true);
            let (from, to) = (before(travel), after(travel));
            let uncertain = from - before(4.0 * travel) + after(4.0 * travel) - to;
            if uncertain as f64 > longest {
                self.barred[from..to].fill(true);
                barred += 1;
            }
        }
        barred
    }

    /// Fits every reversal that has enough motion in one direction on both of its sides, and keeps what describes the
    /// positions at least as well as the filter does.
    fn reversals(&self, filter: &Differentiator, balance: Option<Balance>) -> Vec<Reversal> {
        let stretches = self.stretches();
        let input = balance
            .map(|_| self.input(&Path::default()))
            .unwrap_or_default();
        let drive = balance.map(|balance| Drive {
            input: &input,
            inertia: balance.inertia / (self.period * self.period),
            coulomb: balance.coulomb,
        });
        let half = filter.half();
        let fit = |span: usize, pair: &[Stretch]| {
            let (before, after) = (&pair[0], &pair[1]);
            let (halt, start) = (before.nodes.end, after.nodes.start);
            // Without certain motion on either side the axis may come to rest anywhere.
            let from = before.certain.end.saturating_sub(span);
            let to = after.certain.start + span;
            let nodes = before.nodes.start.max(from)..after.nodes.end.min(to);
            let enough = halt - nodes.start > half && nodes.end - start > half;
            if !enough {
                return None;
            }
            let smooth = filter.variance(&self.q, nodes.clone());
            Reversal::fit(
                &self.q,
                halt - 1,
                start,
                nodes,
                self.position_noise,
                after.direction,
                drive.as_ref(),
            )
            .filter(|reversal| reversal.variance <= smooth)
        };
        stretches
            .windows(2)
            .filter(|pair| pair[0].direction != pair[1].direction)
            .filter_map(|pair| fit(2 * half + 1, pair).or_else(|| fit(half + 1, pair)))
            .collect()
    }

    /// Puts the fitted velocity where the filter's window reached across the reversal.
    fn sharpen(&mut self, reversal: &Reversal, half: usize) {
        let first = reversal
            .nodes
            .start
            .max((reversal.halt as usize).saturating_sub(half));
        let last = (reversal.nodes.end - 1).min(reversal.start.ceil() as usize + half);
        for k in first..=last {
            self.v[k] = reversal.velocity(k as f64) / self.period;
        }
    }

    /// Puts the fitted direction and rest into the cells around a reversal.
    fn place(&mut self, reversal: &Reversal) {
        for k in reversal.nodes.start..reversal.nodes.end - 1 {
            (self.sliding[k], self.cells[k].s) = reversal.cell(k);
        }
    }

    fn bar_gaps(&mut self, t: &[f64]) {
        self.barred = vec![false; self.cells.len()];
        for pair in t.windows(2).filter(|w| w[1] - w[0] > GAP * self.period) {
            let last = self.barred.len() - 1;
            let cell =
                |time: f64| (((time - self.start) / self.period).max(0.0) as usize).min(last);
            let bridge = cell(pair[0])..=cell(pair[1]);
            self.barred[bridge].fill(true);
        }
    }
}

impl Held {
    /// Running integral, up to each of some ascending instants, of what a path makes of the signal, which has stood since
    /// ever at its first value or at zero.
    ///
    /// A lag `y' = (w − y)/τ` gives `∫y = ∫w − τ·(y − y₀)`, exactly.
    fn integral(&self, path: &Path, instants: impl Iterator<Item = f64>) -> Vec<f64> {
        let n = self.t.len();
        let begin = path.pass(self.u[0]);
        let before = if self.fresh { 0.0 } else { begin };
        // The sample that acts, its value, and integral and lagged value at its instant.
        let (mut k, mut w, mut sum, mut y) = (0, begin, 0.0, before);
        instants
            .map(|instant| {
                let time = instant - path.delay;
                if time < self.t[0] {
                    return before * (time - self.t[0]);
                }
                while k + 1 < n && self.t[k + 1] <= time {
                    let h = self.t[k + 1] - self.t[k];
                    sum += w * h;
                    y = path.relax(y, w, h).1;
                    k += 1;
                    w = path.pass(self.u[k]);
                }
                let h = time - self.t[k];
                let lagged = if path.lag > 0.0 && h > 0.0 {
                    path.relax(y, w, h).1
                } else {
                    y
                };
                let smoothed = if path.lag > 0.0 {
                    path.lag * (lagged - before)
                } else {
                    0.0
                };
                sum + w * h - smoothed
            })
            .collect()
    }
}

/// Motion in one direction.
struct Stretch {
    /// Its nodes, with those at its ends at which it may still move.
    nodes: Range<usize>,
    /// Those up to which it certainly does.
    certain: Range<usize>,
    direction: f64,
}

/// Mean of `sgn v` over a cell in which velocity runs linearly from `left` to `right`.
fn mean_sign(left: f64, right: f64) -> f64 {
    let sum = left.abs() + right.abs();
    if sum == 0.0 {
        0.0
    } else if left * right >= 0.0 {
        (left + right).signum()
    } else {
        (left + right) / sum
    }
}

fn integrate(t: &[f64], v: &[f64]) -> Vec<f64> {
    let mut q = vec![0.0; v.len()];
    for k in 1..v.len() {
        q[k] = q[k - 1] + 0.5 * (v[k - 1] + v[k]) * (t[k] - t[k - 1]);
    }
    q
}

/// Cubic interpolation on a uniform grid; slopes from the parabola through three neighbours.
fn resample(t: &[f64], x: &[f64], period: f64) -> Vec<f64> {
    let slope = |k: usize| {
        let (a, b) = (k.max(1) - 1, (k + 1).min(t.len() - 1));
        if a == k || b == k {
            return (x[b] - x[a]) / (t[b] - t[a]);
        }
        let (left, right) = (t[k] - t[a], t[b] - t[k]);
        ((x[k] - x[a]) / left * right + (x[b] - x[k]) / right * left) / (left + right)
    };
    let count = ((t[t.len() - 1] - t[0]) / period + 1e-9) as usize + 1;
    (0..count)
        .map(|i| {
            let time = t[0] + i as f64 * period;
            let k = t.partition_point(|&t_k| t_k <= time).clamp(1, t.len() - 1) - 1;
            let h = t[k + 1] - t[k];
            let r = (time - t[k]) / h;
            let (r2, r3) = (r * r, r * r * r);
            (2.0 * r3 - 3.0 * r2 + 1.0) * x[k]
                + (r3 - 2.0 * r2 + r) * h * slope(k)
                + (3.0 * r2 - 2.0 * r3) * x[k + 1]
                + (r3 - r2) * h * slope(k + 1)
        })
        .collect()
}

/// Largest absolute value of a signal.
fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |a, b| a.max(b.abs()))
}

/// Step of the quantiser behind a signal: the smallest step that it makes, if a hundredth of all repeat it or the others are
/// multiples of it, as those of a signal that nothing quantises are in one of ten cases; else 0. Samples at rest make no
/// steps. Its noise has the variance Δ²/12 while the axis moves.
fn quantum(x: &[f64]) -> f64 {
    let largest = largest(x);
    let steps = x.windows(2).map(|w| (w[1] - w[0]).abs());
    let steps: Vec<f64> = steps.filter(|&d| d > 1e-12 * largest).collect();
    let smallest = steps.iter().copied().fold(f64::INFINITY, f64::min);
    let ratios = || steps.iter().map(|d| d / smallest);
    let repeats = ratios().filter(|r| (r - 1.0).abs() < 1e-3).count();
    let few = ratios().filter(|r| *r < MULTIPLES);
    let multiples = few.clone().filter(|r| (r - r.round()).abs() < OF_A_STEP);
    let (multiples, few) = (multiples.count(), few.count());
    let repeated = repeats > 1 && 100 * repeats > steps.len();
    if repeated || few >= FEWEST_STEPS && 100 * multiples >= 99 * few {
        smallest
    } else {
        0.0
    }
}

/// Standard deviation of the white noise that differences show, quantisation of moving positions among it.
///
/// Differences of order k of white noise of variance σ² have variance C(2k, k)·σ²; their median absolute value,
/// 0.6745·√C(2k, k)·σ, ignores reversals. Motion itself adds to low orders at low sampling rates, so the smallest of three
/// orders counts.
fn white_noise(x: &[f64]) -> f64 {
    let mut differences = x.to_vec();
    let mut white = f64::INFINITY;
    for order in 1..=7 {
        differences = differences.windows(2).map(|w| w[1] - w[0]).collect();
        let central_binomial = match order {
            3 => 20.0,
            5 => 252.0,
            7 => 3432.0_f64,
            _ => continue,
        };
        white = white.min(noise_in(&differences, central_binomial));
    }
    white
}

/// Standard deviation of white noise whose differences of an order are these, and have so many times its variance.
fn noise_in(differences: &[f64], central_binomial: f64) -> f64 {
    let size = median(differences.iter().map(|d| d.abs()).collect());
    size / (0.6745 * central_binomial.sqrt())
}

/// Standard deviation of the noise of a signal that is smooth, or constant for a while, beside it: what its second differences show.
pub fn roughness(x: &[f64]) -> f64 {
    let second = x.windows(3).map(|x| x[2] - 2.0 * x[1] + x[0]);
    noise_in(&second.collect::<Vec<f64>>(), 6.0)
}

/// The upper one of two.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{Held, Track, mean_sign, quantum, resample};
    use crate::effects::Path;
    use crate::motion::Motion;
    use crate::recording::Recording;

    #[test]
    fn a_crossing_inside_a_cell_gives_its_mean_sign() {
        assert_eq!(mean_sign(-1.0, 3.0), 0.5);
        assert_eq!(mean_sign(-1.0, -3.0), -1.0);
        assert_eq!(mean_sign(0.0, 0.0), 0.0);
    }

    #[test]
    fn delayed_input_is_averaged_exactly() {
        let late = Path {
            delay: 0.5,
            ..Path::default()
        };
        let held = held();
        let integral = held.integral(&late, [-0.5, 1.0, 2.0, 4.5].into_iter());
        assert_eq!(integral, [-1.0, 0.5, 2.5, 16.0]);
    }

    fn held() -> Held {
        Held {
            t: vec![0.0, 1.0, 2.0, 3.0],
            u: vec![1.0, 3.0, 5.0, 7.0],
            fresh: false,
        }
    }

    #[test]
    fn nothing_acts_before_the_first_sample_of_an_axis_at_rest() {
        let fresh = Held {
            fresh: true,
            ..held()
        };
        let late = Path {
            delay: 0.5,
            ..Path::default()
        };
        let integral = fresh.integral(&late, [0.0, 0.5, 1.0].into_iter());
        assert_eq!(integral, [0.0, 0.0, 0.5]);
        let path = Path {
            lag: 0.7,
            ..Path::default()
        };
        let step = |t: f64| t - 0.7 * (1.0 - (-t / 0.7).exp());
        let integral = fresh.integral(&path, [0.4].into_iter());
        assert!((integral[0] - step(0.4)).abs() < 1e-14, "{integral:?}");
    }

    /// Against the lag's response to each step, `∫(1 − e^(−t/τ)) dt`.
    #[test]
    fn lagged_input_is_averaged_exactly() {
        let lag = 0.7;
        let path = Path {
            lag,
            ..Path::default()
        };
        let step = |t: f64| t - lag * (1.0 - (-t / lag).exp());
        let integral = held().integral(&path, [0.4, 2.0, 3.6].into_iter());
        let exact = [
            0.4,
            2.0 + 2.0 * step(1.0),
            3.6 + 2.0 * (step(2.6) + step(1.6) + step(0.6)),
        ];
        for (found, exact) in integral.iter().zip(exact) {
            assert!((found - exact).abs() < 1e-14, "{found} {exact}");
        }
    }

    #[test]
    fn resampling_reproduces_parabolas_from_jittered_samples() {
        let t: Vec<f64> = (0..50)
            .map(|k| f64::from(k) + 0.2 * f64::from(k * 7 % 5) / 5.0)
            .collect();
        let x: Vec<f64> = t.iter().map(|t| 0.1 * t * t).collect();
        for (k, y) in resample(&t, &x, 1.0).iter().enumerate().skip(2).take(45) {
            assert!((y - 0.1 * (k as f64).powi(2)).abs() < 1e-9, "{k}: {y}");
        }
    }

    #[test]
    fn quantisation_is_recognised() {
        let q: Vec<f64> = (0..2000)
            .map(|k| ((f64::from(k) * 0.01).sin() * 100.0).floor() * 0.01)
            .collect();
        assert!((quantum(&q) / 0.01 - 1.0).abs() < 1e-6);
        // Nineteen times as long at rest.
        let resting: Vec<f64> = [vec![q[0]; 38_000], q].concat();
        assert!((quantum(&resting) / 0.01 - 1.0).abs() < 1e-6);
        // Up to a thousand counts between samples, hardly ever a single one.
        let fast: Vec<f64> = (0..2000)
            .map(|k| ((f64::from(k) * 0.01).sin() * 1e5).floor() * 0.01)
            .collect();
        assert!((quantum(&fast) / 0.01 - 1.0).abs() < 1e-6);
        // Each step of another size.
        let smooth: Vec<f64> = (0..2000).map(|k| (f64::from(k) * 1e-3).sin()).collect();
        assert_eq!(quantum(&smooth), 0.0);
    }

    #[test]
    fn rest_is_told_from_motion() {
        let t: Vec<f64> = (0..3000).map(|k| f64::from(k) * 1e-3).collect();
        // Moves, rests for a second, moves again; quantised to 0.1 mrad.
        let q = |t: f64| {
            let x = if t < 1.0 {
                t
            } else if t < 2.0 {
                1.0
            } else {
                t - 1.0
            };
            (x * 1e4).floor() * 1e-4
        };
        let recording = Recording {
            path: "rest.csv".into(),
            u: t.iter().map(|t| t.sin()).collect(),
            q: Some(t.iter().map(|&t| q(t)).collect()),
            t,
            ..Recording::default()
        };
        let track = Track::new(&recording, Motion::Rotary, None);
        assert!(track.sliding[1100..1900].iter().all(|&s| s == 0.0));
        assert!(track.sliding[100..900].iter().all(|&s| s == 1.0));
    }

    /// It brakes and stops with a jerk, of which the filter makes a little motion back; after a while it does move back.
    #[test]
    fn rest_before_a_reversal_is_none_of_it() {
        let t: Vec<f64> = (0..1000).map(|k| f64::from(k) * 2e-3).collect();
        let q = |t: f64| 0.5 * (2.0 * (1.001 - t).max(0.0).powi(2) + (t - 1.3).max(0.0).powi(2));
        let recording = Recording {
            path: "stop.csv".into(),
            u: vec![0.0; t.len()],
            q: Some(t.iter().map(|&t| -(q(t) / 1e-7).round() * 1e-7).collect()),
            t,
            ..Recording::default()
        };
        let track = Track::new(&recording, Motion::Rotary, None);
        assert!(track.sliding[502..648].iter().all(|&s| s == 0.0));
        assert!(track.sliding[..499].iter().all(|&s| s == 1.0));
        assert!(track.sliding[652..].iter().all(|&s| s == 1.0));
    }

    /// It stops and rests for 0.7 s, in which noise flickers by a count now and then; only then does it move back.
    #[test]
    fn a_flicker_in_a_rest_is_no_motion() {
        const COUNT: f64 = 2.4e-5;
        let t: Vec<f64> = (0..1200).map(|k| f64::from(k) * 2e-3).collect();
        let place = |t: f64| 7.0 * ((1.001 - t).max(0.0).powi(2) + (t - 1.7).max(0.0).powi(2));
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut seen = |t: f64| {
                let counts = match rng.random_bool(0.1) {
                    true if rng.random_bool(0.5) => 1.0,
                    true => -1.0,
                    false => 0.0,
                };
                ((place(t) / COUNT).round() + counts) * COUNT
            };
            let recording = Recording {
                path: "flicker.csv".into(),
                u: vec![0.0; t.len()],
                q: Some(t.iter().map(|&t| seen(t)).collect()),
                t: t.clone(),
                ..Recording::default()
            };
            let sliding = Track::new(&recording, Motion::Rotary, None).sliding;
            let rests = sliding[505..845].iter().filter(|&&s| s == 0.0).count();
            assert!(rests > 320, "seed {seed}: {rests} of 340 rest");
            assert!(sliding[..499].iter().all(|&s| s == 1.0));
            assert!(sliding[855..].iter().all(|&s| s == 1.0));
        }
    }

    /// At 1 rad/s² a coarse encoder hides some 50 ms on either side of the halt, a fine one 5 ms, and a rest is no part of it.
    #[test]
    fn reversals_too_slow_for_the_encoder_are_barred() {
        let barred = |step: f64, rest: f64| {
            let t: Vec<f64> = (0..2500).map(|k| f64::from(k) * 1e-3).collect();
            let off = |t: f64| (1.0 - t).max(0.0) + (t - 1.0 - rest).max(0.0);
            let q = t
                .iter()
                .map(|&t| (-0.5 * off(t).powi(2) / step).round() * step);
            let recording = Recording {
                path: "turn.csv".into(),
                u: vec![0.0; t.len()],
                q: Some(q.collect()),
                t,
                ..Recording::default()
            };
            let mut track = Track::new(&recording, Motion::Rotary, None);
            let turns = track.bar_unresolved(100);
            let cells = track.barred.iter().filter(|b| **b).count();
            assert_eq!(turns > 0, cells > 0);
            assert!(cells == 0 || track.barred[1000]);
            cells
        };
        assert_eq!(barred(1e-5, 0.0), 0);
        assert_eq!(barred(1e-5, 0.5), 0);
        assert!((60..130).contains(&barred(1e-3, 0.0)));
        assert!((560..630).contains(&barred(1e-3, 0.5)));
    }
}
