//! Twins of a recording: what its sensors would have shown had the axis been exactly the model.

use std::f64::consts::TAU;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::fit::measured_state;
use crate::model::Model;
use crate::plant;
use crate::recording::Recording;
use crate::step::State;
use crate::system;
use crate::weak::Track;

/// Bandwidth with which the motion of a twin follows the measured one, Hz: within that of the test functions (7 Hz), so
/// that both go through the same reversals, and below what an encoder's counts would shake.
const FOLLOWS: f64 = 6.0;

/// The motion of an axis that is exactly a model, and the input that drives it.
pub(super) struct Twin {
    u: Vec<f64>,
    states: Vec<State>,
}

impl Twin {
    /// Under the recorded input and what it takes besides to stay with the measured motion, while a load of this size, in
    /// N·m or N RMS and drawn for every sample by `seed`, disturbs it; that of a negative size is the opposite. `None` where
    /// the model describes no such axis.
    pub fn new(
        model: &Model,
        recording: &Recording,
        track: &Track,
        load: f64,
        seed: u64,
    ) -> Option<Self> {
        if system::path(model).divides() {
            // Held by its load, the axis would shake itself at its resonance.
            return None;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut plant = plant::new(model).ok()?;
        let authority = plant.authority();
        let omega = TAU * FOLLOWS;
        let (t, mut u) = (&recording.t, recording.u.clone());
        plant.start(t, &u, 0, measured_state(recording, track, 0));
        let mut states = Vec::with_capacity(t.len());
        for k in 0..t.len() {
            let (wanted, is) = (measured_state(recording, track, k), plant.measured());
            states.push(is);
            // Critically damped but for friction.
            let lacks = omega * (wanted.q - is.q) + 2.0 * (wanted.v - is.v);
            u[k] += omega * lacks / authority;
            if k + 1 < t.len() {
                // A window sums hundreds, so all that counts is the variance, which is one here.
                let unit = 3f64.sqrt() * rng.random_range(-1.0..=1.0);
                plant.advance(t, &u, k, load * unit);
            }
        }
        let finite = states.iter().all(|s| s.q.is_finite() && s.v.is_finite());
        finite.then_some(Self { u, states })
    }

    /// What ideal sensors show of it.
    pub fn ideal(&self, recording: &Recording) -> Recording {
        let column = |of: fn(&State) -> f64| Some(self.states.iter().map(of).collect());
        let positions = recording.q.is_some();
        Recording {
            u: self.u.clone(),
            q: column(|s| s.q).filter(|_| positions),
            v: column(|s| s.v).filter(|_| !positions),
            ..recording.clone()
        }
    }

    /// What the sensors show of it. `at` from 0 to 1 is where the steps of an encoder lie; `seed` draws other noise.
    pub fn seen(&self, recording: &Recording, track: &Track, at: f64, seed: u64) -> Recording {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let positions = recording.q.is_some();
        let noise = if positions {
            track.position_noise
        } else {
            track.position_noise / track.period
        };
        let step = track.quantum;
        // Uniform on ±√3 has unit variance.
        let white = 3f64.sqrt() * (noise * noise - step * step / 12.0).max(0.0).sqrt();
        let mut sense = |x: f64| {
            let x = x + white * rng.random_range(-1.0..=1.0);
            if step > 0.0 {
                ((x / step + at).floor() + 0.5 - at) * step
            } else {
                x
            }
        };
        let mut column = |of: fn(&State) -> f64| self.states.iter().map(|s| sense(of(s))).collect();
        let (q, v) = if positions {
            (Some(column(|s| s.q)), None)
        } else {
            (None, Some(column(|s| s.v)))
        };
        Recording {
            u: self.u.clone(),
            q,
            v,
            ..recording.clone()
        }
    }
}
