//! Several reactions in one mechanism.

use super::Friction;
use crate::Scalar;

/// `P` scalar friction contacts in a mechanism with `N` coordinates.
///
/// `M·q̈ = f − Σ dᵢ·rᵢ`, where contact `i` slides at `vᵢ = dᵢᵀ·q̇` and reacts with `rᵢ`. The mechanism may couple
/// them: what one contact holds, another need not, so which stick and which slide is one question for all.
///
/// # Which stick
/// A sliding contact reacts with the force of its law. Those at rest accelerate by `a = b − W·r`, with
/// `W = Dᵀ·M⁻¹·D` and `b = Dᵀ·M⁻¹·f`, `f` including the sliding reactions, under the condition that
/// - either `|rᵢ| ≤ Lᵢ` and `aᵢ = 0`: it sticks, and its velocity stays exactly zero;
/// - or `rᵢ = Lᵢ·sgn aᵢ`: it breaks away, and the reaction opposes the motion that begins.
///
/// Those are the optimality conditions of minimising `½·rᵀ·W·r − bᵀ·r` over the box `|rᵢ| ≤ Lᵢ`. `W` is positive
/// semidefinite, so a solution always exists and the accelerations `a` are unique; the reactions are, too, when
/// `W` is regular. Contacts that are redundant (two brakes on one shaft) share a unique total reaction only.
///
/// # How it is found
/// By trying the `3^P` assignments of sticking, forward and backward in the order of most sticking, each with one
/// elimination; a redundant contact in a sticking set is given no reaction. Projected Gauss-Seidel, the usual
/// choice, has no bound on its iterations (stiff couplings need thousands) and leaves the velocity of a stuck
/// contact only nearly zero. Enumeration ends after a known number of operations and is exact to rounding; for
/// the `P ≤ 4` of a drive train it costs at most 81 small eliminations, and one when everything sticks. Should rounding
/// leave no assignment perfect, the one with the least violation is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contacts<S, const N: usize, const P: usize> {
    inverse_mass: [[S; N]; N],
    directions: [[S; N]; P],
}

/// What [`Contacts::react`] finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reactions<S, const N: usize, const P: usize> {
    /// The reaction of each contact, in N·m or N.
    pub reaction: [S; P],
    /// The acceleration of each coordinate, in rad/s² or m/s².
    pub acceleration: [S; N],
    /// Whether the contact is at rest and stays so: its velocity must be kept at exactly zero.
    pub sticks: [bool; P],
}

/// What a contact at rest does.
#[derive(Clone, Copy, PartialEq)]
enum State {
    Stick,
    Forward,
    Backward,
}

impl<S: Scalar, const N: usize, const P: usize> Contacts<S, N, P> {
    /// A mechanism by its inverse mass matrix `M⁻¹`, symmetric and positive definite, and the direction `dᵢ` of
    /// each contact in its coordinates.
    pub fn new(inverse_mass: [[S; N]; N], directions: [[S; N]; P]) -> Self {
        Self {
            inverse_mass,
            directions,
        }
    }

    /// The velocities `vᵢ = dᵢᵀ·q̇` at which the contacts slide, from those of the coordinates.
    pub fn velocities(&self, velocity: &[S; N]) -> [S; P] {
        self.directions.map(|d| dot(&d, velocity))
    }

    /// The reactions to `active`, the sum of all other forces on each coordinate.
    ///
    /// `velocity` is that of the contacts and not of the coordinates, because a contact that sticks has exactly
    /// zero and `dᵢᵀ·q̇` would round.
    pub fn react<L: Friction<S>>(
        &self,
        laws: &[L; P],
        velocity: &[S; P],
        active: &[S; N],
    ) -> Reactions<S, N, P> {
        let mut force = *active;
        let mut reaction = [S::ZERO; P];
        for i in 0..P {
            reaction[i] = laws[i].sliding(velocity[i]);
            subtract(&mut force, &self.directions[i], reaction[i]);
        }
        let at_rest: [bool; P] = core::array::from_fn(|i| velocity[i] == S::ZERO);
        let resting = Resting {
            coupling: core::array::from_fn(|i| {
                let mobility = self.accelerate(&self.directions[i]);
                core::array::from_fn(|j| dot(&self.directions[j], &mobility))
            }),
            free: self.velocities(&self.accelerate(&force)),
            limit: core::array::from_fn(|i| laws[i].break_away()),
            at_rest,
        };
        let (found, states) = resting.solve();
        for i in (0..P).filter(|i| at_rest[*i]) {
            reaction[i] = found[i];
            subtract(&mut force, &self.directions[i], found[i]);
        }
        Reactions {
            reaction,
            acceleration: self.accelerate(&force),
            sticks: core::array::from_fn(|i| at_rest[i] && states[i] == State::Stick),
        }
    }

    fn accelerate(&self, force: &[S; N]) -> [S; N] {
        core::array::from_fn(|i| dot(&self.inverse_mass[i], force))
    }
}

/// The contacts at rest: `a = b − W·r` with the box `|rᵢ| ≤ Lᵢ`.
struct Resting<S, const P: usize> {
    coupling: [[S; P]; P],
    free: [S; P],
    limit: [S; P],
    at_rest: [bool; P],
}

impl<S: Scalar, const P: usize> Resting<S, P> {
    fn solve(&self) -> ([S; P], [State; P]) {
        let resting = self.at_rest.iter().filter(|rests| **rests).count();
        let mut best = ([S::ZERO; P], [State::Stick; P]);
        let mut least = None;
        for sticking in (0..=resting).rev() {
            for code in 0..3_usize.pow(P as u32) {
                let states = decode(code);
                if !self.admits(&states, sticking) {
                    continue;
                }
                let (reaction, violation) = self.attempt(&states);
                if violation == S::ZERO {
                    return (reaction, states);
                }
                if least.is_none_or(|least| violation < least) {
                    least = Some(violation);
                    best = (reaction, states);
                }
            }
        }
        best
    }

    /// Whether the assignment has as many sticking contacts, and only one state for those that slide already.
    fn admits(&self, states: &[State; P], sticking: usize) -> bool {
        let sticks = |i: &usize| states[*i] == State::Stick;
        (0..P).all(|i| self.at_rest[i] || sticks(&i))
            && (0..P).filter(|i| self.at_rest[*i]).filter(sticks).count() == sticking
    }

    /// The reactions under an assignment, and by how much they violate its conditions, relative to their scale.
    fn attempt(&self, states: &[State; P]) -> ([S; P], S) {
        let mut reaction = [S::ZERO; P];
        for i in (0..P).filter(|i| self.at_rest[*i]) {
            match states[i] {
                State::Stick => {}
                State::Forward => reaction[i] = self.limit[i],
                State::Backward => reaction[i] = -self.limit[i],
            }
        }
        let stuck: [bool; P] =
            core::array::from_fn(|i| self.at_rest[i] && states[i] == State::Stick);
        let held = self.hold(&stuck, &self.acceleration(&reaction));
        for i in (0..P).filter(|i| stuck[*i]) {
            reaction[i] = held[i];
        }
        let acceleration = self.acceleration(&reaction);
        let mut violation = S::ZERO;
        for i in (0..P).filter(|i| self.at_rest[*i]) {
            let scale = self.free[i].abs() + dot(&self.coupling[i].map(S::abs), &self.limit);
            let excess = match states[i] {
                State::Stick => {
                    let force = (reaction[i].abs() - self.limit[i]) * self.coupling[i][i];
                    larger(force, acceleration[i].abs())
                }
                State::Forward => -acceleration[i],
                State::Backward => acceleration[i],
            };
            if excess > S::from_f64(16.0) * S::EPSILON * scale {
                violation += excess;
            }
        }
        (reaction, violation)
    }

    fn acceleration(&self, reaction: &[S; P]) -> [S; P] {
        core::array::from_fn(|i| self.free[i] - dot(&self.coupling[i], reaction))
    }

    /// The reactions of the `stuck` contacts that cancel `acceleration` there: one Cholesky-like elimination,
    /// in which a contact without a pivot of its own is redundant and gets none.
    fn hold(&self, stuck: &[bool; P], acceleration: &[S; P]) -> [S; P] {
        let mut matrix = self.coupling;
        let mut right = *acceleration;
        let mut used = [false; P];
        for k in (0..P).filter(|k| stuck[*k]) {
            let tolerance = S::from_f64(64.0) * S::EPSILON * self.coupling[k][k];
            if matrix[k][k] <= tolerance {
                continue;
            }
            used[k] = true;
            for i in (k + 1..P).filter(|i| stuck[*i]) {
                let factor = matrix[i][k] / matrix[k][k];
                for j in k..P {
                    let product = factor * matrix[k][j];
                    matrix[i][j] -= product;
                }
                let product = factor * right[k];
                right[i] -= product;
            }
        }
        let mut reaction = [S::ZERO; P];
        for k in (0..P).rev().filter(|k| used[*k]) {
            let mut sum = right[k];
            for j in (k + 1..P).filter(|j| used[*j]) {
                sum -= matrix[k][j] * reaction[j];
            }
            reaction[k] = sum / matrix[k][k];
        }
        reaction
    }
}

/// The assignment with number `code`, a digit of base 3 for each contact.
fn decode<const P: usize>(mut code: usize) -> [State; P] {
    [(); P].map(|()| {
        let digit = code % 3;
        code /= 3;
        match digit {
            0 => State::Stick,
            1 => State::Forward,
            _ => State::Backward,
        }
    })
}

fn larger<S: Scalar>(a: S, b: S) -> S {
    if a > b { a } else { b }
}

fn dot<S: Scalar, const N: usize>(a: &[S; N], b: &[S; N]) -> S {
    let mut sum = S::ZERO;
    for (x, y) in a.iter().zip(b) {
        sum += *x * *y;
    }
    sum
}

fn subtract<S: Scalar, const N: usize>(force: &mut [S; N], direction: &[S; N], reaction: S) {
    for (f, d) in force.iter_mut().zip(direction) {
        *f -= *d * reaction;
    }
}

#[cfg(test)]
mod tests {
    use super::Contacts;
    use crate::friction::CoulombViscous;
    use crate::scalar::{Q16, Scalar};

    fn coulomb(level: f64) -> CoulombViscous<f64> {
        CoulombViscous {
            coulomb: level,
            viscous: 0.0,
        }
    }

    /// Two blocks of 1 kg, one on the other: contact 0 between the lower and the ground, 1 between the two.
    fn stack() -> Contacts<f64, 2, 2> {
        Contacts::new([[1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [-1.0, 1.0]])
    }

    #[test]
    fn a_stack_slips_where_it_is_weakest() {
        let laws = [coulomb(3.0), coulomb(1.0)];
        let pull = |force: f64| stack().react(&laws, &[0.0; 2], &[0.0, force]);
        // Pulled at the top by 0.9, all holds; each contact passes the force on.
        let held = pull(0.9);
        assert_eq!(held.sticks, [true, true]);
        assert_eq!(held.reaction, [0.9, 0.9]);
        assert_eq!(held.acceleration, [0.0, 0.0]);
        // Pulled by 2, the upper contact slips and carries 1 on to the lower one, which holds.
        let slipped = pull(2.0);
        assert_eq!(slipped.sticks, [true, false]);
        assert_eq!(slipped.reaction, [1.0, 1.0]);
        assert_eq!(slipped.acceleration, [0.0, 1.0]);
    }

    #[test]
    fn a_stack_on_a_slippery_ground_moves_as_one() {
        let laws = [coulomb(0.5), coulomb(5.0)];
        let moved = stack().react(&laws, &[0.0; 2], &[0.0, 2.5]);
        assert_eq!(moved.sticks, [false, true]);
        // 2 kg under 2.5 − 0.5; the upper block needs 1 of it, so the contact passes 1.5 on.
        assert_eq!(moved.acceleration, [1.0, 1.0]);
        assert_eq!(moved.reaction, [0.5, 1.5]);
    }

    #[test]
    fn a_sliding_contact_can_hold_or_break_one_at_rest() {
        let laws = [coulomb(0.5), coulomb(1.0)];
        // The upper block slides forward over the lower one and drags it by 1 against 0.5.
        let dragged = stack().react(&laws, &[0.0, 2.0], &[0.0, 0.0]);
        assert_eq!(dragged.reaction, [0.5, 1.0]);
        assert_eq!(dragged.acceleration, [0.5, -1.0]);
        assert_eq!(dragged.sticks, [false, false]);
    }

    #[test]
    fn redundant_brakes_share_a_unique_total() {
        let shaft = Contacts::new([[0.5]], [[1.0]; 3]);
        let laws = [coulomb(1.0), coulomb(2.0), coulomb(0.5)];
        for k in -60..=60 {
            let torque = f64::from(k) * 0.1;
            let found = shaft.react(&laws, &[0.0; 3], &[torque]);
            let total: f64 = found.reaction.iter().sum();
            let expected = torque.clamp(-3.5, 3.5);
            assert!((total - expected).abs() < 1e-14, "{torque}: {found:?}");
            let rest = torque.abs() <= 3.5;
            assert_eq!(found.acceleration[0].abs() < 1e-14, rest);
        }
    }

    #[test]
    fn a_stack_in_fixed_point_slips_alike() {
        // Masses and forces of 1 have exact inverses and products, so nothing rounds.
        let s = Q16::from_f64;
        let [zero, one] = [Q16::ZERO, Q16::ONE];
        let stack = Contacts::new([[one, zero], [zero, one]], [[one, zero], [-one, one]]);
        let laws = [3.0, 1.0].map(|level| CoulombViscous {
            coulomb: s(level),
            viscous: zero,
        });
        let slipped = stack.react(&laws, &[zero; 2], &[zero, s(2.0)]);
        assert_eq!(slipped.sticks, [true, false]);
        assert_eq!(slipped.acceleration, [zero, one]);
        let held = stack.react(&laws, &[zero; 2], &[zero, s(0.75)]);
        assert_eq!(held.sticks, [true, true]);
        assert_eq!(held.reaction, [s(0.75); 2]);
    }
}
