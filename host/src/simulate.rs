//! Free run: a complete model driven by the input of a recording alone.
//!
//! Between the instants at which the (possibly delayed) input switches, the axis slides in one direction and its
//! equation is smooth: classical Runge-Kutta steps. Where velocity reaches zero the step is cut at that instant,
//! and the forces decide: the axis stays at rest as long as the drive lies within what friction can balance.

use crate::axis::Axis;
use crate::recording::Recording;

/// Position and velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Position, rad or m.
    pub q: f64,
    /// Velocity, rad/s or m/s.
    pub v: f64,
}

/// The part of a step over which velocity may change by its own size through viscous forces.
const STIFFNESS: f64 = 0.3;
/// Substeps beyond this many would mean a model faster than anything its recording could show.
const MOST_SUBSTEPS: usize = 200;

/// Runs the axis from sample `first`, in state `from`, to sample `last`; one state for each sample, `from` included.
pub fn run(
    axis: &Axis,
    recording: &Recording,
    first: usize,
    last: usize,
    from: State,
) -> Vec<State> {
    let t = &recording.t;
    let mut states = Vec::with_capacity(last - first + 1);
    states.push(from);
    let mut state = from;
    // Sample whose input acts at t[first].
    let mut acting = t
        .partition_point(|&sample| sample + axis.delay <= t[first])
        .max(1)
        - 1;
    for k in first..last {
        let mut now = t[k];
        while now < t[k + 1] {
            while acting + 1 < t.len() && t[acting + 1] + axis.delay <= now {
                acting += 1;
            }
            let switch = t
                .get(acting + 1)
                .map_or(f64::INFINITY, |next| next + axis.delay);
            let until = switch.min(t[k + 1]);
            state = advance(axis, recording.u[acting], state, until - now);
            now = until;
        }
        states.push(state);
    }
    states
}

/// Advances by `h` seconds under a constant drive.
pub fn advance(axis: &Axis, u: f64, mut state: State, h: f64) -> State {
    let mut left = h;
    let substep = h / substeps(axis, state, h) as f64;
    // Each pass slides one substep or ends at a standstill; a step cut at zero velocity adds one pass.
    for _ in 0..4 * MOST_SUBSTEPS {
        if left <= 1e-12 * h {
            break;
        }
        let Some(s) = direction(axis, u, state) else {
            state.v = 0.0;
            return state;
        };
        let step = substep.min(left);
        let next = runge_kutta(axis, u, state, s, step);
        if next.v * s >= 0.0 {
            state = next;
            left -= step;
        } else {
            let (cut, at_rest) = stop(axis, u, state, s, step);
            state = at_rest;
            left -= cut;
        }
    }
    state
}

/// Direction in which the axis slides, or `None` if friction holds it.
fn direction(axis: &Axis, u: f64, state: State) -> Option<f64> {
    if state.v != 0.0 {
        return Some(state.v.signum());
    }
    let drive = axis.gain * u;
    let (forward, backward) = (
        axis.resistance(state.q, 0.0, 1.0),
        axis.resistance(state.q, 0.0, -1.0),
    );
    if drive > forward.max(backward) {
        Some(1.0)
    } else if drive < forward.min(backward) {
        Some(-1.0)
    } else {
        None
    }
}

/// Where within `step` velocity reaches zero, by bisection on the length of the step, and the state there.
fn stop(axis: &Axis, u: f64, state: State, s: f64, step: f64) -> (f64, State) {
    let (mut low, mut high) = (0.0, step);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if runge_kutta(axis, u, state, s, middle).v * s >= 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let at = runge_kutta(axis, u, state, s, low);
    (high, State { q: at.q, v: 0.0 })
}

fn runge_kutta(axis: &Axis, u: f64, x: State, s: f64, h: f64) -> State {
    // The branch of sliding direction s is continued smoothly past v = 0, so the order of the method holds.
    let slope = |q: f64, v: f64| (v, axis.acceleration(u, q, v, s));
    let (a1, b1) = slope(x.q, x.v);
    let (a2, b2) = slope(x.q + 0.5 * h * a1, x.v + 0.5 * h * b1);
    let (a3, b3) = slope(x.q + 0.5 * h * a2, x.v + 0.5 * h * b2);
    let (a4, b4) = slope(x.q + h * a3, x.v + h * b3);
    State {
        q: x.q + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4),
        v: x.v + h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4),
    }
}

/// Substeps that keep the fastest mode of the linearised axis within reach of the method.
fn substeps(axis: &Axis, state: State, h: f64) -> usize {
    let s = if state.v < 0.0 { -1.0 } else { 1.0 };
    let v = if state.v == 0.0 { 1e-6 } else { state.v };
    let (dq, dv) = (1e-6, 1e-3 * v.abs().max(1e-6));
    let here = axis.resistance(state.q, v, s);
    let damping = (axis.resistance(state.q, v + s * dv, s) - here) / (dv * axis.inertia);
    let stiffness = (axis.resistance(state.q + dq, v, s) - here) / (dq * axis.inertia);
    let rate = damping.abs().max(stiffness.abs().sqrt());
    ((h * rate / STIFFNESS).ceil() as usize).clamp(1, MOST_SUBSTEPS)
}

#[cfg(test)]
mod tests {
    use super::{State, run};
    use crate::axis::Axis;
    use crate::model::Model;
    use crate::recording::Recording;

    fn axis(effects: &str) -> Axis {
        let text = format!(
            "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\ncoulomb = 0.2\nviscous = 0.0\n{effects}"
        );
        Axis::new(&Model::parse(&text).unwrap()).unwrap()
    }

    fn recording(n: usize, u: impl Fn(f64) -> f64) -> Recording {
        let t: Vec<f64> = (0..n).map(|k| k as f64 * 1e-3).collect();
        Recording {
            path: "made.csv".into(),
            u: t.iter().map(|&t| u(t)).collect(),
            q: None,
            v: None,
            t,
        }
    }

    #[test]
    fn coulomb_friction_stops_the_axis_where_energy_says() {
        // ½·J·v² = Fc·x: from 10 rad/s it rests after 2.5 rad, exactly, and stays.
        let states = run(
            &axis(""),
            &recording(2000, |_| 0.0),
            0,
            1999,
            State { q: 0.0, v: 10.0 },
        );
        assert!((states[1999].q - 2.5).abs() < 1e-9 && states[1999].v == 0.0);
    }

    #[test]
    fn below_break_away_nothing_moves_and_above_it_does() {
        let at_rest = State { q: 0.3, v: 0.0 };
        let stays = run(
            &axis(""),
            &recording(500, |t| 0.19 * (20.0 * t).sin()),
            0,
            499,
            at_rest,
        );
        assert!(stays.iter().all(|s| *s == at_rest));
        let moves = run(&axis(""), &recording(500, |_| 0.25), 0, 499, at_rest);
        // v̇ = (0.25 − 0.2)/0.01 = 5 rad/s²
        assert!((moves[499].v - 5.0 * 0.499).abs() < 1e-9);
    }

    #[test]
    fn the_static_level_holds_what_the_coulomb_level_would_not() {
        let stribeck = axis("[effects.stribeck]\nstatic = 0.3\nstribeck_velocity = 0.1\n");
        let states = run(
            &stribeck,
            &recording(500, |_| 0.25),
            0,
            499,
            State { q: 0.0, v: 0.0 },
        );
        assert!(states[499].v == 0.0);
        let sliding = run(
            &stribeck,
            &recording(500, |_| 0.25),
            0,
            499,
            State { q: 0.0, v: 1.0 },
        );
        assert!(sliding[499].v > 1.0);
    }

    #[test]
    fn a_delay_shifts_the_response_by_itself() {
        let drive = |t: f64| if t < 0.1 { 0.0 } else { 1.0 };
        let from = State { q: 0.0, v: 0.0 };
        let prompt = run(&axis(""), &recording(300, drive), 0, 299, from);
        let late = run(
            &axis("[effects.delay]\ndelay = 0.0205\n"),
            &recording(300, drive),
            0,
            299,
            from,
        );
        // v̇ = 80 rad/s², so 20.5 ms later means 1.64 rad/s slower.
        assert!((prompt[299].v - late[299].v - 80.0 * 0.0205).abs() < 1e-9);
    }

    #[test]
    fn a_pendulum_keeps_its_energy() {
        let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\ncoulomb = 0.0\nviscous = 0.0\n[effects.gravity]\namplitude = 1.0\nphase = 0.0\n";
        let axis = Axis::new(&Model::parse(text).unwrap()).unwrap();
        let states = run(
            &axis,
            &recording(5000, |_| 0.0),
            0,
            4999,
            State { q: 1.0, v: 0.0 },
        );
        let energy = |s: &State| 0.005 * s.v * s.v - s.q.cos();
        let drift = (energy(&states[4999]) - energy(&states[0])).abs();
        // The method's energy error is of order (ωh)^5 per radian: ω·h = 0.01, about 50 rad.
        assert!(drift < 1e-6, "{drift:e}");
    }
}
