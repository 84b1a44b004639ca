//! What follows from parameters.

use super::coulomb::Rates;
use super::friction::Excess;
use super::rows::Rows;
use super::{ObserverGains, Parameters, Pid};
use crate::Scalar;

/// What the control path multiplies with, computed once when parameters are put in force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Derived<T> {
    pub observer: ObserverGains<T>,
    pub velocity: Pid<T>,
    pub rates: Rates<T>,
    pub rows: Rows<T>,
    /// Velocity that a torque of 1 gives in a sample.
    pub kick: T,
    /// Velocity of a count a sample.
    pub per_count: T,
    /// `u` per torque.
    pub per_torque: T,
    pub excess: Excess<T>,
    /// One over the speed of crossing.
    pub per_crossing: T,
    /// Largest `|u|`.
    pub ceiling: T,
    /// Largest torque at standstill.
    pub most: T,
    /// Whether there is play.
    pub loose: bool,
    /// Counts that the set point may change flanks by in a sample.
    pub flank_step: T,
    /// How many waves over position there are.
    pub waves: usize,
    /// Whether anything else depends on position: a spring, or dry friction.
    pub placed: bool,
}

impl<T: Scalar> Derived<T> {
    /// For an axis whose `|u|` must stay `within` a bound beside its parameter.
    pub fn new(p: &Parameters<T>, within: Option<T>) -> Self {
        let ceiling = match within {
            Some(bound) if bound < p.command_limit => bound,
            _ => p.command_limit,
        };
        let most = (p.gain * ceiling).abs();
        let backlash = &p.effects.backlash;
        Self {
            observer: ObserverGains::new(p.observer_bandwidth, p.period, p.count),
            velocity: Pid {
                proportional: p.velocity_gain,
                integral: p.velocity_integral,
                derivative: T::ZERO,
            },
            rates: Rates::new(&p.adaptation, p.period, p.inertia),
            rows: Rows::new(&p.adaptation, p.period, p.inertia, p.count),
            kick: p.period / p.inertia,
            per_count: p.count / p.period,
            per_torque: T::ONE / p.gain,
            excess: Excess::new(&p.friction),
            per_crossing: T::ONE / p.compensation.crossing,
            ceiling,
            most: if most < p.torque_limit {
                most
            } else {
                p.torque_limit
            },
            loose: backlash.gap != T::ZERO,
            flank_step: backlash.speed * p.period / p.count,
            waves: p.effects.waves(),
            placed: p.effects.friction.is_any() || p.effects.stiffness != T::ZERO,
        }
    }
}
