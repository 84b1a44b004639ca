//! Friction laws: the force that opposes motion.
//!
//! Every law obeys one sign convention: `F` is positive for positive `v`, so that it enters the equation of motion as
//! `J·v̇ = k·u − F`.
//!
//! | law | friction | trait |
//! | --- | --- | --- |
//! | [`CoulombViscous`] | `Fc·sgn v + Fv·v` | [`Friction`] |
//! | [`Stribeck`] | falls from `Fs` to `Fc`, as a Gaussian or rational | [`Friction`] |
//! | [`Static`] | falls exponentially; sticks smoothly | [`Friction`] |
//! | [`Dahl`] | bristles with the level `Fc` | [`Dynamic`] |
//! | [`LuGre`] | bristles with the level of a Gaussian Stribeck curve | [`Dynamic`] |
//! | [`ModifiedLuGre`] | bristles with the level of a rational one | [`Dynamic`] |
//!
//! Laws without state are functions of velocity. At exactly `v = 0` they are set-valued; [`Friction::reaction`] resolves
//! the set from the other forces, so that an axis below its break-away level stays at rest. [`Planar`] makes a vector
//! of them, [`Contacts`] puts several into one mechanism, and [`Motion`] moves an axis under one. Laws with
//! bristles have a deflection as state, which [`Dynamic::step`] advances exactly. [`Units`] prepare a law
//! for fixed point.

mod contacts;
mod coulomb_viscous;
mod dahl;
mod dynamic;
mod lugre;
mod modified_lugre;
mod planar;
mod stick_slip;
mod sticking;
mod stribeck;
mod units;

pub use contacts::{Contacts, Reactions};
pub use coulomb_viscous::CoulombViscous;
pub use dahl::Dahl;
pub use dynamic::{Dynamic, Step};
pub use lugre::LuGre;
pub use modified_lugre::ModifiedLuGre;
pub use planar::Planar;
pub use stick_slip::{Motion, time_to_rest};
pub use sticking::Static;
pub use stribeck::{Curve, Stribeck};
pub use units::{OutOfRange, Units};

use crate::Scalar;

/// A friction law without internal state.
pub trait Friction<S: Scalar> {
    /// Friction while sliding, in N·m or N; zero at `v = 0`.
    fn sliding(&self, velocity: S) -> S;

    /// The largest reaction at rest, in N·m or N: motion starts when the active force exceeds it.
    fn break_away(&self) -> S;

    /// The reaction to `active`, the sum of all other forces on the axis.
    ///
    /// While sliding this is [`Friction::sliding`]. At rest the reaction balances `active` exactly up to the
    /// break-away level and is limited to it beyond. (The extended abstract of the source prints
    /// `max{Fc, |a|}` in its eq. 11; inside the sticking area the physical reaction has the magnitude of `a`.)
    fn reaction(&self, velocity: S, active: S) -> S {
        if velocity == S::ZERO {
            active.clamp_symmetric(self.break_away())
        } else {
            self.sliding(velocity)
        }
    }
}
