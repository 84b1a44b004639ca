//! Control of an axis with friction.
//!
//! | part | what it does |
//! | --- | --- |
//! | [`Observer`] | velocity from encoder counts and known forces |
//! | [`Friction`], [`Compensation`] | the torque that takes friction away: static, or by observed bristles |
//! | [`Adaptation`] | the Coulomb level, learned while the axis moves |
//! | [`Effects`], [`Backlash`] | gravity, cogging, asymmetries and whatever else a diagnosis found |
//! | [`Pid`] | P, PI and PID with anti-windup |
//! | [`CurrentLoop`] | voltage from current, below a controller whose `u` is a current |
//! | [`Profile`] | set points of a move with limited velocity, acceleration and jerk |
//! | [`Controller`] | all of these as one sample of an axis: encoder counts and a set point in, a command out |
//!
//! Gains and state are different things here: what a sample changes is small, and parameters are checked once, when they
//! are put in force. The path of a sample cannot panic, and a number that is none is reported and becomes no command.
//!
//! # What a sample costs
//! Instructions of one [`Controller::step`] on Cortex-M4 at `opt-level = "s"`, everything on and a Stribeck curve besides,
//! measured in QEMU 7.2 as `core/benches/footprint/src/bin/control.rs` says; about 40 of them make the set point there:
//!
//! | friction | Coulomb level | `f32` | fixed point |
//! | --- | --- | --- | --- |
//! | static | by the observer | 404 | 776 |
//! | static | by rows | 449 | 797 |
//! | bristles | by the observer | 453 | 1026 |
//!
//! ```
//! use bristle_core::control::{
//!     Adaptation, Compensation, Controller, Driver, Effects, Friction, Learning, Method, Parameters, Position, SetPoint,
//! };
//! use bristle_core::friction::Curve;
//!
//! let parameters = Parameters::<f32> {
//!     period: 1e-3, count: 1.534e-3, inertia: 2e-3, gain: 0.13, back_emf: 0.54,
//!     command_limit: 6.0, torque_limit: 1.0, observer_bandwidth: 300.0,
//!     position_gain: 30.0, velocity_gain: 0.25, velocity_integral: 2.0,
//!     friction: Friction {
//!         coulomb: 0.1, viscous: 0.01, static_level: 0.1, stribeck_velocity: 0.1, curve: Curve::Rational,
//!         bristle_stiffness: 100.0, bristle_damping: 0.0,
//!     },
//!     compensation: Compensation { method: Method::Static, driver: Driver::Command, share: 1.0, slope: 0.25, crossing: 0.01 },
//!     adaptation: Adaptation {
//!         method: Learning::Observer, speed: 0.1, lowest: 0.0, highest: 0.5, rate: 10.0,
//!         window: 0.1, forgotten: 0.1, offset: 0.0,
//!     },
//!     effects: Effects::NONE,
//! };
//! let mut axis = Controller::new(parameters, 0)?;
//! let aim = SetPoint::Position { position: Position::at(100), velocity: 0.0, acceleration: 0.0 };
//! let output = axis.step(0, aim);
//! assert!(output.command > 0.0 && output.finite);
//! # Ok::<(), bristle_core::control::Invalid>(())
//! ```

mod backlash;
mod compensation;
mod controller;
mod coulomb;
mod current;
mod derived;
mod effects;
mod friction;
mod observer;
mod parameters;
mod pid;
mod position;
mod profile;
mod rows;
mod stage;
mod state;

pub use backlash::Backlash;
pub use compensation::{Compensation, Driver, Method};
pub use controller::{Controller, Output, SetPoint};
pub use coulomb::{Adaptation, Learning};
pub use current::{CurrentLoop, Electrical};
pub use effects::{Effects, Harmonic, WAVES};
pub use friction::Friction;
pub use observer::{Observer, ObserverGains};
pub use parameters::{Invalid, Parameters};
pub use pid::Pid;
pub use position::Position;
pub use profile::{Limits, Profile};
pub use stage::{Probe, Stage};
