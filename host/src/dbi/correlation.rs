//! How well the experiment separates the parameters: correlations of the estimates, and the condition of the problem.

use serde::Serialize;

use crate::identify::Workbench;
use crate::model::Model;
use crate::refine;
use crate::uncertainty::normal_matrix;

/// What the design of the experiment makes of the estimates, whatever the noise.
#[derive(Clone, Debug, Serialize)]
pub struct Correlation {
    /// Estimated parameters.
    pub names: Vec<String>,
    /// Correlation of their estimates: the inverse of the normal matrix with unit diagonal. Empty if it has none.
    pub matrix: Vec<Vec<f64>>,
    /// Largest over smallest eigenvalue of the normal matrix of columns of unit norm; `None` if singular.
    pub condition: Option<f64>,
}

impl Correlation {
    /// Of the estimates of a model.
    pub fn new(bench: &Workbench, model: &Model) -> Self {
        let (free, jacobian) =
            refine::sensitivities(&bench.problem, model, &bench.noise, &bench.folds);
        let labels = model.labels();
        let names = free.iter().map(|&k| labels[k].to_string()).collect();
        if free.is_empty() {
            return Self {
                names,
                matrix: Vec::new(),
                condition: None,
            };
        }
        let (normal, _) = normal_matrix(&jacobian);
        let eigenvalues = normal.symmetric_eigenvalues();
        let (low, high) = (eigenvalues.min(), eigenvalues.max());
        let entry = |inverse: &nalgebra::DMatrix<f64>, i: usize, j: usize| {
            inverse[(i, j)] / (inverse[(i, i)] * inverse[(j, j)]).sqrt()
        };
        let n = free.len();
        let row = |inverse: &nalgebra::DMatrix<f64>, i: usize| {
            (0..n).map(|j| entry(inverse, i, j)).collect()
        };
        let inverse = normal.try_inverse();
        Self {
            names,
            matrix: inverse.map_or_else(Vec::new, |m| (0..n).map(|i| row(&m, i)).collect()),
            condition: (low > 0.0).then(|| high / low),
        }
    }
}
