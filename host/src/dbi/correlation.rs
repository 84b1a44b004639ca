//! How well the experiment separates the parameters: correlations of the estimates, and the condition of the problem.

use serde::Serialize;

use crate::identify::Workbench;
use crate::model::Model;
use crate::refine;

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
        let labels = model.labels();
        let free = refine::free_parameters(model);
        let names: Vec<String> = free.iter().map(|&k| labels[k].to_string()).collect();
        let normal = refine::normal(&bench.problem, model, &bench.noise, &bench.blocks);
        let Some((inverse, _, _)) = normal.covariances() else {
            return Self {
                names,
                matrix: Vec::new(),
                condition: None,
            };
        };
        let correlation =
            |i: usize, j: usize| inverse[(i, j)] / (inverse[(i, i)] * inverse[(j, j)]).sqrt();
        let n = names.len();
        let row = |i: usize| (0..n).map(|j| correlation(i, j)).collect();
        let matrix = (0..n).map(row).collect();
        // A matrix and its inverse have the same condition number.
        let eigenvalues = inverse.symmetric_eigenvalues();
        let (low, high) = (eigenvalues.min(), eigenvalues.max());
        Self {
            names,
            matrix,
            condition: (low > 0.0).then(|| high / low),
        }
    }
}
