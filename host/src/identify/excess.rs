//! How much further than noise explains free runs of a model go wrong, and how much larger than it explains outliers are.

use super::Workbench;
use super::settle::common;
use super::twin::Draw;
use crate::error::Result;
use crate::fit::{self, Parts};
use crate::model::{Causality, Model};
use crate::recording::Recording;
use crate::system;
use crate::weak::{Part, Track};

/// Twins that recordings are held against: were the model all there is, these would be seven of a kind, and the recordings those
/// that err most in a part by chance in one of seven cases; by twice as much in far fewer.
const TWINS: u64 = 6;

/// Twins of recordings with their tracks; `None` where the model describes no axis that could give them.
type Twins<'a> = Box<dyn Iterator<Item = Option<(Vec<Recording>, Vec<Track>)>> + 'a>;

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
        let Some(twins) = self.disturbed(model, recordings) else {
            return Ok(None);
        };
        let mut excess = vec![f64::INFINITY; parts.len()];
        for twin in twins {
            let Some((seen, tracks)) = twin else {
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

    /// How many times as large what a model leaves of outliers is, 0 in all other rows, by its RMS over the rows of each list of parts,
    /// as that of the twin of the recordings on which it is largest in the same rows. Twins, and where there are none: as for
    /// [`Self::excess`].
    pub(crate) fn outlying<const N: usize>(
        &self,
        own: &[f64],
        model: &Model,
        recordings: &[Recording],
        parts: [&[Part]; N],
    ) -> Option<[f64; N]> {
        let rows = &self.problem.rows;
        let size = |outliers: &[f64], parts: &[Part]| {
            let rows = outliers.iter().zip(rows);
            let squares = rows.filter(|(_, row)| parts.contains(&row.part));
            squares.map(|(r, _)| r * r).sum::<f64>().sqrt()
        };
        let mut times = [f64::INFINITY; N];
        for twin in self.disturbed(model, recordings)? {
            let problem = self.rows_of(twin?.1);
            let residual = system::residual(&problem, model);
            let outliers = self.noise.law.outliers(&problem, &residual);
            let mut here = vec![0.0; rows.len()];
            for (k, other) in common(rows, &problem.rows) {
                here[k] = outliers[other];
            }
            for (times, parts) in times.iter_mut().zip(parts) {
                let twin = size(&here, parts).max(f64::MIN_POSITIVE);
                *times = times.min(size(own, parts) / twin);
            }
        }
        Some(times)
    }

    /// The twins of recordings that these are held against, each made when it is asked for.
    fn disturbed<'a>(&'a self, model: &'a Model, recordings: &'a [Recording]) -> Option<Twins<'a>> {
        if model.causality == Causality::Inverse {
            return None;
        }
        let load = self.load_noise(&self.noise, model);
        let whites = self.whites(model, recordings, load)?;
        Some(Box::new((0..TWINS).map(move |number| {
            let draw = Draw {
                at: (number as f64 + 0.5) / TWINS as f64,
                white: 0.0,
                load,
                off_levels: true,
                seed: number,
                load_seed: number,
            };
            self.seen(model, recordings, Some(draw), &whites)
        })))
    }
}
