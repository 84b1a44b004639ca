//! What the smoothing of velocity does to estimates.

use super::{Workbench, keep_in_reach};
use crate::model::Model;
use crate::problem::Problem;
use crate::recording::Recording;
use crate::weak::Track;
use crate::{refine, system, uncertainty};

/// Order of the smoothing's effect: first where friction jumps or bends within the filter's width, second where it does not.
const ORDER: f64 = 1.5;

impl Workbench {
    /// Estimates a refined model again with velocity smoothed by a filter of half the width, and adds to each standard
    /// error what the smoothing does.
    ///
    /// Smoothing rounds off what friction does near standstill within the filter's width, and too little of it leaves
    /// noise in the direction of sliding; neither shows in the scatter of residuals. An effect that grows with power `p`
    /// of the width is `1/(1 − 2^−p)` of the difference between the two estimates.
    pub fn settle(&self, model: &mut Model, recordings: &[Recording]) {
        let Some(finer) = self.with_half_the_smoothing(model, recordings) else {
            return;
        };
        let effect = 1.0 / (1.0 - 2f64.powf(-ORDER));
        for (parameter, finer) in model.parameters_mut().into_iter().zip(finer.parameters()) {
            let (Some(here), Some(there)) = (parameter.value, finer.value) else {
                continue;
            };
            uncertainty::add(parameter, effect * (here - there));
        }
    }

    fn with_half_the_smoothing(&self, model: &Model, recordings: &[Recording]) -> Option<Model> {
        let (problem, blocks) = self.finer.get_or_init(|| self.finer_problem(recordings));
        blocks.iter().flatten().next()?;
        let noise = (self.noise.law).on(problem, &system::residual(problem, model), blocks);
        let mut model = model.clone();
        keep_in_reach(problem, &mut model);
        refine::refine(problem, &mut model, &noise, blocks);
        Some(model)
    }

    /// The same windows on velocities that are smoothed half as wide, with the blocks of their rows.
    fn finer_problem(&self, recordings: &[Recording]) -> (Problem, Vec<Option<usize>>) {
        let before = &self.problem;
        let tracks = recordings.iter().zip(before.tracks.iter()).map(|(r, t)| {
            let finer = Some(t.smoothing.finer());
            Track::smoothed(r, before.motion, self.balance, finer).piece_of(t.whole, t.boundary)
        });
        let reaches: Vec<usize> = before.windows.iter().map(|w| w.reach).collect();
        let tracks = tracks.collect();
        let problem = Problem::new(tracks, &reaches, before.motion, before.response);
        let blocks = system::blocks(&problem);
        (problem, blocks)
    }
}
