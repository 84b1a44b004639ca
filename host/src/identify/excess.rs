//! How much further than noise explains free runs of a model go wrong.

use super::Workbench;
use super::twin::Draw;
use crate::error::Result;
use crate::fit::{self, Parts};
use crate::model::{Causality, Model};
use crate::recording::Recording;
use crate::weak::Part;

/// Twins that free runs are held against: were the model all there is, these would be seven of a kind, and the recordings those
/// that err most in a part by chance in one of seven cases; by twice as much in far fewer.
const TWINS: u64 = 6;

impl Workbench {
    /// How many times as far a model's `own` free runs err, in each of the given parts, as on that twin of its recordings on which they
    /// err most there: RMS errors over windows of [`fit::HORIZON`], each from the measured state. Twins are exactly the model under
    /// the noise of this workbench, on the same path and through the same sensors. Once none is more than `enough`, no further
    /// twin is asked.
    ///
    /// `None` where there are no twins: of an imposed motion, and of a model that describes no axis, or a load of its own.
    pub(crate) fn excess(
        &self,
        model: &Model,
        recordings: &[Recording],
        (own, parts): (&Parts, &[Part]),
        enough: f64,
    ) -> Result<Option<Vec<f64>>> {
        if model.causality == Causality::Inverse {
            return Ok(None);
        }
        let load = self.load_noise(&self.noise, model);
        let Some(whites) = self.whites(model, recordings, load) else {
            return Ok(None);
        };
        let mut excess = vec![f64::INFINITY; parts.len()];
        for number in 0..TWINS {
            let draw = Draw {
                at: (number as f64 + 0.5) / TWINS as f64,
                white: 0.0,
                load,
                seed: number,
                load_seed: number,
            };
            let Some((seen, tracks)) = self.seen(model, recordings, Some(draw), &whites) else {
                return Ok(None);
            };
            let twins = fit::parts(model, &seen, &tracks)?;
            for (excess, part) in excess.iter_mut().zip(parts) {
                let twin = twins.error(*part).rmse.max(f64::MIN_POSITIVE);
                *excess = excess.min(own.error(*part).rmse / twin);
            }
            if excess.iter().all(|times| *times <= enough) {
                break;
            }
        }
        Ok(Some(excess))
    }
}
