//! What one piece adds to the sums over all.

use super::cut::Piece;
use super::pilot::Plan;
use crate::axis::Axis;
use crate::dictionary::Dictionary;
use crate::error::Result;
use crate::fit::{self, Along, Sums};
use crate::identify::follow_everything;
use crate::model::{Causality, Model};
use crate::normal::Normal;
use crate::problem::Problem;
use crate::refine::{self, free_parameters};
use crate::system::{self, System};
use crate::weak::{Part, Track};

/// Normal equations of the training rows, and errors of the training and the held-out part.
pub(super) type Share = (Normal, [Sums; 2]);

/// The share of a piece at the present values of a model.
pub(super) fn share(piece: &Piece, plan: &Plan, model: &Model) -> Result<Share> {
    let track = Track::smoothed(&piece.recording, model.motion, plan.balance, plan.smoothing);
    let node = (piece.boundary < piece.recording.len()).then(|| {
        let time = piece.recording.t[piece.boundary] - track.start;
        (time / track.period).round() as usize
    });
    let boundary = node.unwrap_or(usize::MAX);
    let track = track.piece_of(piece.whole, boundary);
    let sums = errors(piece, &track, model)?;
    let normal = if boundary == 0 {
        Normal::zero(free_parameters(model).len())
    } else {
        normal(piece, track, plan, model)?
    };
    Ok((normal, sums))
}

fn normal(piece: &Piece, track: Track, plan: &Plan, model: &Model) -> Result<Normal> {
    let problem = Problem::new(vec![track], &[piece.reach], model.motion, plan.response);
    let clusters = clusters(piece, &problem);
    if clusters.iter().all(Option::is_none) {
        return Ok(Normal::zero(free_parameters(model).len()));
    }
    // The functions that follow whatever is systematic are the piece's own, so that they follow slow changes, too.
    let blocks = system::blocks(&problem);
    let dictionary = Dictionary::new(&problem.tracks, problem.motion);
    let system = System::new(&problem, model)?;
    let residual = match follow_everything(&problem, &system, &dictionary, &blocks) {
        Ok((residual, _)) => residual,
        Err(_) => system::residual(&problem, model),
    };
    let noise = plan.law.on(&problem, &residual, &clusters);
    Ok(refine::normal(&problem, model, &noise, &clusters))
}

/// A number for each training row of the core: rows of one block of time have the same.
fn clusters(piece: &Piece, problem: &Problem) -> Vec<Option<usize>> {
    let track = &problem.tracks[0];
    // Neighbouring pieces share no row and miss none: the instants that part them lie between two samples.
    let instant = |sample: usize| piece.recording.t[sample] - 0.5 * track.period;
    let from = if piece.outer.0 {
        f64::NEG_INFINITY
    } else {
        instant(piece.core.start)
    };
    let to = if piece.outer.1 {
        f64::INFINITY
    } else {
        instant(piece.core.end)
    };
    let length = system::block_length(piece.training);
    let mut last = None;
    let mut count = 0;
    let rows = problem.rows.iter().map(|row| {
        let time = problem.time(*row);
        if row.part != Part::Train || time < from || time >= to {
            return None;
        }
        let block = Some(((time - piece.start) / length) as usize);
        count += usize::from(last != block);
        last = block;
        Some(count - 1)
    });
    rows.collect()
}

fn errors(piece: &Piece, track: &Track, model: &Model) -> Result<[Sums; 2]> {
    let axis = Axis::new(model)?;
    let recording = &piece.recording;
    let mut sums = [Sums::default(); 2];
    if model.causality == Causality::Inverse {
        let force = fit::inverse(&axis, recording, track);
        for k in piece.core.clone() {
            let part = usize::from(k >= piece.boundary);
            sums[part].add(&fit::of_force(force[k], recording.u[k]));
        }
        return Ok(sums);
    }
    let along = Along::new(&axis, track);
    for (run, held_out) in &piece.runs {
        let run = fit::window(&axis, recording, track, &along, run.clone());
        sums[usize::from(*held_out)].add(&run);
    }
    Ok(sums)
}
