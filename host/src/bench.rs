//! A simulated test bench: drives a plant and records what its sensors would have shown.

use std::fmt::Write;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::model::{Model, Motion};
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

/// A load of this RMS for each of `samples`, as [`record`] draws it.
pub fn loads(samples: usize, rms: f64, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..samples).map(|_| normal(&mut rng, rms)).collect()
}

/// Noise of this RMS: a sum of twelve uniform numbers, which is close to normal.
fn normal(rng: &mut ChaCha8Rng, rms: f64) -> f64 {
    if rms > 0.0 {
        rms * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)
    } else {
        0.0
    }
}

/// A recording with units in its header, under the names that the model file gives its columns; without a model, under the
/// canonical names and without units, which it alone knows.
pub fn csv(record: &Record, model: Option<&Model>) -> String {
    let columns = [
        ("t", &record.t),
        ("u", &record.u),
        ("q", &record.q),
        ("i", &record.current),
        ("q_ref", &record.set_point),
    ];
    let columns: Vec<_> = columns
        .into_iter()
        .filter(|(_, values)| !values.is_empty())
        .collect();
    let heads = columns.iter().map(|(name, _)| match model {
        None => (*name).to_owned(),
        Some(model) => {
            let own = model.columns.get(*name).map_or(*name, String::as_str);
            format!("{own}[{}]", unit(name, model))
        }
    });
    let mut text = heads.collect::<Vec<_>>().join(",");
    text.push('\n');
    for k in 0..record.t.len() {
        for (column, (_, values)) in columns.iter().enumerate() {
            let comma = if column == 0 { "" } else { "," };
            // `{:?}` writes the shortest decimal that reads back as the same number.
            let _ = write!(text, "{comma}{:?}", values[k]);
        }
        text.push('\n');
    }
    text
}

/// The unit of a canonical column.
pub fn unit(column: &str, model: &Model) -> &'static str {
    let (torque, position) = match model.motion {
        Motion::Rotary => ("N*m", "rad"),
        Motion::Linear => ("N", "m"),
    };
    match (column, model.input.as_str()) {
        ("t", _) => "s",
        ("i", _) | ("u", "current") => "A",
        ("u", "voltage") => "V",
        // The torque on a wheel whose motion counts in metres.
        ("u", "torque") => "N*m",
        ("u", "force") => "N",
        ("u", _) => torque,
        _ => position,
    }
}

#[cfg(test)]
mod tests {
    use super::{Control, Record, Sensors, record};
    use crate::model::Model;
    use crate::plant;

    const HERTZ: f64 = 1000.0;

    fn run(signal: &[f64], control: Option<Control>, sensors: Sensors) -> Record {
        let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\ncoulomb = 0.1\nviscous = 0.02\n";
        let mut plant = plant::new(&Model::parse(text).unwrap()).unwrap();
        let t = (0..signal.len()).map(|k| k as f64 / HERTZ).collect();
        record(plant.as_mut(), t, signal, control, sensors)
    }

    fn rms(x: impl Iterator<Item = f64> + Clone) -> f64 {
        (x.clone().map(|x| x * x).sum::<f64>() / x.count() as f64).sqrt()
    }

    #[test]
    fn an_encoder_shows_whole_counts_below_the_truth() {
        let count = 1e-3;
        let sensors = Sensors {
            count,
            ..Sensors::default()
        };
        let made = run(&[0.3; 500], None, sensors);
        for (q, truth) in made.q.iter().zip(&made.truth) {
            let steps = q / count;
            assert!((steps - steps.round()).abs() < 1e-6, "{q}");
            assert!((0.0..count * (1.0 + 1e-9)).contains(&(truth.q - q)));
        }
        assert!(made.current.is_empty() && made.set_point.is_empty());
    }

    #[test]
    fn noise_has_the_size_asked_for() {
        let sensors = Sensors {
            position_noise: 2e-3,
            seed: 5,
            ..Sensors::default()
        };
        let made = run(&vec![0.0; 20_000], None, sensors);
        // The RMS of n normal numbers is off by 1/√(2n) = 0.5 %.
        assert!((rms(made.q.iter().copied()) / 2e-3 - 1.0).abs() < 0.02);
        assert!(made.truth.iter().all(|s| s.q == 0.0 && s.v == 0.0));
        // A load below break-away moves nothing; one above does, and shows in no recorded input.
        let load = |load_noise| {
            run(
                &[0.0; 500],
                None,
                Sensors {
                    load_noise,
                    ..sensors
                },
            )
        };
        assert!(load(0.01).truth.iter().all(|s| s.v == 0.0));
        assert!(
            load(0.5).truth.iter().any(|s| s.v != 0.0) && load(0.5).u.iter().all(|&u| u == 0.0)
        );
    }

    #[test]
    fn the_controller_follows_its_set_point() {
        // Critically damped at 10 Hz: a constant set point is approached up to what Coulomb friction holds off, Fc/Kp.
        let control = Control::of_bandwidth(10.0, 1.0 / 0.01);
        let made = run(&[0.5; 2000], Some(control), Sensors::default());
        let end = made.truth[1999];
        let off = control.proportional * (end.q - 0.5).abs();
        assert!(end.v.abs() < 1e-9 && off < 0.1 * (1.0 + 1e-6), "{end:?}");
        assert_eq!(made.set_point, [0.5; 2000]);
    }
}
