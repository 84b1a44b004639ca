//! Test signals: what an axis is driven with to learn about it.

use std::f64::consts::TAU;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The shape of a test signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A sine that sweeps through the band once, equal times for equal ratios of frequency.
    Chirp,
    /// Sines over the whole band at once, with random phases.
    Multisine,
    /// One straight line from zero to the amplitude.
    Ramp,
    /// Straight lines up and down at the lower edge of the band.
    Triangle,
    /// Random levels, each held for half a period of some frequency in the band.
    Steps,
    /// Zero for a tenth of the time, then the amplitude.
    Hold,
    /// The [`STAGES`] one after the other: slow ramps, steps, and sines over the band.
    Sequence,
}

impl Shape {
    /// Whether it has rates worth feeding forward, as one with corners has not.
    pub const fn is_smooth(self) -> bool {
        matches!(self, Self::Chirp | Self::Multisine)
    }
}

/// A stage of [`Shape::Sequence`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// Its name: slow and fast ones are called as by `WPILib` `SysId`.
    pub name: &'static str,
    /// What the signal does in it, with the amplitude in the place of `A`.
    pub text: &'static str,
    /// The share of the whole that it ends at.
    pub end: f64,
}

/// What a whole sequence consists of. Each stage leaves an axis about where it began: it goes both ways.
pub const STAGES: [Stage; 4] = [
    Stage {
        name: "quasistatic forwards",
        text: "slowly from zero to A and back to zero",
        end: 0.25,
    },
    Stage {
        name: "quasistatic backwards",
        text: "slowly from zero to -A and back to zero",
        end: 0.5,
    },
    Stage {
        name: "dynamic",
        text: "at once to A, to -A, to A and to zero; the same backwards",
        end: 0.7,
    },
    Stage {
        name: "multisine",
        text: "many frequencies of the band at once, up to A",
        end: 1.0,
    },
];

/// A test signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excitation {
    /// Its shape.
    pub shape: Shape,
    /// Its largest value, in the unit of what it drives.
    pub amplitude: f64,
    /// Lowest and highest frequency, Hz.
    pub band: (f64, f64),
    /// Its length, s.
    pub duration: f64,
    /// What random shapes are drawn from.
    pub seed: u64,
}

/// Sines of a multisine, fewer if the band holds fewer harmonics of the whole.
const SINES: usize = 40;

impl Excitation {
    /// The values at the instants `t`, which lie from 0 to the duration.
    pub fn values(&self, t: &[f64]) -> Vec<f64> {
        let a = self.amplitude;
        let (low, high) = self.band;
        let line = |f: &dyn Fn(f64) -> f64| t.iter().map(|&t| a * f(t)).collect();
        match self.shape {
            Shape::Chirp => {
                // The phase ∫2πf dt of f = low·(high/low)^(t/T).
                let sweep = (high / low).ln() / self.duration;
                line(&|t| {
                    let turns = if sweep == 0.0 {
                        low * t
                    } else {
                        low * (sweep * t).exp_m1() / sweep
                    };
                    (TAU * turns).sin()
                })
            }
            Shape::Multisine => self.multisine(t),
            Shape::Ramp => line(&|t| t / self.duration),
            Shape::Triangle => line(&|t| {
                let phase = (low * t + 0.25).fract();
                1.0 - 4.0 * (phase - 0.5).abs()
            }),
            Shape::Steps => self.steps(t),
            Shape::Hold => line(&|t| f64::from(t >= 0.1 * self.duration)),
            Shape::Sequence => self.sequence(t),
        }
    }

    fn multisine(&self, t: &[f64]) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        // Harmonics of the whole, so that the signal is periodic in it, at about equal ratios.
        let whole = |k: usize| {
            let share = k as f64 / (SINES - 1) as f64;
            let frequency = self.band.0 * (self.band.1 / self.band.0).powf(share);
            (frequency * self.duration).round().max(1.0) as u32
        };
        let mut harmonics: Vec<u32> = (0..SINES).map(whole).collect();
        harmonics.dedup();
        let sines: Vec<(f64, f64)> = harmonics
            .iter()
            .map(|&k| {
                (
                    TAU * f64::from(k) / self.duration,
                    TAU * rng.random::<f64>(),
                )
            })
            .collect();
        let sum = |t: &f64| {
            sines
                .iter()
                .map(|(omega, phase)| (omega * t + phase).sin())
                .sum()
        };
        let mut values: Vec<f64> = t.iter().map(sum).collect();
        let peak = values.iter().fold(f64::MIN_POSITIVE, |m, v| v.abs().max(m));
        values.iter_mut().for_each(|v| *v *= self.amplitude / peak);
        values
    }

    fn sequence(&self, t: &[f64]) -> Vec<f64> {
        let share = |t: f64| t / self.duration;
        let [forwards, backwards, dynamic, _] = STAGES.map(|stage| stage.end);
        // Rises to one in the middle of a stage.
        let tent = |x: f64, from: f64, to: f64| 1.0 - (2.0 * (x - from) / (to - from) - 1.0).abs();
        let mut values: Vec<f64> = t
            .iter()
            .map(|&t| match share(t) {
                x if x < forwards => tent(x, 0.0, forwards),
                x if x < backwards => -tent(x, forwards, backwards),
                x if x < dynamic => step((x - backwards) / (dynamic - backwards)),
                _ => 0.0,
            })
            .map(|x| self.amplitude * x)
            .collect();
        let sines = t.partition_point(|&t| share(t) < dynamic);
        let rest: Vec<f64> = t[sines..]
            .iter()
            .map(|t| t - dynamic * self.duration)
            .collect();
        let last = Self {
            duration: (1.0 - dynamic) * self.duration,
            ..*self
        };
        values[sines..].copy_from_slice(&last.multisine(&rest));
        values
    }

    fn steps(&self, t: &[f64]) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let (mut until, mut level) = (0.0, 0.0);
        t.iter()
            .map(|&t| {
                while t >= until {
                    let (low, high) = self.band;
                    until += 0.5 / (low * (high / low).powf(rng.random()));
                    level = self.amplitude * (2.0 * rng.random::<f64>() - 1.0);
                }
                level
            })
            .collect()
    }
}

/// Forwards, twice as long backwards, forwards, and a rest, in the first half; the same the other way in the second. An
/// inertia comes to rest where it began.
fn step(share: f64) -> f64 {
    const LEVELS: [f64; 5] = [1.0, -1.0, -1.0, 1.0, 0.0];
    let place = (2.0 * LEVELS.len() as f64 * share) as usize;
    let side = if place < LEVELS.len() { 1.0 } else { -1.0 };
    side * LEVELS[place % LEVELS.len()]
}

#[cfg(test)]
mod tests {
    use super::{Excitation, Shape};

    fn signal(shape: Shape, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let t: Vec<f64> = (0..20_000).map(|k| f64::from(k) * 1e-3).collect();
        let excitation = Excitation {
            shape,
            amplitude: 0.5,
            band: (0.25, 8.0),
            duration: 20.0,
            seed,
        };
        let values = excitation.values(&t);
        (t, values)
    }

    /// Instants at which a signal rises through zero.
    fn rises(t: &[f64], x: &[f64]) -> Vec<f64> {
        let pairs = (1..x.len()).filter(|&k| x[k - 1] < 0.0 && x[k] >= 0.0);
        pairs.map(|k| t[k]).collect()
    }

    #[test]
    fn every_shape_keeps_its_amplitude_and_comes_near_it() {
        for shape in [
            Shape::Chirp,
            Shape::Multisine,
            Shape::Ramp,
            Shape::Triangle,
            Shape::Steps,
            Shape::Hold,
            Shape::Sequence,
        ] {
            let (_, x) = signal(shape, 3);
            let peak = x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            assert!(peak <= 0.5 + 1e-12 && peak > 0.4, "{shape:?}: {peak}");
            assert_eq!(x, signal(shape, 3).1);
        }
    }

    #[test]
    fn a_chirp_sweeps_its_band() {
        let (t, x) = signal(Shape::Chirp, 1);
        let rises = rises(&t, &x);
        let first = 1.0 / (rises[1] - rises[0]);
        let last = 1.0 / (rises[rises.len() - 1] - rises[rises.len() - 2]);
        // ∫f dt over 20 s is (8 − 0.25)·20/ln 32 = 44.7 turns; the first whole period begins when one turn is over.
        assert_eq!(rises.len(), 44);
        assert!(first > 0.25 && first < 0.7, "{first}");
        assert!(last > 7.5 && last < 8.1, "{last}");
    }

    #[test]
    fn a_triangle_has_the_period_of_the_lower_edge() {
        let (t, x) = signal(Shape::Triangle, 1);
        let rises = rises(&t, &x);
        assert!(x[0].abs() < 1e-12 && x[1] > 0.0);
        assert!(rises.windows(2).all(|r| (r[1] - r[0] - 4.0).abs() < 2e-3));
    }

    #[test]
    fn the_stages_of_a_sequence_go_both_ways() {
        let (t, x) = signal(Shape::Sequence, 1);
        let mut from = 0.0;
        for stage in super::STAGES {
            let inside = |t: f64| (from..20.0 * stage.end).contains(&t);
            let part: Vec<f64> = t
                .iter()
                .zip(&x)
                .filter(|(t, _)| inside(**t))
                .map(|(_, x)| *x)
                .collect();
            let most = part.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            assert!((most - 0.5).abs() < 1e-3, "{}: {most}", stage.name);
            from = 20.0 * stage.end;
        }
        // 10,000 samples to the end of the ramps, which go as far back as forth, and 4,000 of steps.
        for part in [&x[..10_000], &x[10_000..14_000]] {
            assert!(part.iter().sum::<f64>().abs() < 1.0);
        }
        // An inertia is back: the sum of the sums of a stage of steps.
        let mut speed = 0.0;
        let way: f64 = x[10_000..14_000]
            .iter()
            .map(|x| {
                speed += x;
                speed
            })
            .sum();
        assert!(way.abs() < 4000.0, "{way}");
    }

    #[test]
    fn seeds_differ() {
        for shape in [Shape::Multisine, Shape::Steps] {
            assert_ne!(signal(shape, 1).1, signal(shape, 2).1);
        }
    }
}
