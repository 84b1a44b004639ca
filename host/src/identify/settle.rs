//! What the way from the motion to the estimates does to them: sensors, smoothing, and noise in the regressors.
//!
//! Regressors are made of measured motion. An encoder's counts make velocity noisy, the filter against that rounds off what
//! friction does near standstill, and torque noise moves the axis and so enters the regressors too. What all this does is
//! measured on twins: recordings of an axis that is exactly the model, on the same path, through the same sensors and the
//! same filters. There the true parameters are known, so that
//! - the mean residual `o` of the twins' rows at these parameters is what is wrong with the rows: it is taken off;
//! - the mean step `b` that the twins' rows, less `o`, ask for is what their regressors' noise does to estimates: it is
//!   taken off these.
//!
//! Both are at the estimated parameters rather than the true ones, so they are repeated at what they lead to (indirect
//! inference: Gouriéroux, Monfort and Renault, Journal of Applied Econometrics 8, 1993). With `o` gone the residual is noise,
//! which is estimated anew: weights and standard errors follow from it.

use super::{Workbench, twin::Twin};
use crate::bench;
use crate::model::{Causality, Model};
use crate::noise::Noise;
use crate::problem::{Problem, Row};
use crate::recording::Recording;
use crate::weak::Track;
use crate::{refine, system};

/// Repetitions: what is left shrinks about fivefold with each, from less than half.
const ROUNDS: usize = 3;
/// Twins of each recording: the steps of their encoders lie evenly within one another, and their loads come in pairs of
/// opposite sign, so that what is linear in noise cancels.
const DRAWS: usize = 6;

/// Twins of the recordings.
struct Twins {
    problems: Vec<Problem>,
    /// Residual of the rows of each.
    residuals: Vec<Vec<f64>>,
    /// Mean of them for each row of the recordings.
    offset: Vec<f64>,
    /// The folds of the rows that a twin has, too.
    folds: Vec<Option<usize>>,
}

impl Workbench {
    /// Takes what sensors and smoothing do off refined estimates, and gives them the standard errors of what is left.
    pub fn settle(&self, model: &mut Model, recordings: &[Recording]) {
        let taken: Vec<usize> = (refine::free_parameters(model).into_iter())
            .filter(|&k| model.parameters()[k].se == Some(f64::INFINITY))
            .collect();
        let hold = |model: &mut Model, known: bool| {
            for &k in &taken {
                model.parameters_mut()[k].known = known;
            }
        };
        let mut settled = model.clone();
        hold(&mut settled, true);
        if self.settle_on_twins(&mut settled, recordings).is_some() {
            for &k in &taken {
                *settled.parameters_mut()[k] = model.parameters()[k].clone();
            }
            *model = settled;
        } else {
            self.allow_for_smoothing(model, recordings);
        }
    }

    fn settle_on_twins(&self, model: &mut Model, recordings: &[Recording]) -> Option<()> {
        if model.causality == Causality::Inverse {
            return None;
        }
        let mut load = 0.0;
        let mut scatter = Scatter::default();
        for round in 0..ROUNDS {
            let twins = self.twins(model, recordings, load, round)?;
            let free = refine::free_parameters(model);
            let residual = system::residual(&self.problem, model);
            let clean = less(&residual, &twins.offset);
            let noise = Noise::estimate(&self.problem, &clean, free.len(), &twins.folds);
            if !lessens(
                &noise.whiten(&clean),
                &noise.whiten(&residual),
                &twins.folds,
            ) {
                return None;
            }
            let steps = self.steps(&twins, model, &noise)?;
            let before = model.clone();
            let normal =
                refine::refine_beside(&twins.offset, &self.problem, model, &noise, &twins.folds);
            let mean = |at: usize| steps.iter().map(|s| s[at].1).sum::<f64>() / DRAWS as f64;
            let bias: Vec<(usize, f64)> = (free.iter().enumerate())
                .map(|(at, &k)| (k, mean(at)))
                .collect();
            if round > 0 {
                scatter.add(&steps, &bias);
            }
            let plain = model.clone();
            *model = refine::moved(model, &bias, -1.0)?;
            load = self.load_noise(&noise, model);
            let (p, w, scale) = normal.covariances()?;
            let now = free.clone();
            for (at, &k) in now.iter().enumerate() {
                let drawn = scatter.deviation(at);
                if round + 1 == ROUNDS && std::env::var("TRACE").is_ok() {
                    let v = model.parameters()[k].value.unwrap();
                    eprintln!("SE,{},{:e},{:e},{:e},{:e},{:e}", model.labels()[k].name, v, p[(at, at)].sqrt() / scale[at], w[(at, at)].sqrt() / scale[at], drawn, bias[at].1);
                }
                let parameter = &mut *model.parameters_mut().swap_remove(k);
                if let Some(se) = plain.parameters()[k].se {
                    parameter.se = Some(se.max(drawn));
                }
            }
            let _ = before;
        }
        Some(())
    }

    /// RMS of the torque or force, constant within each sample, that makes up the noise of the rows beside the encoder's.
    fn load_noise(&self, noise: &Noise, model: &Model) -> f64 {
        let scale = system::torque_scale(&self.problem, model);
        let inertia = model.parameters()[model.moving_inertia()].value;
        let all = noise.law.floor() * scale * scale;
        let tracks = self.problem.tracks.iter().zip(&self.problem.windows);
        let loads = tracks.map(|(track, windows)| {
            let encoder = inertia.unwrap_or_default() * track.position_noise;
            let rest = all - encoder * encoder * windows.acceleration_noise();
            let passed: f64 = windows.hold_weights().iter().map(|w| w * w).sum();
            (rest.max(0.0) / passed).sqrt()
        });
        loads.fold(f64::INFINITY, f64::min)
    }

    /// Twins of the recordings under a load of some RMS; `None` where the model describes no axis that could give them.
    fn twins(&self, model: &Model, recordings: &[Recording], load: f64, round: usize) -> Option<Twins> {
        let make = |draw: usize| self.twin(model, recordings, (round, draw), load);
        let problems = (0..DRAWS).map(make).collect::<Option<Vec<_>>>()?;
        let residuals: Vec<Vec<f64>> = problems
            .iter()
            .map(|problem| system::residual(problem, model))
            .collect();
        let rows = &self.problem.rows;
        let (mut sums, mut counts) = (vec![0.0; rows.len()], vec![0.0_f64; rows.len()]);
        for (problem, residual) in problems.iter().zip(&residuals) {
            for (here, there) in common(rows, &problem.rows) {
                sums[here] += residual[there];
                counts[here] += 1.0;
            }
        }
        let means = sums.iter().zip(&counts);
        let folds = self.folds.iter().zip(&counts);
        Some(Twins {
            offset: means.map(|(sum, count)| sum / count.max(1.0)).collect(),
            folds: folds.map(|(f, count)| f.filter(|_| *count > 0.0)).collect(),
            problems,
            residuals,
        })
    }

    /// The weak form of one twin of each recording, smoothed and cut into windows as the recordings were.
    fn twin(
        &self,
        model: &Model,
        recordings: &[Recording],
        (round, draw): (usize, usize),
        load: f64,
    ) -> Option<Problem> {
        let before = &self.problem;
        let at = (draw as f64 + 0.5) / DRAWS as f64;
        let sign = if draw.is_multiple_of(2) { 1.0 } else { -1.0 };
        let track = |(index, (recording, track)): (usize, (&Recording, &Track))| {
            let seed = |draw: usize| ((round * DRAWS + draw) * recordings.len() + index) as u64;
            let loads = bench::loads(recording.len(), load, seed(draw / 2));
            let loads: Vec<f64> = loads.iter().map(|l| sign * l).collect();
            let twin = Twin::new(model, recording, track, &loads)?;
            let seen = twin.seen(recording, track, at, seed(draw));
            let smoothed =
                Track::smoothed(&seen, before.motion, self.balance, Some(track.smoothing));
            Some(smoothed.piece_of(track.whole, track.boundary))
        };
        let pairs = recordings.iter().zip(&before.tracks).enumerate();
        let tracks = pairs.map(track).collect::<Option<Vec<_>>>()?;
        let reaches: Vec<usize> = before.windows.iter().map(|w| w.reach).collect();
        Some(Problem::new(
            tracks,
            &reaches,
            before.motion,
            before.response,
        ))
    }

    /// The steps that the rows of twins, less their offset, ask for.
    fn steps(
        &self,
        twins: &Twins,
        model: &Model,
        noise: &Noise,
    ) -> Option<Vec<Vec<(usize, f64)>>> {
        let step = |(problem, residual): (&Problem, &Vec<f64>)| {
            let mut offset = residual.clone();
            let mut folds = vec![None; residual.len()];
            for (here, there) in common(&self.problem.rows, &problem.rows) {
                offset[there] = twins.offset[here];
                folds[there] = twins.folds[here];
            }
            let noise = noise.law.on(problem, &less(residual, &offset), &folds);
            refine::step_beside(&offset, problem, model, &noise, &folds)
        };
        let pairs = twins.problems.iter().zip(&twins.residuals);
        pairs.map(step).collect()
    }
}

/// Scatter of the steps that twins ask for: what noise does to estimates.
#[derive(Default)]
struct Scatter {
    squares: Vec<f64>,
    freedom: f64,
}

impl Scatter {
    fn add(&mut self, steps: &[Vec<(usize, f64)>], mean: &[(usize, f64)]) {
        self.squares.resize(mean.len(), 0.0);
        self.freedom += steps.len() as f64 - 1.0;
        for step in steps {
            let off = step.iter().zip(mean).map(|((_, s), (_, m))| s - m);
            self.squares.iter_mut().zip(off).for_each(|(sum, o)| *sum += o * o);
        }
    }

    /// Standard deviation of an estimate; 0 without any steps.
    fn deviation(&self, at: usize) -> f64 {
        let squares = self.squares.get(at).copied().unwrap_or_default();
        (squares / self.freedom.max(1.0)).sqrt()
    }
}

fn less(rows: &[f64], offset: &[f64]) -> Vec<f64> {
    rows.iter().zip(offset).map(|(r, o)| r - o).collect()
}

/// Whether the residual without an offset is no larger than with it, but for the noise of so many draws in the offset. It is
/// larger where twins are unlike the recordings. Medians ignore the odd row in which they reverse otherwise.
fn lessens(clean: &[f64], residual: &[f64], folds: &[Option<usize>]) -> bool {
    let typical = |rows: &[f64]| {
        let counted = rows.iter().zip(folds).filter(|(_, fold)| fold.is_some());
        let mut sizes: Vec<f64> = counted.map(|(z, _)| z.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied()
    };
    match (typical(clean), typical(residual)) {
        (Some(clean), Some(residual)) => {
            clean <= residual * (1.0 + 1.0 / DRAWS as f64).sqrt()
        }
        _ => false,
    }
}

/// Positions of the windows that two sets of rows have in common.
fn common<'a>(here: &'a [Row], there: &'a [Row]) -> impl Iterator<Item = (usize, usize)> + 'a {
    let key = |row: &Row| (row.track, row.centre);
    let mut other = 0;
    here.iter().enumerate().filter_map(move |(k, row)| {
        while there.get(other).is_some_and(|o| key(o) < key(row)) {
            other += 1;
        }
        let same = there.get(other).is_some_and(|o| key(o) == key(row));
        same.then_some((k, other))
    })
}
