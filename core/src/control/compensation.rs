//! The torque that takes friction away.

use serde::{Deserialize, Serialize};

use super::friction::Law;
use crate::Scalar;
use crate::friction::Dynamic;

/// How friction is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Method {
    /// Not at all.
    Off,
    /// As a function of velocity, `g(v)·sgn v + Fv·v` with a steep line through zero in place of the jump.
    Static,
    /// By an observer of the bristles, Dahl's or `LuGre`'s as the parameters say: `F = σ0·z + σ1·ż + Fv·v`.
    Bristles,
}

/// The velocity that friction is computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Driver {
    /// That of the set point: pure feed-forward, which cannot make a loop unstable. The line is
    /// `g·v_ref/crossing`, as steep as one likes.
    Desired,
    /// The estimated one. The line is `slope·v`.
    Measured,
    /// That which the position controller asks for, `v_cmd = v_ref + kp·(q_ref − q)`: the desired one while the axis
    /// follows, while a correction points to the set point when the axis sticks beside it. The line is
    /// `g·v_ref/crossing + slope·(v_cmd − v_ref)`: the set point may be steep, the correction is feedback.
    Command,
}

/// How much of the friction is compensated, and how.
///
/// # Over-compensation
/// Compensation takes away damping that the loop may live on. What keeps a loop with velocity gain `kv` (torque per
/// velocity) from a limit cycle, whatever the true friction is, is the `slope` through zero, where the friction of the
/// model may be all there is:
/// - driven by the measured velocity, the slope is negative damping: [`Compensation::is_safe`] asks for
///   `slope ≤ kv/2`, so that half of the gain is left at every velocity;
/// - driven by the command, it is a spring of stiffness `kp·slope`, of a monotone characteristic: it stores energy and
///   gives it back, and the damping `kv` stays. With gains `kv = J·ω`, `kp = ω/4` the slope `kv` makes the spring as
///   stiff as `J·ω²/2`, which `kv` damps with the ratio 1/√2: `slope ≤ kv` is asked for;
/// - driven by the set point there is no loop, and any slope will do.
///
/// An observer of bristles has the slope `σ0` over *position*; driven by the measured velocity it takes stiffness and
/// level of the true contact away, and more than there is of either would make the standstill unstable:
/// `share ≤ 2/3` is asked for, which leaves something of a contact that has 30 % less than its model. It is
/// for contacts that have bristles: where an axis sticks at once, the bristles keep what they were bent by,
/// and an integral that works against that at a standstill goes to and fro. It is for moving, not for holding a place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compensation<T> {
    /// How friction is computed.
    pub method: Method,
    /// From which velocity.
    pub driver: Driver,
    /// The share of the friction that is compensated, 0 to 1.
    pub share: T,
    /// Slope of static friction through zero where it is feedback, N·m·s/rad or N·s/m.
    pub slope: T,
    /// Speed > 0 of the set point from which on all of the friction is fed forward, rad/s or m/s.
    pub crossing: T,
}

/// The velocities of a sample, rad/s or m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Velocities<T> {
    pub desired: T,
    pub measured: T,
    pub command: T,
    /// The part of the way that the set point has crossed from one sign to the other, −1 to 1.
    pub crossed: T,
}

impl<T: Scalar> Compensation<T> {
    /// Whether the share is one, and the slope is not more than a velocity gain of `gain` keeps stable.
    pub fn is_safe(&self, gain: T) -> bool {
        let three = T::from_i32(3);
        let in_range = self.share >= T::ZERO && self.share <= T::ONE;
        let slope = self.slope.is_finite() && self.slope >= T::ZERO;
        let crossing = self.crossing.is_finite() && self.crossing > T::ZERO;
        let stable = match (self.method, self.driver) {
            (Method::Off, _) | (_, Driver::Desired) => true,
            (Method::Static, Driver::Measured) => self.slope <= gain.half(),
            (Method::Static, Driver::Command) => self.slope <= gain,
            (Method::Bristles, Driver::Measured) => three * self.share <= T::from_i32(2),
            // Bristles remember how far they were bent: driven by a command they would be an integrator.
            (Method::Bristles, Driver::Command) => false,
        };
        in_range && slope && crossing && stable
    }

    /// The torque, with the deflection `bristles`, which is brought forward by `period` seconds.
    #[inline(always)]
    pub(super) fn torque(&self, law: &Law<T>, at: Velocities<T>, bristles: &mut T, period: T) -> T {
        // The viscous part of a command would be one more velocity gain.
        let (velocity, sliding) = match self.driver {
            Driver::Desired => (at.desired, at.desired),
            Driver::Measured => (at.measured, at.measured),
            Driver::Command => (at.command, at.desired),
        };
        let full = match self.method {
            Method::Off => return T::ZERO,
            Method::Static => {
                let level = law.level(velocity);
                let line = if self.driver == Driver::Measured {
                    self.slope * velocity
                } else {
                    // Without a correction in the velocity that is asked for, the second part is none.
                    (level * at.crossed).plus_product(self.slope, velocity - sliding)
                };
                let line = line.clamp_symmetric(level);
                line.plus_product(law.viscosity(), sliding)
            }
            Method::Bristles => {
                // Of a copy, or all of the law would have to lie in memory for the other methods as well.
                let law = *law;
                let step = law.step(*bristles, velocity, period);
                *bristles = step.deflection;
                step.force
            }
        };
        self.share * full
    }
}
