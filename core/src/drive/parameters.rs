//! Everything that a drive has to be told: one set, which is checked, sent, stored and put in force as a whole.
//!
//! # While the axis runs
//! A set is taken under way if it leaves alone what must not change then; else it is refused for that reason
//! ([`Refusal::Fixed`](super::Refusal::Fixed)) and changes nothing. It is in force from one control period to the next as a
//! whole, and is not written to flash.
//!
//! | may change under way | may not | why not |
//! | --- | --- | --- |
//! | friction, effects, what is compensated and how | all of [`Limits`]: converters, current, voltages, jump, stall, timeouts | a fault that is in the making must not be argued away, and a scale that is wrong for one period is a fault |
//! | gains and observer, for whose margins the host answers as it does at rest | period and count | what is remembered, and every set point on its way, is in these |
//! | what is learned, how fast and within which bounds | gain and `back_emf` | the bridge turns torque into `u` by them: a sign would turn the axis round |
//! | | the current loop | it holds the limit of the voltage, and its gains are the winding's |
//! | inertia | `command_limit` and `torque_limit` | they protect the machine, whoever tunes it |
//!
//! What is remembered goes on as [`Controller::set_parameters`](crate::control::Controller::set_parameters) says.

use serde::{Deserialize, Serialize};

use super::Number;
use crate::control;

/// The scales of the converters, and what is a fault. Those of time are in control periods.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits<T> {
    /// Most counts that the encoder can move in a period.
    pub jump: u16,
    /// A to a count of the converter; negative if it counts the other way.
    pub current_per_count: T,
    /// What the converter shows without current.
    pub current_zero: u16,
    /// Largest current, A.
    pub current: T,
    /// V to a count of the converter.
    pub bus_per_count: T,
    /// Least bus voltage under which the axis may run, V.
    pub bus_min: T,
    /// Largest bus voltage, V.
    pub bus_max: T,
    /// An input that must move the axis, in the unit of `u`.
    pub stall: T,
    /// Periods for which it may fail to.
    pub stall_periods: u16,
    /// Periods after which a set point is stale; 0 for never.
    pub command_timeout: u16,
    /// Periods after which a silent host is gone; 0 for never.
    pub link_timeout: u16,
}

impl<T: Number> Limits<T> {
    /// Whether every number is finite and, but for the scale of the current, positive.
    pub fn is_valid(&self) -> bool {
        let positive = [self.current, self.bus_per_count, self.bus_max, self.stall];
        positive.into_iter().all(|x| x.is_sound() && x > T::ZERO)
            && self.current_per_count.is_sound()
            && self.bus_min.is_sound()
            && self.jump > 0
            && self.stall_periods > 0
    }
}

/// A complete set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters<T> {
    /// Scales and faults.
    pub limits: Limits<T>,
    /// The control law.
    pub control: control::Parameters<T>,
    /// The current loop below it, if there is one: the `u` of the control law is then a current in A, and what the bridge
    /// applies is the voltage of the loop.
    pub current: Option<control::CurrentLoop<T>>,
}

impl<T: Number> Parameters<T> {
    /// Whether `next` leaves alone what must not change while the axis runs.
    pub fn may_become(&self, next: &Self) -> bool {
        self.limits == next.limits
            && self.current == next.current
            && self.control.is_same_drive(&next.control)
    }

    /// Whether the set can be put in force.
    pub fn is_valid(&self) -> bool {
        self.surrounds_validly() && self.control.is_valid()
    }

    /// The same of all but the control law, which a controller checks as it takes it.
    pub fn surrounds_validly(&self) -> bool {
        self.limits.is_valid() && self.current.is_none_or(|current| current.is_valid())
    }

    /// The set of a board that was never set up: with limits so low that no motor turns, and no compensation.
    pub fn harmless() -> Self {
        let tiny = T::EPSILON;
        let friction = control::Friction {
            coulomb: T::ZERO,
            viscous: T::ZERO,
            static_level: T::ZERO,
            stribeck_velocity: T::ONE,
            curve: crate::friction::Curve::Rational,
            bristle_stiffness: T::ONE,
            bristle_damping: T::ZERO,
        };
        let compensation = control::Compensation {
            method: control::Method::Off,
            driver: control::Driver::Desired,
            share: T::ZERO,
            slope: T::ZERO,
            crossing: T::ONE,
        };
        let adaptation = control::Adaptation {
            method: control::Learning::Off,
            speed: T::ONE,
            lowest: T::ZERO,
            highest: T::ZERO,
            rate: T::ZERO,
            window: T::ONE,
            forgotten: T::ZERO,
            offset: T::ZERO,
        };
        Self {
            limits: Limits {
                jump: 1000,
                current_per_count: tiny,
                current_zero: 2048,
                current: T::ONE,
                bus_per_count: tiny,
                bus_min: T::ZERO,
                bus_max: T::ONE,
                stall: T::ONE,
                stall_periods: 1000,
                command_timeout: 100,
                link_timeout: 1000,
            },
            control: control::Parameters {
                period: T::ONE,
                count: T::ONE,
                inertia: T::ONE,
                gain: T::ONE,
                back_emf: T::ZERO,
                command_limit: tiny,
                torque_limit: tiny,
                observer_bandwidth: T::ONE,
                position_gain: T::ZERO,
                velocity_gain: T::ZERO,
                velocity_integral: T::ZERO,
                friction,
                compensation,
                adaptation,
                effects: control::Effects::NONE,
            },
            current: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Parameters;
    use crate::scalar::Q16;

    #[test]
    fn the_harmless_set_is_valid_and_bad_limits_are_not() {
        assert!(Parameters::<f64>::harmless().is_valid());
        assert!(Parameters::<f32>::harmless().is_valid());
        assert!(Parameters::<Q16>::harmless().is_valid());
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let mut set = Parameters::<f32>::harmless();
            set.limits.bus_max = bad;
            assert!(!set.is_valid());
        }
    }
}
