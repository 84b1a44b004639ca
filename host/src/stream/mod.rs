//! Identification of recordings that are too long to be held in memory.
//!
//! 1. A pilot: stretches spread evenly over the training parts are identified like recordings of their own. They give the
//!    width of the windows, the filter of the velocity, the side of the response, the law of the noise and values to start
//!    from.
//! 2. Passes: the whole of the recordings goes by in pieces that overlap. The whitened residual and its Jacobian at
//!    the present values of the parameters add up to normal equations, and their solution is a Gauss-Newton step for all
//!    rows together. The pass after which the step would no longer matter has the values that are reported, and
//!    their errors on the training and the held-out parts.
//!
//! The functions that tell outliers from the rest are each piece's own. So memory depends on the length of a piece alone.

mod cut;
mod pass;
mod pilot;
mod work;

use crate::error::{Error, Result};
use crate::fit::{Fit, Sums};
use crate::identify::{Identified, Options, Workbench};
use crate::model::{Model, Parameter};
use crate::normal::Normal;
use crate::recording::{Long, Recording};
use crate::refine::{free_parameters, moved};
use crate::uncertainty;

use pilot::Pilot;
pub use pilot::stretches;

/// Recordings with more samples than this, together, are read piece by piece. Identification holds some 700 bytes for each
/// sample of what it works on, which makes 180 MB of this many.
pub const LONG: usize = 250_000;

/// A step of less than this many standard errors changes no digit that is reported.
const SETTLED: f64 = 0.05;
/// From a pilot's values one step settles it, and one more pass shows that it did.
const PASSES: usize = 8;

/// What has been done, for a progress bar.
#[derive(Clone, Copy, Debug)]
pub enum Progress {
    /// The stretches of the pilot are being identified.
    Pilot,
    /// A pass over this many samples begins.
    Pass(usize, usize),
    /// So many more samples have gone by.
    Samples(usize),
}

/// A model identified from long recordings.
pub struct Streamed {
    /// With the errors over the whole recordings.
    pub identified: Identified,
    /// The stretches of the pilot.
    pub stretches: Vec<Recording>,
    /// What was made of them.
    pub pilot: Workbench,
    /// By how much its χ² is less under the rational Stribeck curve, where the model has got that.
    pub less: Option<f64>,
    /// Rows of the training parts.
    pub rows: usize,
    /// Passes after the pilot.
    pub passes: usize,
}

/// Fits a model to long recordings.
pub fn identify(
    recordings: &[Long],
    model: &Model,
    options: Options,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Streamed> {
    if let Some(term) = model.terms.iter().find(|t| t.effect.timed()) {
        return Err(Error::Usage(format!(
            "[effects.{}] depends on the time since the recording began, which a recording read in pieces does not keep; cut the recording, or leave the effect out",
            term.effect.id()
        )));
    }
    progress(Progress::Pilot);
    let Pilot {
        stretches,
        bench,
        model: mut start,
        less,
        plan,
    } = Pilot::new(recordings, model, options)?;
    let taken = fix_taken(&mut start);
    let mut descent = Descent::new(start);
    let samples = recordings.iter().map(|r| r.samples).sum();
    let mut number = 0;
    let (normal, sums) = loop {
        number += 1;
        progress(Progress::Pass(number, samples));
        let sums = pass::run(recordings, &plan, &descent.model, progress)?;
        if !descent.step(&sums.0) || number == PASSES {
            break sums;
        }
    };
    let mut model = descent.model;
    let chi2 = normal.objective(&model);
    let free = free_parameters(&model);
    uncertainty::assess(&mut model, &free, &normal);
    bench.settle(&mut model, &stretches);
    for (k, parameter) in taken {
        *model.parameters_mut()[k] = parameter;
    }
    let identified = Identified {
        model,
        chi2,
        fit: judged(&sums),
    };
    Ok(Streamed {
        identified,
        stretches,
        pilot: bench,
        less,
        rows: normal.rows(),
        passes: number,
    })
}

/// Parameters that the pilot took rather than estimated, without a bound on their errors, stay as they are.
fn fix_taken(model: &mut Model) -> Vec<(usize, Parameter)> {
    let taken = |se: Option<f64>| se == Some(f64::INFINITY);
    let mut fixed = Vec::new();
    for (k, parameter) in model.parameters_mut().into_iter().enumerate() {
        if !parameter.known && taken(parameter.se) {
            fixed.push((k, parameter.clone()));
            parameter.known = true;
        }
    }
    fixed
}

fn judged(sums: &[Sums; 2]) -> Fit {
    Fit {
        train: sums[0].error(),
        held_out: sums[1].error(),
        free_run_rmse: None,
    }
}

/// Gauss-Newton steps, each halved until it lowers the objective.
struct Descent {
    model: Model,
    before: Option<Taken>,
}

/// Where the last step was taken from, the objective there, the step and the share of it that was taken.
type Taken = (Model, f64, Vec<(usize, f64)>, f64);

impl Descent {
    fn new(model: Model) -> Self {
        Self {
            model,
            before: None,
        }
    }

    /// Moves the model by what the rows say at its present values; returns whether that is worth another pass.
    fn step(&mut self, normal: &Normal) -> bool {
        let now = normal.objective(&self.model);
        if let Some((model, objective, step, share)) = self.before.take()
            && now > objective
        {
            let Some(next) = moved(&model, &step, 0.5 * share) else {
                return false;
            };
            self.model = next;
            self.before = Some((model, objective, step, 0.5 * share));
            return true;
        }
        let free = free_parameters(&self.model);
        let (Some(step), Some(errors)) = (normal.step(&self.model, &free), normal.errors()) else {
            return false;
        };
        let Some((share, next)) = (0..6)
            .map(|halvings| 0.5f64.powi(halvings))
            .find_map(|share| Some((share, moved(&self.model, &step, share)?)))
        else {
            return false;
        };
        let matters = free.into_iter().zip(&errors).any(|(k, se)| {
            let value = |model: &Model| model.parameters()[k].value.unwrap_or(0.0);
            (value(&next) - value(&self.model)).abs() > SETTLED * se
        });
        if matters {
            let model = std::mem::replace(&mut self.model, next);
            self.before = Some((model, now, step, share));
        }
        matters
    }
}
