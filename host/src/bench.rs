//! A simulated test bench: drives a plant and records what its sensors would have shown.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::plant::Plant;
use crate::step::State;

/// Sensors and disturbances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensors {
    /// Smallest step of the measured position, rad or m; zero for none.
    pub count: f64,
    /// RMS of the noise on the measured position, rad or m.
    pub position_noise: f64,
    /// RMS of a torque or force that acts on the plant and is not recorded, N·m or N; constant within each sample.
    pub load_noise: f64,
    /// What all noise is drawn from.
    pub seed: u64,
}

/// A position controller on the measured position: `u = Kp·(q_ref − q) − Kd·q̇`, with `q̇` from the last two samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// `Kp`, in the unit of `u` per rad or m.
    pub proportional: f64,
    /// `Kd`, in the unit of `u` per rad/s or m/s.
    pub derivative: f64,
}

impl Control {
    /// Gains that give a plant of this authority a closed loop of `bandwidth` Hz, critically damped but for friction.
    pub fn of_bandwidth(bandwidth: f64, authority: f64) -> Self {
        let omega = std::f64::consts::TAU * bandwidth;
        Self {
            proportional: omega * omega / authority,
            derivative: 2.0 * omega / authority,
        }
    }
}

/// What was recorded, and the truth behind it.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Instants, s.
    pub t: Vec<f64>,
    /// Input, held from its instant until the next.
    pub u: Vec<f64>,
    /// Measured position, rad or m.
    pub q: Vec<f64>,
    /// Motor current, A; empty for a plant without a motor.
    pub current: Vec<f64>,
    /// Set point of the position controller, rad or m; empty without one.
    pub set_point: Vec<f64>,
    /// True positions and velocities.
    pub truth: Vec<State>,
}

/// Drives a plant from where it is through the instants `t`: by `signal` itself, or under control with `signal` as the
/// set point.
pub fn record(
    plant: &mut dyn Plant,
    t: Vec<f64>,
    signal: &[f64],
    control: Option<Control>,
    sensors: Sensors,
) -> Record {
    let mut rng = ChaCha8Rng::seed_from_u64(sensors.seed);
    let mut out = Record::default();
    for (k, &wanted) in signal.iter().enumerate() {
        let truth = plant.measured();
        let noisy = truth.q + normal(&mut rng, sensors.position_noise);
        let q = if sensors.count > 0.0 {
            (noisy / sensors.count).floor() * sensors.count
        } else {
            noisy
        };
        let u = control.map_or(wanted, |control| {
            let before = out.q.last().copied().unwrap_or(q);
            let velocity = if k == 0 {
                0.0
            } else {
                (q - before) / (t[k] - t[k - 1])
            };
            control.proportional * (wanted - q) - control.derivative * velocity
        });
        out.u.push(u);
        out.q.push(q);
        out.current.extend(plant.current());
        out.truth.push(truth);
        if k + 1 < t.len() {
            let load = normal(&mut rng, sensors.load_noise);
            plant.advance(&t, &out.u, k, load);
        }
    }
    if control.is_some() {
        out.set_point = signal.to_vec();
    }
    Record { t, ..out }
}

/// Noise of this RMS: a sum of twelve uniform numbers, which is close to normal.
fn normal(rng: &mut ChaCha8Rng, rms: f64) -> f64 {
    if rms > 0.0 {
        rms * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)
    } else {
        0.0
    }
}
