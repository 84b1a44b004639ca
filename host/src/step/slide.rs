//! Steps under a friction law without state: the contact slides one way or the other, or it sticks.
//!
//! While it slides in one direction the equations are smooth: classical Runge-Kutta steps. Where the sliding velocity
//! reaches zero the step is cut at that instant, and the forces decide: the contact sticks, with a velocity of exactly
//! zero, as long as the balance of forces lies within what friction can hold; where it leaves that, the step is cut
//! again. Instants are found down to rounding.

use super::{Drive, Mechanism, State, moved, root};

/// The part of a step over which velocity may change by its own size through viscous forces.
const STIFFNESS: f64 = 0.3;
/// Substeps beyond this many would mean a model faster than anything its recording could show.
const MOST_SUBSTEPS: usize = 200;
/// Share of a step that is down to rounding.
const INSTANT: f64 = 1e-12;

pub(super) fn advance<const N: usize>(
    plant: &impl Mechanism<N>,
    drive: Drive,
    mut x: [f64; N],
    h: f64,
) -> [f64; N] {
    let mut left = h;
    let (count, mut friction) = substeps(plant, drive, &x, h);
    let substep = h / count as f64;
    // Each pass goes one substep or ends where the contact sticks or lets go, which adds one pass.
    for _ in 0..4 * MOST_SUBSTEPS {
        if left <= 1e-12 * h {
            break;
        }
        let step = substep.min(left);
        let spent = match direction(plant, drive, &x) {
            Some(s) => slide(plant, drive, &mut x, (s, friction.take()), step),
            None => {
                plant.rest(&mut x);
                // Of a position and a velocity at rest nothing is left to move.
                if N == 2 {
                    left
                } else {
                    stick(plant, drive, &mut x, step)
                }
            }
        };
        left -= spent;
    }
    x
}

/// Direction in which the contact slides, or `None` if friction holds it.
fn direction<const N: usize>(plant: &impl Mechanism<N>, drive: Drive, x: &[f64; N]) -> Option<f64> {
    let v = plant.sliding(x).v;
    if v != 0.0 {
        return Some(v.signum());
    }
    let [forward, backward] = reserves(plant, drive, x);
    if forward < 0.0 {
        Some(1.0)
    } else if backward < 0.0 {
        Some(-1.0)
    } else {
        None
    }
}

/// How much more force in the positive and in the negative direction friction would hold at rest; negative where it yields.
fn reserves<const N: usize>(plant: &impl Mechanism<N>, drive: Drive, x: &[f64; N]) -> [f64; 2] {
    let balance = plant.balance(drive, x);
    let [forward, backward] = [1.0, -1.0].map(|s| plant.resistance(drive, x, s));
    [
        forward.max(backward) - balance,
        balance - forward.min(backward),
    ]
}

/// Slides in direction `s`, against a friction that may be known to begin with, for a step or until velocity reaches zero;
/// returns the time spent.
fn slide<const N: usize>(
    plant: &impl Mechanism<N>,
    drive: Drive,
    x: &mut [f64; N],
    (s, known): (f64, Option<f64>),
    step: f64,
) -> f64 {
    // The branch of sliding direction s is continued smoothly past v = 0, so the order of the method holds.
    let friction = |x: &[f64; N]| plant.resistance(drive, x, s);
    let rate = |x: &[f64; N], friction: f64| plant.rate(drive, x, friction);
    let first = rate(x, known.unwrap_or_else(|| friction(x)));
    let go = |h: f64| runge_kutta(|x| rate(x, friction(x)), x, &first, h);
    let speed = |x: &[f64; N]| plant.sliding(x).v * s;
    let next = go(step);
    let (before, after) = (speed(x), speed(&next));
    if after >= 0.0 {
        *x = next;
        return step;
    }
    if before <= 0.0 {
        // An axis that leaves standstill and is back within the step, against a resistance that soars with the first bit of
        // speed, creeps: less than the step could show, and cutting at every return would never end.
        *x = resting(plant, drive, *x)(step);
        return step;
    }
    let [low, high] = instant(step, [before, after], |h| speed(&go(h)));
    *x = go(low);
    plant.rest(x);
    high
}

/// Stays at rest for a step or until friction can no longer hold; returns the time spent.
fn stick<const N: usize>(
    plant: &impl Mechanism<N>,
    drive: Drive,
    x: &mut [f64; N],
    step: f64,
) -> f64 {
    let go = resting(plant, drive, *x);
    let reserve = |x: &[f64; N]| {
        let [forward, backward] = reserves(plant, drive, x);
        forward.min(backward)
    };
    let next = go(step);
    let after = reserve(&next);
    if after >= 0.0 {
        *x = next;
        return step;
    }
    let [_, high] = instant(step, [reserve(x), after], |h| reserve(&go(h)));
    *x = go(high);
    high
}

/// The state after the contact has been at rest for so long.
fn resting<const N: usize>(
    plant: &impl Mechanism<N>,
    drive: Drive,
    x: [f64; N],
) -> impl Fn(f64) -> [f64; N] {
    let slope = move |x: &[f64; N]| plant.rate(drive, x, plant.balance(drive, x));
    let first = slope(&x);
    move |h| {
        let mut next = runge_kutta(slope, &x, &first, h);
        plant.rest(&mut next);
        next
    }
}

/// The two ends of the instant, within a step, up to which `f` is not negative.
fn instant(step: f64, values: [f64; 2], f: impl Fn(f64) -> f64) -> [f64; 2] {
    let narrow = |[a, b]: [f64; 2], _| (b - a).abs() <= INSTANT * step;
    let mut ends = root::bracket([0.0, step], values, narrow, f);
    ends.sort_by(f64::total_cmp);
    ends
}

/// A step from `x`, where the slope is `a`.
fn runge_kutta<const N: usize>(
    slope: impl Fn(&[f64; N]) -> [f64; N],
    x: &[f64; N],
    a: &[f64; N],
    h: f64,
) -> [f64; N] {
    let b = slope(&moved(x, 0.5 * h, a));
    let c = slope(&moved(x, 0.5 * h, &b));
    let d = slope(&moved(x, h, &c));
    std::array::from_fn(|k| x[k] + h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]))
}

/// Substeps that keep the fastest mode of the linearised mechanism within reach of the method. It is linearised at the
/// velocity that the step is about, its own change at least: a slope that grows without bound towards standstill, like
/// that of a power law, acts for an instant that the step passes over anyway.
///
/// What this finds of the friction at `x` is given back where that slides and nothing hangs behind the contact that takes its share.
fn substeps<const N: usize>(
    plant: &impl Mechanism<N>,
    drive: Drive,
    x: &[f64; N],
    h: f64,
) -> (usize, Option<f64>) {
    let parts = |rate: f64| {
        let rate = rate.max(plant.pace());
        ((h * rate / STIFFNESS).ceil() as usize).clamp(1, MOST_SUBSTEPS)
    };
    if let Some(viscous) = plant.contact().lone_viscous() {
        return (parts(viscous.abs() / plant.inertia()), None);
    }
    let at = plant.sliding(x);
    let s = if at.v < 0.0 { -1.0 } else { 1.0 };
    let moment = plant.moment(drive, x);
    let resistance = |q, v| plant.contact().resistance(moment, State { q, v }, s);
    let now = resistance(at.q, at.v);
    let left = plant.balance(drive, x) - now;
    let v = s * at.v.abs().max(h * left.abs() / plant.inertia()).max(1e-6);
    let (dq, dv) = (1e-6, 1e-3 * v.abs());
    let here = if v == at.v { now } else { resistance(at.q, v) };
    let damping = (resistance(at.q, v + s * dv) - here) / (dv * plant.inertia());
    let stiffness = (resistance(at.q + dq, v) - here) / (dq * plant.inertia());
    let count = parts(damping.abs().max(stiffness.abs().sqrt()));
    (count, (N == 2 && at.v != 0.0).then_some(now))
}
