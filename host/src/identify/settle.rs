//! What the way from the motion to the estimates does to them: sensors, smoothing, and noise in the regressors.
//!
//! Regressors are made of measured motion. An encoder's counts make velocity noisy, the filter against that rounds off what
//! friction does near standstill, and torque noise moves the axis and so enters the regressors too. What all this does is
//! measured on twins: recordings of an axis that is exactly the model, on the same path, through the same sensors and the
//! same filters. There the true parameters are known, so that
//! - the mean residual `o` of the twins' rows at these parameters is what is wrong with the rows: it is taken off;
//! - the mean step `b` that the twins' rows, less `o`, call for is what noise in their regressors does to estimates: it is
//!   taken off these;
//! - the scatter of these steps is the standard error of the estimates. The larger of this and of what the scatter of the
//!   recordings' own residuals says is reported.
//!
//! `o` and `b` are those at the estimates rather than at the truth, so they are repeated at what they lead to (indirect
//! inference: Gouriéroux, Monfort and Renault, Journal of Applied Econometrics 8, 1993). Where noise makes regressors look
//! more sensitive than they are, estimates follow the truth by `D < 1` only; that repetition divides by it, hence
//! the covariance `D⁻¹·C·D⁻ᵀ`, with `D = (JᵀJ)⁻¹·JᵀG` and `G` the derivative on rows that ideal sensors give.

use nalgebra::{DMatrix, DVector};

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
    /// Whether a load disturbed them.
    loaded: bool,
    /// Mean of them for each row of the recordings.
    offset: Vec<f64>,
    /// Derivative of the residual of these rows as ideal sensors would give them, by free parameter.
    sensitivities: Vec<Vec<f64>>,
    /// The blocks of the rows that twins have, too.
    blocks: Vec<Option<usize>>,
}

impl Workbench {
    /// A refined model less what sensors and smoothing did to it, with the standard errors of what is left. `None` where
    /// twins of the recordings cannot tell. Parameters that were taken rather than estimated stay as they are.
    pub(super) fn settled_on_twins(
        &self,
        model: &Model,
        recordings: &[Recording],
    ) -> Option<Model> {
        if model.causality == Causality::Inverse {
            return None;
        }
        let mut settled = model.clone();
        let taken = |k: &usize| model.parameters()[*k].se == Some(f64::INFINITY);
        let taken: Vec<usize> = (refine::free_parameters(model).into_iter())
            .filter(taken)
            .collect();
        for &k in &taken {
            settled.parameters_mut()[k].known = true;
        }
        let mut scatter = Scatter::default();
        let mut load = 0.0;
        for round in 0..ROUNDS {
            let twins = self.twins(&settled, recordings, load, round)?;
            let noise;
            (settled, noise) = self.settle_once(&settled, &twins, &mut scatter)?;
            load = self.load_noise(&noise, &settled);
        }
        for &k in &taken {
            *settled.parameters_mut()[k] = model.parameters()[k].clone();
        }
        Some(settled)
    }

    /// One repetition. Twins of the first one knew of no noise beside the encoder's: their scatter does not count.
    fn settle_once(
        &self,
        model: &Model,
        twins: &Twins,
        scatter: &mut Scatter,
    ) -> Option<(Model, Noise)> {
        let (offset, blocks) = (&twins.offset, &twins.blocks);
        let free = refine::free_parameters(model);
        let residual = system::residual(&self.problem, model);
        let clean = less(&residual, offset);
        let noise = Noise::estimate(&self.problem, &clean, free.len(), blocks);
        if !lessens(&noise.whiten(&clean), &noise.whiten(&residual), blocks) {
            return None;
        }
        let (steps, follows) = self.answers(twins, model, &noise)?;
        let mut next = model.clone();
        let normal = refine::refine_beside(offset, &self.problem, &mut next, &noise, blocks);
        let mean = steps.iter().sum::<DVector<f64>>() / DRAWS as f64;
        let bias: Vec<(usize, f64)> = free.iter().copied().zip(mean.iter().copied()).collect();
        next = refine::moved(&next, &bias, -1.0)?;
        let (_, sandwich, scale) = normal.covariances()?;
        // Everything in units of the inverse column norms, as parameters differ in size by orders of magnitude.
        let scale = DMatrix::from_diagonal(&DVector::from_vec(scale));
        let unscale = scale.clone().try_inverse()?;
        let back = (&scale * follows * &unscale).try_inverse()?;
        if twins.loaded {
            let steps = steps
                .iter()
                .map(|s| &unscale * &back * &scale * (s - &mean));
            scatter.add(steps);
        }
        let own = &unscale * &back * sandwich * back.transpose() * &unscale;
        for (at, &k) in free.iter().enumerate() {
            let se = own[(at, at)].max(scatter.variance(at)).sqrt();
            next.parameters_mut()[k].se = Some(se);
        }
        Some((next, noise))
    }

    /// The steps that the rows of each twin, less their offset, call for; and by how much estimates follow the truth, `D`.
    fn answers(
        &self,
        twins: &Twins,
        model: &Model,
        noise: &Noise,
    ) -> Option<(Vec<DVector<f64>>, DMatrix<f64>)> {
        let free = refine::free_parameters(model).len();
        let mut steps = Vec::with_capacity(DRAWS);
        let mut follows = DMatrix::zeros(free, free);
        for (problem, residual) in twins.problems.iter().zip(&twins.residuals) {
            let mut blocks = vec![None; residual.len()];
            let mut errors = vec![vec![0.0; residual.len()]; 1 + free];
            for (here, there) in common(&self.problem.rows, &problem.rows) {
                blocks[there] = twins.blocks[here];
                errors[0][there] = residual[there] - twins.offset[here];
                for (error, column) in errors[1..].iter_mut().zip(&twins.sensitivities) {
                    error[there] = column[here];
                }
            }
            let noise = noise.law.on(problem, &errors[0], &blocks);
            let (step, follow) = refine::answers(&errors, problem, model, &noise, &blocks)?;
            steps.push(step);
            follows += follow / DRAWS as f64;
        }
        Some((steps, follows))
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
    fn twins(
        &self,
        model: &Model,
        recordings: &[Recording],
        load: f64,
        round: usize,
    ) -> Option<Twins> {
        let draws = (0..DRAWS).map(|draw| {
            let draw = Draw {
                at: (draw as f64 + 0.5) / DRAWS as f64,
                load: if draw % 2 == 0 { load } else { -load },
                seed: (round * DRAWS + draw) as u64,
                pair: (round * DRAWS + draw / 2) as u64,
            };
            self.twin(model, recordings, Some(draw))
        });
        let problems = draws.collect::<Option<Vec<_>>>()?;
        let residuals = problems.iter().map(|twin| system::residual(twin, model));
        let residuals: Vec<Vec<f64>> = residuals.collect();
        let rows = &self.problem.rows;
        let (mut sums, mut counts) = (vec![0.0; rows.len()], vec![0.0_f64; rows.len()]);
        for (problem, residual) in problems.iter().zip(&residuals) {
            for (here, there) in common(rows, &problem.rows) {
                sums[here] += residual[there];
                counts[here] += 1.0;
            }
        }
        let ideal = self.twin(model, recordings, None)?;
        let raw = refine::sensitivities(&ideal, model);
        let mut sensitivities = vec![vec![0.0; rows.len()]; raw.len()];
        let mut blocks = vec![None; rows.len()];
        for (here, there) in common(rows, &ideal.rows) {
            blocks[here] = self.blocks[here].filter(|_| counts[here] > 0.0);
            let columns = sensitivities.iter_mut().zip(&raw);
            columns.for_each(|(column, raw)| column[here] = raw[there]);
        }
        let means = sums.iter().zip(&counts);
        Some(Twins {
            offset: means.map(|(sum, count)| sum / count.max(1.0)).collect(),
            loaded: load > 0.0,
            problems,
            residuals,
            sensitivities,
            blocks,
        })
    }

    /// The weak form of one twin of each recording, smoothed and cut into windows as the recordings were; without a draw,
    /// of one without noise as ideal sensors see it.
    fn twin(&self, model: &Model, recordings: &[Recording], draw: Option<Draw>) -> Option<Problem> {
        let before = &self.problem;
        let track = |(index, (recording, track)): (u64, (&Recording, &Track))| {
            let Draw {
                at,
                load,
                seed,
                pair,
            } = draw.unwrap_or_default();
            let loads = bench::loads(recording.len(), load.abs(), pair ^ index << 32);
            let loads: Vec<f64> = loads.iter().map(|l| l * load.signum()).collect();
            let twin = Twin::new(model, recording, track, &loads)?;
            let made = match draw {
                None => Track::new(&twin.ideal(recording), before.motion, None),
                Some(_) => Track::smoothed(
                    &twin.seen(recording, track, at, seed ^ index << 32),
                    before.motion,
                    self.balance,
                    Some(track.smoothing),
                ),
            };
            Some(made.piece_of(track.whole, track.boundary))
        };
        let pairs = (0..).zip(recordings.iter().zip(&before.tracks));
        let tracks = pairs.map(track).collect::<Option<Vec<_>>>()?;
        let reaches: Vec<usize> = before.windows.iter().map(|w| w.reach).collect();
        let problem = Problem::new(tracks, &reaches, before.motion, before.response);
        Some(problem)
    }
}

/// What is drawn for one twin of each recording.
#[derive(Clone, Copy, Default)]
struct Draw {
    /// Where the steps of the encoder lie, from 0 to 1.
    at: f64,
    /// RMS of the load, and its sign.
    load: f64,
    /// Of the noise of the sensors, and of the load, which two twins share but for its sign.
    seed: u64,
    pair: u64,
}

/// Squares of the steps that twins call for.
#[derive(Default)]
struct Scatter {
    squares: Vec<f64>,
    freedom: f64,
}

impl Scatter {
    /// Adds the steps of one repetition, less their mean.
    fn add(&mut self, steps: impl Iterator<Item = DVector<f64>>) {
        for step in steps {
            self.squares.resize(step.len(), 0.0);
            let sums = self.squares.iter_mut().zip(step.iter());
            sums.for_each(|(sum, s)| *sum += s * s);
        }
        self.freedom += DRAWS as f64 - 1.0;
    }

    /// Variance of an estimate; 0 without any steps.
    fn variance(&self, at: usize) -> f64 {
        let squares = self.squares.get(at).copied().unwrap_or_default();
        squares / self.freedom.max(1.0)
    }
}

fn less(rows: &[f64], offset: &[f64]) -> Vec<f64> {
    rows.iter().zip(offset).map(|(r, o)| r - o).collect()
}

/// Whether the residual without an offset is no larger than with it, but for the noise of so many draws in the offset. It is
/// larger where twins are unlike the recordings. Medians ignore the odd row in which they reverse otherwise.
fn lessens(clean: &[f64], residual: &[f64], blocks: &[Option<usize>]) -> bool {
    let typical = |rows: &[f64]| {
        let counted = rows.iter().zip(blocks).filter(|(_, block)| block.is_some());
        let mut sizes: Vec<f64> = counted.map(|(z, _)| z.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied()
    };
    let worst = (1.0 + 1.0 / DRAWS as f64).sqrt();
    let pair = typical(clean).zip(typical(residual));
    pair.is_some_and(|(clean, residual)| clean <= worst * residual)
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
