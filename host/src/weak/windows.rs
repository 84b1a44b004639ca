//! Windows over a track and the functionals on them.

use bristle_core::weak::Kernel;
use nalgebra::DVectorView;

use super::Track;
use crate::effects::Path;

/// Which part of the recording a window lies in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Wholly in the part that the fit sees.
    Train,
    /// Wholly in the held-out part.
    HeldOut,
}

/// The windows of one track: centres a quarter of the half-width apart, those at rest and across gaps left out.
#[derive(Clone, Debug)]
pub struct Windows {
    /// Samples on either side of a centre.
    pub reach: usize,
    /// Samples between neighbouring centres.
    pub hop: usize,
    /// Node at the centre of each window, ascending.
    pub centres: Vec<usize>,
    /// Part of each window.
    pub parts: Vec<Part>,
    /// How many of them functionals are computed on, the first ones; they are zero on the others.
    counted: usize,
    acceleration: Vec<f64>,
    velocity: Vec<f64>,
    hold: Vec<f64>,
}

/// Share of a window's weight that may lie on a gap: what remains is below the smallest effects.
const BARRED_SHARE: f64 = 0.005;
/// Share of a window's weight that must lie on sliding: one mostly at rest tells little.
const SLIDING_SHARE: f64 = 0.5;

impl Windows {
    /// Lays windows of `reach` samples over a track.
    pub fn new(track: &Track, reach: usize) -> Self {
        let kernel = Kernel::new(reach, track.period);
        let mut windows = Self {
            reach,
            hop: (reach / 4).max(1),
            centres: Vec::new(),
            parts: Vec::new(),
            counted: 0,
            acceleration: vec![0.0; 2 * reach + 1],
            velocity: vec![0.0; 2 * reach + 1],
            hold: vec![0.0; 2 * reach],
        };
        kernel.acceleration(&mut windows.acceleration);
        kernel.velocity(&mut windows.velocity);
        kernel.hold(&mut windows.hold);
        let nodes = track.q.len();
        let boundary = track.boundary;
        let mut centre = reach;
        while centre + reach < nodes {
            let part = if centre + reach <= boundary {
                Some(Part::Train)
            } else if centre - reach >= boundary {
                Some(Part::HeldOut)
            } else {
                None
            };
            if let Some(part) = part
                && windows.share(centre, |k| f64::from(track.barred[k])) <= BARRED_SHARE
                && windows.share(centre, |k| track.sliding[k]) >= SLIDING_SHARE
            {
                windows.centres.push(centre);
                windows.parts.push(part);
            }
            centre += windows.hop;
        }
        windows.counted = windows.centres.len();
        windows
    }

    /// The same with functionals on those of the training part alone, which come first.
    #[must_use]
    pub fn training(&self) -> Self {
        let parts = self.parts.iter();
        Self {
            counted: parts.take_while(|part| **part == Part::Train).count(),
            ..self.clone()
        }
    }

    /// Whether functionals are on windows of the training part alone.
    pub fn of_training_alone(&self) -> bool {
        // The last of them tells, as these come first.
        let last = self.parts[..self.counted].last();
        last.is_none_or(|part| *part == Part::Train)
    }

    /// How many cells of a track functionals need, from the first on.
    pub fn cells(&self, track: &Track) -> usize {
        if self.counted == self.centres.len() {
            return track.cells.len();
        }
        let last = self.centres[..self.counted].last();
        last.map_or(0, |centre| centre + self.reach)
    }

    /// `∫q φ̈` on every window: the mean acceleration.
    pub fn acceleration(&self, nodes: &[f64]) -> Vec<f64> {
        self.apply(&self.acceleration, nodes)
    }

    /// `−∫q φ̇` on every window: the mean velocity.
    pub fn velocity(&self, nodes: &[f64]) -> Vec<f64> {
        self.apply(&self.velocity, nodes)
    }

    /// `∫x φ` over the sliding part of every window for a signal given by its mean in each cell.
    pub fn hold(&self, track: &Track, cells: &[f64]) -> Vec<f64> {
        self.hold_through(track, cells, &Path::default())
    }

    /// The same of what the spring of a path passes of the signal. While the axis rests, friction takes up what drives it, and
    /// nothing of either reaches the spring.
    pub fn hold_through(&self, track: &Track, cells: &[f64], path: &Path) -> Vec<f64> {
        let sliding: Vec<f64> = cells
            .iter()
            .zip(&track.sliding)
            .map(|(x, s)| x * s)
            .collect();
        self.hold_sliding(&sliding, track.period, path)
    }

    /// The same of a signal of the sliding part of every cell alone.
    pub fn hold_sliding(&self, sliding: &[f64], period: f64, path: &Path) -> Vec<f64> {
        if path.swings() {
            let swung = path.swung(sliding, period).map(|(mean, _)| mean);
            self.apply(&self.hold, &swung.collect::<Vec<_>>())
        } else {
            self.apply(&self.hold, sliding)
        }
    }

    /// Variance of `∫q φ̈` that the noise of a track's sensor makes.
    pub fn acceleration_noise(&self, track: &Track) -> f64 {
        track.noise_under(&self.acceleration)
    }

    /// `∫φ` over each cell under a window.
    pub fn hold_weights(&self) -> &[f64] {
        &self.hold
    }

    /// Dot product of weights with what lies under every window: `2·reach + 1` of them with values at the nodes,
    /// `2·reach` with values in the cells.
    pub fn apply(&self, weights: &[f64], signal: &[f64]) -> Vec<f64> {
        // Unrolled into independent sums, which plain iteration over floats is not.
        let length = weights.len();
        let weights = DVectorView::from_slice(weights, length);
        let dot = |&centre: &usize| {
            let under = &signal[centre - self.reach..][..length];
            weights.dot(&DVectorView::from_slice(under, length))
        };
        let (counted, others) = self.centres.split_at(self.counted);
        let zeros = others.iter().map(|_| 0.0);
        counted.iter().map(dot).chain(zeros).collect()
    }

    /// Share of a window's weight for which `signal` counts, cell by cell.
    fn share(&self, centre: usize, signal: impl Fn(usize) -> f64) -> f64 {
        let start = centre - self.reach;
        self.hold
            .iter()
            .enumerate()
            .map(|(k, w)| w * signal(start + k))
            .sum()
    }
}
