//! The Coulomb level by least squares on rows of the weak form.

use super::Adaptation;
use crate::Scalar;
use crate::weak::Kernel;

/// Samples on either side of the centre of a window.
const REACH: usize = 16;
/// Samples that a window has intervals between.
const INTERVALS: usize = 2 * REACH;

/// The weights of a window and the gains of the recursion, computed once.
///
/// A window of test function φ turns `J·v̇ = τ − Fc·s − o`, in which the axis slides in the direction `s` all the time
/// and `τ` is everything known, into one row `∫τφ − J·∫q φ̈ = Fc·s + o`: nothing measured is differentiated. Windows
/// overlap by half. Recursive least squares take the row in,
/// `g = P·x/(1 + xᵀ·P·x)`, `θ ← θ + g·(y − xᵀθ)`, `P ← P − g·xᵀ·P`, with `x = (s, 1)`, `θ = (Fc, o)` and the row's noise
/// as the unit of `P`.
///
/// # Forgetting without wind-up
/// After each row, and never without one, a share of the prior comes back: `P ← P + (1 − λ)·(P₀ − P)`. As every `P` is
/// then between zero and `P₀`, the gain `xᵀ·g` stays between 0 and 1, so that a row always brings the prediction nearer
/// to what it says, whatever λ from 0 to 1: the recursion is stable without a condition, cannot burst after
/// a rest, and cannot fall asleep. A direction that is not driven keeps what it knows but for what the prior makes
/// likely: that a change of friction is a change of `Fc` rather than of `o`.
///
/// # Excitation
/// A row counts only if the axis has moved in one direction, faster than [`Adaptation::speed`], in all of its window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rows<T> {
    acceleration: [T; INTERVALS + 1],
    hold: [T; INTERVALS],
    /// Samples of the controller to one of a window.
    every: i32,
    /// One over that.
    mean: T,
    /// Torque per weighted count.
    torque_per_count: T,
    /// `1 − λ`.
    forgotten: T,
    /// Diagonal of `P₀`.
    prior: [T; 2],
}

/// What the windows and the recursion remember.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RowState<T> {
    windows: [Window<T>; 2],
    /// Samples since the last one that the windows took.
    since: i32,
    /// Sum of torques since then.
    sum: T,
    /// `P`: the variances of `Fc` and `o`, and their covariance.
    variance: [T; 3],
}

/// A window in the making.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window<T> {
    /// Samples taken; below zero until its turn comes.
    taken: i32,
    start: i32,
    torque: T,
    way: T,
    /// Direction all along, zero once that is lost.
    direction: T,
}

impl<T: Scalar> Window<T> {
    fn new(taken: i32) -> Self {
        Self {
            taken,
            start: 0,
            torque: T::ZERO,
            way: T::ZERO,
            direction: T::ZERO,
        }
    }
}

impl<T: Scalar> RowState<T> {
    pub fn new(rows: &Rows<T>) -> Self {
        Self {
            windows: [Window::new(0), Window::new(-(REACH as i32))],
            since: 0,
            sum: T::ZERO,
            variance: [rows.prior[0], rows.prior[1], T::ZERO],
        }
    }
}

/// What a sample shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<T> {
    pub counts: i32,
    pub velocity: T,
    /// Everything known that acted since the last sample, N·m or N.
    pub torque: T,
}

impl<T: Scalar> Rows<T> {
    pub fn new(adaptation: &Adaptation<T>, period: T, inertia: T, count: T) -> Self {
        let reach = T::from_i32(REACH as i32);
        let wide = adaptation.window.half() / period;
        let every = (wide / reach + T::ONE.half()).floor().max(1);
        // In units of half a window all weights lie around 1.
        let kernel = Kernel::new(REACH, T::ONE / reach);
        let mut acceleration = [T::ZERO; INTERVALS + 1];
        let mut hold = [T::ZERO; INTERVALS];
        kernel.acceleration(&mut acceleration);
        kernel.hold(&mut hold);
        let half_width = reach * T::from_i32(every) * period;
        let certain = T::from_i32(16);
        Self {
            acceleration,
            hold,
            every,
            mean: T::ONE / T::from_i32(every),
            torque_per_count: inertia / half_width * (count / half_width),
            forgotten: adaptation.forgotten,
            prior: [certain, certain * adaptation.offset * adaptation.offset],
        }
    }

    /// Takes a sample in; where it completes a row, the level and the offset `(Fc, o)` are brought forward.
    pub fn sample(&self, state: &mut RowState<T>, seen: Seen<T>, slowest: T, theta: &mut [T; 2]) {
        let direction = if seen.velocity.abs() > slowest {
            seen.velocity.sign()
        } else {
            T::ZERO
        };
        state.sum += seen.torque;
        state.since += 1;
        let whole = state.since >= self.every;
        let torque = state.sum * self.mean;
        if whole {
            state.sum = T::ZERO;
            state.since = 0;
        }
        let RowState {
            windows, variance, ..
        } = state;
        for window in windows {
            if window.direction != direction {
                window.direction = T::ZERO;
            }
            if whole && let Some(row) = self.extend(window, seen.counts, torque, direction) {
                self.learn(variance, row, theta);
            }
        }
    }

    /// Adds a sample to a window; the row `(s, y)` if that was the last one of a window with a direction.
    fn extend(
        &self,
        window: &mut Window<T>,
        counts: i32,
        torque: T,
        direction: T,
    ) -> Option<(T, T)> {
        let Ok(k) = usize::try_from(window.taken) else {
            window.taken += 1;
            return None;
        };
        if k == 0 {
            window.start = counts;
            window.direction = direction;
        } else if let Some(&weight) = self.hold.get(k - 1) {
            window.torque += weight * torque;
        }
        if let Some(&weight) = self.acceleration.get(k) {
            window.way += weight * T::from_i32(counts.wrapping_sub(window.start));
        }
        window.taken += 1;
        if k < INTERVALS {
            return None;
        }
        let row = (
            window.direction,
            window.torque - self.torque_per_count * window.way,
        );
        // The next window of this turn begins where this one ends.
        *window = Window::new(1);
        window.start = counts;
        window.direction = direction;
        (row.0 != T::ZERO).then_some(row)
    }

    /// The recursion.
    fn learn(&self, [pc, po, pco]: &mut [T; 3], (s, y): (T, T), [level, offset]: &mut [T; 2]) {
        // P·x with x = (s, 1), and xᵀ·P·x.
        let (gc, go) = (*pc * s + *pco, *pco * s + *po);
        let scale = T::ONE / (T::ONE + gc * s + go);
        let error = y - *level * s - *offset;
        *level += gc * scale * error;
        *offset += go * scale * error;
        let share = self.forgotten;
        let back = |p: T, prior: T| p + share * (prior - p);
        *pc = back(*pc - gc * gc * scale, self.prior[0]);
        *po = back(*po - go * go * scale, self.prior[1]);
        *pco = back(*pco - gc * go * scale, T::ZERO);
    }
}
