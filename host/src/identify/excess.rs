//! How much further than noise explains free runs of a model go wrong.

use super::Workbench;
use super::twin::Draw;
use crate::error::Result;
use crate::fit::{self, Parts};
use crate::model::{Causality, Model};
use crate::recording::Recording;

/// Twins that free runs are held against: were the model all there is, these would be seven of a kind, and the recordings those
/// that err most of them in both parts by chance in one of 49 cases; by twice as much in far fewer.
const TWINS: u64 = 6;

impl Workbench {
    /// How many times as far free runs of a model err as on that twin of its recordings on which they err most, in the part where
    /// that is less: RMS errors over windows of [`fit::HORIZON`], each from the measured state. Twins are exactly the model under
    /// the noise of this workbench, on the same path and through the same sensors. Once it is no more than `enough`, no further
    /// twin is asked.
    ///
    /// `None` where there are no twins: of an imposed motion, and of a model that describes no axis, or a load of its own.
    pub(crate) fn excess(
        &self,
        model: &Model,
        recordings: &[Recording],
        enough: f64,
    ) -> Result<Option<f64>> {
        if model.causality == Causality::Inverse {
            return Ok(None);
        }
        let load = self.load_noise(&self.noise, model);
        let Some(whites) = self.whites(model, recordings, load) else {
            return Ok(None);
        };
        let own = fit::parts(model, recordings, &self.problem.tracks)?;
        let mut excess = f64::INFINITY;
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
            let times = |of: fn(&Parts) -> fit::Error| {
                of(&own).rmse / of(&twins).rmse.max(f64::MIN_POSITIVE)
            };
            let both = [Parts::train, Parts::held_out];
            excess = both.into_iter().map(times).fold(excess, f64::min);
            if excess <= enough {
                break;
            }
        }
        Ok(Some(excess))
    }
}
