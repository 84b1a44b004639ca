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
    /// O. V. Lepski, Theory of Probability and its Applications 35, 1991). Where it does not fit, towards the ends, a narrower
    /// one or the value of a node further in takes its place, whichever errs less.
    pub fn acceleration(&self, q: &[f64]) -> Vec<f64> {
        let widest = (WIDEST / self.period).min(0.25 * q.len() as f64).max(2.0) as usize;
        let mut all: Vec<Tried> = Vec::new();
        let mut reach = 2;
        while reach <= widest {
            let mut tried = Tried::new(q, reach, self.period);
            let lost = all.last().map_or(0.0, |narrower| {
                let seen = tried.differs(narrower, self);
                let ratio = narrower.reach as f64 / reach as f64;
                seen.max(0.0) / (1.0 - ratio * ratio).powi(2)
            });
            tried.risk = lost + self.noise_under(&tried.weights);
            all.push(tried);
            reach = (WIDER * reach as f64).ceil() as usize;
        }
        let by_risk = |a: &usize, b: &usize| all[*a].risk.total_cmp(&all[*b].risk);
        let best = (0..all.len()).min_by(by_risk).unwrap_or(0);
        to_the_ends(&all[..=best], q.len())
    }

    /// RMS of the noise of the sensor, in the unit of what it measures.
    pub fn sensor_noise(&self) -> f64 {
        // Of a measured velocity, the noise of its running sum is known.
        self.position_noise / if self.summed { self.period } else { 1.0 }
    }

    /// Noise like that of the sensor at every node, from draws of unit variance.
    pub fn noise(&self, mut draw: impl FnMut() -> f64) -> Vec<f64> {
        let mut sum = 0.0;
        let noise = self.q.iter().map(|_| {
            let one = self.position_noise * draw();
            sum += one;
            if self.summed { sum } else { one }
        });
        noise.collect()
    }

    /// Variance that the noise of the sensor makes in a dot product with positions. Those that are sums of a measured velocity have its
    /// running sum.
    pub(super) fn noise_under(&self, weights: &[f64]) -> f64 {
        self.position_noise.powi(2) * energy(weights.iter(), self.summed)
    }
}

/// The means of the last of some test functions, and towards both ends, where it does not fit, what errs least there.
fn to_the_ends(tried: &[Tried], whole: usize) -> Vec<f64> {
    let best = &tried[tried.len() - 1];
    // What it errs by if a mean stands for one so many nodes away.
    let changes = |apart: usize| {
        let pairs = best.means.iter().zip(best.means.iter().skip(apart));
        let squares: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
        squares / best.means.len().saturating_sub(apart).max(1) as f64
    };
    let changes: Vec<f64> = (0..=best.reach).map(changes).collect();
    // By the distance from an end: the risk there, whose value it is and what gives it.
    let mut ends = vec![(best.risk, best.reach, best); best.reach + 1];
    for distance in (0..best.reach).rev() {
        let fitting = tried.iter().filter(|t| t.reach <= distance);
        let fitting = fitting.map(|t| (t.risk, distance, t));
        let further = (distance + 1..=best.reach).map(|inside| {
            let (risk, of, by) = ends[inside];
            (risk + changes[inside - distance], of, by)
        });
        let least = fitting.chain(further).min_by(|a, b| a.0.total_cmp(&b.0));
        ends[distance] = least.unwrap_or(ends[distance]);
    }
    let value = |k: usize| {
        let (_, of, by) = ends[k.min(whole - 1 - k).min(best.reach)];
        let middle = of.max(k).min(whole - 1 - of);
        by.means[middle - by.reach]
    };
    (0..whole).map(value).collect()
}

/// A test function of some width laid over every node that it fits around.
struct Tried {
    reach: usize,
    /// Mean square of what it errs by.
    risk: f64,
    weights: Vec<f64>,
    means: Vec<f64>,
}

impl Tried {
    fn new(q: &[f64], reach: usize, period: f64) -> Self {
        let mut weights = vec![0.0; 2 * reach + 1];
        Kernel::new(reach, period).acceleration(&mut weights);
        let length = weights.len();
        let view = |x| DVectorView::from_slice(x, length);
        let means = q.windows(length).map(|q| view(q).dot(&view(&weights)));
        Self {
            means: means.collect(),
            reach,
            risk: f64::INFINITY,
            weights,
        }
    }

    /// Mean square of the difference from a narrower one, less what the noise of a track adds to it.
    fn differs(&self, narrower: &Self, track: &Track) -> f64 {
        let inset = self.reach - narrower.reach;
        let mut between = self.weights.clone();
        let inner = between[inset..].iter_mut().zip(&narrower.weights);
        inner.for_each(|(own, other)| *own -= other);
        let pairs = self.means.iter().zip(&narrower.means[inset..]);
        let squares: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
        squares / self.means.len() as f64 - track.noise_under(&between)
    }
}

/// Variance of a dot product with white noise of unit variance, or with its running sum.
pub(super) fn energy<'a>(weights: impl DoubleEndedIterator<Item = &'a f64>, summed: bool) -> f64 {
    let mut tail = 0.0;
    let effective = weights.rev().map(|w| {
        tail += w;
        if summed { tail } else { *w }
    });
    effective.map(|w| w * w).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Motion;
    use crate::recording::Recording;

    const PERIOD: f64 = 1e-3;
    const SAMPLES: usize = 8000;

    fn truth(k: usize) -> f64 {
        let t = PERIOD * k as f64;
        -9.0 * (3.0 * t).sin() - 80.0 * (40.0 * t).sin()
    }

    /// Two sines through an encoder.
    fn counted(quantum: f64) -> (Track, Vec<f64>) {
        let t: Vec<f64> = (0..SAMPLES).map(|k| PERIOD * k as f64).collect();
        let wave = |t: &f64| (3.0 * t).sin() + 0.05 * (40.0 * t).sin();
        let q: Vec<f64> = (t.iter().map(|t| (wave(t) / quantum).round() * quantum)).collect();
        let recording = Recording {
            path: "none".into(),
            u: t.iter().map(|t| t.sin()).collect(),
            t,
            q: Some(q.clone()),
            v: None,
            sampled: true,
            input_unit: None,
            stamps: None,
            readings: None,
        };
        (Track::new(&recording, Motion::Rotary, None), q)
    }

    fn error(a: &[f64], over: std::ops::Range<usize>) -> f64 {
        let count = over.len() as f64;
        let squares = over.map(|k| (a[k] - truth(k)).powi(2));
        (squares.sum::<f64>() / count).sqrt()
    }

    /// Means of one width, the first and the last of them held over the ends.
    fn held(q: &[f64], reach: usize) -> Vec<f64> {
        let means = Tried::new(q, reach, PERIOD).means;
        let nearest = |k: usize| means[k.saturating_sub(reach).min(means.len() - 1)];
        (0..q.len()).map(nearest).collect()
    }

    /// The mean that is chosen errs by no more than a third beyond the best of all widths.
    #[test]
    fn the_width_that_errs_least_is_chosen() {
        let inside = 200..SAMPLES - 200;
        for quantum in [1e-5, 1e-4, 1e-3] {
            let (track, q) = counted(quantum);
            let chosen = error(&track.acceleration(&q), inside.clone());
            let fixed = |reach| error(&held(&q, reach), inside.clone());
            let best = (2..=70).map(fixed).fold(f64::INFINITY, f64::min);
            assert!(chosen < 1.33 * best, "{quantum}: {chosen} {best}");
        }
    }

    /// Within the first and last 20 ms it errs by less than half of what holding the nearest mean of the best width does, where
    /// the encoder is fine enough for narrower ones, and by no more where it is not.
    #[test]
    fn narrower_windows_lead_to_the_ends() {
        for (quantum, share) in [(1e-6, 0.5), (1e-5, 0.5), (1e-3, 1.05)] {
            let (track, q) = counted(quantum);
            let ends = |a: &[f64]| error(a, 0..20).hypot(error(a, SAMPLES - 20..SAMPLES));
            let inside = |reach: &usize| error(&held(&q, *reach), 200..SAMPLES - 200);
            let best = (2..=70).min_by(|a, b| inside(a).total_cmp(&inside(b)));
            let chosen = ends(&track.acceleration(&q));
            let holding = ends(&held(&q, best.expect("a width")));
            assert!(chosen < share * holding, "{quantum}: {chosen} {holding}");
        }
    }
}
