//! When an axis halts before a reversal and when it moves on.
//!
//! A filter wider than a reversal rounds the kink that friction puts there: it shifts the instant of the sign
//! change, and friction times the shift is an impulse in the weak form. So each reversal is fitted by itself:
//! `q = c + a·x² + b·x³` with `x = (halt − t)₊` before it and likewise with `(t − start)₊` after it, and rest in
//! between. Velocity is zero at both instants by construction.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};

/// A fitted reversal; instants are in sampling intervals from node 0.
#[derive(Clone, Debug)]
pub(super) struct Reversal {
    /// The axis halts.
    pub halt: f64,
    /// It moves on the other way; equals `halt` where no rest can be told.
    pub start: f64,
    /// Direction after the reversal.
    pub direction: f64,
    /// Variance of the noise as this fit sees it: the sum of squares that it leaves, per degree of freedom.
    pub variance: f64,
    /// How long the axis may rest without the positions showing it, sampling intervals; 0 if it rests.
    pub doubt: f64,
    /// Nodes that were fitted.
    pub nodes: Range<usize>,
    coefficients: Coefficients,
    scale: f64,
}

/// `c`, then `a, b` and, where used, the fourth power, before; the same after; in powers of `x/scale`.
type Coefficients = SVector<f64, 7>;

/// A form of reversal: its highest power, and whether it rests.
#[derive(Clone, Copy)]
struct Form {
    quartic: bool,
    rests: bool,
}

/// The fourth powers are there so that mere curvature is not taken for rest.
const FORMS: [Form; 3] = [
    Form {
        quartic: false,
        rests: false,
    },
    Form {
        quartic: true,
        rests: false,
    },
    Form {
        quartic: false,
        rests: true,
    },
];
/// Instants that are tried first, evenly over the stretch of uncertain direction.
const GRID: usize = 9;
/// The search for the instants ends at this share of a sampling interval.
const RESOLUTION: f64 = 0.02;

impl Form {
    fn parameters(self) -> f64 {
        let powers = if self.quartic { 6.0 } else { 4.0 };
        1.0 + powers + if self.rests { 2.0 } else { 1.0 }
    }
}

impl Reversal {
    /// Fits the reversal between nodes `before` and `after`, whose directions are certain and opposite, to the positions
    /// at `nodes`. Of three forms the one with the lowest Bayesian information criterion is taken.
    ///
    /// `noise` is the standard deviation of the positions. A `drive` decides on rests that the positions are too coarse
    /// to show. `None` if the motion is not of this form.
    pub fn fit(
        q: &[f64],
        before: usize,
        after: usize,
        nodes: Range<usize>,
        noise: f64,
        direction: f64,
        drive: Option<&Drive>,
    ) -> Option<Self> {
        let count = nodes.len() as f64;
        let data = Data::new(q, nodes.clone());
        let (before, after) = (before as f64, after as f64);
        let driven = |before: f64, after: f64| {
            drive.and_then(|drive| data.search_driven(drive, direction, before, after))
        };
        let rests = |driven: &(Instants, f64)| driven.0[1] > driven.0[0];
        let shown = driven(before, after);
        // Positions that flicker between two counts seem to move on after the halt. Where the drive lets go after none that they
        // show, it may after an earlier one, for them to decide.
        let earlier = shown.is_none().then(|| driven(data.first, before));
        let earlier = earlier.flatten().filter(rests);
        let shown = shown.filter(rests);
        let candidates = FORMS
            .iter()
            .filter(|form| count > form.parameters() + 1.0 && (form.rests || shown.is_none()));
        let mut fits: Vec<(Form, Instants, f64)> = candidates
            .filter_map(|&form| {
                data.search(form, before, after)
                    .map(|(at, rss)| (form, at, rss))
            })
            .filter(|(form, at, _)| !form.rests || data.rest_shows(*at, noise))
            .collect();
        let driven = shown.into_iter().chain(earlier);
        fits.extend(driven.map(|(at, rss)| (FORMS[0], at, rss)));
        let variance = |fit: &(Form, Instants, f64)| fit.2 / (count - fit.0.parameters());
        let least = fits.iter().map(variance).fold(f64::INFINITY, f64::min);
        let unit = least.max(noise * noise).max(f64::MIN_POSITIVE);
        let criterion =
            |fit: &(Form, Instants, f64)| fit.2 / unit + fit.0.parameters() * count.ln();
        let best = fits
            .iter()
            .min_by(|a, b| criterion(a).total_cmp(&criterion(b)))?;
        let (form, [halt, start], _) = *best;
        let reversal = Self {
            halt,
            start,
            direction,
            variance: variance(best),
            doubt: if start > halt {
                0.0
            } else {
                data.dwell([halt, start], noise)
            },
            nodes: nodes.clone(),
            coefficients: data.solve(form, [halt, start])?.0,
            scale: data.scale,
        };
        let inside = halt >= nodes.start as f64 && start <= (nodes.end - 1) as f64;
        let one_way = |range: Range<usize>, sign: f64| {
            range
                .into_iter()
                .all(|k| sign * reversal.velocity(k as f64) >= -noise)
        };
        (inside
            && one_way(nodes.start..halt as usize, -direction)
            && one_way(start.ceil() as usize..nodes.end, direction))
        .then_some(reversal)
    }

    /// Velocity at an instant, per sampling interval.
    pub fn velocity(&self, at: f64) -> f64 {
        let slope = |x: f64, from: usize| {
            let (a, b, c) = (
                self.coefficients[from],
                self.coefficients[from + 1],
                self.coefficients[from + 2],
            );
            x * (2.0 * a + x * (3.0 * b + x * 4.0 * c)) / self.scale
        };
        if at < self.halt {
            -slope((self.halt - at) / self.scale, 1)
        } else if at > self.start {
            slope((at - self.start) / self.scale, 4)
        } else {
            0.0
        }
    }

    /// Share of the interval from node `k` to the next in which the axis slides, and the mean direction while it does.
    pub fn cell(&self, k: usize) -> (f64, f64) {
        let left = k as f64;
        let before = (self.halt - left).clamp(0.0, 1.0);
        let after = (left + 1.0 - self.start).clamp(0.0, 1.0);
        let sliding = before + after;
        if sliding > 0.0 {
            (
                sliding.min(1.0),
                self.direction * (after - before) / sliding,
            )
        } else {
            (0.0, 0.0)
        }
    }
}

/// The drive around a reversal and what it takes to move the axis, all in units of `u`.
///
/// Up to the halt the axis brakes by `J·a = k·u·σ + Fc + …`, with `σ` the direction after the reversal and whatever else
/// acts in `…`, which stays the same at rest. So it rests until `k·σ·(u − u(halt)) ≥ 2·Fc − J·a`: not at all if braking
/// alone is stronger than twice the friction.
pub(super) struct Drive<'a> {
    /// Mean of `u` in every cell.
    pub input: &'a [f64],
    /// `J/k`, per position and squared sampling interval.
    pub inertia: f64,
    /// `Fc/k`.
    pub coulomb: f64,
}

impl Drive<'_> {
    /// When an axis that halts after braking at `braking` moves on, `latest` at most.
    fn start(&self, halt: f64, braking: f64, direction: f64, latest: f64) -> f64 {
        let missing = 2.0 * self.coulomb - self.inertia * braking;
        if missing <= 0.0 {
            return halt;
        }
        let first = (halt.max(0.0) as usize).min(self.input.len() - 1);
        let last = (latest as usize).min(self.input.len());
        let at_halt = self.input[first];
        let moves_on = |cell: &usize| direction * (self.input[*cell] - at_halt) >= missing;
        let start = (first..last).find(moves_on).map_or(latest, |k| k as f64);
        start.max(halt)
    }
}

/// Sums over the nodes on one side of a rest: no product of the two sides differs from zero.
#[derive(Default)]
struct Side {
    /// `Σ x²` to `Σ x⁸`.
    powers: [f64; 7],
    /// `Σ x²·q` to `Σ x⁴·q`.
    products: [f64; 3],
}

impl Side {
    /// Sums over nodes with their distance from the rest; the highest power of a form takes the last two.
    fn of(nodes: impl Iterator<Item = (f64, f64)>, form: Form) -> Self {
        let mut side = Self::default();
        for (x, q) in nodes {
            let x2 = x * x;
            let (x3, x4) = (x2 * x, x2 * x2);
            let powers = [x2, x3, x4, x4 * x, x4 * x2];
            let sums = side.powers.iter_mut().zip(powers);
            sums.for_each(|(sum, power)| *sum += power);
            side.products[0] += x2 * q;
            side.products[1] += x3 * q;
            if form.quartic {
                side.powers[5] += x4 * x3;
                side.powers[6] += x4 * x4;
                side.products[2] += x4 * q;
            }
        }
        side
    }

    /// Writes the normal equations of the coefficients from position `from` on.
    fn enter(
        &self,
        form: Form,
        from: usize,
        gram: &mut SMatrix<f64, 7, 7>,
        right: &mut Coefficients,
    ) {
        let used = if form.quartic { 3 } else { 2 };
        for i in 0..used {
            right[from + i] = self.products[i];
            (gram[(0, from + i)], gram[(from + i, 0)]) = (self.powers[i], self.powers[i]);
            // The product of x^(i + 2) and x^(j + 2) is x^(i + j + 4).
            (0..used).for_each(|j| gram[(from + i, from + j)] = self.powers[i + j + 2]);
        }
        if !form.quartic {
            gram[(from + 2, from + 2)] = 1.0;
        }
    }
}

/// Positions around one reversal.
struct Data {
    /// Relative to the first.
    q: Vec<f64>,
    origin: f64,
    /// Of the relative positions.
    sum: f64,
    squares: f64,
    first: f64,
    scale: f64,
}

impl Data {
    fn new(q: &[f64], nodes: Range<usize>) -> Self {
        let (first, count) = (nodes.start as f64, nodes.len() as f64);
        let origin = q[nodes.start];
        let q: Vec<f64> = q[nodes].iter().map(|q| q - origin).collect();
        Self {
            sum: q.iter().sum(),
            squares: q.iter().map(|q| q * q).sum(),
            q,
            origin,
            first,
            scale: (0.5 * count).max(1.0),
        }
    }

    /// Sums over the nodes before a halt.
    fn before(&self, form: Form, halt: f64) -> Side {
        let nodes = self.q[..self.node(halt.ceil())].iter().enumerate();
        let distant = nodes.map(|(k, &q)| ((halt - (self.first + k as f64)) / self.scale, q));
        Side::of(distant, form)
    }

    /// Sums over the nodes after a start.
    fn after(&self, form: Form, start: f64) -> Side {
        let from = self.node(start.floor() + 1.0);
        let nodes = (from..).zip(&self.q[from..]);
        let distant = nodes.map(|(k, &q)| ((self.first + k as f64 - start) / self.scale, q));
        Side::of(distant, form)
    }

    /// Position of a node among those that are fitted, or of the end that is nearest.
    fn node(&self, instant: f64) -> usize {
        ((instant - self.first).max(0.0) as usize).min(self.q.len())
    }

    /// Least squares for given instants: coefficients and the sum of squares.
    fn solve(&self, form: Form, [halt, start]: Instants) -> Option<(Coefficients, f64)> {
        self.solve_sides(form, &self.before(form, halt), &self.after(form, start))
    }

    fn solve_sides(&self, form: Form, before: &Side, after: &Side) -> Option<(Coefficients, f64)> {
        let mut gram = SMatrix::<f64, 7, 7>::zeros();
        let mut right = Coefficients::zeros();
        (gram[(0, 0)], right[0]) = (self.q.len() as f64, self.sum);
        // A power that is not used has a zero column; so has a side without nodes, which is refused.
        before.enter(form, 1, &mut gram, &mut right);
        after.enter(form, 4, &mut gram, &mut right);
        let mut coefficients = gram.cholesky()?.solve(&right);
        let rss = (self.squares - coefficients.dot(&right)).max(0.0);
        coefficients[0] += self.origin;
        Some((coefficients, rss))
    }

    /// Whether the axis rests for longer than its position would stay within one step of a quantiser anyway.
    fn rest_shows(&self, at: Instants, noise: f64) -> bool {
        at[1] - at[0] > self.dwell(at, noise)
    }

    /// How long the position stays within one step of a quantiser: `√(2Δ/a)` on either side, `Δ = √12·noise`.
    fn dwell(&self, at: Instants, noise: f64) -> f64 {
        let Some((coefficients, _)) = self.solve(FORMS[2], at) else {
            return f64::INFINITY;
        };
        let step = 12f64.sqrt() * noise;
        let side = |a: f64| self.scale * (step / a.abs().max(f64::MIN_POSITIVE)).sqrt();
        side(coefficients[1]) + side(coefficients[4])
    }

    /// Halt and start where the drive says when the axis lets go, by a search for the halt alone.
    fn search_driven(
        &self,
        drive: &Drive,
        direction: f64,
        before: f64,
        after: f64,
    ) -> Option<(Instants, f64)> {
        let value = |halt: f64| {
            let mut at = [halt, halt];
            // The start moves the fit of the braking, and that the start: one repetition settles it.
            for _ in 0..2 {
                let (coefficients, _) = self.solve(FORMS[0], at)?;
                let braking = 2.0 * direction * coefficients[1] / (self.scale * self.scale);
                at[1] = drive.start(
                    halt,
                    braking,
                    direction,
                    self.first + self.q.len() as f64 - 1.0,
                );
            }
            self.solve(FORMS[0], at).map(|(_, rss)| (at, rss))
        };
        let lowest = |halts: &mut dyn Iterator<Item = f64>| {
            halts.filter_map(value).min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let mut step = (after - before) / (GRID - 1) as f64;
        let mut best = lowest(&mut (0..GRID).map(|k| before + k as f64 * step))?;
        while step > RESOLUTION {
            let halt = best.0[0];
            match lowest(&mut [halt - step, halt + step].into_iter()).filter(|n| n.1 < best.1) {
                Some(next) => best = next,
                None => step *= 0.5,
            }
        }
        Some(best)
    }

    /// Compass search for the instants, from the best of a grid between `before` and `after`.
    fn search(&self, form: Form, before: f64, after: f64) -> Option<(Instants, f64)> {
        // Pairs of the instants from a step back, here and a step on.
        const MOVES: [[usize; 2]; 6] = [[2, 2], [0, 0], [2, 1], [0, 1], [1, 2], [1, 0]];
        let moves = if form.rests { &MOVES } else { &MOVES[..2] };
        let mut step = (after - before) / (GRID - 1) as f64;
        let instants: Vec<f64> = (0..GRID).map(|k| before + k as f64 * step).collect();
        let pairs = (0..GRID).flat_map(|halt| {
            let latest = if form.rests { GRID - 1 } else { halt };
            (halt..=latest).map(move |start| [halt, start])
        });
        let pairs: Vec<[usize; 2]> = pairs.collect();
        let mut best = self.lowest(form, [&instants, &instants], &pairs)?;
        while step > RESOLUTION {
            let [halts, starts] = best.0.map(|at| [at - step, at, at + step]);
            match self
                .lowest(form, [&halts, &starts], moves)
                .filter(|next| next.1 < best.1)
            {
                Some(next) => best = next,
                None => step *= 0.5,
            }
        }
        Some(best)
    }

    /// The best of some pairs of halts and starts, by their places.
    fn lowest(
        &self,
        form: Form,
        [halts, starts]: [&[f64]; 2],
        pairs: &[[usize; 2]],
    ) -> Option<(Instants, f64)> {
        let befores = halts.iter().map(|&halt| self.before(form, halt));
        let afters = starts.iter().map(|&start| self.after(form, start));
        let (befores, afters): (Vec<Side>, Vec<Side>) = (befores.collect(), afters.collect());
        let value = |&[i, j]: &[usize; 2]| {
            let (_, rss) = (starts[j] >= halts[i])
                .then(|| self.solve_sides(form, &befores[i], &afters[j]))
                .flatten()?;
            Some(([halts[i], starts[j]], rss))
        };
        let values = pairs.iter().filter_map(value);
        values.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Halt and start.
type Instants = [f64; 2];

#[cfg(test)]
mod tests {
    use super::{Drive, Reversal};

    /// Brakes at 30 rad/s², rests, and accelerates at 8 rad/s² the other way; sampled at 1 kHz, quantised.
    fn positions(halt: f64, start: f64, count: f64) -> Vec<f64> {
        (0..200)
            .map(|k| f64::from(k) * 1e-3)
            .map(|t| -15.0 * (halt - t).max(0.0).powi(2) - 4.0 * (t - start).max(0.0).powi(2))
            .map(|q| {
                if count > 0.0 {
                    (q / count).floor() * count
                } else {
                    q
                }
            })
            .collect()
    }

    #[test]
    fn finds_a_rest_and_its_ends() {
        let q = positions(0.0803, 0.1107, 0.0);
        let found = Reversal::fit(&q, 76, 116, 50..140, 1e-7, -1.0, None).unwrap();
        assert!(
            (found.halt - 80.3).abs() < 0.2 && (found.start - 110.7).abs() < 0.2,
            "{found:?}"
        );
        assert_eq!(found.cell(95), (0.0, 0.0));
        assert!((found.velocity(130.0) * 1e3 + 8.0 * 0.0193).abs() < 0.01);
    }

    #[test]
    fn finds_the_instant_of_a_kink_through_a_quantiser() {
        let count = 1e-3;
        let q = positions(0.0804, 0.0804, count);
        let found = Reversal::fit(&q, 76, 88, 50..112, count / 12f64.sqrt(), -1.0, None).unwrap();
        assert!(
            (found.halt - 80.4).abs() < 3.0 && found.start - found.halt < 8.0,
            "{found:?}"
        );
    }

    /// A count that flickers long after the halt; the drive falls evenly, and lets go after 200 samples.
    #[test]
    fn a_rest_that_begins_before_the_last_count_is_found() {
        let (halt, start) = (100.0, 300.0);
        let q: Vec<f64> = (0..400)
            .map(|k| {
                let (before, after) = (halt - f64::from(k), f64::from(k) - start);
                let moved = before.max(0.0).powi(2) + after.max(0.0).powi(2);
                (-1e-3 * moved / 1e-2).round() * 1e-2 - if k == 155 { 1e-2 } else { 0.0 }
            })
            .collect();
        let input: Vec<f64> = (0..400).map(|k| -0.01 * f64::from(k)).collect();
        let drive = Drive {
            input: &input,
            inertia: 1.0,
            coulomb: 1.001,
        };
        let found = Reversal::fit(&q, 155, 309, 60..340, 3e-3, -1.0, Some(&drive)).unwrap();
        assert!(
            (found.halt - halt).abs() < 5.0 && (found.start - start).abs() < 5.0,
            "{found:?}"
        );
    }

    #[test]
    fn motion_of_another_form_is_refused() {
        // Two reversals where one is expected.
        let q: Vec<f64> = (0..90).map(|k| (f64::from(k) * 0.2).sin()).collect();
        assert!(Reversal::fit(&q, 40, 50, 5..85, 1e-6, 1.0, None).is_none());
    }
}
