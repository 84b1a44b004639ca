//! From recordings to weak-form rows: uniform tracks, smoothed velocity, windows and functionals.

mod acceleration;
mod bend;
mod reversal;
mod smooth;
mod track;
mod windows;

pub use bend::Bent;
pub use track::{Balance, Smoothing, Track, roughness};
pub use windows::{Part, Windows};

/// The share of each recording that the fit sees; the rest is held out.
pub const TRAIN_SHARE: f64 = 0.7;
