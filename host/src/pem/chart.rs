//! Coordinates that an optimiser may move freely, for the free parameters of a model.

use nalgebra::DVector;

use super::predictor::Family;
use crate::axis::Axis;
use crate::error::Result;
use crate::model::Model;

/// Step of a coordinate that one-step derivatives are taken with. A step of the simulator is smooth in its parameters,
/// so this error is relative, and far above rounding.
const SMALL: f64 = 1e-5;

/// How one free parameter depends on its coordinate.
#[derive(Clone, Copy, Debug)]
struct Coordinate {
    /// Position among [`Model::parameters`].
    parameter: usize,
    /// `None`: the coordinate is the logarithm; else it is the value over this size.
    size: Option<f64>,
}

/// The free parameters of a model and their coordinates.
pub struct Chart {
    model: Model,
    coordinates: Vec<Coordinate>,
}

impl Chart {
    /// Coordinates for all parameters that are to be estimated and have a value to start from.
    ///
    /// What is positive by nature has its logarithm as coordinate: inertias, levels, stiffnesses and velocities of a law.
    /// Everything else is measured in its own start value, or its standard error if that is larger.
    pub fn new(model: &Model) -> Self {
        let labels = model.labels();
        let parameters = model.parameters();
        let free = (0..parameters.len()).filter(|&k| {
            let p = parameters[k];
            !p.known && p.value.is_some() && !model.is_whole(k)
        });
        let coordinates = free
            .map(|k| {
                let value = parameters[k].value.unwrap_or_default();
                let natural = labels[k].effect.is_none() && labels[k].name != "viscous";
                let doubt = parameters[k].se.filter(|se| se.is_finite()).unwrap_or(0.0);
                let size = value.abs().max(doubt).max(f64::MIN_POSITIVE.sqrt());
                Coordinate {
                    parameter: k,
                    size: (!natural || value <= 0.0).then_some(size),
                }
            })
            .collect();
        Self {
            model: model.clone(),
            coordinates,
        }
    }

    /// Number of free parameters.
    pub fn len(&self) -> usize {
        self.coordinates.len()
    }

    /// Positions of the free parameters among [`Model::parameters`].
    pub fn parameters(&self) -> Vec<usize> {
        self.coordinates.iter().map(|c| c.parameter).collect()
    }

    /// Coordinates of the model that the chart was made from.
    pub fn origin(&self) -> DVector<f64> {
        self.at(&self.model)
    }

    /// Coordinates of another model with the same parameters.
    pub fn at(&self, model: &Model) -> DVector<f64> {
        let parameters = model.parameters();
        let coordinates = self.coordinates.iter().map(|c| {
            let value = parameters[c.parameter].value.unwrap_or_default();
            c.size.map_or_else(|| value.ln(), |size| value / size)
        });
        DVector::from_iterator(self.len(), coordinates)
    }

    /// The model at some coordinates, its parameters kept within their bounds.
    pub fn model(&self, at: &DVector<f64>) -> Model {
        let mut model = self.model.clone();
        for (c, x) in self.coordinates.iter().zip(at.iter()) {
            let value = c.size.map_or_else(|| x.exp(), |size| x * size);
            model.move_to(c.parameter, value);
        }
        model
    }

    /// Derivative of each parameter by its coordinate.
    pub fn rates(&self, at: &DVector<f64>) -> Vec<f64> {
        let pairs = self.coordinates.iter().zip(at.iter());
        pairs
            .map(|(c, x)| c.size.unwrap_or_else(|| x.exp()))
            .collect()
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
            moved: (0..if derivatives { self.len() } else { 0 })
                .map(beside)
                .collect::<Result<_>>()?,
            placed: self.model.terms.iter().any(|term| !term.in_law),
        })
    }
}
