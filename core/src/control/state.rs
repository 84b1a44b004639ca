//! What a controller remembers, and what becomes of it when parameters change under way.

use super::backlash::Play;
use super::derived::Derived;
use super::rows::{RowState, Rows};
use super::{Learning, Method, Observer, Parameters};
use crate::Scalar;

/// What a controller remembers from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State<T> {
    pub observer: Observer<T>,
    /// Integral part of the torque.
    pub integral: T,
    /// Deflection of the observed bristles, rad or m.
    pub bristles: T,
    /// Coulomb level and constant offset, adapted or as given.
    pub learned: [T; 2],
    pub rows: RowState<T>,
    pub play: Play<T>,
    /// Friction level beyond the Coulomb level at the last sample.
    pub excess: T,
    /// What but dry friction acts from the last sample on, N·m or N.
    pub drive: T,
    /// See [`super::Controller::amend`]: nothing but its sign counts.
    pub pressed: T,
}

/// Coulomb level and offset as a set gives them.
fn given<T: Scalar>(parameters: &Parameters<T>) -> [T; 2] {
    [parameters.friction.coulomb, parameters.effects.offset]
}

impl<T: Scalar> State<T> {
    pub fn at_rest(counts: i32, parameters: &Parameters<T>, derived: &Derived<T>) -> Self {
        Self {
            observer: Observer::at_rest(counts),
            integral: T::ZERO,
            bristles: T::ZERO,
            learned: given(parameters),
            rows: RowState::new(&derived.rows),
            play: Play {
                at: T::ZERO,
                ahead: T::ZERO,
            },
            excess: T::ZERO,
            drive: T::ZERO,
            pressed: T::ZERO,
        }
    }

    /// From one set to the `next`, whose `rows` these are, as [`super::Controller::set_parameters`] says.
    pub fn carry_over(&mut self, last: &Parameters<T>, next: &Parameters<T>, rows: &Rows<T>) {
        self.bristles = deflection(self.bristles, last, next);
        let learns = |p: &Parameters<T>| p.adaptation.method != Learning::Off;
        let (before, now) = (given(last), given(next));
        for (k, level) in self.learned.iter_mut().enumerate() {
            if !learns(next) || before.get(k) != now.get(k) {
                *level = now.get(k).copied().unwrap_or(*level);
            }
        }
        if learns(next) {
            self.learned = next.adaptation.bounded(self.learned, now);
        }
        let same_rows = last.adaptation == next.adaptation
            && last.inertia == next.inertia
            && last.friction == next.friction
            && last.effects == next.effects;
        if !same_rows {
            self.rows = RowState::new(rows);
        }
    }
}

/// The deflection that has the same force under the next set.
fn deflection<T: Scalar>(bristles: T, last: &Parameters<T>, next: &Parameters<T>) -> T {
    let observed = |p: &Parameters<T>| p.compensation.method == Method::Bristles;
    if !(observed(last) && observed(next)) {
        return T::ZERO;
    }
    let (was, is) = (
        last.friction.bristle_stiffness,
        next.friction.bristle_stiffness,
    );
    if was == is {
        return bristles;
    }
    let same_force = bristles * (was / is);
    // Of stiffnesses further apart than the numbers reach nothing can be carried over.
    if same_force.is_finite() {
        same_force
    } else {
        T::ZERO
    }
}
