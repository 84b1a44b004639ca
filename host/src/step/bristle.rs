//! Steps under a friction law with a bristle state.
//!
//! The implicit midpoint rule for the mechanism, and within it the exact exponential step of the bristles at the
//! velocity of the midpoint, whose mean force over the step brakes the mechanism. Second order; sliding bristles that
//! settle a thousand times faster than the step cost nothing, as their state is never integrated. The equation of a
//! step is solved by iteration: steps short against the bristles' own oscillation `√(σ0/m)` make it contract.

use bristle_core::friction::Dynamic;

use super::{Drive, Mechanism, Memory, moved};

/// The part of a step over which the fastest mode may turn, rad.
const TURN: f64 = 0.05;
/// Substeps beyond this many would mean bristles faster than any recording could show.
const MOST_SUBSTEPS: usize = 20_000;
/// Iterations of the equation of a step; each takes about a factor of `2/TURN` off its error.
const ITERATIONS: usize = 12;

pub(super) fn advance<const N: usize>(
    plant: &impl Mechanism<N>,
    law: &dyn Dynamic<f64>,
    drive: Drive,
    from: Memory<N>,
    h: f64,
) -> Memory<N> {
    let count = substeps(plant, law, h);
    (0..count).fold(from, |now, _| {
        step(plant, law, drive, now, h / count as f64)
    })
}

fn step<const N: usize>(
    plant: &impl Mechanism<N>,
    law: &dyn Dynamic<f64>,
    drive: Drive,
    Memory { x, z }: Memory<N>,
    h: f64,
) -> Memory<N> {
    let mut middle = x;
    for _ in 0..ITERATIONS {
        let at = plant.sliding(&middle);
        let bent = law.stiffness() * law.advance(z, at.v, 0.5 * h) / law.level(at.v);
        let moment = plant.moment(drive, &middle);
        let effects = plant.contact().resistance(moment, at, bent);
        let friction = law.mean_force(z, at.v, h) + effects;
        let next = moved(&x, 0.5 * h, &plant.rate(drive, &middle, friction));
        let change = (0..N).map(|k| (next[k] - middle[k]).abs() - 1e-13 * next[k].abs());
        let settled = change.fold(f64::MIN, f64::max) <= 1e-300;
        middle = next;
        if settled {
            break;
        }
    }
    Memory {
        x: std::array::from_fn(|k| 2.0 * middle[k] - x[k]),
        z: law.advance(z, plant.sliding(&middle).v, h),
    }
}

/// Substeps that resolve the oscillation and the decay of the mechanism on its bristles.
fn substeps<const N: usize>(plant: &impl Mechanism<N>, law: &dyn Dynamic<f64>, h: f64) -> usize {
    let m = plant.inertia();
    let rate = (law.stiffness() / m)
        .sqrt()
        .max((law.damping() + law.viscosity()) / m)
        .max(plant.pace());
    ((h * rate / TURN).ceil() as usize).clamp(1, MOST_SUBSTEPS)
}
