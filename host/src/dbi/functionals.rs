//! The algebraic problem itself: what each term of the equation of motion becomes under the windows.

use serde::Serialize;

use crate::effects::Quantity;
use crate::identify::Workbench;
use crate::model::Model;
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

fn terms(bench: &Workbench, model: &Model) -> Vec<Functional> {
    let problem = &bench.problem;
    let direction = problem.direction(model);
    let value = |p: &crate::model::Parameter| p.value.unwrap_or_default();
    let speed = model.unit(Quantity::Speed);
    let acceleration = if speed == "rad/s" { "rad/s^2" } else { "m/s^2" };
    let drive = match (model.input.as_str(), model.unit(Quantity::Torque)) {
        ("voltage", _) => "V",
        ("current", _) => "A",
        (_, torque) => torque,
    };
    let (sign, coulomb) = if model.bristles().is_some() {
        ("bristles", "∫(σ0·z/g) φ")
    } else {
        ("direction", "∫s φ")
    };
    let mut terms: Vec<(String, &'static str, &'static str, f64, Column)> = vec![
        (
            "acceleration".to_owned(),
            "∫q φ̈",
            acceleration,
            value(&model.inertia),
            problem.acceleration.clone(),
        ),
        (
            "drive".to_owned(),
            "∫u φ",
            drive,
            value(&model.gain),
            problem.input(system::delay(model)),
        ),
        (
            "velocity".to_owned(),
            "−∫q φ̇",
            speed,
            value(&model.viscous),
            problem.velocity(),
        ),
        (
            sign.to_owned(),
            coulomb,
            "1",
            value(&model.coulomb),
            problem.coulomb(&direction),
        ),
    ];
    for term in &model.terms {
        let (inner, coefficients) = term
            .effect
            .linear(&system::values(term), value(&model.coulomb));
        let columns = problem.effect(term.effect, inner, &direction);
        for (k, (column, c)) in columns.into_iter().zip(coefficients).enumerate() {
            let name = if term.effect.width() == 1 {
                term.effect.id().to_owned()
            } else {
                format!("{}, column {}", term.effect.id(), k + 1)
            };
            terms.push((name, "∫B φ", "1", c, column));
        }
    }
    let seen = || bench.folds.iter().enumerate().filter(|(_, f)| f.is_some());
    let rms = |c: f64, column: &[f64]| {
        let sum: f64 = seen().map(|(k, _)| (c * column[k]).powi(2)).sum();
        (sum / seen().count() as f64).sqrt()
    };
    let all = terms.into_iter();
    all.map(|(name, formula, unit, coefficient, column)| Functional {
        name,
        formula,
        unit,
        coefficient,
        rms: rms(coefficient, &column),
        values: column.to_vec(),
    })
    .collect()
}
