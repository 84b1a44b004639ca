//! A motor with armature resistance and inductance.
//!
//! `J·ω̇ = kt·i − F` and `L·di/dt = gain·u − R·i − ke·ω`, with `u` the voltage at the terminals in V, `J` =
//! `plant.inertia` in kg·m², `R` = `plant.resistance` in Ω, `L` = `plant.inductance` in H, `kt` =
//! `plant.torque_constant` in N·m/A and `ke` = `plant.back_emf` in V·s/rad, which in SI units is the same number unless
//! the file says otherwise. `plant.gain` is that of the amplifier, V/V. The recording has the column `i[A]`.

use crate::axis::Axis;
use crate::axis::Contact;
use crate::effects::{Moment, Path};
use crate::error::Result;
use crate::model::Model;
use crate::step::{Drive, Mechanism, State};

/// The motor; its state is `q, ω, i`.
pub struct DcMotor {
    /// What turns: `J`, and the friction on it. Its gain is that of the amplifier.
    pub axis: Axis,
    /// `R`, Ω.
    pub resistance: f64,
    /// `L`, H.
    pub inductance: f64,
    /// `kt`, N·m/A.
    pub torque_constant: f64,
    /// `ke`, V·s/rad.
    pub back_emf: f64,
}

impl DcMotor {
    /// The motor that a model file describes.
    pub fn new(model: &Model) -> Result<Self> {
        let constant = |name: &str| model.constant(&format!("plant.{name}"));
        Ok(Self {
            axis: Axis::simulated(model)?,
            resistance: constant("resistance"),
            inductance: constant("inductance"),
            torque_constant: constant("torque_constant"),
            back_emf: constant("back_emf"),
        })
    }
}

impl Mechanism<3> for DcMotor {
    fn contact(&self) -> &Contact {
        &self.axis.contact
    }
    fn inertia(&self) -> f64 {
        self.axis.inertia
    }
    fn path(&self) -> Path {
        self.axis.path
    }
    fn moment(&self, drive: Drive, x: &[f64; 3]) -> Moment {
        // What the motor transmits is the torque of its current.
        let u = self.torque_constant * x[2] / self.axis.gain;
        Moment {
            u,
            ..drive.moment()
        }
    }
    fn sliding(&self, x: &[f64; 3]) -> State {
        State { q: x[0], v: x[1] }
    }
    fn balance(&self, drive: Drive, x: &[f64; 3]) -> f64 {
        self.torque_constant * x[2] + drive.load
    }
    fn rate(&self, drive: Drive, x: &[f64; 3], friction: f64) -> [f64; 3] {
        let voltage = self.axis.gain * drive.u - self.resistance * x[2] - self.back_emf * x[1];
        [
            x[1],
            (self.balance(drive, x) - friction) / self.axis.inertia,
            voltage / self.inductance,
        ]
    }
    fn rest(&self, x: &mut [f64; 3]) {
        x[1] = 0.0;
    }
    fn measured(&self, x: &[f64; 3]) -> State {
        self.axis.seen(self.sliding(x))
    }
    fn placed(&self, state: State) -> [f64; 3] {
        let truth = self.axis.truth(state);
        [truth.q, truth.v, 0.0]
    }
    fn pace(&self) -> f64 {
        // The two modes are no faster than their sum and their geometric mean.
        let electric = self.resistance / self.inductance;
        let coupled = self.torque_constant * self.back_emf / (self.inductance * self.axis.inertia);
        electric.max(coupled.sqrt())
    }
    fn current(&self, x: &[f64; 3]) -> Option<f64> {
        Some(x[2])
    }
    fn authority(&self) -> f64 {
        self.axis.gain * self.torque_constant / (self.resistance * self.axis.inertia)
    }
}
