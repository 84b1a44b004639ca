//! Twins of a recording: what its sensors would have shown had the axis been exactly the model.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::steady;
use crate::fit::measured_state;
use crate::model::Model;
use crate::plant;
use crate::recording::Recording;
use crate::step::State;
use crate::system;
use crate::weak::Track;

/// Bandwidth with which the motion of a twin follows the measured one where no controller sees to that, Hz: within that of the
/// test functions (7 Hz), so that both go through the same reversals, and below what an encoder's counts would shake.
const FOLLOWS: f64 = 6.0;

/// The motion of an axis that is exactly a model, the input that drives it, and what its sensors show.
pub(super) struct Twin {
    u: Vec<f64>,
    states: Vec<State>,
    seen: Vec<f64>,
}

/// What is drawn for a twin.
#[derive(Clone, Copy)]
pub(super) struct Draw {
    /// Where the steps of the encoder lie, from 0 to 1.
    pub at: f64,
    /// RMS of the noise that the sensor adds before these steps, in the unit of what it measures.
    pub white: f64,
    /// RMS of the load in N·m or N, drawn for every sample; that of a negative one is the opposite.
    pub load: f64,
    /// Whether what drives it differs from levels that were taken for readings by what these err by.
    pub off_levels: bool,
    /// Of the noise of the sensors.
    pub seed: u64,
    /// Of the load.
    pub load_seed: u64,
}

impl Twin {
    /// Under the recorded input and what keeps it with the measured motion; without a draw, undisturbed and with ideal sensors.
    /// `None` where the model describes no such axis.
    ///
    /// Where the input comes from a [`controller`], that keeps the twin there, too: told what the twin's sensors show, since it
    /// shakes the axis with the very counts that it reads.
    pub fn new(
        model: &Model,
        recording: &Recording,
        track: &Track,
        draw: Option<Draw>,
    ) -> Option<Self> {
        if system::path(model).divides() {
            // Held by its load, the axis would shake itself at its resonance.
            return None;
        }
        let measured: Vec<State> = (0..recording.t.len())
            .map(|k| measured_state(recording, track, k))
            .collect();
        let kept = |gains: Option<&[f64]>| {
            let sensors = draw.map(|draw| Sensors::new(track, draw));
            let twin = Self::kept(model, recording, &measured, (gains, draw, sensors))?;
            let finite = |s: &State| s.q.is_finite() && s.v.is_finite();
            twin.states.iter().all(finite).then_some(twin)
        };
        let controlled = controller(recording).and_then(|gains| kept(Some(&gains)));
        controlled
            .filter(|twin| twin.stays_with(&measured))
            .or_else(|| kept(None))
    }

    /// By a controller of these gains, or else so that it follows with [`FOLLOWS`].
    fn kept(
        model: &Model,
        recording: &Recording,
        measured: &[State],
        (gains, draw, mut sensors): (Option<&[f64]>, Option<Draw>, Option<Sensors>),
    ) -> Option<Self> {
        let load = draw.map_or(0.0, |draw| draw.load);
        let mut rng = ChaCha8Rng::seed_from_u64(draw.map_or(0, |draw| draw.load_seed));
        let off_levels = draw.filter(|draw| draw.off_levels);
        let off = off_levels.and_then(|draw| steady::errors_of_levels(recording, draw.load_seed));
        let gain = model.gain.value.unwrap_or(1.0);
        let mut plant = plant::new(model).ok()?;
        let authority = plant.authority();
        let omega = TAU * FOLLOWS;
        let (t, mut u) = (&recording.t, recording.u.clone());
        let was = recording.measured();
        plant.start(t, &u, 0, measured[0]);
        let (mut states, mut seen) = (Vec::with_capacity(t.len()), Vec::with_capacity(t.len()));
        for (k, wanted) in measured.iter().enumerate() {
            let is = plant.measured();
            states.push(is);
            let shown = if recording.q.is_some() { is.q } else { is.v };
            seen.push(sensors.as_mut().map_or(shown, |s| s.read(shown)));
            u[k] += if let Some(gains) = gains {
                let past = gains.iter().zip((0..=k).rev());
                past.map(|(gain, k)| gain * (seen[k] - was[k])).sum::<f64>()
            } else {
                // Critically damped but for friction.
                let lacks = omega * (wanted.q - is.q) + 2.0 * (wanted.v - is.v);
                omega * lacks / authority
            };
            if k + 1 < t.len() {
                // A window sums hundreds, so all that counts is the variance, which is one here.
                let unit = 3f64.sqrt() * rng.random_range(-1.0..=1.0);
                let off = off.as_ref().map_or(0.0, |off| gain * off[k]);
                plant.advance(t, &u, k, load * unit + off);
            }
        }
        Some(Self { u, states, seen })
    }

    /// Whether it errs by less than half of the motion, in position and in velocity.
    fn stays_with(&self, measured: &[State]) -> bool {
        let count = measured.len() as f64;
        [|s: &State| s.q, |s: &State| s.v].iter().all(|of| {
            let mean = measured.iter().map(of).sum::<f64>() / count;
            let moves: f64 = measured.iter().map(|s| (of(s) - mean).powi(2)).sum();
            let pairs = self.states.iter().zip(measured);
            let errs: f64 = pairs.map(|(is, was)| (of(is) - of(was)).powi(2)).sum();
            errs < 0.25 * moves
        })
    }

    /// What its sensors show.
    pub fn recording(&self, recording: &Recording) -> Recording {
        let seen = Some(self.seen.clone());
        let (q, v) = match recording.q {
            Some(_) => (seen, None),
            None => (None, seen),
        };
        Recording {
            u: self.u.clone(),
            q,
            v,
            ..recording.clone()
        }
    }
}

/// Halvings of the interval in which the noise of a sensor lies.
const HALVINGS: usize = 5;

/// RMS of the noise that the sensor of a recording adds, in the unit of what it measures.
///
/// What differences of a quantised signal show is mostly its steps: where an axis shakes by less than one, as under a
/// controller that answers each with a push, they may show more noise than the sensor has. There it is as much as makes
/// the readings of a twin as rough as those of the recording.
pub(super) fn white(model: &Model, recording: &Recording, track: &Track, load: f64) -> Option<f64> {
    let most = (track.sensor_noise().powi(2) - track.quantum.powi(2) / 12.0)
        .max(0.0)
        .sqrt();
    if track.quantum == 0.0 || most == 0.0 {
        return Some(most);
    }
    let draw = |white| Draw {
        at: 0.5,
        white,
        load,
        off_levels: false,
        seed: 0,
        load_seed: 0,
    };
    let rougher = |white| {
        let twin = Twin::new(model, recording, track, Some(draw(white)))?;
        Some(roughness(&twin.seen) > roughness(recording.measured()))
    };
    let (mut low, mut high) = (0.0, most);
    if rougher(low)? {
        return Some(low);
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        *(if rougher(middle)? {
            &mut high
        } else {
            &mut low
        }) = middle;
    }
    Some(0.5 * (low + high))
}

/// Sum of the squared third differences, in which motion hardly shows.
fn roughness(x: &[f64]) -> f64 {
    let third = |x: &[f64]| x[3] - 3.0 * x[2] + 3.0 * x[1] - x[0];
    x.windows(4).map(|x| third(x).powi(2)).sum()
}

/// The sensors of a twin.
struct Sensors {
    rng: ChaCha8Rng,
    white: f64,
    step: f64,
    at: f64,
}

impl Sensors {
    fn new(track: &Track, draw: Draw) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(draw.seed),
            // Uniform on ±√3 has unit variance.
            white: 3f64.sqrt() * draw.white,
            step: track.quantum,
            at: draw.at,
        }
    }

    fn read(&mut self, x: f64) -> f64 {
        let x = x + self.white * self.rng.random_range(-1.0..=1.0);
        if self.step > 0.0 {
            ((x / self.step + self.at).floor() + 0.5 - self.at) * self.step
        } else {
            x
        }
    }
}

/// Samples that a controller looks back: two make a velocity, and filters take a few more.
const MEMORY: usize = 4;
/// Share of the squared second differences of the input that a controller must account for.
const ACCOUNTS: f64 = 0.9;

/// What a controller adds to the input for each unit that the sensors show now and in the samples before, if one makes the input:
/// by least squares of second differences, in which a set point and an integral hardly show.
fn controller(recording: &Recording) -> Option<Vec<f64>> {
    let second =
        |x: &[f64]| -> Vec<f64> { x.windows(3).map(|x| x[2] - 2.0 * x[1] + x[0]).collect() };
    let (u, shown) = (second(&recording.u), second(recording.measured()));
    let rows = u.len().checked_sub(MEMORY)?;
    let past = DMatrix::from_fn(rows, MEMORY, |k, lag| shown[k + MEMORY - lag]);
    let input = DVector::from_column_slice(&u[MEMORY..]);
    let gains = past.tr_mul(&past).cholesky()?.solve(&past.tr_mul(&input));
    let left = (&input - &past * &gains).norm_squared();
    let accounts = left < (1.0 - ACCOUNTS) * input.norm_squared();
    accounts.then(|| gains.iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::{controller, white};
    use crate::bench::{self, Control, Sensors};
    use crate::excite::{Excitation, Shape};
    use crate::model::Model;
    use crate::plant;
    use crate::recording::Recording;
    use crate::weak::Track;

    const CONTROL: Control = Control {
        proportional: 20.0,
        derivative: 0.8,
    };
    const COUNT: f64 = 1.5e-3;
    const LOAD: f64 = 0.01;

    fn model() -> Model {
        let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.012\n[friction]\ncoulomb = 0.12\nviscous = 0.02\n";
        Model::parse(text).unwrap()
    }

    fn recorded(control: Option<Control>, position_noise: f64) -> Recording {
        let mut plant = plant::new(&model()).unwrap();
        let signal = Excitation {
            shape: Shape::Multisine,
            amplitude: 0.5,
            band: (0.1, 2.0),
            duration: 4.0,
            seed: 1,
        };
        let t: Vec<f64> = (0..4000).map(|k| f64::from(k) * 1e-3).collect();
        let values = signal.values(&t);
        let sensors = Sensors {
            count: COUNT,
            load_noise: LOAD,
            position_noise,
            ..Sensors::default()
        };
        let record = bench::record(plant.as_mut(), t, &values, control, sensors);
        Recording {
            t: record.t,
            u: record.u,
            q: Some(record.q),
            ..Recording::default()
        }
    }

    /// `u = Kp·(q_ref − q) − Kd·q̇`, and a torque that nobody controls.
    #[test]
    fn a_controller_shows_in_what_its_input_makes_of_counts() {
        let gains = controller(&recorded(Some(CONTROL), 0.0)).unwrap();
        let truth = [-20.0 - 800.0, 800.0, 0.0, 0.0];
        for (gain, truth) in gains.iter().zip(truth) {
            assert!((gain - truth).abs() < 1.0, "{gains:?}");
        }
        assert_eq!(controller(&recorded(None, 0.0)), None);
    }

    /// Counts that a controller answers look like noise, and noise within a count hides in it.
    #[test]
    fn the_noise_of_a_sensor_is_told_from_its_steps() {
        for truth in [0.0, 0.2, 0.5, 2.0] {
            let recording = recorded(Some(CONTROL), truth * COUNT);
            let model = model();
            let track = Track::new(&recording, model.motion, None);
            let found = white(&model, &recording, &track, LOAD).unwrap() / COUNT;
            assert!(
                (found - truth).abs() < 0.05 + 0.1 * truth,
                "{found} counts for {truth}"
            );
        }
    }
}
