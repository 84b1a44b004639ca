//! Steps under a friction law with a bristle state.
//!
//! The implicit midpoint rule for the mechanism, and within it the exact exponential step of the bristles at the
//! velocity of the midpoint, whose mean force over the step brakes the mechanism. Second order; sliding bristles that
//! settle a thousand times faster than the step cost nothing, as their state is never integrated. The equation of a
//! step is solved by iteration: steps short against the bristles' own oscillation `√(σ0/m)` make it contract.
//!
//! Oscillation and decay at rest beyond the Nyquist frequency of the drive's steps show in no recording and are not resolved:
//! the rule stays stable there, and its equation is solved by bracketing the friction, which rises with velocity.

use std::f64::consts::PI;

use bristle_core::friction::Dynamic;

use super::{Drive, Mechanism, Memory, moved, root};

/// Turn of the fastest mode in a substep at most, rad: the rule errs by a twelfth of its square, less than a thousandth of the rate.
const TURN: f64 = 0.1;
/// Substeps beyond this many would mean a mechanism faster than any recording could show. The state is then no longer a number:
/// the equation of a step would not be solved, and what came out would only look like motion.
const MOST_SUBSTEPS: f64 = 20_000.0;
/// Iterations of the equation of a step; each takes about a factor of `2/TURN` off its error.
const ITERATIONS: usize = 12;
/// Turn of the bristles in a substep up to which each iteration still takes a factor of ten off.
const CONTRACTS: f64 = 0.2;
/// Relative error of a friction that is down to rounding.
const PRECISION: f64 = 1e-13;

pub(super) fn advance<const N: usize>(
    plant: &impl Mechanism<N>,
    law: &dyn Dynamic<f64>,
    drive: Drive,
    from: Memory<N>,
    h: f64,
) -> Memory<N> {
    let rate = own_rate(plant, law);
    let turn = (h * rate).min(PI).max(h * plant.pace());
    let count = (turn / TURN).ceil().max(1.0);
    if count > MOST_SUBSTEPS || from.x.iter().any(|x| !x.is_finite()) {
        return Memory {
            x: [f64::NAN; N],
            z: f64::NAN,
        };
    }
    let h = h / count;
    let contact = Contact {
        plant,
        law,
        drive,
        h,
    };
    // Where the middle of a step will lie is guessed from the one before.
    let mut half = [0.0; N];
    (0..count as usize).fold(from, |now, _| {
        let middle = if h * rate <= CONTRACTS {
            contact.iterated(now, std::array::from_fn(|k| now.x[k] + half[k]))
        } else {
            contact.bracketed(now)
        };
        half = std::array::from_fn(|k| middle[k] - now.x[k]);
        Memory {
            x: std::array::from_fn(|k| middle[k] + half[k]),
            z: law.advance(now.z, plant.sliding(&middle).v, h),
        }
    })
}

/// The fastest rate of the mechanism on its bristles at rest, of oscillation or decay, 1/s.
fn own_rate<const N: usize>(plant: &impl Mechanism<N>, law: &dyn Dynamic<f64>) -> f64 {
    let m = plant.inertia();
    let decay = (law.damping() + law.viscosity()) / m;
    (law.stiffness() / m).sqrt().max(decay)
}

/// What a substep of `h` seconds is solved with.
struct Contact<'a, P> {
    plant: &'a P,
    law: &'a dyn Dynamic<f64>,
    drive: Drive,
    h: f64,
}

impl<P> Contact<'_, P> {
    /// The friction over the substep from bristles bent by `z`, with the mechanism so in the middle of it.
    fn friction<const N: usize>(&self, z: f64, middle: &[f64; N]) -> f64
    where
        P: Mechanism<N>,
    {
        let &Self { plant, law, h, .. } = self;
        let v = plant.sliding(middle).v;
        let level = law.level(v);
        let halfway = law.step_at(level, z, v, 0.5 * h).deflection;
        let beside = plant.resistance(self.drive, middle, law.stiffness() * halfway / level);
        law.step_at(level, z, v, h).force + beside
    }

    /// The middle of the substep from `x`, where `friction` resists, from a guess of it.
    ///
    /// Each iteration takes the same factor `r` off the error, so that two of them tell the limit (Aitken's Δ²).
    fn settle<const N: usize>(
        &self,
        x: &[f64; N],
        guess: [f64; N],
        friction: impl Fn(&[f64; N]) -> f64,
    ) -> [f64; N]
    where
        P: Mechanism<N>,
    {
        let mut middle = guess;
        // The change of sliding velocity by the last iteration, if no extrapolation came between.
        let mut last = None;
        for _ in 0..ITERATIONS {
            let rate = self.plant.rate(self.drive, &middle, friction(&middle));
            let next = moved(x, 0.5 * self.h, &rate);
            let change: [f64; N] = std::array::from_fn(|k| next[k] - middle[k]);
            let excess = (0..N).map(|k| change[k].abs() - 1e-13 * next[k].abs());
            let settled = excess.fold(f64::MIN, f64::max) <= 1e-300;
            let slid = self.plant.sliding(&next).v - self.plant.sliding(&middle).v;
            middle = next;
            if settled {
                break;
            }
            let r = last.map_or(0.0, |last| slid / last);
            last = Some(slid);
            if r != 0.0 && r.abs() <= CONTRACTS {
                middle = moved(&middle, r / (1.0 - r), &change);
                last = None;
            }
        }
        middle
    }

    /// The middle of a substep by iteration.
    fn iterated<const N: usize>(&self, Memory { x, z }: Memory<N>, guess: [f64; N]) -> [f64; N]
    where
        P: Mechanism<N>,
    {
        self.settle(&x, guess, |middle| self.friction(z, middle))
    }

    /// The middle of a substep by the friction that brings about itself: the more of it, the slower the mechanism and the less
    /// of it, so that any guess and what comes of it lie on both sides.
    fn bracketed<const N: usize>(&self, Memory { x, z }: Memory<N>) -> [f64; N]
    where
        P: Mechanism<N>,
    {
        let under = |friction: f64| self.settle(&x, x, |_| friction);
        let excess = |friction: f64| self.friction(z, &under(friction)) - friction;
        let guess = self.friction(z, &x);
        let ends = [guess, guess + excess(guess)];
        let values = [ends[1] - ends[0], excess(ends[1])];
        // More friction brings about less, so the excess changes by no less than the friction: it says how far off that is.
        let narrow = |[a, b]: [f64; 2], values: [f64; 2]| {
            let width = (b - a).abs().min(values[1].abs());
            width <= PRECISION * (a.abs() + b.abs())
        };
        under(root::bracket(ends, values, narrow, excess)[1])
    }
}

#[cfg(test)]
mod tests {
    use super::{Contact, Drive, Mechanism, Memory};
    use crate::axis::Axis;
    use crate::model::Model;

    /// `2·m·(w_middle − w)/h = a − F`, whether the bristles hold, yield or are bent the other way.
    #[test]
    fn a_bracketed_step_solves_its_equation() {
        let text = "[plant]\nmotion = \"linear\"\ninertia = 2.0\n[friction]\nmodel = \"lugre\"\ncoulomb = 4.0\nviscous = 0.5\nstatic = 6.0\nstribeck_velocity = 0.1\nbristle_stiffness = 1e9\nbristle_damping = 1e3\n";
        let model = Model::parse(text).expect("the model parses");
        let plant = Axis::simulated(&model).expect("the model is complete");
        let law = plant.contact().bristles().expect("bristles");
        for (v, z, u) in [(0.0, 2e-9, 5.0), (0.3, 4e-9, -9.0), (-0.02, 5e-9, 20.0)] {
            let drive = Drive {
                u,
                ..Drive::default()
            };
            let contact = Contact {
                plant: &plant,
                law,
                drive,
                h: 1e-4,
            };
            let middle = contact.bracketed(Memory { x: [0.0, v], z });
            let friction = contact.friction(z, &middle);
            let inertial = 2.0 * plant.inertia() * (middle[1] - v) / contact.h;
            let off = plant.balance(drive, &middle) - friction - inertial;
            let scale = u.abs() + friction.abs() + inertial.abs();
            assert!(off.abs() <= 1e-11 * scale, "{off} of {scale}");
        }
    }
}
