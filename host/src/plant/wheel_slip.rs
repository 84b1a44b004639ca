//! The wheel-slip mechanism of rolling stock: a drive turns a wheel through an elastic axle, and adhesion between wheel
//! and rail pulls the vehicle.
//!
//! Everything counts at the rim of the wheel, in m, N and kg: an inertia `I` behind a rolling radius `r` is the mass
//! `I/r²`, a torque the force `torque/r` (so `gain = 1/r` for `input = "torque"`). With drive `d`, wheel `w`, vehicle `V`,
//! axle force `T = K·ϑ + D·(v_d − v_w)` and slip velocity `w = v_w − V`:
//! `m_d·v̇_d = gain·u − T`, `ϑ̇ = v_d − v_w`, `m_w·v̇_w = T − F(w)`, `M·V̇ = F(w) − B·V`. In the model file `m_d` = `inertia`,
//! `m_w` = `wheel_mass`, `M` = `vehicle_mass`, `K` = `axle_stiffness`, `D` = `axle_damping` and `B` = `vehicle_drag` (both
//! 0 unless given). The encoder sits on the drive.
//!
//! The `[friction]` of the file is the adhesion `F(w)`. Its falling branch is the law's: Polach's decrease with slip
//! velocity, `μ = μ0·[(1 − A)·e^(−B·w) + A]`, is the law `stribeck` with `static = μ0·N`, `coulomb = A·μ0·N`,
//! `stribeck_velocity = 1/B` and `exponent = 1` under the wheel load `N`; on wet rails `μ0` is about 0.3, `A` 0.4 and `B`
//! 0.2 s/m. A law of bristles adds the creep below the adhesion limit. Beyond that limit the wheel runs away from the
//! vehicle, until the drive is taken back; on the falling branch the axle may chatter.
//!
//! The effects of the catalogue act on the drive; those that jump where its velocity changes sign are refused.
//!
//! # References
//! O. Polach, Creep forces in simulations of traction vehicles running on adhesion limit, Wear 258, 2005, 992-1000;
//! C. Canudas de Wit, P. Tsiotras, Dynamic tire friction models for vehicle traction control, CDC 1999 (`LuGre` at a wheel).

use crate::axis::{Contact, complete};
use crate::effects::Path;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::step::{Drive, Mechanism, State};
use crate::system;

/// The mechanism; its state is `q_d, v_d, ϑ, v_w, V`.
pub struct WheelSlip {
    adhesion: Contact,
    shaft: Contact,
    gain: f64,
    path: Path,
    drive: f64,
    wheel: f64,
    vehicle: f64,
    stiffness: f64,
    damping: f64,
    drag: f64,
}

impl WheelSlip {
    /// The mechanism that a model file describes.
    pub fn new(model: &Model) -> Result<Self> {
        complete(model)?;
        let constant = |name: &str| model.constant(&format!("plant.{name}"));
        let shaft = Contact::effects(model);
        let mut added = model.terms.iter().filter(|t| !t.in_law);
        let friction = added.find(|t| t.is_of_contact()).map(|t| t.effect);
        if let Some(effect) = friction.or_else(|| shaft.jumping()) {
            return Err(Error::Usage(format!(
                "[effects.{}] is friction, and that of plant.kind = \"wheel-slip\" is the adhesion in [friction]; leave the effect out",
                effect.id()
            )));
        }
        Ok(Self {
            adhesion: Contact::law(model),
            shaft,
            gain: model.gain.value.unwrap_or_default(),
            path: system::path(model),
            drive: model.parameters()[model.moving_inertia()]
                .value
                .unwrap_or_default(),
            wheel: constant("wheel_mass"),
            vehicle: constant("vehicle_mass"),
            stiffness: constant("axle_stiffness"),
            damping: constant("axle_damping"),
            drag: constant("vehicle_drag"),
        })
    }

    /// `T`.
    fn axle(&self, x: &[f64; 5]) -> f64 {
        self.stiffness * x[2] + self.damping * (x[1] - x[3])
    }
}

impl Mechanism<5> for WheelSlip {
    fn contact(&self) -> &Contact {
        &self.adhesion
    }
    fn inertia(&self) -> f64 {
        1.0 / (1.0 / self.wheel + 1.0 / self.vehicle)
    }
    fn path(&self) -> Path {
        self.path
    }
    fn sliding(&self, x: &[f64; 5]) -> State {
        State {
            q: 0.0,
            v: x[3] - x[4],
        }
    }
    fn balance(&self, _drive: Drive, x: &[f64; 5]) -> f64 {
        self.inertia() * (self.axle(x) / self.wheel + self.drag * x[4] / self.vehicle)
    }
    fn rate(&self, drive: Drive, x: &[f64; 5], friction: f64) -> [f64; 5] {
        let axle = self.axle(x);
        let turning = State { q: x[0], v: x[1] };
        let shaft = self
            .shaft
            .resistance(drive.moment(), turning, x[1].signum());
        [
            x[1],
            (self.gain * drive.u + drive.load - shaft - axle) / self.drive,
            x[1] - x[3],
            (axle - friction) / self.wheel,
            (friction - self.drag * x[4]) / self.vehicle,
        ]
    }
    fn rest(&self, x: &mut [f64; 5]) {
        // What one gains the other loses.
        let together = (self.wheel * x[3] + self.vehicle * x[4]) / (self.wheel + self.vehicle);
        (x[3], x[4]) = (together, together);
    }
    fn measured(&self, x: &[f64; 5]) -> State {
        State { q: x[0], v: x[1] }
    }
    fn placed(&self, state: State) -> [f64; 5] {
        [state.q, state.v, 0.0, state.v, state.v]
    }
    fn pace(&self) -> f64 {
        // Drive and wheel swing against each other on the axle; a wheel that sticks moves with the vehicle.
        let apart = 1.0 / self.drive + 1.0 / self.wheel;
        (self.stiffness * apart).sqrt().max(self.damping * apart)
    }
    fn authority(&self) -> f64 {
        self.gain / (self.drive + self.wheel + self.vehicle)
    }
}
