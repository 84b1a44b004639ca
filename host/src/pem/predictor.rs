//! The one-step predictor: the simulator's own step, corrected by what each reading shows, and its sensitivities.

use nalgebra::{Matrix3, Vector3};

use super::sequence::{Sequence, vector};
use crate::axis::Axis;
use crate::simulate::Hold;
use crate::step::Memory;

/// Perturbations of the state that one-step derivatives are taken with, over the RMS speed and over the largest
/// deflection: the square root of rounding, about.
const SMALL: f64 = 1e-6;

/// What a reading does to the state: `x ← x + K·e`, with `e` of variance `s` in units of a single reading's noise.
#[derive(Clone, Copy, Debug)]
pub struct Gain {
    correction: Vector3<f64>,
    /// `s`.
    pub variance: f64,
}

/// How corrections are weighed.
#[derive(Clone, Copy)]
pub enum Weighing<'a> {
    /// By an extended Kalman filter, under white torque noise that adds this many N·m or N over a sample, as a share
    /// of the noise of a single reading.
    Filter(f64),
    /// Not at all: the axis runs freely from the measured states.
    Free,
    /// As a filter did before, sample by sample.
    Given(&'a [Gain]),
}

/// An axis, and the same with one parameter moved a little.
pub struct Family {
    pub axis: Axis,
    /// Axes with the steps that lead to them, one for each free parameter; empty where no derivatives are wanted.
    pub moved: Vec<(Axis, f64)>,
    /// Whether the motion depends on the position, and not on its changes alone.
    pub placed: bool,
}

/// What a pass over a sequence finds.
#[derive(Default)]
pub struct Pass {
    /// Innovations over the root of their variance.
    pub residuals: Vec<f64>,
    /// Derivatives of the residuals, one row for each.
    pub slopes: Vec<f64>,
    /// Gains used, one for each residual.
    pub gains: Vec<Gain>,
    /// Sample that each residual belongs to.
    pub samples: Vec<usize>,
    /// What each residual counts for: a reading that repeats is one reading.
    pub counts: Vec<f64>,
    /// Sum of the variances that sensors and torque noise give the innovations, in units of a single reading's noise.
    pub expected: f64,
}

impl Pass {
    /// Innovations over the noise of a single reading.
    pub fn errors(&self) -> impl Iterator<Item = f64> {
        let pairs = self.residuals.iter().zip(&self.gains);
        pairs.map(|(r, gain)| r * gain.variance.sqrt())
    }
}

/// One sampling interval of a sequence.
#[derive(Clone, Copy)]
struct Interval<'a> {
    sequence: &'a Sequence<'a>,
    k: usize,
    hold: Hold,
}

impl Interval<'_> {
    fn step(&mut self, axis: &Axis, x: &Vector3<f64>, load: f64) -> Vector3<f64> {
        let recording = self.sequence.recording;
        let from = Memory {
            x: [x[0], x[1]],
            z: x[2],
        };
        let drive = (&recording.t[..], &recording.u[..]);
        vector(&self.hold.advance(axis, drive, self.k, load, from))
    }

    /// `∂x⁺/∂x`, by differences of one step.
    fn transition(&self, family: &Family, x: &Vector3<f64>, next: &Vector3<f64>) -> Matrix3<f64> {
        let axis = &family.axis;
        let bent = axis
            .contact
            .bristles()
            .map(|law| law.level(0.0) / law.stiffness());
        // Most axes move the same way wherever they are.
        let mut a = Matrix3::zeros();
        a[(0, 0)] = 1.0;
        let sizes = [
            family.placed.then_some(self.sequence.speed),
            Some(self.sequence.speed),
            bent,
        ];
        for (j, size) in sizes.into_iter().enumerate() {
            let Some(h) = size.map(|size| SMALL * size.max(1e-9)) else {
                continue;
            };
            let mut moved = *x;
            moved[j] += h;
            let mut interval = *self;
            a.set_column(j, &((interval.step(axis, &moved, 0.0) - next) / h));
        }
        a
    }

    /// What torque noise of one standard deviation does to the state: the difference over its whole size, as below
    /// break-away a small torque does nothing and a larger one may do much.
    fn noise(&self, axis: &Axis, x: &Vector3<f64>, torque: f64) -> Vector3<f64> {
        let to = |load: f64| {
            let mut interval = *self;
            interval.step(axis, x, load)
        };
        (to(torque) - to(-torque)) / 2.0
    }
}

/// Predicts every reading of a sequence from those before it.
///
/// `x⁻ = f(x⁺, u)`, `e = y − H·x⁻`, `x⁺ = x⁻ + K·e`, and for the sensitivities `∂x⁻ = A·∂x⁺ + ∂f/∂θ`, `∂x⁺ = (I − K·H)·∂x⁻`
/// at given gains.
pub fn pass(sequence: &Sequence, family: &Family, weighing: Weighing) -> Pass {
    let axis = &family.axis;
    let mut pass = Pass::default();
    let (t, u) = (&sequence.recording.t, &sequence.recording.u);
    let mut x = Vector3::zeros();
    let mut spread = Matrix3::zeros();
    let mut slopes = vec![Vector3::zeros(); family.moved.len()];
    let mut hold = Hold::default();
    for k in 0..sequence.readings.len() {
        if sequence.restarts[k] {
            let (state, covariance) = sequence.begin(k, axis);
            x = Sequence::at_ease(axis, state);
            spread = covariance;
            for (slope, (moved, h)) in slopes.iter_mut().zip(&family.moved) {
                *slope = (Sequence::at_ease(moved, state) - x) / *h;
            }
            hold = Hold::at(t, u, k, state.v, &axis.path);
            continue;
        }
        let from = Interval {
            sequence,
            k: k - 1,
            hold,
        };
        let mut now = from;
        let next = now.step(axis, &x, 0.0);
        hold = now.hold;
        let known = matches!(weighing, Weighing::Given(_));
        let transition = if !known || !slopes.is_empty() {
            from.transition(family, &x, &next)
        } else {
            Matrix3::zeros()
        };
        for (slope, (moved, h)) in slopes.iter_mut().zip(&family.moved) {
            let mut own = Interval {
                sequence,
                k: k - 1,
                hold: if moved.path == axis.path {
                    from.hold
                } else {
                    Hold::at(t, u, k - 1, x[1], &moved.path)
                },
            };
            *slope = transition * *slope + (own.step(moved, &x, 0.0) - next) / *h;
        }
        let gain = match weighing {
            Weighing::Given(gains) => gains[pass.gains.len()],
            Weighing::Filter(share) => {
                let longer = sequence.period / (t[k] - t[k - 1]);
                let torque = share * sequence.noise * longer.sqrt();
                let noise = from.noise(axis, &x, torque) / sequence.noise;
                spread = transition * spread * transition.transpose() + noise * noise.transpose();
                let (gain, after) = weigh(sequence, k, &spread);
                spread = after;
                pass.expected += gain.variance;
                gain
            }
            Weighing::Free => {
                spread = transition * spread * transition.transpose();
                pass.expected += weigh(sequence, k, &spread).0.variance;
                Gain {
                    correction: Vector3::zeros(),
                    variance: sequence.repeats[k],
                }
            }
        };
        let error = sequence.readings[k] - (sequence.sees * next)[0];
        // A model that runs away counts as a large error, not as a missing one.
        let error = if error.is_finite() {
            error
        } else {
            1e6 * sequence.speed
        };
        let scale = sequence.noise * gain.variance.sqrt();
        pass.residuals.push(error / scale);
        for slope in &mut slopes {
            let seen = (sequence.sees * *slope)[0];
            pass.slopes.push(-seen / scale);
            *slope -= gain.correction * seen;
        }
        x = next + gain.correction * error;
        pass.gains.push(gain);
        pass.samples.push(k);
        pass.counts.push(1.0 / sequence.repeats[k]);
    }
    pass
}

/// The gain for one reading and the covariance after it, in units of a single reading's variance.
fn weigh(sequence: &Sequence, k: usize, spread: &Matrix3<f64>) -> (Gain, Matrix3<f64>) {
    let seen = spread * sequence.sees.transpose();
    let variance = (sequence.sees * seen)[0] + sequence.repeats[k];
    let correction = seen / variance;
    let after = spread - correction * seen.transpose();
    let gain = Gain {
        correction,
        variance,
    };
    (gain, 0.5 * (after + after.transpose()))
}
