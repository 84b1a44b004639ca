//! What follows from parameters.

use super::coulomb::Rates;
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
    /// One over the Stribeck velocity.
    pub per_stribeck: T,
    /// One over the speed of crossing.
    pub per_crossing: T,
    /// Largest `|u|`.
    pub ceiling: T,
    /// Largest torque at standstill.
    pub most: T,
    /// Counts that the set point may change flanks by in a sample.
    pub flank_step: T,
    /// Whether any torque depends on position.
    pub placed: bool,
    /// How many waves over position there are.
    pub waves: usize,
    /// Whether dry friction depends on position.
    pub uneven: bool,
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
        let (waves, uneven) = (p.effects.waves(), p.effects.friction.is_any());
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
            per_stribeck: T::ONE / p.friction.stribeck_velocity,
            per_crossing: T::ONE / p.compensation.crossing,
            ceiling,
            most: if most < p.torque_limit {
                most
            } else {
                p.torque_limit
            },
            flank_step: backlash.speed * p.period / p.count,
            placed: waves > 0 || uneven || p.effects.stiffness != T::ZERO,
            waves,
            uneven,
        }
    }
}
