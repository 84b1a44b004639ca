//! The experimental platform of DBI: for recordings and a model, everything between the samples and the estimates.
//!
//! The test functions, the windows, the functionals, what the fit leaves, and how the estimates move with the width: what
//! it takes to trust the method, or to see where it fails.

mod correlation;
mod functionals;
mod layout;
pub mod linear;
mod shape;
mod whiteness;
mod widths;

use serde::Serialize;

pub use correlation::Correlation;
pub use functionals::{Functional, Functionals};
pub use layout::{Laid, Layout};
pub use shape::Shape;
pub use whiteness::Whiteness;
pub use widths::{Agreement, AtWidth, Found, LinearEstimate, Named, Product};

use crate::check::{self, Warning};
use crate::diagnose::{Estimates, estimates};
use crate::fit::Fit;
use crate::identify::{Identified, Workbench};
use crate::model::Model;
use crate::recording::Recording;
use linear::NoiseDraws;

/// All that the platform shows: the JSON of `bristle dbi`.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// `bristle.dbi/1`.
    pub schema: &'static str,
    /// Estimates at the chosen width.
    pub parameters: Estimates,
    /// How they predict.
    pub fit: Fit,
    /// What is wrong with the recordings.
    pub warnings: Vec<Warning>,
    /// One for each half-width among the recordings.
    pub test_functions: Vec<Shape>,
    /// Where the windows lie.
    pub windows: Layout,
    /// The rows.
    pub functionals: Functionals,
    /// What the fit leaves.
    pub whiteness: Whiteness,
    /// How well the experiment separates the parameters.
    pub correlation: Correlation,
    /// Estimates at several half-widths, ascending.
    pub widths: Vec<AtWidth>,
    /// Whether they agree.
    pub agreement: Vec<Agreement>,
    /// The linear forms of the model's law.
    pub linear_forms: Vec<LinearForm>,
}

/// A form of DBI that is linear in products of the parameters.
#[derive(Clone, Debug, Serialize)]
pub struct LinearForm {
    /// What it is called.
    pub name: &'static str,
    /// The row of a window.
    pub equation: &'static str,
    /// What it assumes beyond the model.
    pub remark: &'static str,
}

impl Study {
    /// Studies an identification: `start` is the model as it was given.
    pub fn new(
        bench: &Workbench,
        identified: &Identified,
        start: &Model,
        recordings: &[Recording],
        progress: &dyn Fn(&str),
    ) -> Self {
        let model = &identified.model;
        let forms = linear::forms(start);
        let noisier: &[Recording] = if forms.is_empty() { &[] } else { recordings };
        let draws = NoiseDraws::new(noisier, start, bench.balance);
        let widths = widths::over(bench, start, model, &draws, progress);
        let windows = Layout::new(bench, recordings);
        let mut half_widths: Vec<f64> = windows.recordings.iter().map(|l| l.half_width).collect();
        half_widths.sort_by(f64::total_cmp);
        half_widths.dedup();
        Self {
            schema: "bristle.dbi/1",
            parameters: estimates(model, None),
            fit: identified.fit,
            warnings: check::warnings(bench, model, recordings),
            test_functions: half_widths.into_iter().map(Shape::new).collect(),
            windows,
            functionals: Functionals::new(bench, model),
            whiteness: Whiteness::new(bench, model),
            correlation: Correlation::new(bench, model),
            agreement: widths::agreement(&widths),
            widths,
            linear_forms: forms
                .iter()
                .map(|form| LinearForm {
                    name: form.name(),
                    equation: form.equation(),
                    remark: form.remark(),
                })
                .collect(),
        }
    }
}
