//! One axis under control: everything put together.

use serde::{Deserialize, Serialize};

use super::compensation::Velocities;
use super::{CoulombGains, Invalid, Observer, ObserverGains, Parameters, Pid, Position};
use crate::Scalar;

/// What the axis is to do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum SetPoint<T> {
    /// Nothing: `u = 0`. The observer goes on.
    Off,
    /// This `u`, within its limit; nothing is compensated.
    Command(T),
    /// This torque or force on the motor side, N·m or N; nothing is compensated.
    Torque(T),
    /// A velocity.
    Velocity {
        /// rad/s or m/s.
        velocity: T,
        /// Its rate, rad/s² or m/s².
        acceleration: T,
    },
    /// A position.
    Position {
        /// In counts.
        position: Position<T>,
        /// Its rate, rad/s or m/s.
        velocity: T,
        /// Its second rate, rad/s² or m/s².
        acceleration: T,
    },
}

/// What a sample gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output<T> {
    /// `u`: what the bridge is to apply until the next sample. Within the limits, and zero if not `finite`.
    pub command: T,
    /// The torque or force that this makes, N·m or N.
    pub torque: T,
    /// Whether a limit cut the command.
    pub saturated: bool,
    /// Whether all numbers are. If not, the state is lost: see [`Controller::reset`].
    pub finite: bool,
    /// Position error `q_ref − q`, rad or m; zero unless a position is asked for.
    pub error: T,
    /// Estimated position.
    pub position: Position<T>,
    /// Estimated velocity, rad/s or m/s.
    pub velocity: T,
    /// The part of the torque that compensates dry and viscous friction, N·m or N.
    pub friction: T,
    /// Coulomb level, adapted or as given, N·m or N.
    pub coulomb: T,
}

/// A cascade of position (P) and velocity (PI) with feed-forward of acceleration, friction and further physics, on an
/// observer of position and velocity, with the Coulomb level adapted.
///
/// `v_cmd = v_ref + kp·(q_ref − q̂)`, `τ = J·a_ref + kv·(v_cmd − v̂) + ki·∫(v_cmd − v̂) dt + F̂ + effects`, and
/// `u = τ/gain + back_emf·v̂` within the limits.
///
/// At a standstill asked for (`v_ref = 0`) the integral rests while the position is within a count of the set point:
/// nothing could be won there, and it would wind up until the axis jumps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controller<T> {
    parameters: Parameters<T>,
    derived: Derived<T>,
    state: State<T>,
}

/// What follows from parameters, computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Derived<T> {
    observer: ObserverGains<T>,
    velocity: Pid<T>,
    /// Velocity that a torque of 1 gives in a sample.
    kick: T,
    /// Velocity of a count a sample.
    per_count: T,
    /// `u` per torque.
    per_torque: T,
    /// Largest torque at standstill.
    most: T,
    /// Share of its error that the Coulomb level loses in a sample.
    learning: T,
}

/// What a controller remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct State<T> {
    observer: Observer<T>,
    /// Integral part of the torque.
    integral: T,
    /// Deflection of the observed bristles, rad or m.
    bristles: T,
    coulomb: T,
    /// Friction level beyond the Coulomb level at the last sample.
    excess: T,
    /// What but dry friction acts from the last sample on, N·m or N.
    drive: T,
}

impl<T: Scalar> State<T> {
    fn at_rest(counts: i32, coulomb: T) -> Self {
        Self {
            observer: Observer::at_rest(counts),
            integral: T::ZERO,
            bristles: T::ZERO,
            coulomb,
            excess: T::ZERO,
            drive: T::ZERO,
        }
    }
}

impl<T: Scalar> Derived<T> {
    fn new(p: &Parameters<T>) -> Self {
        let most = (p.gain * p.command_limit).abs();
        Self {
            observer: ObserverGains::new(p.observer_bandwidth, p.period, p.count),
            velocity: Pid {
                proportional: p.velocity_gain,
                integral: p.velocity_integral,
                derivative: T::ZERO,
            },
            per_count: p.count / p.period,
            kick: p.period / p.inertia,
            per_torque: T::ONE / p.gain,
            most: if most < p.torque_limit {
                most
            } else {
                p.torque_limit
            },
            learning: p.adaptation.rate * p.period,
        }
    }
}

/// What the position loop makes of a set point.
struct Wanted<T> {
    error: T,
    velocity: T,
    command: T,
    acceleration: T,
    /// Whether the integral is to rest.
    rest: bool,
}

impl<T: Scalar> Controller<T> {
    /// A controller of an axis that is at rest where the encoder shows `counts`.
    pub fn new(parameters: Parameters<T>, counts: i32) -> Result<Self, Invalid> {
        parameters.check()?;
        Ok(Self {
            derived: Derived::new(&parameters),
            state: State::at_rest(counts, parameters.friction.coulomb),
            parameters,
        })
    }

    /// The parameters in force.
    pub fn parameters(&self) -> &Parameters<T> {
        &self.parameters
    }

    /// Puts other parameters in force at the next sample, of an axis that may be moving. The Coulomb level starts anew
    /// from them. If they are not valid, the old ones stay.
    pub fn set_parameters(&mut self, parameters: Parameters<T>) -> Result<(), Invalid> {
        parameters.check()?;
        self.derived = Derived::new(&parameters);
        self.state.coulomb = parameters.friction.coulomb;
        self.parameters = parameters;
        Ok(())
    }

    /// Forgets everything: the axis is at rest where the encoder shows `counts`.
    pub fn reset(&mut self, counts: i32) {
        self.state = State::at_rest(counts, self.parameters.friction.coulomb);
    }

    /// One sample: the encoder shows `counts`; gives the command from now until the next sample.
    pub fn step(&mut self, counts: i32, set_point: SetPoint<T>) -> Output<T> {
        let travelled = self.observe(counts);
        let p = &self.parameters;
        let (position, velocity) = (self.state.observer.position, self.state.observer.velocity);
        let holding = p.effects.holding(position, p.count);
        let wave = p.effects.friction.at(position);
        let difference = p.effects.viscous_difference;
        let moving = move |v: T| difference * v.abs();

        let (mut friction, mut error) = (T::ZERO, T::ZERO);
        let torque = match set_point {
            SetPoint::Off | SetPoint::Command(_) => T::ZERO,
            SetPoint::Torque(torque) => torque,
            _ => {
                let wanted = self.wanted(set_point);
                error = wanted.error;
                let at = Velocities {
                    desired: wanted.velocity,
                    measured: velocity,
                    command: wanted.command,
                };
                let coulomb = self.state.coulomb + wave;
                let bristles = &mut self.state.bristles;
                friction = p
                    .compensation
                    .torque(&p.friction, coulomb, at, bristles, p.period);
                let ahead =
                    p.inertia * wanted.acceleration + friction + holding + moving(wanted.velocity);
                self.feed_back(&wanted, ahead, travelled)
            }
        };
        let (command, torque, saturated) = match set_point {
            SetPoint::Off => self.given(T::ZERO, velocity),
            SetPoint::Command(command) => self.given(command, velocity),
            _ => self.limited(torque, velocity),
        };
        let p = &self.parameters;
        self.state.drive = torque - holding - moving(velocity) - p.friction.viscous * velocity;
        self.state.excess = wave + p.friction.excess(velocity);
        let finite =
            command.is_finite() && self.state.drive.is_finite() && self.state.integral.is_finite();
        Output {
            command: if finite { command } else { T::ZERO },
            torque,
            saturated,
            finite,
            error,
            position,
            velocity,
            friction,
            coulomb: self.state.coulomb,
        }
    }

    /// Takes the encoder's counts in and learns from them; the mean velocity since the last sample.
    fn observe(&mut self, counts: i32) -> T {
        let Self {
            parameters,
            derived,
            state,
        } = self;
        let before = state.observer.velocity;
        let push = state.drive * derived.kick;
        let level = state.coulomb + state.excess;
        let moved = state
            .observer
            .sample(&derived.observer, counts, push, level * derived.kick);
        let gains: &CoulombGains<T> = &parameters.adaptation;
        if gains.rate > T::ZERO {
            // What is known of friction beyond the Coulomb level belongs to what acts.
            let known = push - before.sign() * state.excess * derived.kick;
            let after = state.observer.velocity;
            state.coulomb = gains.learn(
                derived.learning,
                state.coulomb,
                before,
                after,
                known,
                derived.kick,
            );
        }
        moved * derived.per_count
    }

    /// The position loop.
    fn wanted(&self, set_point: SetPoint<T>) -> Wanted<T> {
        let p = &self.parameters;
        match set_point {
            SetPoint::Off | SetPoint::Command(_) | SetPoint::Torque(_) => Wanted {
                error: T::ZERO,
                velocity: T::ZERO,
                command: T::ZERO,
                acceleration: T::ZERO,
                rest: true,
            },
            SetPoint::Velocity {
                velocity,
                acceleration,
            } => Wanted {
                error: T::ZERO,
                velocity,
                command: velocity,
                acceleration,
                rest: false,
            },
            SetPoint::Position {
                position,
                velocity,
                acceleration,
            } => {
                let counts = position.minus(self.state.observer.position);
                let error = counts * p.count;
                Wanted {
                    error,
                    velocity,
                    command: velocity + p.position_gain * error,
                    acceleration,
                    rest: velocity == T::ZERO && counts.abs() <= T::ONE,
                }
            }
        }
    }

    /// The velocity loop on top of what is fed forward; brings the integral forward.
    ///
    /// The integral takes the velocity that the encoder shows, and not the observer's: where the model of friction is
    /// wrong the latter is off by a constant, and so would be the position that the integral comes to rest at.
    fn feed_back(&mut self, wanted: &Wanted<T>, ahead: T, travelled: T) -> T {
        let Derived { velocity, most, .. } = &self.derived;
        let error = wanted.command - self.state.observer.velocity;
        let torque = ahead + velocity.output(self.state.integral, error, T::ZERO);
        if !wanted.rest {
            let excess = torque - torque.clamp_symmetric(*most);
            let period = self.parameters.period;
            let slow = wanted.command - travelled;
            self.state.integral =
                velocity.integrated(self.state.integral, slow, period, excess, *most);
        }
        torque
    }

    /// Command, torque and whether a limit cut them, for a command asked for.
    fn given(&self, wanted: T, velocity: T) -> (T, T, bool) {
        let p = &self.parameters;
        let command = wanted.clamp_symmetric(p.command_limit);
        let made = p.gain * (command - p.back_emf * velocity);
        (command, made, command != wanted)
    }

    /// Command, torque and whether a limit cut them, for a torque asked for.
    fn limited(&self, torque: T, velocity: T) -> (T, T, bool) {
        let p = &self.parameters;
        let counter = p.back_emf * velocity;
        let allowed = torque.clamp_symmetric(p.torque_limit);
        let wanted = allowed * self.derived.per_torque + counter;
        let command = wanted.clamp_symmetric(p.command_limit);
        let saturated = allowed != torque || command != wanted;
        let made = if command == wanted {
            allowed
        } else {
            p.gain * (command - counter)
        };
        (command, made, saturated)
    }
}
