//! A plant under the controller that a board runs, in the board's precision.

mod merit;

pub use merit::{Step, peak, rms, settled, step};

use bristle_core::Scalar;
use bristle_core::control::{Controller, Parameters, Position, SetPoint};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::{Error, Result};
use crate::model::Model;
use crate::plant::{self, Plant};
use crate::recording::Recording;
use crate::step::State;
use crate::tune::SI;

/// What the axis is to do at an instant, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// A position with its rates.
    Position {
        /// rad or m.
        q: f64,
        /// rad/s or m/s.
        v: f64,
        /// rad/s² or m/s².
        a: f64,
    },
    /// A velocity with its rate.
    Velocity {
        /// rad/s or m/s.
        v: f64,
        /// rad/s² or m/s².
        a: f64,
    },
}

/// What a controller makes of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Act {
    /// `u` until the next sample.
    pub command: f32,
    /// Coulomb level, adapted or as given, N·m or N.
    pub coulomb: f32,
}

/// What controls a plant: the controller on the host, or a board that runs it.
pub trait Control {
    /// One sample.
    fn step(&mut self, counts: i32, set_point: SetPoint<f32>) -> Result<Act>;
    /// Other parameters from the next sample on.
    fn set(&mut self, parameters: &Parameters<f32>) -> Result<()>;
}

impl Control for Controller<f32> {
    fn step(&mut self, counts: i32, set_point: SetPoint<f32>) -> Result<Act> {
        let output = Controller::step(self, counts, set_point);
        Ok(Act {
            command: output.command,
            coulomb: output.coulomb,
        })
    }

    fn set(&mut self, parameters: &Parameters<f32>) -> Result<()> {
        self.set_parameters(*parameters)
            .map_err(|e| Error::Internal(format!("parameters were refused: {e}")))
    }
}

/// Makes what controls a plant that is at rest where the encoder shows zero.
pub trait Make {
    /// With these parameters.
    fn control<'a>(&'a mut self, parameters: &Parameters<f32>) -> Result<Box<dyn Control + 'a>>;
}

/// Controllers on the host.
pub struct OnHost;

impl Make for OnHost {
    fn control<'a>(&'a mut self, parameters: &Parameters<f32>) -> Result<Box<dyn Control + 'a>> {
        let controller = Controller::new(*parameters, 0)
            .map_err(|e| Error::Internal(format!("a controller was refused: {e}")))?;
        Ok(Box::new(controller))
    }
}

/// A sample of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// What was asked for.
    pub aim: Aim,
    /// What the plant did.
    pub truth: State,
    /// Encoder counts.
    pub counts: i32,
    /// What the controller made of them.
    pub act: Act,
}

/// A plant and what controls it, sample by sample.
pub struct Servo<'a> {
    plant: Box<dyn Plant>,
    control: Box<dyn Control + 'a>,
    parameters: Parameters<f64>,
    t: Vec<f64>,
    u: Vec<f64>,
    samples: Vec<Sample>,
    load_noise: f64,
    rng: ChaCha8Rng,
}

/// Parameters in the board's precision.
pub fn single(parameters: &Parameters<f64>) -> Result<Parameters<f32>> {
    parameters
        .scaled(&SI)
        .map_err(|e| Error::Usage(format!("the controller cannot hold its parameters: {e}")))
}

impl<'a> Servo<'a> {
    /// A plant at rest at zero, under what `make` makes. `load_noise` is the RMS of a torque or force that acts on it and
    /// nobody knows, N·m or N, drawn from `seed`.
    pub fn new(
        make: &'a mut dyn Make,
        model: &Model,
        parameters: &Parameters<f64>,
        load_noise: f64,
        seed: u64,
    ) -> Result<Self> {
        Ok(Self {
            plant: plant::new(model)?,
            control: make.control(&single(parameters)?)?,
            parameters: *parameters,
            t: vec![0.0],
            u: Vec::new(),
            samples: Vec::new(),
            load_noise,
            rng: ChaCha8Rng::seed_from_u64(seed),
        })
    }

    /// The plant becomes another one, and goes on from where it is.
    pub fn change_plant(&mut self, model: &Model) -> Result<()> {
        let state = self.plant.measured();
        let mut next = plant::new(model)?;
        let k = self.u.len();
        // The input of the instant is not known yet; none acts before it.
        next.start(&self.t, &self.u, k, state);
        self.plant = next;
        Ok(())
    }

    /// Other parameters for the controller from the next sample on.
    pub fn change_parameters(&mut self, parameters: &Parameters<f64>) -> Result<()> {
        self.parameters = *parameters;
        self.control.set(&single(parameters)?)
    }

    /// Time of the next sample, s.
    pub fn now(&self) -> f64 {
        self.u.len() as f64 * self.parameters.period
    }

    /// Takes a sample and goes on to the next.
    pub fn step(&mut self, aim: Aim) -> Result<()> {
        let k = self.u.len();
        let truth = self.plant.measured();
        let count = self.parameters.count;
        let counts = Scalar::floor(truth.q / count);
        let act = self.control.step(counts, set_point(aim, count))?;
        self.samples.push(Sample {
            aim,
            truth,
            counts,
            act,
        });
        self.u.push(f64::from(act.command));
        self.t.push((k + 1) as f64 * self.parameters.period);
        let load = self.load_noise * ((0..12).map(|_| self.rng.random::<f64>()).sum::<f64>() - 6.0);
        self.plant.advance(&self.t, &self.u, k, load);
        Ok(())
    }

    /// Everything so far.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// What a driver would have recorded between two instants: the command and the encoder.
    pub fn recording(&self, from: f64, to: f64) -> Recording {
        let at = |t: f64| ((t / self.parameters.period).round() as usize).min(self.samples.len());
        let range = at(from)..at(to);
        let position = |s: &Sample| f64::from(s.counts) * self.parameters.count;
        Recording {
            path: "run.csv".into(),
            t: self.t[range.clone()].to_vec(),
            u: self.u[range.clone()].to_vec(),
            q: Some(self.samples[range].iter().map(position).collect()),
            ..Recording::default()
        }
    }
}

/// A set point in the units of the board. The encoder rounds down, and zero is the middle of its count zero.
pub fn set_point(aim: Aim, count: f64) -> SetPoint<f32> {
    match aim {
        Aim::Position { q, v, a } => SetPoint::Position {
            position: Position::from_f64(q / count),
            velocity: v as f32,
            acceleration: a as f32,
        },
        Aim::Velocity { v, a } => SetPoint::Velocity {
            velocity: v as f32,
            acceleration: a as f32,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::{Aim, OnHost, Servo, rms};
    use crate::model::Model;
    use crate::tune::{Wish, parameters};

    fn text(coulomb: f64) -> String {
        format!(
            "[plant]\nmotion = \"rotary\"\ninertia = 0.002\n[friction]\ncoulomb = {coulomb}\nviscous = 0.015\n"
        )
    }

    fn aim(t: f64) -> Aim {
        let (sine, cosine) = (3.0 * t).sin_cos();
        Aim::Position {
            q: 0.4 * (1.0 - cosine),
            v: 1.2 * sine,
            a: 3.6 * cosine,
        }
    }

    #[test]
    fn a_plant_changes_under_way_and_is_followed_and_recorded() {
        let model = Model::parse(&text(0.1)).unwrap();
        let wish = Wish {
            bandwidth: 8.0,
            rate: 1000.0,
            counts: 4096.0,
            limit: 0.5,
            current: None,
        };
        let tuned = parameters(&model, &wish).unwrap();
        let mut host = OnHost;
        let mut servo = Servo::new(&mut host, &model, &tuned, 0.0, 1).unwrap();
        for k in 0..6000 {
            if k == 3000 {
                servo
                    .change_plant(&Model::parse(&text(0.2)).unwrap())
                    .unwrap();
            }
            servo.step(aim(f64::from(k) * 1e-3)).unwrap();
        }
        let samples = servo.samples();
        assert!((f64::from(samples[2999].act.coulomb) - 0.1).abs() < 0.01);
        assert!((f64::from(samples[5999].act.coulomb) - 0.2).abs() < 0.02);
        assert!(rms(&samples[4500..]) < tuned.count);
        let recording = servo.recording(1.0, 3.0);
        assert_eq!((recording.t[0], recording.len()), (1.0, 2000));
        let q = recording.q.unwrap();
        assert!((q[500] - samples[1500].truth.q).abs() <= tuned.count);
    }
}
