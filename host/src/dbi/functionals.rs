//! The algebraic problem itself: what each term of the equation of motion becomes under the windows.

use serde::Serialize;

use crate::effects::{Quantity, Seat};
use crate::identify::Workbench;
use crate::model::{Model, Parameter, Term};
use crate::motion::Motion;
use crate::problem::Column;
use crate::system;
use crate::weak::Part;

/// The rows of all windows.
#[derive(Clone, Debug, Serialize)]
pub struct Functionals {
    /// Index of each row's recording.
    pub recording: Vec<usize>,
    /// Instant at the centre of each row's window, s.
    pub time: Vec<f64>,
    /// Whether the fit did not see a row.
    pub held_out: Vec<bool>,
    /// The terms: acceleration first, then the drive, then what resists.
    pub terms: Vec<Functional>,
    /// `k·∫u φ`, the drive, of every row.
    pub drive: Vec<f64>,
    /// What the model makes of it: `J·∫q φ̈` and all that resists.
    pub model: Vec<f64>,
    /// Drive less model.
    pub residual: Vec<f64>,
    /// The residual of the fit's response after whitening, in standard deviations.
    pub whitened: Vec<f64>,
    /// Unit of drive, model and residual.
    pub unit: &'static str,
}

/// One term of the equation of motion.
#[derive(Clone, Debug, Serialize)]
pub struct Functional {
    /// What it is.
    pub name: String,
    /// The functional as a formula.
    pub formula: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it is multiplied by in the equation of motion: a torque or force per its unit.
    pub coefficient: f64,
    /// RMS of the term over the training rows, in the unit of torque or force.
    pub rms: f64,
    /// The functional of every row.
    pub values: Vec<f64>,
}

impl Functionals {
    /// Evaluates the rows for a model with values.
    pub fn new(bench: &Workbench, model: &Model) -> Self {
        let problem = &bench.problem;
        let terms = terms(bench, model);
        let weighted = |term: &Functional, k: usize| term.coefficient * term.values[k];
        let rows = 0..problem.rows.len();
        let drive: Vec<f64> = rows.clone().map(|k| weighted(&terms[1], k)).collect();
        let sides = |k: usize| -> f64 {
            let others = terms.iter().enumerate().filter(|(i, _)| *i != 1);
            others.map(|(_, term)| weighted(term, k)).sum()
        };
        let modelled: Vec<f64> = rows.map(sides).collect();
        let rows = problem.rows.iter();
        Self {
            recording: rows.clone().map(|r| r.track).collect(),
            time: rows.clone().map(|r| problem.time(*r)).collect(),
            held_out: rows.map(|r| r.part == Part::HeldOut).collect(),
            residual: drive.iter().zip(&modelled).map(|(d, m)| d - m).collect(),
            whitened: bench.noise.whiten(&system::residual(problem, model)),
            terms,
            drive,
            model: modelled,
            unit: Quantity::Torque.unit(model.motion),
        }
    }
}

/// Name, formula, unit, coefficient and column of a term.
type Raw = (String, &'static str, &'static str, f64, Column);

fn terms(bench: &Workbench, model: &Model) -> Vec<Functional> {
    let mut terms = axis(bench, model);
    for term in &model.terms {
        terms.extend(of_effect(bench, model, term));
    }
    let seen = || bench.blocks.iter().enumerate().filter(|(_, f)| f.is_some());
    let rms = |c: f64, column: &[f64]| {
        let sum: f64 = seen().map(|(k, _)| (c * column[k]).powi(2)).sum();
        (sum / seen().count() as f64).sqrt()
    };
    let functional = |(name, formula, unit, coefficient, column): Raw| Functional {
        name,
        formula,
        unit,
        coefficient,
        rms: rms(coefficient, &column),
        values: column.to_vec(),
    };
    terms.into_iter().map(functional).collect()
}

fn inertia(model: &Model) -> f64 {
    let moving = model.parameters()[model.moving_inertia()];
    moving.value.unwrap_or_default()
}

/// The terms of every axis.
fn axis(bench: &Workbench, model: &Model) -> Vec<Raw> {
    let problem = &bench.problem;
    let value = |p: &Parameter| p.value.unwrap_or_default();
    let speed = model.unit(Quantity::Speed);
    let acceleration = match model.motion {
        Motion::Rotary => "rad/s^2",
        Motion::Linear => "m/s^2",
    };
    let drive = match model.input.as_str() {
        "voltage" => "V",
        "current" => "A",
        _ => model.unit(Quantity::Torque),
    };
    let (sign, coulomb) = if model.bristles().is_some() {
        ("bristles", "∫(σ0·z/g) φ")
    } else {
        ("direction", "∫s φ")
    };
    let path = system::path(model);
    let direction = problem.coulomb(&problem.direction(model), &path);
    let input = problem.input(&path);
    let named = |name: &str| name.to_owned();
    vec![
        (
            named("acceleration"),
            "∫q φ̈",
            acceleration,
            inertia(model),
            problem.acceleration.clone(),
        ),
        (named("drive"), "∫u φ", drive, value(&model.gain), input),
        (
            named("velocity"),
            "−∫q φ̇",
            speed,
            value(&model.viscous),
            problem.velocity(&path),
        ),
        (named(sign), coulomb, "1", value(&model.coulomb), direction),
    ]
}

/// The terms of an effect, one for each of its coefficients.
fn of_effect(bench: &Workbench, model: &Model, term: &Term) -> Vec<Raw> {
    let (problem, effect) = (&bench.problem, term.effect);
    let (inner, coefficients) = effect.linear(&system::values(term), model.scale());
    let torque = model.unit(Quantity::Torque);
    // An error in the measured position takes part of the acceleration and of the velocity away.
    let feigned = |[acceleration, velocity]: &[Column; 2]| {
        let (inertia, viscous) = (inertia(model), model.viscous.value.unwrap_or_default());
        let rows = acceleration.iter().zip(velocity.iter());
        Column::new(rows.map(|(a, v)| -(inertia * a + viscous * v)).collect())
    };
    let (formula, unit, columns) = match effect.seat() {
        Seat::Load => ("∫l φ̈", "1", problem.load(effect, inner)),
        Seat::Sensor => {
            let columns = problem
                .errors(effect, &coefficients)
                .iter()
                .map(feigned)
                .collect();
            ("−J·∫e φ̈ + Fv·∫e φ̇", torque, columns)
        }
        Seat::Torque => {
            let (direction, path) = (problem.direction(model), system::path(model));
            let columns = problem.effect(effect, inner, &direction, &path);
            ("∫B φ", "1", columns)
        }
        Seat::Input | Seat::Inertia | Seat::Momentum => return Vec::new(),
    };
    let several = columns.len() > 1;
    let named = |k: usize| {
        if several {
            format!("{}, column {}", effect.id(), k + 1)
        } else {
            effect.id().to_owned()
        }
    };
    let columns = columns.into_iter().zip(coefficients).enumerate();
    columns
        .map(|(k, (column, c))| (named(k), formula, unit, c, column))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::Functionals;
    use crate::identify::{Options, Workbench};
    use crate::model::Model;
    use crate::recording::Recording;
    use crate::system;

    #[test]
    fn the_terms_make_the_residual_that_fits_minimise() {
        let t: Vec<f64> = (0..12_000).map(|k| f64::from(k) * 1e-3).collect();
        let recording = Recording {
            path: "made.csv".into(),
            u: t.iter().map(|t| (2.0 * t).sin()).collect(),
            q: Some(
                t.iter()
                    .map(|t| (1.7 * t).cos() + 0.2 * (5.0 * t).sin())
                    .collect(),
            ),
            t,
            ..Recording::default()
        };
        let model = Model::parse(
            "[plant]\nmotion = \"rotary\"\ninertia = 0.01\n[friction]\nmodel = \"lugre\"\ncoulomb = 0.1\nviscous = 0.02\nstatic = 0.2\nstribeck_velocity = 0.5\nbristle_stiffness = 30\nbristle_damping = 0.1\n[effects.gravity]\namplitude = 0.2\nphase = 0.3\n[effects.delay]\ndelay = 0.004\n[effects.sensor-eccentricity]\namplitude = 0.01\nphase = 0.3\n[effects.compliance]\nload_inertia = 0.004\nantiresonance = 12\ndamping_ratio = 0.1",
        )
        .unwrap();
        let bench = Workbench::new(&[recording], &model, Options::default()).unwrap();
        let functionals = Functionals::new(&bench, &model);
        let scale = -system::torque_scale(&bench.problem, &model);
        let residual = system::residual(&bench.problem, &model);
        let size = residual
            .iter()
            .fold(0.0, |a: f64, r| a.max((scale * r).abs()));
        for (own, r) in functionals.residual.iter().zip(&residual) {
            assert!((own - scale * r).abs() < 1e-9 * size, "{own}, {r}");
        }
        assert_eq!(functionals.terms.len(), 4 + 1 + 1 + 2 + 2 + 1);
    }
}
