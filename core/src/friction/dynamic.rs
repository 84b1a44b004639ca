//! Laws with a state: the mean deflection of the bristles between two surfaces.

use crate::Scalar;

/// A friction law with a bristle deflection `z`, in rad or m.
///
/// Every law of this kind is `ż = v − |v|·z/ẑ(v)` with the saturation deflection `ẑ(v) = g(v)/σ0`, and
/// `F = σ0·z + σ1·ż + Fv·v` (Canudas de Wit, Olsson, Åström and Lischinsky 1995, eq. 1 to 3). A law states its
/// level `g(v) > 0` and three coefficients; everything else follows. The law holds the parameters and the caller
/// the deflection, so one law serves many contacts.
///
/// # Which force to use
/// [`Dynamic::force`] is the force at an instant: for plots, observers and high-order solvers. A simulation in
/// steps of `dt` wants [`Dynamic::step`] or [`Dynamic::mean_force`], the exact mean over the step: as
/// `x = |v|·dt/ẑ` grows past 1, the transient `σ1·ż` dies within the step, and an instantaneous value held over
/// it would supply momentum, and energy, that no contact has.
///
/// # Passivity
/// With `W = σ0·z²/2` stored in the bristles, a law is dissipative over an interval when `∫F·v dt ≥ ΔW`.
/// Inserting `v = ż + a·z` with `a = |v|/ẑ(v)`, the difference of the integrands is the quadratic form
/// `σ0·a·z² + σ1·(ż² + a·z·ż) + Fv·v²`, and so
/// - without bristle damping (Dahl) the law is dissipative always;
/// - it is, whatever the state, at velocities with `|v| ≤ 4·g(v)·(σ1 + Fv)/σ1²`, where the form has no negative
///   eigenvalue;
/// - it is, at any velocity, from states with `|z| ≤ max ẑ` if `Fv ≥ σ1·(max g/min g − 1)`, as
///   `ż·v = v²·(1 − z·sgn v/ẑ(v))` then loses at most what `Fv·v²` dissipates. For `LuGre` this reads
///   `Fv ≥ σ1·(Fs − Fc)/Fc`, the condition of Barahanov and Ortega (2000). Without it a cycle of slow sliding and
///   fast strokes can gain energy, as a test shows.
///
/// A deflection within `|z| ≤ max ẑ` stays there.
///
/// As the mean force of a step is that of a true trajectory, all three hold for [`Dynamic::step`] as they stand,
/// at any `dt`, with the velocity constant within each step.
pub trait Dynamic<S: Scalar> {
    /// The level `g(v)` > 0 of the bristle force when sliding steadily, without sign and viscous part; in N·m or N.
    fn level(&self, velocity: S) -> S;

    /// Bristle stiffness `σ0` > 0, in N·m/rad or N/m: the slope of force over position at rest.
    fn stiffness(&self) -> S;

    /// Bristle damping `σ1` ≥ 0, in N·m·s/rad or N·s/m.
    fn damping(&self) -> S;

    /// Viscous coefficient `Fv` ≥ 0, in N·m·s/rad or N·s/m.
    fn viscosity(&self) -> S;

    /// The deflection after `dt` seconds at constant velocity.
    ///
    /// Exact: `z ← z + (z_ss − z)·(1 − e^(−x))` with `z_ss = ẑ·sgn v` and `x = |v|·dt/ẑ`. Near `x = 0` this is
    /// `z + v·dt` without cancellation; for large `x` it is `z_ss`. Explicit Euler would diverge from `x > 2`.
    /// Being between `z` and `z_ss`, the result never leaves `|z| ≤ max ẑ` once inside.
    fn advance(&self, deflection: S, velocity: S, dt: S) -> S {
        let level = self.level(velocity);
        let (saturation, inverse) = (level / self.stiffness(), self.stiffness() / level);
        let (relaxed, _) = (velocity.abs() * dt * inverse).relax();
        deflection + (saturation * velocity.sign() - deflection) * relaxed
    }

    /// The rate `ż` of the deflection, in rad/s or m/s.
    fn rate(&self, deflection: S, velocity: S) -> S {
        // This share of the saturation stays moderate at any velocity, which a saturating number needs.
        let share = deflection * (self.stiffness() / self.level(velocity));
        velocity - velocity.abs() * share
    }

    /// Friction at this instant, `σ0·z + σ1·ż + Fv·v`, in N·m or N.
    fn force(&self, deflection: S, velocity: S) -> S {
        self.stiffness() * deflection
            + self.damping() * self.rate(deflection, velocity)
            + self.viscosity() * velocity
    }

    /// Friction when sliding steadily, `g(v)·sgn v + Fv·v`, in N·m or N.
    fn steady(&self, velocity: S) -> S {
        self.level(velocity) * velocity.sign() + self.viscosity() * velocity
    }

    /// The exact mean of the friction over the `dt` seconds that [`Dynamic::advance`] takes from `deflection`.
    fn mean_force(&self, deflection: S, velocity: S, dt: S) -> S {
        self.step(deflection, velocity, dt).force
    }

    /// [`Dynamic::advance`] and [`Dynamic::mean_force`] at the cost of one evaluation.
    fn step(&self, deflection: S, velocity: S, dt: S) -> Step<S> {
        self.step_at(self.level(velocity), deflection, velocity, dt)
    }

    /// [`Dynamic::step`] for a caller who has asked for the level `g(v)` at this velocity already, in N·m or N.
    fn step_at(&self, level: S, deflection: S, velocity: S, dt: S) -> Step<S> {
        let (speed, sign) = (velocity.abs(), velocity.sign());
        let (saturation, inverse) = (level / self.stiffness(), self.stiffness() / level);
        let (relaxed, mean) = (speed * dt * inverse).relax();
        // Deflection and rate approach their steady values alike, so the mean force is as far from the steady
        // force as the mean of what is left of the way, (1 − e^(−x))/x, leaves of the force at the start.
        let rate = velocity - speed * (deflection * inverse);
        let start = self.stiffness() * deflection + self.damping() * rate;
        let steady = level * sign;
        Step {
            deflection: deflection + (saturation * sign - deflection) * relaxed,
            force: steady + (start - steady) * mean + self.viscosity() * velocity,
        }
    }
}

/// What one step gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<S> {
    /// The bristle deflection at the end of the step, in rad or m.
    pub deflection: S,
    /// The mean friction over the step, in N·m or N: multiplied by `dt` it is the impulse.
    pub force: S,
}
