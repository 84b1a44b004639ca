//! Time steps of mechanisms with friction: the one integrator behind every plant.
//!
//! A mechanism has one place of contact, where a friction law acts. Laws without state are integrated by classical
//! Runge-Kutta steps that are cut at the exact instants where the contact sticks or lets go (`slide.rs`); laws with a
//! bristle state by midpoint steps with the exact step of the bristles inside (`bristle.rs`).

mod bristle;
mod loaded;
mod root;
mod slide;

pub use loaded::Loaded;

use bristle_core::Scalar;
use bristle_core::friction::Dynamic;

pub use crate::axis::State;
use crate::axis::{Axis, Contact};
use crate::effects::{Moment, Path};

/// All that a mechanism in motion remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memory<const N: usize> {
    /// State variables of the mechanism.
    pub x: [f64; N],
    /// Deflection of the bristles at the contact, rad or m; zero under a law that has none.
    pub z: f64,
}

impl<const N: usize> Memory<N> {
    /// A mechanism that an encoder sees so, all that it does not see being at ease: sliding bristles bent as steady
    /// sliding bends them, resting ones straight.
    pub fn at_ease(plant: &impl Mechanism<N>, state: State) -> Self {
        let x = plant.placed(state);
        let w = plant.sliding(&x).v;
        let bent = |law: &dyn Dynamic<f64>| law.level(w) * w.sign() / law.stiffness();
        let z = plant.contact().bristles().map_or(0.0, bent);
        Self { x, z }
    }
}

/// What acts on a mechanism during a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drive {
    /// Time in the middle of the step since the first sample, s.
    pub t: f64,
    /// Length of the step, s.
    pub dt: f64,
    /// The input that acts, in its own unit.
    pub u: f64,
    /// A torque or force in the direction of positive motion that no recording shows, N·m or N.
    pub load: f64,
}

impl Drive {
    /// The drive as effects see it.
    pub fn moment(&self) -> Moment {
        let &Self { t, dt, u, .. } = self;
        Moment { t, dt, u }
    }
}

/// Equations of motion in `N` state variables with friction at one contact, which slides at the velocity `w`.
///
/// The friction `F` of the contact enters linearly: `m·ẇ = a(x, drive) − F`.
pub trait Mechanism<const N: usize> {
    /// The friction law at the contact, and the effects beside it.
    fn contact(&self) -> &Contact;
    /// `m`: the inertia that the contact brakes, kg·m² or kg.
    fn inertia(&self) -> f64;
    /// The way of the input to the mechanism.
    fn path(&self) -> Path;
    /// The drive as effects at the contact see it: its `u` times the model's gain is the torque or force that it transmits.
    fn moment(&self, drive: Drive, _x: &[f64; N]) -> Moment {
        drive.moment()
    }
    /// What resists sliding in direction `s`, of a law with bristles all but these, N·m or N.
    fn resistance(&self, drive: Drive, x: &[f64; N], s: f64) -> f64 {
        let moment = self.moment(drive, x);
        self.contact().resistance(moment, self.sliding(x), s)
    }
    /// Position and sliding velocity `w` of the contact.
    fn sliding(&self, x: &[f64; N]) -> State;
    /// `a`: the friction that would keep the sliding velocity as it is, N·m or N.
    fn balance(&self, drive: Drive, x: &[f64; N]) -> f64;
    /// Time derivative of the state while the contact resists with `friction`.
    fn rate(&self, drive: Drive, x: &[f64; N], friction: f64) -> [f64; N];
    /// Makes the sliding velocity, which is zero but for rounding, exactly zero.
    fn rest(&self, x: &mut [f64; N]);
    /// What an encoder sees of the state.
    fn measured(&self, x: &[f64; N]) -> State;
    /// The state that an encoder would see so, all that it does not see being at ease.
    fn placed(&self, state: State) -> [f64; N];
    /// The fastest rate of what lies beyond the contact, 1/s.
    fn pace(&self) -> f64 {
        0.0
    }
    /// Motor current, A.
    fn current(&self, _x: &[f64; N]) -> Option<f64> {
        None
    }
    /// Acceleration of what is measured that a lasting unit of `u` causes, friction and motion aside.
    fn authority(&self) -> f64;
}

/// Advances a mechanism by `h` seconds under a constant drive.
pub fn advance<const N: usize>(
    plant: &impl Mechanism<N>,
    drive: Drive,
    from: Memory<N>,
    h: f64,
) -> Memory<N> {
    match plant.contact().bristles() {
        None => Memory {
            x: slide::advance(plant, drive, from.x, h),
            z: 0.0,
        },
        Some(law) => bristle::advance(plant, law, drive, from, h),
    }
}

/// `x + h·slope`.
fn moved<const N: usize>(x: &[f64; N], h: f64, slope: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|k| x[k] + h * slope[k])
}

impl Mechanism<2> for Axis {
    fn contact(&self) -> &Contact {
        &self.contact
    }
    fn inertia(&self) -> f64 {
        self.inertia
    }
    fn path(&self) -> Path {
        self.path
    }
    fn sliding(&self, x: &[f64; 2]) -> State {
        State { q: x[0], v: x[1] }
    }
    fn balance(&self, drive: Drive, x: &[f64; 2]) -> f64 {
        self.gain * (drive.u - self.back_emf * x[1]) + drive.load
    }
    fn rate(&self, drive: Drive, x: &[f64; 2], friction: f64) -> [f64; 2] {
        [x[1], (self.balance(drive, x) - friction) / self.inertia]
    }
    fn rest(&self, x: &mut [f64; 2]) {
        x[1] = 0.0;
    }
    fn measured(&self, x: &[f64; 2]) -> State {
        self.seen(self.sliding(x))
    }
    fn placed(&self, state: State) -> [f64; 2] {
        let truth = self.truth(state);
        [truth.q, truth.v]
    }
    fn authority(&self) -> f64 {
        self.gain / self.inertia
    }
}
