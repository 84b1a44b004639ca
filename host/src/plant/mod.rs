//! Plants: what a model file can describe, each driven by any friction law and by the effects that make sense on it.
//!
//! One plant, one file. An axis is the plant that `identify` and `diagnose` fit; the others are for simulation. The
//! model file chooses by `[plant] kind = "…"`; each file says which constants that asks for.

mod dc_motor;
mod geared_servo;
mod mass_spring;
mod wheel_slip;

pub use dc_motor::DcMotor;
pub use geared_servo::geared_servo;
pub use mass_spring::mass_spring;
pub use wheel_slip::WheelSlip;

use crate::axis::Axis;
use crate::error::{Error, Result};
use crate::model::{Kind, Model};
use crate::recording::Recording;
use crate::simulate::Hold;
use crate::step::{Loaded, Mechanism, Memory, State};

/// A mechanism in motion, whatever its equations.
pub trait Plant {
    /// What an encoder sees.
    fn measured(&self) -> State;
    /// Motor current, A.
    fn current(&self) -> Option<f64>;
    /// Acceleration that a lasting unit of `u` causes, friction and motion aside.
    fn authority(&self) -> f64;
    /// Starts at sample `first` as an encoder would see it so, all that it does not see being at ease.
    fn start(&mut self, t: &[f64], u: &[f64], first: usize, state: State);
    /// Advances from instant `t[k]` to `t[k + 1]` under the inputs `u[..=k]` and a load, in N·m or N, that no
    /// recording shows.
    fn advance(&mut self, t: &[f64], u: &[f64], k: usize, load: f64);
}

/// The plant that a model file describes, at rest at zero; a message names what is missing or does not fit together.
pub fn new(model: &Model) -> Result<Box<dyn Plant>> {
    refuse_loads(model)?;
    Ok(match model.kind {
        Kind::Axis => {
            let axis = Axis::simulated(model)?;
            match axis.coupling {
                None => Running::new(axis),
                Some(coupling) => Running::new(Loaded::new(axis, coupling)),
            }
        }
        Kind::MassSpring => Running::new(mass_spring(model)?),
        Kind::DcMotor => Running::new(DcMotor::new(model)?),
        Kind::GearedServo => Running::new(geared_servo(model)?),
        Kind::WheelSlip => Running::new(WheelSlip::new(model)?),
    })
}

/// Only an axis can carry a load behind its driven side; the other plants have their own.
fn refuse_loads(model: &Model) -> Result<()> {
    let mut terms = model.terms.iter();
    match terms.find(|t| t.effect.divides()) {
        Some(term) if model.kind != Kind::Axis => Err(Error::Usage(format!(
            "[effects.{}] hangs a load on the axis, and plant.kind = {:?} has a mechanism of its own; leave the effect out",
            term.effect.id(),
            model.kind.as_str()
        ))),
        _ => Ok(()),
    }
}

/// A mechanism with what it remembers.
struct Running<P, const N: usize> {
    mechanism: P,
    memory: Memory<N>,
    hold: Hold,
}

impl<P: Mechanism<N> + 'static, const N: usize> Running<P, N> {
    #[expect(
        clippy::new_ret_no_self,
        reason = "its number of states is nobody's business"
    )]
    fn new(mechanism: P) -> Box<dyn Plant> {
        Box::new(Self {
            memory: Memory::at_ease(&mechanism, State::default()),
            mechanism,
            hold: Hold::default(),
        })
    }
}

impl<P: Mechanism<N>, const N: usize> Plant for Running<P, N> {
    fn measured(&self) -> State {
        self.mechanism.measured(&self.memory.x)
    }
    fn current(&self) -> Option<f64> {
        self.mechanism.current(&self.memory.x)
    }
    fn authority(&self) -> f64 {
        self.mechanism.authority()
    }
    fn start(&mut self, t: &[f64], u: &[f64], first: usize, state: State) {
        self.memory = Memory::at_ease(&self.mechanism, state);
        self.hold = Hold::at(t, u, first, state.v, &self.mechanism.path());
    }
    fn advance(&mut self, t: &[f64], u: &[f64], k: usize, load: f64) {
        self.memory = self
            .hold
            .advance(&self.mechanism, (t, u), k, load, self.memory);
    }
}

/// Runs a plant along a recording, restarted every `horizon` seconds from the state measured at a sample; one state for
/// each sample.
pub fn follow(
    plant: &mut dyn Plant,
    recording: &Recording,
    horizon: f64,
    measured: impl Fn(usize) -> State,
) -> Vec<State> {
    let t = &recording.t;
    let mut restart = f64::NEG_INFINITY;
    (0..t.len())
        .map(|k| {
            if t[k] >= restart - 1e-9 {
                plant.start(t, &recording.u, k, measured(k));
                restart = t[k] + horizon;
            } else {
                plant.advance(t, &recording.u, k - 1, 0.0);
            }
            plant.measured()
        })
        .collect()
}
