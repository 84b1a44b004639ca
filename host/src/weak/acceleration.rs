//! The acceleration of a track at each of its nodes.

use bristle_core::weak::Kernel;

use nalgebra::DVectorView;

use super::Track;

/// Half-width of the widest test function that is tried, s: that of the narrowest that fits use.
const WIDEST: f64 = 0.07;
/// By how much each is wider than the one before.
const WIDER: f64 = 1.5;

impl Track {
    /// The mean of `q̈` around every node under the test function that errs least.
    ///
    /// A wider one takes more of the noise away, of which the positions have [`Track::position_noise`], and more of the
    /// motion, in proportion to the square of its width. The latter is told by what the next narrower one leaves of it (as in
    /// O. V. Lepski, Theory of Probability and its Applications 35, 1991). Over the ends, where no window fits, the nearest
    /// value is held. `summed` says that positions are running sums of noisy velocities.
    pub fn acceleration(&self, q: &[f64], summed: bool) -> Vec<f64> {
        let noise = self.position_noise.powi(2);
        let widest = (WIDEST / self.period).min(0.25 * q.len() as f64).max(2.0) as usize;
        let mut best = (f64::INFINITY, vec![0.0; q.len()]);
        let mut narrower: Option<Tried> = None;
        let mut reach = 2;
        while reach <= widest {
            let tried = Tried::new(q, reach, self.period);
            let lost = narrower.map_or(0.0, |narrower| {
                let seen = tried.differs(&narrower, noise, summed);
                let ratio = narrower.reach as f64 / reach as f64;
                seen.max(0.0) / (1.0 - ratio * ratio).powi(2)
            });
            let risk = lost + noise * energy(&tried.weights, summed);
            if risk < best.0 {
                best = (risk, held(&tried.means, q.len()));
            }
            narrower = Some(tried);
            reach = (WIDER * reach as f64).ceil() as usize;
        }
        best.1
    }
}

/// A test function of some width laid over every node that it fits around.
struct Tried {
    reach: usize,
    weights: Vec<f64>,
    means: Vec<f64>,
}

impl Tried {
    fn new(q: &[f64], reach: usize, period: f64) -> Self {
        let mut weights = vec![0.0; 2 * reach + 1];
        Kernel::new(reach, period).acceleration(&mut weights);
        make_exact(&mut weights, period);
        let length = weights.len();
        let view = |x| DVectorView::from_slice(x, length);
        let means = q.windows(length).map(|q| view(q).dot(&view(&weights)));
        Self {
            means: means.collect(),
            reach,
            weights,
        }
    }

    /// Mean square of the difference from a narrower one, less what noise of some variance adds to it.
    fn differs(&self, narrower: &Self, noise: f64, summed: bool) -> f64 {
        let inset = self.reach - narrower.reach;
        let mut between = self.weights.clone();
        let inner = between[inset..].iter_mut().zip(&narrower.weights);
        inner.for_each(|(own, other)| *own -= other);
        let pairs = self.means.iter().zip(&narrower.means[inset..]);
        let squares: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
        squares / self.means.len() as f64 - noise * energy(&between, summed)
    }
}

/// Makes weights exact for parabolas, which the sum in place of the integral is not where few samples lie under it.
fn make_exact(weights: &mut [f64], period: f64) {
    let mean = weights.iter().sum::<f64>() / weights.len() as f64;
    weights.iter_mut().for_each(|w| *w -= mean);
    let middle = (weights.len() / 2) as f64;
    let parabola = |k: usize| 0.5 * ((k as f64 - middle) * period).powi(2);
    let sum: f64 = (weights.iter().enumerate())
        .map(|(k, w)| w * parabola(k))
        .sum();
    weights.iter_mut().for_each(|w| *w /= sum);
}

/// Variance of a dot product with white noise of unit variance, or with its running sum.
fn energy(weights: &[f64], summed: bool) -> f64 {
    let mut tail = 0.0;
    let effective = weights.iter().rev().map(|w| {
        tail += w;
        if summed { tail } else { *w }
    });
    effective.map(|w| w * w).sum()
}

/// Values in the middle of a whole, the first and last of them held over its ends.
fn held(middle: &[f64], whole: usize) -> Vec<f64> {
    let before = (whole - middle.len()) / 2;
    (0..whole)
        .map(|k| middle[k.saturating_sub(before).min(middle.len() - 1)])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Motion;
    use crate::recording::Recording;

    /// Of two sines under noise of an encoder the mean that is chosen errs by no more than a third beyond the best of all widths.
    #[test]
    fn the_width_that_errs_least_is_chosen() {
        for quantum in [1e-5, 1e-4, 1e-3] {
            let wave = |t: f64| (3.0 * t).sin() + 0.05 * (40.0 * t).sin();
            let truth = |t: f64| -9.0 * (3.0 * t).sin() - 80.0 * (40.0 * t).sin();
            let t: Vec<f64> = (0..8000).map(|k| 1e-3 * f64::from(k)).collect();
            let count = |&t: &f64| (wave(t) / quantum).round() * quantum;
            let q: Vec<f64> = t.iter().map(count).collect();
            let recording = Recording {
                path: "none".into(),
                u: t.iter().map(|t| t.sin()).collect(),
                t: t.clone(),
                q: Some(q.clone()),
                v: None,
                sampled: true,
                input_unit: None,
                stamps: None,
            };
            let track = Track::new(&recording, Motion::Rotary, None);
            let error = |a: &[f64]| -> f64 {
                let inside = 200..t.len() - 200;
                let squares = inside.clone().map(|k| (a[k] - truth(t[k])).powi(2));
                (squares.sum::<f64>() / inside.len() as f64).sqrt()
            };
            let chosen = error(&track.acceleration(&q, false));
            let fixed = |reach| error(&held(&Tried::new(&q, reach, 1e-3).means, q.len()));
            let best = (2..=70).map(fixed).fold(f64::INFINITY, f64::min);
            assert!(chosen < 1.33 * best, "{quantum}: {chosen} {best}");
        }
    }
}
