//! Coordinates that an optimiser may move freely, for the free parameters of a model.

use nalgebra::{DMatrix, DVector};

use super::predictor::Family;
use crate::axis::Axis;
use crate::error::Result;
use crate::model::Model;

/// Step of a coordinate that one-step derivatives are taken with. A step of the simulator is smooth in its parameters,
/// so this error is relative, and far above rounding.
const SMALL: f64 = 1e-5;

/// How one free parameter depends on its coordinate `x`, which is 1 at the start.
#[derive(Clone, Copy, Debug)]
struct Coordinate {
    /// Position among [`Model::parameters`].
    parameter: usize,
    /// The value at the start, less its floor.
    start: f64,
    scale: Scale,
}

#[derive(Clone, Copy, Debug)]
enum Scale {
    /// `start·e^(x − 1)`.
    Logarithm,
    /// The same above the Coulomb level: friction falls with speed, or the law is another.
    AboveCoulomb,
    /// `start + size·(x − 1)`.
    Size(f64),
}

impl Coordinate {
    /// The value above its floor.
    fn value(&self, x: f64) -> f64 {
        match self.scale {
            Scale::Logarithm | Scale::AboveCoulomb => self.start * (x - 1.0).exp(),
            Scale::Size(size) => self.start + size * (x - 1.0),
        }
    }

    fn rate(&self, x: f64) -> f64 {
        match self.scale {
            Scale::Logarithm | Scale::AboveCoulomb => self.value(x),
            Scale::Size(size) => size,
        }
    }
}

/// Position of the Coulomb level among [`Model::parameters`].
const COULOMB: usize = 2;

/// The free parameters of a model and their coordinates.
pub struct Chart {
    model: Model,
    coordinates: Vec<Coordinate>,
}

impl Chart {
    /// Coordinates for all parameters that are to be estimated and have a value to start from.
    ///
    /// What is positive by nature has its logarithm as coordinate: inertia, levels, stiffnesses and velocities of a law;
    /// the static level what it is above the Coulomb level. Everything else is measured in its own start value, or its
    /// standard error if that is larger. A step of one is thus a large change of any parameter.
    pub fn new(model: &Model) -> Self {
        let parameters = model.parameters();
        let free = (0..parameters.len()).filter(|&k| {
            let p = parameters[k];
            !p.known && p.value.is_some() && !model.is_whole(k)
        });
        Self {
            coordinates: free.filter_map(|k| coordinate(model, k)).collect(),
            model: model.clone(),
        }
    }

    /// Number of free parameters.
    pub fn count(&self) -> usize {
        self.coordinates.len()
    }

    /// Positions of the free parameters among [`Model::parameters`].
    pub fn parameters(&self) -> Vec<usize> {
        self.coordinates.iter().map(|c| c.parameter).collect()
    }

    /// Coordinates of the model that the chart was made from.
    pub fn origin(&self) -> DVector<f64> {
        DVector::from_element(self.count(), 1.0)
    }

    /// The model at some coordinates, its parameters kept within their bounds.
    pub fn model(&self, at: &DVector<f64>) -> Model {
        let mut model = self.model.clone();
        for (c, x) in self.coordinates.iter().zip(at.iter()) {
            let floor = match c.scale {
                Scale::AboveCoulomb => model.coulomb.value.unwrap_or_default(),
                _ => 0.0,
            };
            model.move_to(c.parameter, floor + c.value(*x));
        }
        model
    }

    /// The coordinates of the same model that lie within the bounds: beyond them nothing changes, and no derivative
    /// would lead back.
    pub fn within(&self, at: &DVector<f64>) -> DVector<f64> {
        let model = self.model(at);
        let coordinates = self.coordinates.iter().zip(at.iter()).map(|(c, x)| {
            let value = model.parameters()[c.parameter].value.unwrap_or_default();
            match c.scale {
                Scale::Size(size) => 1.0 + (value - c.start) / size,
                Scale::Logarithm | Scale::AboveCoulomb => *x,
            }
        });
        DVector::from_iterator(self.count(), coordinates)
    }

    /// Derivatives of the parameters, row by row, by the coordinates.
    pub fn rates(&self, at: &DVector<f64>) -> DMatrix<f64> {
        let rates = self.coordinates.iter().zip(at.iter());
        let rates: Vec<f64> = rates.map(|(c, x)| c.rate(*x)).collect();
        DMatrix::from_fn(self.count(), self.count(), |row, column| {
            let (of, by) = (&self.coordinates[row], &self.coordinates[column]);
            let lifted = matches!(of.scale, Scale::AboveCoulomb) && by.parameter == COULOMB;
            if row == column || lifted {
                rates[column]
            } else {
                0.0
            }
        })
    }

    /// The axis at some coordinates, and if derivatives are wanted those beside it.
    pub fn family(&self, at: &DVector<f64>, derivatives: bool) -> Result<Family> {
        let beside = |k: usize| {
            let mut moved = at.clone();
            moved[k] += SMALL;
            Ok((Axis::new(&self.model(&moved))?, SMALL))
        };
        Ok(Family {
            axis: Axis::new(&self.model(at))?,
            moved: (0..if derivatives { self.count() } else { 0 })
                .map(beside)
                .collect::<Result<_>>()?,
            placed: self.model.terms.iter().any(|term| !term.in_law),
        })
    }
}

/// A parameter whose start is zero, without a bound on its error, has no size to move by: nothing showed it, and it stays.
fn coordinate(model: &Model, k: usize) -> Option<Coordinate> {
    let label = &model.labels()[k];
    let parameter = model.parameters()[k];
    let value = parameter.value.unwrap_or_default();
    let coulomb = model.coulomb.value.unwrap_or_default();
    let natural = label.effect.is_none() && label.name != "viscous";
    let doubt = parameter.se.filter(|se| se.is_finite()).unwrap_or(0.0);
    let mut size = value.abs().max(doubt);
    if label.name == "bristle_damping" {
        // It may be zero; what damps the bristles' own oscillation by a tenth is its size.
        size = size.max(0.2 * bristle_impedance(model));
    }
    let (start, scale) = if natural && label.name == "static" && value > coulomb {
        (value - coulomb, Scale::AboveCoulomb)
    } else if natural && label.name != "bristle_damping" && value > 0.0 {
        (value, Scale::Logarithm)
    } else {
        (value, Scale::Size(size))
    };
    (size > 0.0).then_some(Coordinate {
        parameter: k,
        start,
        scale,
    })
}

/// `√(σ0·J)`.
fn bristle_impedance(model: &Model) -> f64 {
    let labels = model.labels();
    let stiffness = labels.iter().position(|l| l.name == "bristle_stiffness");
    let stiffness = stiffness.and_then(|k| model.parameters()[k].value);
    (stiffness.unwrap_or(0.0) * model.inertia.value.unwrap_or(0.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::Chart;
    use crate::model::Model;

    const LUGRE: &str = "[plant]\nmotion = \"rotary\"\ninertia = { value = 0.01, known = false }\n[friction]\nmodel = \"lugre\"\ncoulomb = { value = 0.2, known = false }\nviscous = { value = -0.02, known = false }\nstatic = { value = 0.3, known = false }\nstribeck_velocity = 0.5\nbristle_stiffness = { value = 60.0, max = 70.0, known = false }\nbristle_damping = { value = 0.0, known = false }\n";

    fn values(model: &Model) -> Vec<f64> {
        model.parameters().iter().filter_map(|p| p.value).collect()
    }

    #[test]
    fn the_origin_is_the_model_and_known_values_stay() {
        let model = Model::parse(LUGRE).unwrap();
        let chart = Chart::new(&model);
        assert_eq!(chart.count(), 6);
        for (a, b) in values(&chart.model(&chart.origin()))
            .iter()
            .zip(values(&model))
        {
            assert!((a - b).abs() < 1e-12);
        }
        let far = chart.model(&chart.origin().add_scalar(3.0));
        let of = |k: usize| far.parameters()[k].value.unwrap();
        let at = |name: &str| of(far.labels().iter().position(|l| l.name == name).unwrap());
        // Levels rise by e³ each, the static one above the other; bounds hold; what is known stays.
        assert!((at("coulomb") - 0.2 * 3f64.exp()).abs() < 1e-9);
        assert!((at("static") - 0.3 * 3f64.exp()).abs() < 1e-9);
        assert_eq!(
            (at("bristle_stiffness"), at("stribeck_velocity")),
            (70.0, 0.5)
        );
        assert!(at("bristle_damping") > 0.0 && at("viscous") > 0.0);
        // Damping below zero is zero, from where it may rise again.
        let below = chart.origin().add_scalar(-0.5);
        assert!(chart.within(&below).iter().any(|x| *x == 1.0));
        let again = chart.model(&chart.within(&below));
        for (a, b) in values(&chart.model(&below)).iter().zip(values(&again)) {
            assert!((a - b).abs() < 1e-12);
        }
    }

    #[test]
    fn rates_are_differences_of_the_parameters() {
        let model = Model::parse(&LUGRE.replace("max = 70.0, ", "")).unwrap();
        let chart = Chart::new(&model);
        let at = chart.origin().add_scalar(0.2);
        let rates = chart.rates(&at);
        for k in 0..chart.count() {
            let mut moved = at.clone();
            moved[k] += 1e-6;
            let (a, b) = (chart.model(&at), chart.model(&moved));
            for (row, p) in chart.parameters().into_iter().enumerate() {
                let rate =
                    (b.parameters()[p].value.unwrap() - a.parameters()[p].value.unwrap()) / 1e-6;
                assert!(
                    (rate - rates[(row, k)]).abs() < 1e-4 * (1.0 + rate.abs()),
                    "{row} {k}"
                );
            }
        }
    }
}
