//! The steady-state torque-speed curve: a friction law fitted to the points at which a drive holds its speed.
//!
//! At constant speed nothing is accelerated and bristles are bent as they stay, so that the drive's torque is friction,
//! `F(v) = sgn v·g(v) + Fv·v` with `g(v) = Fc + (Fs − Fc)·e^(−(v/vs)²)` for `LuGre` (Canudas de Wit, Olsson, Åström and
//! Lischinsky 1995, eq. 5), and the other shapes for the other laws. A voltage-driven DC motor has at steady state the
//! torque `kt·(gain·u − ke·v)/R`. Least squares over the points gives `Fc`, `Fs`, `vs` and `Fv`; inertia, bristle stiffness
//! and bristle damping do not show and stay as the model file has them.
//!
//! The optimisers are those of prediction errors; from where they start: for each of some Stribeck velocities between
//! the slowest and the fastest point the other parameters follow by linear least squares, and the best goes first.
//! Nelder-Mead and BFGS on this curve are what `fminsearch` and `fminunc` did in the thesis that the project follows.
//!
//! A drift of the speed that is too slow to be seen within a piece of 0.2 s (2 %) leaves its inertial torque in a point.

mod dwell;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

pub use dwell::{Dwell, dwells};

use crate::axis::Contact;
use crate::error::{Error, Result};
use crate::model::{Kind, Model};
use crate::normal::Normal;
use crate::pem::{Chart, LeastSquares, Optimiser, minimise};
use crate::plant::{DcMotor, geared_servo};
use crate::recording::Recording;
use crate::step::State;
use crate::uncertainty;
use crate::weak::Track;

/// A point of the curve.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    /// rad/s or m/s.
    pub velocity: f64,
    /// N·m or N.
    pub torque: f64,
    /// Of the fitted law, N·m or N.
    pub fitted: f64,
}

/// What a fit to the curve found.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// Steady points with the fitted torque.
    pub points: Vec<Point>,
    /// RMS error of the torque, N·m or N.
    pub rmse: f64,
    /// The same at the start.
    pub rmse_at_start: f64,
    /// Iterations of the optimiser.
    pub iterations: usize,
    /// Whether it stopped because nothing was left to gain.
    pub converged: bool,
    /// Why it stopped.
    pub reason: String,
}

/// Stribeck velocities that are tried as a start.
const STARTS: usize = 12;
/// Points beyond the unknowns that an error estimate needs at least.
const SPARE: usize = 2;
/// Rounds; the first finds how large the errors are.
const ROUNDS: usize = 2;

/// Names of the parameters that the curve shows.
pub const SHOWN: [&str; 5] = [
    "coulomb",
    "viscous",
    "static",
    "stribeck_velocity",
    "exponent",
];

/// Fits the friction law of a model to the steady points of recordings, from the values in the model if `given`.
pub fn fit(
    recordings: &[Recording],
    model: &Model,
    optimiser: Optimiser,
    most: usize,
    given: bool,
) -> Result<(Model, Curve)> {
    let data = points(recordings, model)?;
    let mut start = shown(model);
    enough(&data, &start)?;
    if !given {
        start = begin(&data, &start);
    }
    let chart = Chart::new(&start);
    let mut at = chart.origin();
    let scale = data.iter().map(|p| p.torque * p.torque).sum::<f64>() / data.len() as f64;
    let mut noise = 0.01 * scale.sqrt();
    let spare = (data.len() - chart.count()) as f64;
    let (mut iterations, mut last) = (0, None);
    let rmse = |at: &DVector<f64>| {
        let fit = Fit {
            data: &data,
            chart: &chart,
            noise: 1.0,
        };
        fit.raw(at).norm() / (data.len() as f64).sqrt()
    };
    for _ in 0..ROUNDS {
        let fit = Fit {
            data: &data,
            chart: &chart,
            noise,
        };
        let ended = minimise(optimiser, &fit, &at, most - iterations);
        iterations += ended.iterations;
        at = ended.at.clone();
        noise = (fit.raw(&at).norm() / spare.sqrt()).max(1e-9 * scale.sqrt());
        last = Some(ended);
        if iterations >= most {
            break;
        }
    }
    let Some(ended) = last else {
        return Err(Error::Internal("the curve was not fitted".to_owned()));
    };
    let fit = Fit {
        data: &data,
        chart: &chart,
        noise,
    };
    let mut found = model.clone();
    fit.conclude(&at, &mut found);
    let contact = Contact::law(&chart.model(&at));
    let curve = Curve {
        points: data
            .iter()
            .map(|p| Point {
                fitted: contact.steady(
                    State {
                        q: 0.0,
                        v: p.velocity,
                    },
                    p.velocity.signum(),
                ),
                ..*p
            })
            .collect(),
        rmse: rmse(&at),
        rmse_at_start: rmse(&chart.origin()),
        iterations,
        converged: ended.converged,
        reason: ended.reason,
    };
    Ok((found, curve))
}

/// Refuses a curve of fewer points than its unknowns ask for.
fn enough(data: &[Point], model: &Model) -> Result<()> {
    let free = model.parameters().iter().filter(|p| !p.known).count();
    let refuse = |what: String| Err(Error::NotIdentifiable(what));
    if free == 0 {
        return refuse("the friction law has no unknown that the steady-state curve shows; write \"?\" for those that are to be found".to_owned());
    }
    if data.len() < free + SPARE {
        return refuse(format!(
            "only {} steady points were found, and {free} parameters ask for {} at least; hold each of several speeds, slow ones and both directions among them, for 1 s or longer",
            data.len(),
            free + SPARE
        ));
    }
    Ok(())
}

/// Steady points of recordings as velocity and torque.
fn points(recordings: &[Recording], model: &Model) -> Result<Vec<Point>> {
    let refuse = |what: String| Err(Error::Usage(what));
    if let Some(term) = model.terms.iter().find(|term| !term.in_law) {
        return refuse(format!(
            "[effects.{}]: the steady-state curve shows the friction law alone; leave the effect out, or fit the motion by --method pem without --curve",
            term.effect.id()
        ));
    }
    let torque = torque(model)?;
    let mut points = Vec::new();
    for recording in recordings {
        let track = Track::new(recording, model.motion, None);
        points.extend(dwells(&track).into_iter().map(|d| Point {
            velocity: d.velocity,
            torque: torque(d.input, d.velocity),
            fitted: 0.0,
        }));
    }
    Ok(points)
}

/// Torque or force of the drive at steady state, by its input and its velocity.
fn torque(model: &Model) -> Result<Box<dyn Fn(f64, f64) -> f64>> {
    let Some(gain) = model.gain.value else {
        return Err(Error::Usage("the steady-state curve needs plant.gain, as friction and gain scale together in it; write a number".to_owned()));
    };
    // What does not show in the curve may be unknown, and takes any value.
    let mut filled = model.clone();
    for parameter in filled.parameters_mut() {
        parameter.value.get_or_insert(1.0);
    }
    let motor = match model.kind {
        Kind::Axis => return Ok(Box::new(move |u, _| gain * u)),
        Kind::DcMotor => DcMotor::new(&filled)?,
        Kind::GearedServo => geared_servo(&filled)?,
        other => {
            return Err(Error::Usage(format!(
                "plant.kind = {:?} has no steady-state curve of its own; use \"axis\", \"dc-motor\" or \"geared-servo\"",
                other.as_str()
            )));
        }
    };
    Ok(Box::new(move |u, v| {
        motor.torque_constant * (gain * u - motor.back_emf * v) / motor.resistance
    }))
}

/// The model with all that the curve does not show taken as known.
fn shown(model: &Model) -> Model {
    let labels = model.labels();
    let mut model = model.clone();
    for (parameter, label) in model.parameters_mut().into_iter().zip(&labels) {
        parameter.known |= !SHOWN.contains(&label.name);
    }
    model
}

/// The model with the best of the starts that follow linearly from a Stribeck velocity.
fn begin(data: &[Point], model: &Model) -> Model {
    let speeds = || data.iter().map(|p| p.velocity.abs());
    let (low, high) = (
        speeds().fold(f64::INFINITY, f64::min),
        speeds().fold(0.0, f64::max),
    );
    let falls = model.labels().iter().any(|l| l.name == "stribeck_velocity");
    let count = if falls { STARTS } else { 1 };
    let candidates = (0..count).map(|k| {
        let velocity = low * (high / low).powf((k as f64 + 0.5) / count as f64);
        linear(data, model, velocity)
    });
    let best = candidates.min_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or_else(|| model.clone(), |(_, model)| model)
}

/// Sum of squares and model with the levels and the viscous coefficient that fit best at a Stribeck velocity.
fn linear(data: &[Point], model: &Model, velocity: f64) -> (f64, Model) {
    let with = |coulomb: f64, fall: f64, viscous: f64| {
        let mut model = model.clone();
        let values = [
            ("coulomb", coulomb),
            ("static", coulomb + fall),
            ("viscous", viscous),
            ("stribeck_velocity", velocity),
            ("exponent", 2.0),
        ];
        let labels = model.labels();
        for (parameter, label) in model.parameters_mut().into_iter().zip(&labels) {
            let value = values.iter().find(|(name, _)| *name == label.name);
            if let Some((_, value)) = value.filter(|_| !parameter.known) {
                parameter.value = Some(*value);
            }
        }
        model
    };
    let torque = |model: &Model| {
        let contact = Contact::law(model);
        let all = data.iter().map(|p| {
            contact.steady(
                State {
                    q: 0.0,
                    v: p.velocity,
                },
                p.velocity.signum(),
            )
        });
        DVector::from_iterator(data.len(), all)
    };
    // The curve is linear in these three; what of them is known is in the curve of zeros.
    let none = torque(&with(0.0, 0.0, 0.0));
    let units = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)];
    let columns: Vec<DVector<f64>> = units
        .iter()
        .map(|&(c, f, v)| torque(&with(c, f, v)) - &none)
        .collect();
    let measured = DVector::from_iterator(data.len(), data.iter().map(|p| p.torque));
    let solution = DMatrix::from_columns(&columns)
        .svd(true, true)
        .solve(&(&measured - &none), 1e-9)
        .unwrap_or_else(|_| DVector::zeros(3));
    // Levels that friction can have: above zero, and no lower at rest than in motion.
    let least = 0.02 * measured.amax();
    let start = with(solution[0].max(least), solution[1].max(least), solution[2]);
    ((torque(&start) - measured).norm_squared(), start)
}

/// Errors of the torque over their standard deviation.
struct Fit<'a> {
    data: &'a [Point],
    chart: &'a Chart,
    noise: f64,
}

impl Fit<'_> {
    fn raw(&self, at: &DVector<f64>) -> DVector<f64> {
        let contact = Contact::law(&self.chart.model(at));
        let errors = self.data.iter().map(|p| {
            contact.steady(
                State {
                    q: 0.0,
                    v: p.velocity,
                },
                p.velocity.signum(),
            ) - p.torque
        });
        DVector::from_iterator(self.data.len(), errors)
    }

    /// Puts the values with their standard errors into a model.
    fn conclude(&self, at: &DVector<f64>, model: &mut Model) {
        let fitted = self.chart.model(at);
        let free = self.chart.parameters();
        for &k in &free {
            model.parameters_mut()[k].value = fitted.parameters()[k].value;
        }
        let before = model.clone();
        let inverse = self.chart.rates(at).try_inverse();
        let Some(((residuals, jacobian), inverse)) = self.linearised(at).zip(inverse) else {
            return;
        };
        let clusters: Vec<usize> = (0..residuals.len()).collect();
        let square = self.data.iter().map(|p| p.torque * p.torque).sum::<f64>();
        let drive = square.sqrt() / self.noise;
        let mut normal = Normal::new(&(jacobian * inverse), &residuals, &clusters);
        normal.drive_squares = drive * drive;
        uncertainty::assess(model, &free, &normal);
        // Of the others the curve says nothing.
        for (k, parameter) in model.parameters_mut().into_iter().enumerate() {
            if !free.contains(&k) {
                *parameter = before.parameters()[k].clone();
            }
        }
    }
}

impl LeastSquares for Fit<'_> {
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>> {
        let residuals = self.raw(at) / self.noise;
        residuals.iter().all(|r| r.is_finite()).then_some(residuals)
    }

    fn linearised(&self, at: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        // The law is smooth in its parameters: central differences of this step are exact to ten digits.
        const H: f64 = 1e-5;
        let column = |k: usize| {
            let moved = |h: f64| {
                let mut x = at.clone();
                x[k] += h;
                self.raw(&x)
            };
            (moved(H) - moved(-H)) / (2.0 * H * self.noise)
        };
        let columns: Vec<DVector<f64>> = (0..at.len()).map(column).collect();
        Some((self.residuals(at)?, DMatrix::from_columns(&columns)))
    }
}
