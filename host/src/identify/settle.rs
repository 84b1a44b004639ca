//! What the way from the motion to the estimates does to them: sensors, smoothing, and noise in the regressors.
//!
//! Regressors are made of measured motion. An encoder's counts make velocity noisy, the filter against that rounds off what
//! friction does near standstill, and torque noise moves the axis and so enters the regressors too. What all this does is
//! measured on twins: recordings of an axis that is exactly the model, on the same path, through the same sensors, whose
//! noise makes the twin's readings as rough as the recording's, and the same filters. There the true parameters are known,
//! so that
//! - the mean residual `o` of the twins' rows at these parameters is what is wrong with the rows: it is taken off;
//! - the mean step `b` that the twins' rows, less `o`, call for is what noise in their regressors does to estimates: it is
//!   taken off these;
//! - the scatter of the gradients of blocks of the twins' rows is that of the estimates, and what the recordings' own residuals
//!   say is another figure for the same. The mean of both variances is reported, unless the recordings' is so much larger that
//!   twins do not resemble them: the larger of two uncertain figures would be too large.
//!
//! Twins only resemble the recordings, so that what is taken off is known to some share of itself ([`UNSURE`]), which is part of
//! the standard errors.
//!
//! `o` and `b` are those at the estimates rather than at the truth, so they are repeated, on twins with the same noise, at
//! what they lead to (indirect inference: Gouriéroux, Monfort and Renault, Journal of Applied Econometrics 8, 1993). Where
//! noise makes regressors look more sensitive than they are, estimates follow the truth by `D < 1` only; steps are divided
//! by it, hence the covariance `D⁻¹·C·D⁻ᵀ`. To begin with `D = (JᵀJ)⁻¹·JᵀG`, `G` being the derivative on rows that ideal
//! sensors give; that twins take other ways under other parameters shows from one repetition to the next, and `D` learns
//! it as quasi-Newton methods do (Broyden, Mathematics of Computation 19, 1965).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::twin::{self, Draw, Twin};
use super::way::Way;
use super::{Workbench, keep_in_reach};
use crate::model::{Causality, Model};
use crate::noise::Noise;
use crate::problem::{Problem, Row};
use crate::recording::Recording;
use crate::refine::{self, Answer};
use crate::weak::Track;
use crate::{system, uncertainty};

/// Most repetitions.
const MOST_ROUNDS: usize = 6;
/// They end when none of their steps is longer than this, in standard errors: it adds less than a tenth to these.
const ENOUGH: f64 = 0.4;
/// Twins of each recording: the steps of their encoders lie evenly within one another, and their loads come in pairs of
/// opposite sign, so that what is linear in noise cancels.
const DRAWS: usize = 6;
/// Variance, in squared standard errors, by which what estimates are off by differs between two repetitions by chance, at most: that
/// of two means over twins that have nothing in common.
const CHANCE: f64 = 2.0 / DRAWS as f64;
/// Noise variance, as a multiple of what it is known to be at most, from which on twins tell nothing. They take for noise all
/// that they do not have, so the bias that they show is too large in this proportion, and from twice on taking it off
/// does as much harm as good. Variances of estimates that differ by so much are not two figures for one thing either.
const MOST_MISFIT: f64 = 2.0;

/// What is taken off may be off by this share of itself (one standard deviation). Without it fewer intervals held the truth the
/// larger the correction was. Chosen on axes under the two `LuGre` laws (`coverage --seed 777`); those of another seed are in the
/// book.
const UNSURE: f64 = 0.125;

/// Twins of the recordings.
struct Twins {
    problems: Vec<Problem>,
    /// Residual of the rows of each.
    residuals: Vec<Vec<f64>>,
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
        keep_in_reach(&self.problem, &mut settled);
        let taken = |k: &usize| model.parameters()[*k].se == Some(f64::INFINITY);
        let taken: Vec<usize> = (refine::free_parameters(model).into_iter())
            .filter(taken)
            .collect();
        for &k in &taken {
            settled.parameters_mut()[k].known = true;
        }
        let mut noise = self.quieter(&settled);
        let most = MOST_MISFIT * noise.law.floor();
        let mut way = Way::default();
        let whites = self.whites(&settled, recordings, self.load_noise(&noise, &settled))?;
        for round in 0..MOST_ROUNDS {
            let load = self.load_noise(&noise, &settled);
            let twins = self.twins(&settled, recordings, (load, &whites))?;
            let residual = less(&system::residual(&self.problem, &settled), &twins.offset);
            let unknowns = refine::free_parameters(&settled).len();
            noise = Noise::estimate(&self.problem, &residual, unknowns, &twins.blocks);
            if noise.law.floor() > most {
                return None;
            }
            let left;
            (settled, left) = self.settle_once(&settled, &twins, &noise, &mut way)?;
            if round > 0 && left < ENOUGH {
                break;
            }
        }
        let pairs = settled.parameters_mut().into_iter();
        for (k, (settled, refined)) in pairs.zip(model.parameters()).enumerate() {
            (settled.min, settled.max) = (refined.min, refined.max);
            if taken.contains(&k) {
                *settled = refined.clone();
            } else if let (Some(after), Some(before)) = (settled.value, refined.value) {
                uncertainty::add(settled, UNSURE * (after - before));
            }
        }
        Some(settled)
    }

    /// The noise of the rows as generic functions leave it or as the model does. What either does not follow counts as noise
    /// to it, so the smaller one is nearer.
    fn quieter(&self, model: &Model) -> Noise {
        let residual = system::residual(&self.problem, model);
        let unknowns = refine::free_parameters(model).len();
        let own = Noise::estimate(&self.problem, &residual, unknowns, &self.blocks);
        if own.law.floor() < self.noise.law.floor() {
            own
        } else {
            self.noise.clone()
        }
    }

    /// One repetition, with the longest of its steps in standard errors. `None`, too, where it leaves nothing of what an inner
    /// parameter shapes, such as friction that falls with speed on an axis where it hardly does.
    fn settle_once(
        &self,
        model: &Model,
        twins: &Twins,
        noise: &Noise,
        way: &mut Way,
    ) -> Option<(Model, f64)> {
        let (offset, blocks) = (&twins.offset, &twins.blocks);
        let free = refine::free_parameters(model);
        let answers = self.answers(twins, model, noise)?;
        let mut next = model.clone();
        let normal = refine::refine_beside(offset, &self.problem, &mut next, noise, blocks);
        let values = |model: &Model| {
            let value = |&k: &usize| model.parameters()[k].value.unwrap_or_default();
            DVector::from_iterator(free.len(), free.iter().map(value))
        };
        let off = values(&next) - answers.step - values(model);
        let (_, sandwich, scale) = normal.covariances()?;
        let own = DMatrix::from_fn(free.len(), free.len(), |i, j| {
            sandwich[(i, j)] / (scale[i] * scale[j])
        });
        let unit = answers.covariance.diagonal().map(f64::sqrt);
        let back = way.back(off.clone(), answers.follows, &unit, CHANCE)?;
        let (step, stepped) = [&back * &off, off].into_iter().find_map(|step| {
            let moves: Vec<_> = free.iter().copied().zip(step.iter().copied()).collect();
            Some((step, refine::moved(model, &moves, 1.0)?))
        })?;
        let through = |c: DMatrix<f64>| (&back * c * back.transpose()).diagonal();
        let (own, twins) = (through(own), through(answers.covariance));
        // The twins' own noise comes on top of the recordings', as part of what estimates are held against.
        let drawn = 1.0 + 1.0 / DRAWS as f64;
        let mut longest = 0.0_f64;
        for (at, (&k, value)) in free.iter().zip(&values(&stepped)).enumerate() {
            let alike = own[at] <= MOST_MISFIT * twins[at];
            let variance = if alike {
                0.5 * (own[at] + twins[at])
            } else {
                own[at]
            };
            let se = (drawn * variance).sqrt();
            if !se.is_finite() || (!model.is_linear(k) && stepped.at_bound(k)) {
                return None;
            }
            longest = longest.max((step[at] / se).abs());
            let parameter = &mut *next.parameters_mut().swap_remove(k);
            // What this step has put right the next one might take back.
            (parameter.value, parameter.se) = (Some(*value), Some(se.hypot(step[at])));
        }
        way.stepped = Some(step);
        Some((next, longest))
    }

    /// What the rows of twins, less their offset, make of errors in them, on the average.
    fn answers(&self, twins: &Twins, model: &Model, noise: &Noise) -> Option<Answer> {
        let free = refine::free_parameters(model).len();
        let answer = |(problem, residual): (&Problem, &Vec<f64>)| {
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
            refine::answer(&errors, problem, model, &noise, &blocks)
        };
        let pairs = twins.problems.par_iter().zip(&twins.residuals);
        let answers = pairs.map(answer).collect::<Option<Vec<_>>>()?;
        let mean = answers.into_iter().reduce(|a, b| Answer {
            step: a.step + b.step,
            covariance: a.covariance + b.covariance,
            follows: a.follows + b.follows,
        })?;
        let share = 1.0 / DRAWS as f64;
        Some(Answer {
            step: mean.step * share,
            covariance: mean.covariance * share,
            follows: mean.follows * share,
        })
    }

    /// RMS of the torque or force, constant within each sample, that makes up the noise of the rows beside the encoder's.
    pub(super) fn load_noise(&self, noise: &Noise, model: &Model) -> f64 {
        let scale = system::torque_scale(&self.problem, model);
        let inertia = model.parameters()[model.moving_inertia()].value;
        let all = noise.law.floor() * scale * scale;
        let tracks = self.problem.tracks.iter().zip(&self.problem.windows);
        let loads = tracks.map(|(track, windows)| {
            let encoder = inertia.unwrap_or_default().powi(2) * windows.acceleration_noise(track);
            let rest = all - encoder;
            let passed: f64 = windows.hold_weights().iter().map(|w| w * w).sum();
            (rest.max(0.0) / passed).sqrt()
        });
        loads.fold(f64::INFINITY, f64::min)
    }

    /// Twins of the recordings under a load of some RMS, whose sensors add noise of others; `None` where the model describes no axis
    /// that could give them.
    fn twins(
        &self,
        model: &Model,
        recordings: &[Recording],
        (load, whites): (f64, &[f64]),
    ) -> Option<Twins> {
        // The last one is the ideal one, without noise.
        let make = |draw: usize| {
            let draw = (draw < DRAWS).then(|| Draw {
                at: (draw as f64 + 0.5) / DRAWS as f64,
                white: 0.0,
                load: if draw.is_multiple_of(2) { load } else { -load },
                off_levels: false,
                seed: draw as u64,
                load_seed: draw as u64 / 2,
            });
            let problem = self.twin(model, recordings, draw, whites)?;
            let residual = system::residual(&problem, model);
            Some((problem, residual))
        };
        let made = (0..=DRAWS).into_par_iter().map(make);
        let mut made = made.collect::<Option<Vec<_>>>()?;
        let (ideal, _) = made.pop()?;
        let (problems, residuals): (Vec<_>, Vec<_>) = made.into_iter().unzip();
        let rows = &self.problem.rows;
        let (mut sums, mut counts) = (vec![0.0; rows.len()], vec![0.0_f64; rows.len()]);
        for (problem, residual) in problems.iter().zip(&residuals) {
            for (here, there) in common(rows, &problem.rows) {
                sums[here] += residual[there];
                counts[here] += 1.0;
            }
        }
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
            problems,
            residuals,
            sensitivities,
            blocks,
        })
    }

    /// The weak form of one twin of each recording, smoothed and cut into windows as the recordings were; without a draw,
    /// of one without noise as ideal sensors see it.
    fn twin(
        &self,
        model: &Model,
        recordings: &[Recording],
        draw: Option<Draw>,
        whites: &[f64],
    ) -> Option<Problem> {
        let (_, tracks) = self.seen(model, recordings, draw, whites)?;
        Some(self.rows_of(tracks))
    }

    /// The weak form of such tracks.
    pub(super) fn rows_of(&self, tracks: Vec<Track>) -> Problem {
        let before = &self.problem;
        let reaches: Vec<usize> = before.windows.iter().map(|w| w.reach).collect();
        Problem::new(tracks, &reaches, before.motion, before.response)
    }

    /// What one twin of each recording shows, and their tracks, smoothed as those of the recordings were; without a draw, what
    /// ideal sensors show of twins without noise.
    pub(super) fn seen(
        &self,
        model: &Model,
        recordings: &[Recording],
        draw: Option<Draw>,
        whites: &[f64],
    ) -> Option<(Vec<Recording>, Vec<Track>)> {
        let motion = self.problem.motion;
        let twin = |(index, ((recording, track), &white)): (u64, ((&Recording, &Track), &f64))| {
            let own = draw.map(|draw| Draw {
                white,
                seed: draw.seed ^ index << 32,
                load_seed: draw.load_seed ^ index << 32,
                ..draw
            });
            let seen = Twin::new(model, recording, track, own)?.recording(recording);
            let made = match draw {
                None => Track::new(&seen, motion, None),
                Some(_) => Track::smoothed(&seen, motion, self.balance, Some(track.smoothing)),
            };
            Some((seen, made.piece_of(track.whole, track.boundary)))
        };
        let pairs = (0..).zip(
            recordings
                .iter()
                .zip(self.problem.tracks.iter())
                .zip(whites),
        );
        pairs.map(twin).collect()
    }

    /// RMS of the noise that the sensor of each recording adds.
    pub(super) fn whites(
        &self,
        model: &Model,
        recordings: &[Recording],
        load: f64,
    ) -> Option<Vec<f64>> {
        let pairs = recordings.par_iter().zip(self.problem.tracks.par_iter());
        let whites = pairs.map(|(recording, track)| twin::white(model, recording, track, load));
        whites.collect()
    }
}

fn less(rows: &[f64], offset: &[f64]) -> Vec<f64> {
    rows.iter().zip(offset).map(|(r, o)| r - o).collect()
}

/// Positions of the windows that two sets of rows have in common.
pub(super) fn common<'a>(
    here: &'a [Row],
    there: &'a [Row],
) -> impl Iterator<Item = (usize, usize)> + 'a {
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
