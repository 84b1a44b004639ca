//! One axis under control: everything put together.

use serde::{Deserialize, Serialize};

use super::compensation::Velocities;
use super::coulomb::Slid;
use super::derived::Derived;
use super::friction::Law;
use super::rows::{Seen, Weights};
use super::state::State;
use super::{Invalid, Learning, Parameters, Position, Probe, Stage};
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
    /// Constant torque that resists motion in the positive direction, adapted or as given, N·m or N.
    pub offset: T,
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
    /// What `|u|` must stay within beside its parameter.
    within: Option<T>,
    derived: Derived<T>,
    weights: Weights<T>,
    state: State<T>,
}

/// What the position loop makes of a set point.
struct Wanted<T> {
    error: T,
    velocity: T,
    command: T,
    acceleration: T,
    /// Counts to the set point; more than the one at which the integral rests, where a velocity is asked for.
    left: T,
}

impl<T: Scalar> Controller<T> {
    /// A controller of an axis that is at rest where the encoder shows `counts`.
    pub fn new(parameters: Parameters<T>, counts: i32) -> Result<Self, Invalid> {
        parameters.check()?;
        let derived = Derived::new(&parameters, None);
        Ok(Self {
            state: State::at_rest(counts, &parameters, &derived),
            derived,
            weights: Weights::new(),
            parameters,
            within: None,
        })
    }

    /// The parameters in force.
    pub fn parameters(&self) -> &Parameters<T> {
        &self.parameters
    }

    /// Puts other parameters in force at the next sample, of an axis that may be moving. If they are not valid, the old ones
    /// stay.
    ///
    /// # Transfer
    /// What the controller remembers is in units that no gain defines, so it means the same under the new parameters and is
    /// carried over: a set like the one in force changes no bit of what follows, and the command steps by what the
    /// control law makes of the new parameters in the same state, and by nothing else.
    ///
    /// | remembered | under new parameters |
    /// | --- | --- |
    /// | position and velocity | kept: they are the axis's own, whatever gains correct them |
    /// | integral | kept as a torque: another `ki` changes how it goes on and not what it is |
    /// | deflection of bristles | such that the force `σ0·z` is kept; what the new level cannot hold relaxes over the next of the way, as in a contact. From zero where no bristles were observed before |
    /// | Coulomb level, offset | what was learned is kept unless the set says otherwise: by another `friction.coulomb` or `effects.offset`, or by learning nothing. Within the new bounds at once |
    /// | rows of the weak form | kept if all that a row is made of stays (inertia, friction, effects, adaptation). Else windows and covariance begin anew: a row out of two models would be of neither |
    /// | play within the backlash | kept: it is where the load lies |
    /// | what acted last | kept, as it did act |
    ///
    /// The integral is not moved to make up for a step of what is fed forward. Friction turns with the motion and the integral
    /// does not, so what hides the step now would be wrong by twice as much after the next reversal.
    ///
    /// Period, count and whatever else [`Parameters::is_same_drive`] compares give those units their meaning: change them
    /// only at rest, and [`Controller::reset`] after it.
    pub fn set_parameters(&mut self, parameters: Parameters<T>) -> Result<(), Invalid> {
        parameters.check()?;
        self.derived = Derived::new(&parameters, self.within);
        self.state
            .carry_over(&self.parameters, &parameters, &self.derived.rows);
        self.parameters = parameters;
        Ok(())
    }

    /// Keeps `|u|` within a bound from the next sample on, beside the parameter `command_limit`; `None` takes it away. It is
    /// a limit like the parameter, so that neither the integral nor the observer is misled by it.
    pub fn confine(&mut self, within: Option<T>) {
        self.within = within;
        self.derived = Derived::new(&self.parameters, within);
    }

    /// Forgets everything: the axis is at rest where the encoder shows `counts`.
    pub fn reset(&mut self, counts: i32) {
        self.state = State::at_rest(counts, &self.parameters, &self.derived);
    }

    /// Corrects what is believed of the time since the last sample, where something between the command and the axis, as a
    /// current loop, has its own dynamics and limits: `u` was larger by `off` in the mean, and `short` of the sign of what
    /// could not be made. The integral of the velocity loop does not push any further that way in the coming sample.
    #[inline]
    pub fn amend(&mut self, off: T, short: T) {
        let gain = self.parameters.gain;
        self.state.drive = self.state.drive.plus_product(gain, off);
        self.state.pressed = if gain < T::ZERO { -short } else { short };
    }

    /// One sample: the encoder shows `counts`; gives the command from now until the next sample.
    pub fn step(&mut self, counts: i32, set_point: SetPoint<T>) -> Output<T> {
        self.step_probed(counts, set_point, &mut ())
    }

    /// The same, under a probe.
    #[inline]
    pub fn step_probed(
        &mut self,
        counts: i32,
        set_point: SetPoint<T>,
        probe: &mut impl Probe,
    ) -> Output<T> {
        let before = self.state.observer.velocity;
        let moved = self.observe(counts);
        probe.ended(Stage::Observer);
        self.learn(counts, before);
        probe.ended(Stage::Estimator);
        let (position, velocity) = (self.state.observer.position, self.state.observer.velocity);
        let (holding, wave) = self.placed(position, velocity);
        probe.ended(Stage::Effects);
        let (mut friction, mut error) = (T::ZERO, T::ZERO);
        let torque = match set_point {
            SetPoint::Off | SetPoint::Command(_) => T::ZERO,
            SetPoint::Torque(torque) => torque,
            _ => {
                let wanted = self.wanted(set_point, moved);
                error = wanted.error;
                probe.ended(Stage::Controller);
                friction = self.friction(&wanted, wave);
                probe.ended(Stage::Compensation);
                let p = &self.parameters;
                let inertia = if self.derived.loose {
                    let backlash = &p.effects.backlash;
                    backlash.carried(p.inertia, wanted.acceleration, &self.state.play)
                } else {
                    p.inertia
                };
                let ahead = (friction + holding).plus_product(inertia, wanted.acceleration);
                self.feed_back(&wanted, ahead, moved)
            }
        };
        probe.ended(Stage::Controller);
        let (command, torque, saturated) = match set_point {
            SetPoint::Off => self.given(T::ZERO, velocity),
            SetPoint::Command(command) => self.given(command, velocity),
            _ => self.limited(torque, velocity),
        };
        probe.ended(Stage::Limits);
        let finite = self.remember(torque, holding, wave);
        probe.ended(Stage::Memory);
        Output {
            command: if finite { command } else { T::ZERO },
            torque,
            saturated,
            finite,
            error,
            position,
            velocity,
            friction,
            coulomb: self.state.learned[0],
            offset: self.state.learned[1],
        }
    }

    /// Takes the encoder's counts in; by how many counts the position has moved.
    #[inline(always)]
    fn observe(&mut self, counts: i32) -> T {
        let Self { derived, state, .. } = self;
        let push = state.drive * derived.kick;
        let level = state.learned[0] + state.excess;
        state
            .observer
            .sample(&derived.observer, counts, push, level * derived.kick)
    }

    /// Learns from a sample before which the velocity was `before`.
    #[inline(always)]
    fn learn(&mut self, counts: i32, before: T) {
        let Self {
            parameters,
            derived,
            weights,
            state,
            ..
        } = self;
        let after = state.observer.velocity;
        let adaptation = &parameters.adaptation;
        let last = state.learned;
        match adaptation.method {
            Learning::Off => {}
            Learning::Observer => {
                let slid = Slid {
                    before,
                    after,
                    drive: state.drive,
                    excess: state.excess,
                };
                state.learned[0] = adaptation.observed(&derived.rates, last[0], slid);
            }
            Learning::Rows => {
                // What is known of friction beyond the Coulomb level belongs to what acts; an offset in force as well, and
                // is to be learned anew.
                let torque = state.drive - before.sign() * state.excess + last[1];
                let seen = Seen { counts, torque };
                derived
                    .rows
                    .sample(weights, &mut state.rows, seen, &mut state.learned);
                state.learned = adaptation.bounded(state.learned, last);
            }
        }
    }

    /// What resists at a position, whatever the direction, and what the Coulomb level has there beyond its mean.
    #[inline(always)]
    fn placed(&self, position: Position<T>, velocity: T) -> (T, T) {
        let (effects, derived) = (&self.parameters.effects, &self.derived);
        let even = self.state.learned[1].plus_product(effects.viscous_difference, velocity.abs());
        let holding = even + effects.waving(position, derived.waves);
        if derived.placed {
            let spring = effects.spring(position, self.parameters.count);
            (holding + spring, effects.friction.at(position))
        } else {
            (holding, T::ZERO)
        }
    }

    /// The torque that compensates friction.
    #[inline(always)]
    fn friction(&mut self, wanted: &Wanted<T>, wave: T) -> T {
        let (p, state) = (&self.parameters, &mut self.state);
        let law = Law {
            friction: &p.friction,
            coulomb: state.learned[0] + wave,
            excess: &self.derived.excess,
        };
        let at = Velocities {
            desired: wanted.velocity,
            measured: state.observer.velocity,
            command: wanted.command,
            crossed: (wanted.velocity * self.derived.per_crossing).clamp_symmetric(T::ONE),
        };
        p.compensation
            .torque(&law, at, &mut state.bristles, p.period)
    }

    /// Keeps what acts until the next sample; whether all of it is finite.
    #[inline(always)]
    fn remember(&mut self, torque: T, holding: T, wave: T) -> bool {
        let (p, state) = (&self.parameters, &mut self.state);
        let velocity = state.observer.velocity;
        state.drive = (torque - holding).plus_product(p.friction.viscous, -velocity);
        state.excess = wave + self.derived.excess.at(velocity);
        (state.drive + state.integral + state.bristles).is_finite()
    }

    /// The position loop, after the axis has moved by `moved` counts.
    #[inline(always)]
    fn wanted(&mut self, set_point: SetPoint<T>, moved: T) -> Wanted<T> {
        let p = &self.parameters;
        match set_point {
            SetPoint::Position {
                position,
                velocity,
                acceleration,
            } => {
                let backlash = &p.effects.backlash;
                let (mut ahead, mut extra) = (T::ZERO, T::ZERO);
                if self.derived.loose {
                    let play = &mut self.state.play;
                    let step = backlash.follow(play, moved, velocity, self.derived.flank_step);
                    (ahead, extra) = (play.ahead, step * self.derived.per_count);
                }
                let counts = position.minus(self.state.observer.position) + ahead;
                let error = counts * p.count;
                Wanted {
                    error,
                    velocity,
                    command: (velocity + extra).plus_product(p.position_gain, error),
                    acceleration,
                    left: counts,
                }
            }
            SetPoint::Velocity {
                velocity,
                acceleration,
            } => Wanted {
                error: T::ZERO,
                velocity,
                command: velocity,
                acceleration,
                left: T::ONE + T::ONE,
            },
            SetPoint::Off | SetPoint::Command(_) | SetPoint::Torque(_) => Wanted {
                error: T::ZERO,
                velocity: T::ZERO,
                command: T::ZERO,
                acceleration: T::ZERO,
                left: T::ZERO,
            },
        }
    }

    /// The velocity loop on top of what is fed forward; brings the integral forward.
    ///
    /// The integral takes the velocity that the encoder shows, and not the observer's: where the model of friction is
    /// wrong the latter is off by a constant, and so would be the position that the integral comes to rest at.
    #[inline(always)]
    fn feed_back(&mut self, wanted: &Wanted<T>, ahead: T, moved: T) -> T {
        let Derived {
            velocity,
            most,
            per_count,
            ..
        } = &self.derived;
        let error = wanted.command - self.state.observer.velocity;
        let torque = (ahead + self.state.integral).plus_product(velocity.proportional, error);
        // At a standstill within a count of the set point it rests.
        if wanted.velocity != T::ZERO || wanted.left.abs() > T::ONE {
            let beyond = torque.beyond(*most);
            let excess = if beyond == T::ZERO {
                self.state.pressed
            } else {
                beyond
            };
            let slow = wanted.command.plus_product(-moved, *per_count);
            let period = self.parameters.period;
            let integral = &mut self.state.integral;
            *integral = velocity.integrated(*integral, slow, period, excess, *most);
        }
        torque
    }

    /// Command, torque and whether a limit cut them, for a command asked for.
    #[inline]
    fn given(&self, wanted: T, velocity: T) -> (T, T, bool) {
        let p = &self.parameters;
        let command = wanted.clamp_symmetric(self.derived.ceiling);
        let made = p.gain * (command - p.back_emf * velocity);
        (command, made, command != wanted)
    }

    /// Command, torque and whether a limit cut them, for a torque asked for.
    #[inline(always)]
    fn limited(&self, torque: T, velocity: T) -> (T, T, bool) {
        let p = &self.parameters;
        let counter = p.back_emf * velocity;
        let allowed = torque.clamp_symmetric(p.torque_limit);
        let wanted = counter.plus_product(allowed, self.derived.per_torque);
        let command = wanted.clamp_symmetric(self.derived.ceiling);
        if command == wanted {
            (command, allowed, allowed != torque)
        } else {
            (command, p.gain * (command - counter), true)
        }
    }
}
