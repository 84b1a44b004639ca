//! What drives the axis: a torque of unit RMS, or a position reference of unit top speed.

use std::f64::consts::{PI, TAU};

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::recipe::{Control, between, log_between, sign};

/// A shape on the sample grid.
pub(super) struct Excitation {
    pub kind: &'static str,
    pub shape: Vec<f64>,
}

impl Excitation {
    /// Draws kind and shape.
    pub fn draw(rng: &mut ChaCha8Rng, control: Control, n: usize, ts: f64) -> Self {
        let (kind, shape) = match (control, rng.random_range(0..4)) {
            (Control::Open, 0 | 3) => {
                let top = between(rng, 3.0, 10.0);
                ("multisine", multisine(rng, n, ts, top, 0.0))
            }
            (Control::Open, 1) => {
                let top = between(rng, 5.0, 10.0);
                ("chirp", chirp(rng, n, ts, top, 0.5))
            }
            (Control::Open, _) => ("filtered-steps", filtered_steps(rng, n, ts)),
            (Control::Pd, 0) => {
                let (top, fall) = (between(rng, 2.0, 4.0), between(rng, 0.8, 1.4));
                ("multisine-position", multisine(rng, n, ts, top, fall))
            }
            (Control::Pd, 1) => {
                let top = between(rng, 5.0, 7.0);
                ("chirp-position", chirp(rng, n, ts, top, -1.0))
            }
            (Control::Pd, 2) => ("triangle-sine-position", triangle_sine(rng, n, ts)),
            (Control::Pd, _) => ("zigzag-position", zigzag(rng, n, ts)),
        };
        Self {
            kind,
            shape: match control {
                Control::Open => unit_rms(shape),
                Control::Pd => unit_speed(shape, ts),
            },
        }
    }

    /// Half of the range of the shape.
    pub fn half_range(&self) -> f64 {
        let (lo, hi) = super::measure::range(self.shape.iter().copied());
        0.5 * (hi - lo)
    }
}

/// Sines between 0.15..0.4 Hz and `top`, amplitudes as `f^−fall`, random phases.
fn multisine(rng: &mut ChaCha8Rng, n: usize, ts: f64, top: f64, fall: f64) -> Vec<f64> {
    let low = between(rng, 0.15, 0.4);
    let lines: Vec<(f64, f64, f64)> = (0..rng.random_range(7..15))
        .map(|_| {
            let f = log_between(rng, low, top);
            (TAU * f, f.powf(-fall), TAU * rng.random::<f64>())
        })
        .collect();
    let at = |t: f64| -> f64 { lines.iter().map(|(w, a, p)| a * (w * t + p).sin()).sum() };
    (0..n).map(|k| at(k as f64 * ts)).collect()
}

/// Logarithmic sweep from 0.2 Hz to `top` and back in one to three legs, amplitude as `f^power`.
fn chirp(rng: &mut ChaCha8Rng, n: usize, ts: f64, top: f64, power: f64) -> Vec<f64> {
    let legs = f64::from(rng.random_range(1..4));
    let mut phase = TAU * rng.random::<f64>();
    (0..n)
        .map(|k| {
            let part = legs * k as f64 / n as f64;
            let up = if (part as u32).is_multiple_of(2) {
                part.fract()
            } else {
                1.0 - part.fract()
            };
            let f = 0.2 * (top / 0.2).powf(up);
            phase += TAU * f * ts;
            f.powf(power) * phase.sin()
        })
        .collect()
}

/// Random levels held for random times, through a first-order filter.
fn filtered_steps(rng: &mut ChaCha8Rng, n: usize, ts: f64) -> Vec<f64> {
    let hold = between(rng, 0.1, 0.4);
    let keep = (-TAU * between(rng, 4.0, 20.0) * ts).exp();
    let (mut level, mut left, mut y) = (0.0, 0.0, 0.0);
    (0..n)
        .map(|_| {
            if left <= 0.0 {
                level = between(rng, -1.0, 1.0);
                left = hold * between(rng, 0.4, 1.6);
            }
            left -= ts;
            y = level + (y - level) * keep;
            y
        })
        .collect()
}

/// A slow triangle with a faster sine on it.
fn triangle_sine(rng: &mut ChaCha8Rng, n: usize, ts: f64) -> Vec<f64> {
    let period = between(rng, 2.5, 8.0);
    let (f, phase) = (between(rng, 0.6, 2.5), TAU * rng.random::<f64>());
    // Speeds: the triangle's is 1, the sine's share lets the sum reverse within a leg or not.
    let share = between(rng, 0.4, 1.6);
    let raw = (0..n).map(|k| {
        let t = k as f64 * ts;
        let part = (t / period).fract();
        let triangle = period * (if part < 0.5 { part } else { 1.0 - part });
        triangle + share * (TAU * f * t + phase).sin() / (TAU * f)
    });
    smooth(&raw.collect::<Vec<f64>>(), ts, between(rng, 0.05, 0.15))
}

/// Straight legs of random speed, slow and fast, with a drift back to the middle.
fn zigzag(rng: &mut ChaCha8Rng, n: usize, ts: f64) -> Vec<f64> {
    let leg = between(rng, 0.3, 1.0);
    let (mut y, mut speed, mut left) = (0.0, 0.0_f64, 0.0);
    let mut raw = Vec::with_capacity(n);
    for _ in 0..n {
        if left <= 0.0 {
            // Mostly reverse, always when far out.
            let back = if rng.random_bool(0.75) {
                -speed.signum()
            } else {
                sign(rng)
            };
            let side = if f64::abs(y) > leg {
                -f64::signum(y)
            } else {
                back
            };
            speed = side * log_between(rng, 0.08, 1.0);
            left = leg * between(rng, 0.5, 1.5);
        }
        left -= ts;
        y += speed * ts;
        raw.push(y);
    }
    smooth(&raw, ts, between(rng, 0.05, 0.15))
}

/// Two centred moving averages of the given width in seconds.
fn smooth(raw: &[f64], ts: f64, width: f64) -> Vec<f64> {
    let half = (0.5 * width / ts) as usize;
    let once = super::measure::moving_average(raw, half);
    super::measure::moving_average(&once, half)
}

fn unit_rms(mut shape: Vec<f64>) -> Vec<f64> {
    let mean = shape.iter().sum::<f64>() / shape.len() as f64;
    shape.iter_mut().for_each(|x| *x -= mean);
    let rms = super::measure::rms(&shape);
    shape.iter_mut().for_each(|x| *x /= rms);
    shape
}

/// Starts with a smooth second, ends centred, top speed 1.
fn unit_speed(mut shape: Vec<f64>, ts: f64) -> Vec<f64> {
    let (lo, hi) = super::measure::range(shape.iter().copied());
    for (k, x) in shape.iter_mut().enumerate() {
        let rise = 0.5 - 0.5 * (PI * (k as f64 * ts).min(1.0)).cos();
        *x = (*x - 0.5 * (lo + hi)) * rise;
    }
    let steps = shape.windows(2).skip((1.0 / ts) as usize);
    let top = steps.map(|w| (w[1] - w[0]).abs() / ts).fold(0.0, f64::max);
    shape.iter_mut().for_each(|x| *x /= top);
    shape
}
