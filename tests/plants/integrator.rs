//! One step of the motion: `J·dv/dt = drive + external(q, v, t) − F·s`, `s` in `Sgn(v)`.
//!
//! The friction impulse is a projection: if the free velocity after the step is smaller than the impulse
//! at zero speed can undo, the axis rests, exactly. Otherwise friction acts against the free velocity,
//! at the mean speed of the step, which makes sliding second order in the step.

use std::f64::consts::TAU;

use super::effect::{Effect, Law};

/// What moves: inertia, Coulomb and viscous friction, effects.
#[derive(Clone, Debug)]
pub struct Axis {
    /// kg·m² or kg.
    pub inertia: f64,
    /// N·m or N.
    pub coulomb: f64,
    /// N·m·s/rad or N·s/m.
    pub viscous: f64,
    pub(super) effects: Vec<Effect>,
}

/// Where it is.
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    /// rad or m.
    pub q: f64,
    /// rad/s or m/s.
    pub v: f64,
    /// Bristle deflection, where the axis has one.
    pub z: f64,
    /// Bristle torque over the last step.
    pub bristle: f64,
    /// Position of a load behind the measured side, where there is one.
    pub load_q: f64,
    /// Its velocity.
    pub load_v: f64,
}

/// What moves by itself: its inertia, and its share of the friction.
struct Side {
    inertia: f64,
    friction: f64,
}

impl Axis {
    /// An axis with Coulomb and viscous friction and nothing else.
    pub fn plain(inertia: f64, coulomb: f64, viscous: f64) -> Self {
        Self {
            inertia,
            coulomb,
            viscous,
            effects: Vec::new(),
        }
    }

    /// Advances by `h` from time `t` under the commanded torque `u` and another, unknown to the drive.
    pub fn step(&self, x: &State, u: f64, process: f64, t: f64, h: f64) -> State {
        let q = x.q + 0.5 * h * x.v;
        let mut torque = u;
        for effect in &self.effects {
            torque = effect.drive(torque, q, t + 0.5 * h);
        }
        let load = torque.abs();
        torque += process;
        for effect in &self.effects {
            torque += effect.external(q, x.v, t + 0.5 * h);
        }
        torque -= self.spring(x, h);
        let at = Place {
            q,
            t: t + 0.5 * h,
            load,
        };
        if let Some(together) = self.together(x, torque, &at, h) {
            return together;
        }
        let own = self.own_inertia();
        let free = x.v + h / own * torque;
        let (v, z, bristle) = match self.bristle() {
            Some(law) => self.bend(x, &law, free, &at, h),
            None => {
                let side = Side {
                    inertia: own,
                    friction: 1.0 - self.load_friction(),
                };
                (self.project(x.v, free, &at, h, &side), 0.0, 0.0)
            }
        };
        let next = State {
            q: x.q + 0.5 * h * (x.v + v),
            v,
            z,
            bristle,
            ..*x
        };
        self.carry(x, next, &at, h)
    }

    /// The step of both sides of a play where the measured one pushes the load before it, or rests against it.
    fn together(&self, x: &State, torque: f64, at: &Place, h: f64) -> Option<State> {
        let half = 0.5 * self.play()?;
        let ahead = x.load_q - x.q;
        if ahead.abs() < half * (1.0 - 1e-9) || x.load_v != x.v || self.bristle().is_some() {
            return None;
        }
        let both = Side {
            inertia: self.inertia,
            friction: 1.0,
        };
        let v = self.project(x.v, x.v + h / self.inertia * torque, at, h, &both);
        let mean = 0.5 * (x.v + v);
        let push = if v == 0.0 {
            torque
        } else {
            let braked = self.load_friction() * self.friction(mean.abs(), v.signum(), at);
            self.load_inertia() * (v - x.v) / h + braked * v.signum()
        };
        (push * ahead <= 0.0).then_some(State {
            q: x.q + h * mean,
            v,
            load_q: x.load_q + h * mean,
            load_v: v,
            ..*x
        })
    }

    /// Inertia behind the measured side.
    pub fn load_inertia(&self) -> f64 {
        let share = |e: &Effect| match e.law {
            Law::Compliance { share, .. } | Law::Backlash { share, .. } => share,
            _ => 0.0,
        };
        self.inertia * self.effects.iter().map(share).sum::<f64>()
    }

    /// Share of the friction that a load beyond a play has, if bristles do not carry it.
    fn load_friction(&self) -> f64 {
        let share = |e: &Effect| match e.law {
            Law::Backlash { friction, .. } => friction,
            _ => 0.0,
        };
        if self.bristle().is_some() {
            return 0.0;
        }
        self.effects.iter().map(share).sum()
    }

    /// The play between both sides, where there is one.
    fn play(&self) -> Option<f64> {
        let mut plays = self.effects.iter();
        plays.find_map(|e| matches!(e.law, Law::Backlash { .. }).then_some(e.x))
    }

    fn own_inertia(&self) -> f64 {
        self.inertia - self.load_inertia()
    }

    /// Torque of an elastic transmission, at the middle of the step as the velocities before it say.
    fn spring(&self, x: &State, h: f64) -> f64 {
        let of = |e: &Effect| match e.law {
            Law::Compliance { damping, .. } => {
                let omega = TAU / e.x.sqrt();
                let rate = x.v - x.load_v;
                let twist = x.q - x.load_q + 0.5 * h * rate;
                self.load_inertia() * omega * (omega * twist + 2.0 * damping * rate)
            }
            _ => 0.0,
        };
        self.effects.iter().map(of).sum()
    }

    /// Moves the load: by its spring, or freely up to the walls of its play, where it and the measured side go on together
    /// with their momentum (Moreau's inelastic impact).
    fn carry(&self, before: &State, mut next: State, at: &Place, h: f64) -> State {
        let load = self.load_inertia();
        if load == 0.0 {
            return next;
        }
        next.load_v += h / load * self.spring(before, h);
        let side = Side {
            inertia: load,
            friction: self.load_friction(),
        };
        if side.friction > 0.0 {
            next.load_v = self.project(before.load_v, next.load_v, at, h, &side);
        }
        next.load_q += 0.5 * h * (before.load_v + next.load_v);
        if let Some(play) = self.play() {
            let half = 0.5 * play;
            let ahead = next.load_q - next.q;
            if ahead.abs() >= half && (next.load_v - next.v) * ahead > 0.0 {
                let momentum = self.own_inertia() * next.v + load * next.load_v;
                next.v = momentum / self.inertia;
                next.load_v = next.v;
            }
            if ahead.abs() > half {
                next.load_q = next.q + half.copysign(ahead);
            }
        }
        next
    }

    /// Velocity of a side after the step with rigid, set-valued friction.
    fn project(&self, before: f64, free: f64, at: &Place, h: f64, of: &Side) -> f64 {
        let gain = of.friction * h / of.inertia;
        let side = if free < 0.0 { -1.0 } else { 1.0 };
        let free = free.abs();
        if free <= gain * self.friction(0.0, side, at) {
            return 0.0;
        }
        let before = (before * side).max(0.0);
        let left = |after: f64| free - gain * self.friction(0.5 * (before + after), side, at);
        let mut after = before;
        for _ in 0..5 {
            let next = left(after).max(0.0);
            if (next - after).abs() <= 1e-11 * free {
                return side * next;
            }
            after = next;
        }
        side * bisect(|w| w - left(w), free)
    }

    /// Friction level at a speed in a direction, without bristles.
    fn friction(&self, speed: f64, side: f64, at: &Place) -> f64 {
        let base = self.coulomb + self.viscous * speed;
        let more: f64 = self
            .effects
            .iter()
            .map(|e| e.friction(speed, side, at))
            .sum();
        (base + more).max(0.0)
    }

    fn bristle(&self) -> Option<Bristle> {
        self.effects.iter().find_map(|e| match e.law {
            Law::Presliding {
                rise,
                stribeck,
                damping,
            } => {
                let stiffness = self.coulomb / e.x;
                Some(Bristle {
                    stiffness,
                    damping: damping * (stiffness * self.inertia).sqrt(),
                    rise,
                    stribeck,
                })
            }
            _ => None,
        })
    }

    /// Velocity, deflection and bristle torque after the step where bristles carry the Coulomb part.
    fn bend(&self, x: &State, law: &Bristle, free: f64, at: &Place, h: f64) -> (f64, f64, f64) {
        let mut v = x.v;
        let (mut z, mut torque) = (x.z, x.bristle);
        for _ in 0..4 {
            let mid = 0.5 * (x.v + v);
            let level = self.coulomb * (1.0 + law.rise * (-(mid / law.stribeck).powi(2)).exp());
            let side = if mid < 0.0 { -1.0 } else { 1.0 };
            // Exact for a constant velocity: dz/dt = mid − |mid|·stiffness/level·z.
            let end = side * level / law.stiffness;
            z = end + (x.z - end) * (-mid.abs() * h * law.stiffness / level).exp();
            torque = law.stiffness * 0.5 * (x.z + z) + law.damping * (z - x.z) / h;
            let slide = self.friction(mid.abs(), side, at) - self.coulomb;
            v = free - h / self.own_inertia() * (torque + side * slide);
        }
        (v, z, torque)
    }
}

/// Where and when friction is asked for, and under which load.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub q: f64,
    pub t: f64,
    pub load: f64,
}

/// Canudas de Wit et al., "A new model for control of systems with friction", 1995, eqs. 1 to 3;
/// without rise and damping it is Dahl's.
struct Bristle {
    stiffness: f64,
    damping: f64,
    rise: f64,
    stribeck: f64,
}

/// Root of a function that is negative at 0 and positive at `high`.
fn bisect(f: impl Fn(f64) -> f64, high: f64) -> f64 {
    let (mut a, mut b) = (0.0, high);
    for _ in 0..50 {
        let mid = 0.5 * (a + b);
        if f(mid) < 0.0 {
            a = mid;
        } else {
            b = mid;
        }
    }
    0.5 * (a + b)
}
