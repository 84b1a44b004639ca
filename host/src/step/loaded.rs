//! An axis with a load behind its driven side: backlash and compliance.

use super::{Drive, Mechanism, State};
use crate::axis::{Axis, Contact};
use crate::effects::{CONTACT, Coupling, Moment, Path};

/// Rate at which friction of the load takes its last velocity, 1/s: as fast as a wall catches it.
const STOPS: f64 = CONTACT;

/// `(J − J_L)·v̇ = k·u − (F − F_L·s − c_L·v) − T`, `J_L·v̇_L = T − F_L·s_L − c_L·v_L`: of the friction `F` of the axis `F_L` and
/// `c_L·v_L` brake the load, and `T` is what the coupling transmits. States: position and velocity of the driven side, and of the
/// load relative to it.
///
/// Contact is exact for the driven side alone. So the load's friction rises with its velocity over the span in which it stops
/// it as fast as the contact catches it, and what it falls short there of `F_L` while the driven side pushes the load is the
/// driven side's: both together stick and slide under `F`.
pub struct Loaded<A> {
    axis: A,
    coupling: Coupling,
}

impl<A: AsRef<Axis>> Loaded<A> {
    /// An axis that carries a load.
    pub fn new(axis: A, coupling: Coupling) -> Self {
        Self { axis, coupling }
    }

    fn axis(&self) -> &Axis {
        self.axis.as_ref()
    }

    /// Coulomb friction of the load while it moves at velocity `v`.
    fn braking(&self, v: f64) -> f64 {
        let Coupling {
            inertia, friction, ..
        } = self.coupling;
        friction.min(inertia * STOPS * v.abs()).copysign(v)
    }

    /// The same with its viscous friction.
    fn slowing(&self, v: f64) -> f64 {
        self.braking(v) + self.coupling.viscous * v
    }

    /// The state that an encoder would see so while the load is ahead of the driven side, and moves ahead, by so much.
    pub fn carrying(&self, seen: State, [ahead, rate]: [f64; 2]) -> [f64; 4] {
        let State { q, v } = self.axis().truth(seen);
        if self.coupling.load_side {
            [q - ahead, v - rate, ahead, rate]
        } else {
            [q, v, ahead, rate]
        }
    }
}

impl AsRef<Self> for Axis {
    fn as_ref(&self) -> &Self {
        self
    }
}

impl<A: AsRef<Axis>> Mechanism<4> for Loaded<A> {
    fn contact(&self) -> &Contact {
        &self.axis().contact
    }
    fn inertia(&self) -> f64 {
        self.axis().inertia - self.coupling.inertia
    }
    fn path(&self) -> Path {
        self.axis().path
    }
    fn moment(&self, drive: Drive, _x: &[f64; 4]) -> Moment {
        drive.moment()
    }
    fn resistance(&self, drive: Drive, x: &[f64; 4], s: f64) -> f64 {
        let Coupling {
            friction,
            viscous,
            gap,
            ..
        } = self.coupling;
        let both = (self.contact()).resistance(drive.moment(), self.sliding(x), s);
        let pushes = x[2] * s < 0.0 && x[2].abs() >= 0.5 * gap;
        let braked = if pushes {
            self.braking((x[1] + x[3]) * s.signum()).max(0.0)
        } else {
            friction
        };
        both - s * braked - viscous * x[1]
    }
    fn sliding(&self, x: &[f64; 4]) -> State {
        State { q: x[0], v: x[1] }
    }
    fn balance(&self, drive: Drive, x: &[f64; 4]) -> f64 {
        let axis = self.axis();
        axis.gain * (drive.u - axis.back_emf * x[1]) + drive.load - self.coupling.torque(x[2], x[3])
    }
    fn rate(&self, drive: Drive, x: &[f64; 4], friction: f64) -> [f64; 4] {
        let acceleration = (self.balance(drive, x) - friction) / self.inertia();
        let transmitted = self.coupling.torque(x[2], x[3]);
        [
            x[1],
            acceleration,
            x[3],
            (transmitted - self.slowing(x[1] + x[3])) / self.coupling.inertia - acceleration,
        ]
    }
    fn rest(&self, x: &mut [f64; 4]) {
        // The load keeps its own velocity.
        x[3] += x[1];
        x[1] = 0.0;
    }
    fn measured(&self, x: &[f64; 4]) -> State {
        let State { q, v } = self.sliding(x);
        self.axis().seen(if self.coupling.load_side {
            State {
                q: q + x[2],
                v: v + x[3],
            }
        } else {
            State { q, v }
        })
    }
    fn placed(&self, state: State) -> [f64; 4] {
        // A moving axis pulls its load along at the end of the gap.
        let behind = if state.v == 0.0 {
            0.0
        } else {
            -0.5 * self.coupling.gap * state.v.signum()
        };
        self.carrying(state, [behind, 0.0])
    }
    fn pace(&self) -> f64 {
        let Coupling {
            inertia,
            stiffness,
            damping,
            ..
        } = self.coupling;
        let apart = 1.0 / inertia + 1.0 / self.inertia();
        (stiffness * apart).sqrt().max(damping * apart)
    }
    fn authority(&self) -> f64 {
        self.axis().authority()
    }
}
