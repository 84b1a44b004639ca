//! The search for the frequency of a line in the spectrum over time.

use std::borrow::Cow;

use super::{Found, Ground};
use crate::error::Result;
use crate::model::Term;
use crate::phasor;
use crate::problem::Row;
use crate::projection::Projection;
use crate::spectrum::Circle;

/// Frequencies up to this number over the half-width pass the test functions with a tenth of their amplitude.
const PASSED: f64 = 0.8;
/// Resolution cells, which are periods within the recording, below which a line is a drift: the functions of time describe it.
const SLOWEST_LINE: usize = 2;
/// Bands of frequencies over each of which whitening does next to the same. From the middle to the end of one, up to
/// `PASSED/(2·64)` over the half-width of four hops, the phase changes by 0.24 over the 24 hops that whitening reaches.
const BANDS: usize = 64;
/// Frequencies that are compared by their exact gains. Of `N` of them in noise the best gains `ln N/ln(N/32)` times as much as
/// the best but 31 (order statistics of exponential variables), 1.7 times for 5,000: far more than approximate gains err by.
const LIKELY: usize = 32;

impl Ground<'_> {
    pub(super) fn on_line(&self, term: &Term) -> Result<Option<Found>> {
        let frequencies = self.frequencies();
        let Some(hertz) = self.strongest_line(&frequencies, None) else {
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
        let seen = self.training();
        let step = 0.5 / seen.max(f64::MIN_POSITIVE);
        let most = (PASSED / self.survey.half_width / step) as usize;
        let least = (2 * SLOWEST_LINE).max((self.setting.slowest / step).ceil() as usize);
        (least..most).map(|k| k as f64 * step).collect()
    }

    /// The frequency at which a sine and a cosine in time, times what carries them if something does, take most off the
    /// residual, of frequencies that are equally far apart.
    pub fn strongest_line(&self, frequencies: &[f64], carrier: Option<&[f64]>) -> Option<f64> {
        let whiten = |pair: [&[f64]; 2]| {
            let [sin, cos] = carried(pair, carrier);
            self.setting.noise.whiten_training([&*sin, &*cos])
        };
        let times = self.times();
        let projection = self.projection();
        let likely = likely(frequencies, &times, &projection, &whiten);
        strongest(&likely, &times, &projection, &whiten)
    }

    /// Whitened sine and cosine in time, by their values at the centres of the windows, times what carries them if something
    /// does.
    pub fn line(&self, hertz: f64, carrier: Option<&[f64]>) -> Vec<Vec<f64>> {
        let line = |sin: &[f64], cos: &[f64]| {
            let [sin, cos] = carried([sin, cos], carrier);
            self.setting.noise.whiten_all([&*sin, &*cos])
        };
        let lines = phasor::each(&angular(&[hertz]), &self.times(), line);
        lines.into_iter().flatten().collect()
    }

    /// Times of the centres of the windows, from the first sample on.
    fn times(&self) -> Vec<f64> {
        let at = |row: &Row| row.centre as f64 * self.setting.problem.tracks[row.track].period;
        self.setting.problem.rows.iter().map(at).collect()
    }
}

/// Columns times another, if there is one.
fn carried<'a>(columns: [&'a [f64]; 2], carrier: Option<&[f64]>) -> [Cow<'a, [f64]>; 2] {
    columns.map(|column| match carrier {
        None => Cow::Borrowed(column),
        Some(carrier) => column.iter().zip(carrier).map(|(x, c)| x * c).collect(),
    })
}

/// The frequency whose whitened sine and cosine take most off the residual of a fit.
fn strongest(
    frequencies: &[f64],
    times: &[f64],
    projection: &Projection,
    whiten: &(impl Fn([&[f64]; 2]) -> Vec<Vec<f64>> + Sync),
) -> Option<f64> {
    let gain = |sin: &[f64], cos: &[f64]| projection.gain(&whiten([sin, cos]));
    let gains = phasor::each(&angular(frequencies), times, gain);
    let gains = gains.into_iter().zip(frequencies);
    gains.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, f)| *f)
}

/// The [`LIKELY`] frequencies that take most off if the whitening `W` does to all of a band what it does to its middle `ω₀`:
/// `W e^(iωt) ≈ e^(i(ω − ω₀)t)·W e^(iω₀t)`, so that the gains of a band are Fourier sums over the rows.
///
/// This takes time in proportion to the rows, where every frequency by itself takes it in proportion to rows times
/// frequencies.
fn likely(
    frequencies: &[f64],
    times: &[f64],
    projection: &Projection,
    whiten: &(impl Fn([&[f64]; 2]) -> Vec<Vec<f64>> + Sync),
) -> Vec<f64> {
    let most = frequencies.len() / (2 * BANDS);
    if most == 0 {
        return frequencies.to_vec();
    }
    let step = frequencies[1] - frequencies[0];
    let bands = frequencies.chunks(2 * most + 1);
    let middles: Vec<f64> = bands.map(|band| band[0] + most as f64 * step).collect();
    let turns: Vec<f64> = times.iter().map(|t| step * t).collect();
    let circle = Circle::new(&turns, most as i32);
    let gains = phasor::each(&angular(&middles), times, |sin, cos| {
        let whitened = whiten([sin, cos]);
        projection.gains_of_turned(&whitened[0], &whitened[1], &circle)
    });
    let gains = gains.into_iter().flatten();
    let mut ranked: Vec<(f64, f64)> = gains.zip(frequencies.iter().copied()).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked.iter().take(LIKELY).map(|(_, f)| *f).collect()
}

/// Angular frequencies.
fn angular(hertz: &[f64]) -> Vec<f64> {
    hertz.iter().map(|f| std::f64::consts::TAU * f).collect()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{BANDS, LIKELY, angular, likely, strongest};
    use crate::phasor;
    use crate::projection::Projection;

    /// Two tracks whose windows are differently far apart, one of them with holes, whitened by a filter that starts anew in
    /// each part and changes with time, as does the size of the noise.
    #[test]
    fn the_strongest_line_is_that_of_a_search_through_all_frequencies() {
        let first = (0..1000)
            .filter(|k| k % 60 < 45)
            .map(|k| (0, 0.025 * f64::from(k)));
        let second = (0..1400).map(|k| (1, 0.017 * f64::from(k)));
        let (track, times): (Vec<usize>, Vec<f64>) = first.chain(second).unzip();
        let whiten = |pair: [&[f64]; 2]| -> Vec<Vec<f64>> {
            let whitened = pair.map(|column| {
                let mut out: Vec<f64> = Vec::new();
                for (k, x) in column.iter().enumerate() {
                    let goes_on =
                        k > 0 && track[k] == track[k - 1] && times[k] - times[k - 1] < 0.1;
                    let past = if goes_on { out[k - 1] } else { 0.0 };
                    let swing = (3.8 * times[k]).sin();
                    out.push(x * (1.0 + 0.7 * swing) - (0.6 + 0.3 * swing) * past);
                }
                out
            });
            whitened.to_vec()
        };
        let lines =
            |hertz: f64| phasor::each(&angular(&[hertz]), &times, |s, c| whiten([s, c])).concat();
        let frequencies: Vec<f64> = (4..400).map(|k| 0.02 * f64::from(k)).collect();
        let seen: Vec<bool> = times.iter().map(|t| *t < 20.0).collect();
        for seed in 0..12 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut noise =
                || -> Vec<f64> { times.iter().map(|_| rng.random_range(-1.0..1.0)).collect() };
            let mut columns = lines(0.604);
            columns.push(noise());
            let (mut response, line) = (noise(), 0.15 * f64::from((seed % 3) as u8));
            let added = &lines([0.655, 1.2, 3.331, 7.5][seed as usize % 4])[0];
            response
                .iter_mut()
                .zip(added)
                .for_each(|(x, s)| *x += line * s);
            let projection = Projection::new(&response, &columns, &seen);
            let few = likely(&frequencies, &times, &projection, &whiten);
            assert!(few.len() == LIKELY && frequencies.len() > 2 * BANDS);
            let best = |of: &[f64]| strongest(of, &times, &projection, &whiten);
            assert_eq!(best(&few), best(&frequencies), "{seed}");
        }
    }
}
