//! The width of the test functions: chosen by what encoder noise leaves of the residual, unless the user says.

use super::{FEWEST_ROWS, Options, follow_everything, with_starts};
use crate::dictionary::Dictionary;
use crate::error::{Error, Result};
use crate::format::{quantity, whole_percent};
use crate::model::Model;
use crate::problem::{Problem, Response};
use crate::system::{self, System};
use crate::weak::{Part, Track};

/// Half-widths of test functions that are tried, s. The narrowest passes motion up to 7 Hz (−3 dB), the band in which an
/// axis is a rigid body and its drive an ideal one; narrower windows bring in current loops and resonances.
const HALF_WIDTHS: [f64; 4] = [0.07, 0.1, 0.14, 0.2];
/// Samples under half a test function at least: fewer hardly resolve what a velocity does within a window.
const FEWEST_SAMPLES: usize = 8;
/// Encoder noise in `∫q φ̈` falls with the width to the power −5/2, everything else with −1/2 at most. Where it makes up
/// this share of the residual variance or less, widening gains little precision and loses resolution in time.
const MOST_ENCODER_SHARE: f64 = 1.0 / 3.0;
/// A half-width that was tried.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Tried {
    /// Half-width of the test functions, s.
    pub half_width: f64,
    /// Windows in the training part.
    pub rows: usize,
    /// Share of the residual variance that encoder noise accounts for; none where there are too few windows to tell.
    pub encoder_share: Option<f64>,
}

/// The choice of the windows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Width {
    /// What was tried, the last of it chosen.
    pub tried: Vec<Tried>,
    /// Whether the user chose.
    pub asked: bool,
}

impl Width {
    /// Whether encoder noise makes up little of the residual, so that measured positions may serve as regressors.
    pub fn quiet(&self) -> bool {
        let share = self.tried.last().and_then(|tried| tried.encoder_share);
        share.is_some_and(|share| share <= MOST_ENCODER_SHARE)
    }

    /// The choice in a sentence.
    pub fn reason(&self) -> String {
        let Some(chosen) = self.tried.last() else {
            return String::new();
        };
        let why = match (self.asked, chosen.encoder_share) {
            (true, _) => "as asked for".to_owned(),
            (_, None) => "as the recording is too short for more".to_owned(),
            (_, Some(share)) if share <= MOST_ENCODER_SHARE => format!(
                "the narrowest at which encoder noise makes up less than a third of the residual variance ({})",
                whole_percent(share)
            ),
            (_, Some(share)) => format!(
                "the widest, as encoder noise makes up {} of the residual variance",
                whole_percent(share)
            ),
        };
        format!(
            "Test functions of half-width {}, {why}; {} windows.",
            quantity(1e3 * chosen.half_width, "ms"),
            chosen.rows
        )
    }
}

/// The tracks under windows of the narrowest width at which the encoder's noise no longer dominates, or of the width
/// asked for.
pub(super) fn choose_width(
    tracks: &[Track],
    dictionary: &Dictionary,
    model: &Model,
    options: Options,
) -> Result<(Problem, Width)> {
    let reach = |track: &Track, width: f64| {
        let most = (track.whole / 40).max(FEWEST_SAMPLES);
        ((width / track.period).round() as usize).clamp(FEWEST_SAMPLES, most)
    };
    // Without inertia there is no acceleration to compare, nor encoder noise in it.
    let massless = model.inertia.known && model.inertia.value == Some(0.0);
    let side = if massless {
        Response::Force
    } else {
        Response::Acceleration
    };
    let problem = |width: f64| {
        let reaches: Vec<usize> = tracks.iter().map(|t| reach(t, width)).collect();
        Problem::new(tracks.to_vec(), &reaches, model.motion, side)
    };
    let widths = options.half_width.map_or(HALF_WIDTHS.to_vec(), |w| vec![w]);
    let mut chosen = Width {
        tried: Vec::new(),
        asked: options.half_width.is_some(),
    };
    let last = widths.len() - 1;
    for (k, width) in widths.into_iter().enumerate() {
        let problem = problem(width);
        let rows = problem.count(Part::Train);
        let encoder_share = if rows < FEWEST_ROWS {
            None
        } else {
            Some(encoder_share(&problem, dictionary, model)?)
        };
        chosen.tried.push(Tried {
            half_width: problem.half_width(),
            rows,
            encoder_share,
        });
        if k == last || encoder_share.is_none_or(|share| share <= MOST_ENCODER_SHARE) {
            return Ok((problem, chosen));
        }
    }
    Err(Error::Internal("no width of windows to try".to_owned()))
}

/// Share of the residual variance that encoder noise accounts for.
fn encoder_share(problem: &Problem, dictionary: &Dictionary, model: &Model) -> Result<f64> {
    if problem.response == Response::Force {
        return Ok(0.0);
    }
    let system = System::new(problem, &with_starts(problem, model))?;
    let blocks = system::blocks(problem);
    let (residual, unknowns) = follow_everything(problem, &system, dictionary, &blocks)?;
    let mut squares: Vec<f64> = residual
        .iter()
        .zip(&blocks)
        .filter(|(_, f)| f.is_some())
        .map(|(r, _)| r * r)
        .collect();
    squares.sort_by(f64::total_cmp);
    let train = squares.len() as f64;
    // The median of χ² with one degree of freedom is 0.455; the median ignores reversals.
    let variance =
        squares[squares.len() / 2] / 0.455 * train / (train - unknowns as f64).max(0.2 * train);
    let encoder = problem
        .tracks
        .iter()
        .zip(&problem.windows)
        .map(|(track, windows)| windows.acceleration_noise(track));
    Ok(encoder.fold(0.0, f64::max) / variance.max(1e-300))
}
