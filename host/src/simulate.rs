//! Free run: a complete model driven by the input of a recording alone.

use crate::axis::Axis;
use crate::effects::Path;
use crate::recording::Recording;
pub use crate::step::State;
use crate::step::{self, Drive, Loaded, Mechanism, Memory};

/// Which sample's input acts, under a zero-order hold, and where a lag behind it stands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hold {
    acting: usize,
    lagged: f64,
    /// Whether nothing acted before the first sample, rather than its value.
    fresh: bool,
}

/// Of a lag this many time constants back nothing is left to rounding.
const FORGOTTEN: f64 = 40.0;
/// Parts of a hold over which a lagged input acts by its mean.
const PARTS: f64 = 8.0;

impl Hold {
    /// The hold at the instant of sample `first`, under the inputs recorded so far. Of an axis that moves at `speed` then; what
    /// drives one off that is at rest at the first sample of all was not there before.
    pub fn at(t: &[f64], u: &[f64], first: usize, speed: f64, path: &Path) -> Self {
        if first == 0 && speed == 0.0 {
            return Self {
                fresh: true,
                ..Self::default()
            };
        }
        let begun = |instant: f64| t.partition_point(|&sample| sample + path.delay <= instant);
        let acting = begun(t[first]).max(1) - 1;
        let from = begun(t[first] - FORGOTTEN * path.lag).max(1) - 1;
        let value = |k: usize| u.get(k).map_or(0.0, |&u| path.pass(u));
        let mut lagged = value(from);
        for k in from..acting {
            lagged = path.relax(lagged, value(k), t[k + 1] - t[k]).1;
        }
        let rest = t[first] - path.delay - t[acting];
        lagged = path.relax(lagged, value(acting), rest.max(0.0)).1;
        Self {
            acting,
            lagged,
            fresh: false,
        }
    }

    /// Advances a mechanism from instant `t[k]` to `t[k + 1]` under the inputs up to now.
    pub fn advance<const N: usize>(
        &mut self,
        plant: &impl Mechanism<N>,
        (t, u): (&[f64], &[f64]),
        k: usize,
        load: f64,
        mut state: Memory<N>,
    ) -> Memory<N> {
        let path = plant.path();
        let mut now = t[k];
        while now < t[k + 1] {
            while self.acting + 1 < t.len() && t[self.acting + 1] + path.delay <= now {
                self.acting += 1;
            }
            self.fresh &= now < t[0] + path.delay;
            let next = if self.fresh { 0 } else { self.acting + 1 };
            let switch = t.get(next).map_or(f64::INFINITY, |next| next + path.delay);
            let until = switch.min(t[k + 1]);
            let passed = if self.fresh {
                0.0
            } else {
                path.pass(u[self.acting])
            };
            let parts = if path.lag > 0.0 {
                ((until - now) / path.lag * PARTS).ceil().clamp(1.0, PARTS)
            } else {
                1.0
            };
            let dt = (until - now) / parts;
            for part in 0..parts as usize {
                let mean;
                (mean, self.lagged) = path.relax(self.lagged, passed, dt);
                let drive = Drive {
                    t: now + (part as f64 + 0.5) * dt - t[0],
                    dt,
                    u: mean,
                    load,
                };
                state = step::advance(plant, drive, state, dt);
            }
            now = until;
        }
        state
    }
}

/// Where a free run of an axis starts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Start {
    /// What an encoder sees.
    pub state: State,
    /// Position and velocity of a load relative to the driven side; at ease where nothing is known of it.
    pub load: Option<[f64; 2]>,
    /// Deflection of the bristles, rad or m; at ease where nothing is known of it.
    pub bend: Option<f64>,
}

impl From<State> for Start {
    fn from(state: State) -> Self {
        Self {
            state,
            load: None,
            bend: None,
        }
    }
}

/// Runs a mechanism from sample `first`, where an encoder sees `from` and all else is as `state` says, to sample `last`;
/// one state for each sample, `from` included. `None` once there is one that may not be.
fn run<const N: usize>(
    plant: &impl Mechanism<N>,
    recording: &Recording,
    (first, last): (usize, usize),
    from: State,
    mut state: Memory<N>,
    may: impl Fn(&State) -> bool,
) -> Option<Vec<State>> {
    if !may(&from) {
        return None;
    }
    let mut states = Vec::with_capacity(last - first + 1);
    states.push(from);
    let mut hold = Hold::at(&recording.t, &recording.u, first, from.v, &plant.path());
    for k in first..last {
        state = hold.advance(plant, (&recording.t, &recording.u), k, 0.0, state);
        let seen = plant.measured(&state.x);
        if !may(&seen) {
            return None;
        }
        states.push(seen);
    }
    Some(states)
}

/// Runs an axis, with the load behind its driven side if it has one, from sample `first` to sample `last`; one state for
/// each sample, that of the start included.
pub fn run_axis(
    axis: &Axis,
    recording: &Recording,
    first: usize,
    last: usize,
    start: impl Into<Start>,
) -> Vec<State> {
    run_axis_while(axis, recording, (first, last), start, |_| true).unwrap_or_default()
}

/// The same as long as every state may be; `None` from the first one on that may not.
pub fn run_axis_while(
    axis: &Axis,
    recording: &Recording,
    samples: (usize, usize),
    start: impl Into<Start>,
    may: impl Fn(&State) -> bool,
) -> Option<Vec<State>> {
    let start = start.into();
    let bent = |z: f64| start.bend.unwrap_or(z);
    let Some(coupling) = axis.coupling else {
        let Memory { x, z } = Memory::at_ease(axis, start.state);
        let memory = Memory { x, z: bent(z) };
        return run(axis, recording, samples, start.state, memory, may);
    };
    let loaded = Loaded::new(axis, coupling);
    let Memory { mut x, z } = Memory::at_ease(&loaded, start.state);
    if let Some(load) = start.load {
        x = loaded.carrying(start.state, load);
    }
    let memory = Memory { x, z: bent(z) };
    run(&loaded, recording, samples, start.state, memory, may)
}

/// Advances an axis whose law has no state by `h` seconds under a constant drive.
pub fn advance(axis: &Axis, u: f64, state: State, h: f64) -> State {
    let from = Memory {
        x: [state.q, state.v],
        z: 0.0,
    };
    axis.measured(
        &step::advance(
            axis,
            Drive {
                u,
                dt: h,
                ..Drive::default()
            },
            from,
            h,
        )
        .x,
    )
}

#[cfg(test)]
mod tests {
    use super::{State, run_axis};
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
            t,
            ..Recording::default()
        }
    }

    #[test]
    fn coulomb_friction_stops_the_axis_where_energy_says() {
        // ½·J·v² = Fc·x: from 10 rad/s it rests after 2.5 rad, exactly, and stays.
        let states = run_axis(
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
        let stays = run_axis(
            &axis(""),
            &recording(500, |t| 0.19 * (20.0 * t).sin()),
            0,
            499,
            at_rest,
        );
        assert!(stays.iter().all(|s| *s == at_rest));
        let moves = run_axis(&axis(""), &recording(500, |_| 0.25), 0, 499, at_rest);
        // v̇ = (0.25 − 0.2)/0.01 = 5 rad/s²
        assert!((moves[499].v - 5.0 * 0.499).abs() < 1e-9);
    }

    #[test]
    fn the_static_level_holds_what_the_coulomb_level_would_not() {
        let stribeck = axis("[effects.stribeck]\nstatic = 0.3\nstribeck_velocity = 0.1\n");
        let states = run_axis(
            &stribeck,
            &recording(500, |_| 0.25),
            0,
            499,
            State { q: 0.0, v: 0.0 },
        );
        assert!(states[499].v == 0.0);
        let sliding = run_axis(
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
        let prompt = run_axis(&axis(""), &recording(300, drive), 0, 299, from);
        let late = run_axis(
            &axis("[effects.delay]\ndelay = 0.0205\n"),
            &recording(300, drive),
            0,
            299,
            from,
        );
        // v̇ = 80 rad/s², so 20.5 ms later means 1.64 rad/s slower.
        assert!((prompt[299].v - late[299].v - 80.0 * 0.0205).abs() < 1e-9);
    }

    /// What drives an axis off that stands at the first sample was not there before; one that moves already had it.
    #[test]
    fn nothing_acted_before_an_axis_that_stands() {
        let slower = |v: f64| {
            let [prompt, late] = ["", "[effects.delay]\ndelay = 0.0205\n"].map(|late| {
                let from = State { q: 0.0, v };
                run_axis(&axis(late), &recording(300, |_| 1.0), 0, 299, from)
            });
            prompt[299].v - late[299].v
        };
        assert!((slower(0.0) - 80.0 * 0.0205).abs() < 1e-9);
        assert!(slower(0.1).abs() < 1e-9);
    }

    #[test]
    fn a_pendulum_keeps_its_energy() {
        let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\ncoulomb = 0.0\nviscous = 0.0\n[effects.gravity]\namplitude = 1.0\nphase = 0.0\n";
        let axis = Axis::new(&Model::parse(text).unwrap()).unwrap();
        let states = run_axis(
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

    #[test]
    fn a_load_without_inertia_is_no_load_and_one_without_a_gap_no_other_side() {
        let bare = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\ncoulomb = 0.1\nviscous = 0.02\n";
        let loads = [
            "",
            "[effects.backlash]\nload_inertia = 0.0\ngap = 0.02\n",
            "[effects.backlash]\nmatched_gap = 0.0\nmotor_friction = 1.0\n",
        ];
        let runs = loads.map(|load| {
            let axis = Axis::new(&Model::parse(&format!("{bare}{load}")).unwrap()).unwrap();
            let swinging = recording(300, |t| (40.0 * t).sin());
            run_axis(&axis, &swinging, 0, 299, State::default())[299]
        });
        assert!(runs[0].q != 0.0, "{runs:?}");
        assert!(runs.iter().all(|end| end.q == runs[0].q), "{runs:?}");
    }

    #[test]
    fn truth_and_reading_are_inverse_and_err_as_said() {
        let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\ncoulomb = 0.1\nviscous = 0.0\n[effects.sensor-eccentricity]\namplitude = 0.02\nphase = 0.6\n";
        let axis = Axis::new(&Model::parse(text).unwrap()).unwrap();
        let truth = State { q: 1.3, v: 7.0 };
        let seen = axis.seen(truth);
        assert!((seen.q - truth.q - 0.02 * 1.9f64.sin()).abs() < 1e-15);
        assert!((seen.v - 7.0 * (1.0 + 0.02 * 1.9f64.cos())).abs() < 1e-14);
        let again = axis.truth(seen);
        assert!((again.q - truth.q).abs() < 1e-14 && (again.v - truth.v).abs() < 1e-13);
    }

    /// Under a step `u₀` without friction, `v = u₀/J·(t − τ·(1 − e^(−t/τ)))`.
    #[test]
    fn a_step_is_answered_late_and_softly() {
        let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\ncoulomb = 0.0\nviscous = 0.0\n[effects.actuator-lag]\ntime_constant = 0.004\n";
        let axis = Axis::new(&Model::parse(text).unwrap()).unwrap();
        let t: Vec<f64> = (0..40).map(|k| f64::from(k) * 1e-3).collect();
        let u: Vec<f64> = (0..40).map(|k| f64::from(k >= 10)).collect();
        let recording = Recording {
            path: "made.csv".into(),
            t,
            u,
            ..Recording::default()
        };
        let states = run_axis(&axis, &recording, 0, 39, State::default());
        let since = 0.029;
        let exact = 100.0 * (since - 0.004 * (1.0 - f64::exp(-since / 0.004)));
        assert!(
            (states[39].v - exact).abs() < 1e-12,
            "{} {exact}",
            states[39].v
        );
        // Restarted in the middle, it knows where the lag stands.
        let again = run_axis(&axis, &recording, 15, 39, states[15]);
        assert!((again[24].v - exact).abs() < 1e-12);
    }

    /// A resistance that soars with the first bit of speed holds an axis that is driven little beyond break-away at a creep
    /// too slow to see, and costs no more than any other step.
    #[test]
    fn a_power_law_creeps_and_then_slides() {
        let law = "[effects.power-law-viscous]\ncoefficient = 0.5\nexponent = 0.2\n";
        let from = State::default();
        let creeps = run_axis(&axis(law), &recording(300, |_| 0.201), 0, 299, from);
        // The excess of 0.001 N·m balances 0.5·v^0.2 at 3e-14 rad/s.
        assert!(creeps.iter().all(|s| s.v.abs() < 1e-6 && s.q.abs() < 1e-6));
        let slides = run_axis(&axis(law), &recording(15_000, |_| 1.2), 0, 14_999, from);
        // 1 N·m balances 0.5·v^0.2 at 32 rad/s.
        assert!(
            (slides[14_999].v - 32.0).abs() < 0.1,
            "{}",
            slides[14_999].v
        );
    }

    #[test]
    fn it_takes_the_place_of_the_given_inertia() {
        let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\ncoulomb = 0.1\nviscous = 0.0\n[effects.inertia-mismatch]\ninertia = 0.013\n";
        let model = Model::parse(text).unwrap();
        assert_eq!(Axis::new(&model).unwrap().inertia, 0.013);
        let unknown = text.replace("0.01\n", "\"?\"\n");
        assert!(
            Model::parse(&unknown)
                .err()
                .unwrap()
                .contains("does not apply")
        );
    }
}
