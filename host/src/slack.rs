//! An axis whose encoder sits behind a gap: when the drive is in it, and the blow at its end.
//!
//! With the motor ahead of the measured load by `x` within `±gap/2`, `J·q̈ + J_M·ẍ + F = k·u`. In the gap nothing reaches the
//! load: the motor, of inertia `J_M`, moves by itself until it meets a wall and shares its momentum with the load.
//!
//! A recording shows the load alone, and of motor and gap hardly more than `J_M·gap`: how long the load lacks the drive, and how
//! hard the blow is. The share `μ` of the friction that is the motor's, and the share `m` of the inertia, show in when the two part:
//! where `J_L·q̈ + (1 − μ)·F`, with which the motor pushes the load, changes its sign, which it does at `k·u = (μ − m)/(1 − m)·F`. So
//! of both only one is told: `μ` with `m` a half, or, where a motor without friction is the heavier side, `m`.

use crate::effects::{Path, Point};
use crate::weak::Track;

/// What moves an axis and holds it.
#[derive(Clone, Copy, Debug)]
pub struct Forces {
    /// Torque or force per unit of `u`.
    pub gain: f64,
    /// What velocity takes off `u`, per rad/s or m/s.
    pub back_emf: f64,
    /// Inertia of both sides.
    pub inertia: f64,
    /// Coulomb friction of both sides.
    pub coulomb: f64,
    /// Viscous friction of both sides.
    pub viscous: f64,
}

impl Forces {
    /// What distinguishes two of them.
    pub fn bits(&self) -> [u64; 5] {
        let Self {
            gain,
            back_emf,
            inertia,
            coulomb,
            viscous,
        } = *self;
        [gain, back_emf, inertia, coulomb, viscous].map(f64::to_bits)
    }

    /// Drive in the cells of a track under an input.
    fn drive(&self, track: &Track, input: &[f64]) -> Vec<f64> {
        let input = input.iter().zip(&track.cells);
        let drive = |(u, cell): (&f64, &Point)| self.gain * (u - self.back_emf * cell.v);
        input.map(drive).collect()
    }
}

/// The motion of a motor within a gap.
pub struct Slack {
    /// Torque or force that does not reach the load, as means over the cells; what the blow at the end of the gap gives is
    /// negative.
    pub missing: Vec<f64>,
    /// Where the load stands at every node relative to the motor, and how fast it moves so.
    pub load: Vec<[f64; 2]>,
}

/// A motor on one side of a gap.
struct Motor {
    inertia: f64,
    /// Share of the inertia that is its own.
    share: f64,
    /// Share of the friction that is its own.
    own: f64,
    /// Its own Coulomb friction.
    held: f64,
    /// Its own viscous friction.
    viscous: f64,
}

impl Motor {
    fn of(forces: &Forces, path: &Path) -> Self {
        let (own, share) = (path.gap.friction, path.gap.inertia);
        Self {
            inertia: share * forces.inertia,
            share,
            own,
            held: (own * forces.coulomb).max(0.0),
            viscous: own * forces.viscous,
        }
    }

    /// What it pushes the load with while both move or stand together, up to a positive factor.
    fn push(&self, drive: f64, friction: f64, moving: bool) -> f64 {
        if moving {
            (1.0 - self.share) * drive + (self.share - self.own) * friction
        } else {
            drive - drive.clamp(-self.held, self.held)
        }
    }

    /// Its velocity after a time `h` by itself.
    fn alone(&self, v: f64, drive: f64, h: f64) -> f64 {
        let free = v + h / self.inertia * (drive - self.viscous * v);
        let stop = h / self.inertia * self.held;
        free - free.clamp(-stop, stop)
    }
}

impl Slack {
    /// Follows the motor through the gap on a path along a track, from the end towards which it pushes first, through the cells
    /// whose input is given.
    pub fn new(track: &Track, input: &[f64], forces: &Forces, path: &Path) -> Self {
        let (h, half) = (track.period, 0.5 * path.gap.width);
        let motor = Motor::of(forces, path);
        let drive = forces.drive(track, input);
        let count = drive.len();
        let mut missing = vec![0.0; count];
        let mut load = Vec::with_capacity(count + 1);
        let first = drive.iter().find(|drive| **drive != 0.0);
        let mut x = half.copysign(first.copied().unwrap_or_default());
        let (mut v, mut loose) = (track.v[0], false);
        load.push([-x, 0.0]);
        for (k, &drive) in drive.iter().enumerate() {
            let (before, after) = (track.v[k], track.v[k + 1]);
            let friction = forces.coulomb * track.cells[k].s + forces.viscous * track.cells[k].v;
            if !loose {
                v = before;
                loose = x * motor.push(drive, friction, track.sliding[k] > 0.0) < 0.0;
            }
            if !loose {
                load.push([-x, 0.0]);
                continue;
            }
            let next = motor.alone(v, drive, h);
            let step = 0.5 * h * (v + next - before - after);
            let wall = half.copysign(step);
            // Share of the cell until the motor meets a wall.
            let share = if (x + step) * wall.signum() >= half && step != 0.0 {
                ((wall - x) / step).clamp(0.0, 1.0)
            } else {
                1.0
            };
            let lacks = drive - motor.own * friction - motor.inertia * (after - before) / h;
            missing[k] += share * track.sliding[k] * lacks;
            x = (x + step).clamp(-half, half);
            loose = share >= 1.0;
            if loose {
                v = next;
            } else {
                let ahead = v + share * (next - v) - before - share * (after - before);
                strike(&mut missing, k as f64 + share, -motor.inertia * ahead / h);
            }
            load.push([-x, if loose { after - v } else { 0.0 }]);
        }
        Self { missing, load }
    }
}

/// Adds a blow at some time, counted in cells, to the cells whose middles lie around it.
fn strike(cells: &mut [f64], at: f64, blow: f64) {
    let at = (at - 0.5).clamp(0.0, cells.len() as f64 - 1.0);
    let (cell, rest) = (at as usize, at.fract());
    cells[cell] += (1.0 - rest) * blow;
    if let Some(next) = cells.get_mut(cell + 1) {
        *next += rest * blow;
    }
}
