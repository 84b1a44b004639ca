//! The search for the frequency of a line in the spectrum over time.

use super::{Found, Ground};
use crate::error::Result;
use crate::model::Term;
use crate::phasor;
use crate::problem::Row;
use crate::weak::TRAIN_SHARE;

/// Frequencies up to this number over the half-width pass the test functions with a tenth of their amplitude.
const PASSED: f64 = 0.8;
/// Resolution cells, which are periods within the recording, below which a line is a drift: the functions of time describe it.
const SLOWEST_LINE: usize = 2;

impl Ground<'_> {
    pub(super) fn on_line(&self, term: &Term) -> Result<Option<Found>> {
        let frequencies = self.frequencies();
        let Some(hertz) = self.strongest_line(&frequencies) else {
            return Ok(None);
        };
        let step = frequencies.get(1).map_or(hertz, |f| f - frequencies[0]);
        let inner = [hertz, 0.0];
        let Some(score) = self.with(term, inner)? else {
            return Ok(None);
        };
        let mut found = Found {
            inner,
            score,
            tried: frequencies.len(),
        };
        self.refine(term, 0, (hertz - step, hertz + step), &mut found)?;
        Ok(Some(found))
    }

    /// Frequencies half a resolution cell apart, in Hz, from where a line is no drift and is sought at all, up to where the
    /// windows pass little.
    pub fn frequencies(&self) -> Vec<f64> {
        let seen = TRAIN_SHARE * self.survey.duration;
        let step = 0.5 / seen.max(f64::MIN_POSITIVE);
        let most = (PASSED / self.survey.half_width / step) as usize;
        let least = (2 * SLOWEST_LINE).max((self.setting.slowest / step).ceil() as usize);
        (least..most).map(|k| k as f64 * step).collect()
    }

    /// The frequency at which a sine and a cosine in time take most off the residual, of frequencies that are equally far
    /// apart.
    pub fn strongest_line(&self, frequencies: &[f64]) -> Option<f64> {
        frequencies.get(1)?;
        let projection = self.projection();
        let gain = |sin: &[f64], cos: &[f64]| {
            projection.gain(&self.setting.noise.whiten_training([sin, cos]))
        };
        let gains = phasor::each(&angular(frequencies), &self.times(), gain);
        let gains = gains.into_iter().zip(frequencies);
        gains.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, f)| *f)
    }

    /// Whitened sine and cosine in time, by their values at the centres of the windows.
    pub fn line(&self, hertz: f64) -> Vec<Vec<f64>> {
        let line = |sin: &[f64], cos: &[f64]| self.setting.noise.whiten_all([sin, cos]);
        let lines = phasor::each(&angular(&[hertz]), &self.times(), line);
        lines.into_iter().flatten().collect()
    }

    /// Times of the centres of the windows, from the first sample on.
    fn times(&self) -> Vec<f64> {
        let at = |row: &Row| row.centre as f64 * self.setting.problem.tracks[row.track].period;
        self.setting.problem.rows.iter().map(at).collect()
    }
}

/// Angular frequencies.
fn angular(hertz: &[f64]) -> Vec<f64> {
    hertz.iter().map(|f| std::f64::consts::TAU * f).collect()
}
