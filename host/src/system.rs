//! A model as a system of weak-form equations: the linear problem and the residual.
//!
//! One equation, `J·F2[q] = k·Fu[u] − Σ c·B`, solved for one of two responses ([`Response`]):
//! - acceleration, `F2[q] = (k·Fu[u] − Σ c·B)/J`: encoder noise stays out of the regressors, and a disturbance torque is
//!   independent of an imposed `u`;
//! - force, `k·Fu[u] = J·F2[q] + Σ c·B`: a disturbance torque is independent of an imposed motion. Here encoder noise in
//!   the regressor `F2[q]` would bias `J`; its known energy is subtracted from the normal equations.

use std::sync::Arc;

use nalgebra::DVector;

use crate::effects::{Effect, Inner, Path, Seat};
use crate::error::{Error, Result};
use crate::linear::{FOLDS, Products, Score};
use crate::model::{Causality, Model, Parameter, Term};
use crate::noise::Noise;
use crate::problem::{Column, Direction, Problem, Response};
use crate::slack::Forces;
use crate::weak::{Part, Track};

/// What a coefficient of the linear problem stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unknown {
    InverseInertia,
    Inertia,
    Gain,
    Coulomb,
    Viscous,
    Coefficient {
        term: usize,
        index: usize,
    },
    /// Of an error in the measured position, which needs no scale.
    Error {
        term: usize,
        index: usize,
    },
}

/// The linear weak-form problem of a model whose inner parameters are given.
#[derive(Clone)]
pub struct System {
    /// Response of every row.
    pub response: Vec<f64>,
    /// One column for each unknown.
    pub columns: Vec<Vec<f64>>,
    unknowns: Vec<Unknown>,
    /// What a resisting torque, and the acceleration of an error in position, are multiplied by to become a column.
    factors: [f64; 2],
    /// A column that carries encoder noise, and the energy of that noise over the training rows.
    errors: Option<(usize, f64)>,
    /// See [`emphasis`].
    emphasis: f64,
}

/// Blocks of the training rows, which are dealt out in turn to the folds of a cross-validation, last this many seconds.
const BLOCK: f64 = 1.2;

/// The block of every training row, numbered through all recordings, see [`Products::score`]; `None` for held-out rows.
pub fn blocks(problem: &Problem) -> Vec<Option<usize>> {
    let mut first = 0;
    let starts: Vec<(usize, f64)> = problem
        .tracks
        .iter()
        .map(|track| {
            let length = block_length(training(track));
            let start = (first, length);
            // The training part may go on beyond a piece of a recording.
            let samples = track.boundary.min(track.cells.len());
            first += (samples as f64 * track.period / length) as usize + 1;
            start
        })
        .collect();
    let number = |row: &crate::problem::Row| {
        let (first, length) = starts[row.track];
        let time = row.centre as f64 * problem.tracks[row.track].period;
        (row.part == Part::Train).then(|| first + (time / length) as usize)
    };
    problem.rows.iter().map(number).collect()
}

/// Whether a recording is so short that its blocks are shorter than usual.
pub fn shortened(problem: &Problem) -> bool {
    let mut tracks = problem.tracks.iter();
    tracks.any(|track| block_length(training(track)) < BLOCK)
}

/// Length of the training part of a recording, s.
fn training(track: &Track) -> f64 {
    track.boundary as f64 * track.period
}

/// Length of the blocks of a recording, s. Short recordings are cut into smaller ones, so that every fold has its share of
/// each.
pub fn block_length(training: f64) -> f64 {
    BLOCK.min(training / (2 * FOLDS) as f64)
}

/// The way of the input in a model whose parameters have values.
pub fn path(model: &Model) -> Path {
    let mut path = Path {
        lag: model.winding_lag(),
        ..Path::default()
    };
    for term in &model.terms {
        term.effect.transmit(&values(term), &mut path);
    }
    path
}

/// Values of a term's parameters; unknown ones count as zero.
pub fn values(term: &Term) -> Vec<f64> {
    term.parameters
        .iter()
        .map(|p| p.value.unwrap_or(0.0))
        .collect()
}

fn add(sum: &mut [f64], factor: f64, column: &[f64]) {
    sum.iter_mut()
        .zip(column)
        .for_each(|(s, c)| *s += factor * c);
}

fn scaled(column: &[f64], factor: f64) -> Vec<f64> {
    column.iter().map(|c| factor * c).collect()
}

impl System {
    /// Sets up the problem. Inner parameters must have values.
    pub fn new(problem: &Problem, model: &Model) -> Result<Self> {
        check_scale(model)?;
        let known_value = |p: &Parameter| if p.known { p.value } else { None };
        let (direction, path) = (problem.direction(model), path(model));
        let mut sides = Sides {
            inertia: known_value(model.parameters()[model.moving_inertia()]),
            gain: known_value(&model.gain),
            input: effective_input(problem, model, &path),
            acceleration: problem.acceleration.to_vec(),
            known: vec![0.0; problem.rows.len()],
            unknown: Vec::new(),
        };
        for (parameter, unknown, column) in [
            (
                &model.coulomb,
                Unknown::Coulomb,
                problem.coulomb(&direction, &path),
            ),
            (&model.viscous, Unknown::Viscous, problem.velocity(&path)),
        ] {
            match known_value(parameter) {
                Some(value) => add(&mut sides.known, value, &column),
                None => sides.unknown.push((unknown, column)),
            }
        }
        for (term, of) in model.terms.iter().enumerate() {
            let (_, coefficients) = of.effect.linear(&values(of), model.scale());
            let fixed = of.parameters.iter().all(|p| p.known);
            let sensor = of.effect.seat() == Seat::Sensor;
            for (index, column) in columns(problem, model, of).into_iter().enumerate() {
                match (fixed, sensor) {
                    (true, false) => add(&mut sides.known, coefficients[index], &column),
                    (true, true) => add(&mut sides.acceleration, -coefficients[index], &column),
                    _ => sides.unknown.push((unknown(sensor, term, index), column)),
                }
            }
        }
        let system = match problem.response {
            Response::Acceleration => sides.by_acceleration(),
            Response::Force => sides.by_force(),
        };
        Ok(Self {
            emphasis: emphasis(problem, model),
            ..system
        })
    }

    /// Adds the unknown terms to the columns of inertia and gain. `factors` say what a resisting torque and a feigned
    /// acceleration are multiplied by to become a column.
    fn complete(
        response: Vec<f64>,
        mut columns: Vec<Vec<f64>>,
        mut unknowns: Vec<Unknown>,
        terms: Vec<(Unknown, Column)>,
        factors: [f64; 2],
    ) -> Self {
        for (unknown, column) in terms {
            let sensor = matches!(unknown, Unknown::Error { .. });
            columns.push(scaled(&column, factors[usize::from(sensor)]));
            unknowns.push(unknown);
        }
        Self {
            response,
            columns,
            unknowns,
            factors,
            errors: None,
            emphasis: 1.0,
        }
    }

    /// The same system with response and columns whitened.
    #[must_use]
    pub fn whitened(&self, noise: &Noise) -> Self {
        let response = noise.whiten(&self.response);
        self.made_of(response, noise.whiten_all(self.columns_and([])), noise)
    }

    /// The same over the training rows alone. What these have in common with another system is taken from that, `raw` and
    /// `whitened`.
    #[must_use]
    pub fn whitened_as(
        &self,
        [raw, whitened]: [&Self; 2],
        noise: &Noise,
        blocks: &[Option<usize>],
    ) -> Self {
        let [own, raw, whitened] =
            [self, raw, whitened].map(|s| s.columns_and([s.response.as_slice()]));
        let same = |a: &[f64], b: &[f64]| {
            let mut rows = a.iter().zip(b).zip(blocks);
            rows.all(|((a, b), block)| block.is_none() || a == b)
        };
        let taken = |k: usize| {
            let other = raw.get(k).filter(|raw| same(own[k], raw));
            other.map(|_| whitened[k].to_vec())
        };
        let taken: Vec<Option<Vec<f64>>> = (0..own.len()).map(taken).collect();
        let open = own.iter().zip(&taken).filter(|(_, taken)| taken.is_none());
        let mut open = noise.whiten_training(open.map(|(c, _)| *c)).into_iter();
        let all = taken.into_iter().map(|taken| taken.or_else(|| open.next()));
        let mut columns: Vec<Vec<f64>> = all.flatten().collect();
        let response = columns.pop().unwrap_or_default();
        self.made_of(response, columns, noise)
    }

    /// The system with its response and columns whitened to these.
    fn made_of(&self, response: Vec<f64>, columns: Vec<Vec<f64>>, noise: &Noise) -> Self {
        Self {
            response,
            columns,
            errors: self
                .unknowns
                .iter()
                .position(|u| *u == Unknown::Inertia)
                .map(|k| (k, noise.encoder_energy)),
            unknowns: self.unknowns.clone(),
            factors: self.factors,
            emphasis: self.emphasis,
        }
    }

    /// The system, which is whitened, with the [`columns`] of the last term of a model, which it does not have yet; these
    /// over the training rows alone.
    #[must_use]
    pub fn extended(&self, model: &Model, columns: &[Column], noise: &Noise) -> Self {
        let mut system = self.clone();
        let term = model.terms.len() - 1;
        let sensor = model.terms[term].effect.seat() == Seat::Sensor;
        let factor = self.factors[usize::from(sensor)];
        let columns: Vec<Vec<f64>> = columns.iter().map(|c| scaled(c, factor)).collect();
        for (index, column) in noise
            .whiten_training(columns.iter().map(Vec::as_slice))
            .into_iter()
            .enumerate()
        {
            system.columns.push(column);
            system.unknowns.push(unknown(sensor, term, index));
        }
        system
    }

    /// The columns of the system, and others after them.
    pub fn columns_and<'a>(
        &'a self,
        others: impl IntoIterator<Item = &'a [f64]>,
    ) -> Vec<&'a [f64]> {
        let own = self.columns.iter().map(Vec::as_slice);
        own.chain(others).collect()
    }

    /// What residuals count for: see [`emphasis`].
    pub fn emphasis(&self) -> f64 {
        self.emphasis
    }

    /// A column that carries encoder noise, and the energy of that noise.
    pub fn errors(&self) -> Option<(usize, f64)> {
        self.errors
    }

    /// Fits the system over the rows that have a block, with the [`emphasis`] of its model.
    pub fn score(&self, blocks: &[Option<usize>]) -> Option<Score> {
        self.score_of(self.products(blocks)?, 0.0)
    }

    /// What a fit of the system over the rows that have a block needs of them.
    pub fn products(&self, blocks: &[Option<usize>]) -> Option<Products> {
        Products::new(&self.response, &self.columns_and([]), blocks)
    }

    /// A fit with the [`emphasis`] of the model, by the products of its columns, perhaps with others after them, and with
    /// a ridge: see [`Products::score`].
    pub fn score_of(&self, products: Products, ridge: f64) -> Option<Score> {
        let score = products.score(ridge, self.errors);
        score.map(|score| score.times(self.emphasis * self.emphasis))
    }

    /// Coefficient of a column of the input of which the axis follows nothing, by the values of a decoded model.
    pub fn per_input(&self, model: &Model) -> f64 {
        let gain = model.gain.value.unwrap_or(1.0);
        let moved = model.parameters()[model.moving_inertia()].value;
        // With force as the response, a torque that resists.
        if self.factors[1] < 0.0 {
            gain
        } else {
            -gain / moved.unwrap_or(1.0)
        }
    }

    /// Writes the physical parameters that a linear solution stands for into the model; known ones stay.
    ///
    /// Returns whether physics allows the coefficients of every effect.
    pub fn decode(&self, beta: &DVector<f64>, model: &mut Model) -> bool {
        let mut scale = 1.0;
        let mut coefficients: Vec<Vec<f64>> = model
            .terms
            .iter()
            .map(|t| vec![0.0; t.effect.width()])
            .collect();
        let (mut coulomb, mut viscous) = (model.coulomb.value, model.viscous.value);
        let moving = model.moving_inertia();
        let mut moved = model.parameters()[moving].value;
        for (unknown, &value) in self.unknowns.iter().zip(beta.iter()) {
            match *unknown {
                Unknown::InverseInertia => {
                    scale = 1.0 / value;
                    moved = Some(scale);
                }
                Unknown::Inertia => moved = Some(value),
                Unknown::Gain => model.gain.value = Some(value),
                Unknown::Coulomb => coulomb = Some(value * scale),
                Unknown::Viscous => viscous = Some(value * scale),
                Unknown::Coefficient { term, index } => coefficients[term][index] = value * scale,
                Unknown::Error { term, index } => {
                    // With force as the response it is the error times the inertia that it shakes.
                    let shaken = if self.factors[1] < 0.0 {
                        moved.unwrap_or(1.0)
                    } else {
                        1.0
                    };
                    coefficients[term][index] = value / shaken;
                }
            }
        }
        (model.coulomb.value, model.viscous.value) = (coulomb, viscous);
        model.parameters_mut()[moving].value = moved;
        let measure = model.scale();
        let mut admissible = scale > 0.0;
        let level_holds = level_holds(model);
        for (term, coefficients) in model.terms.iter_mut().zip(&coefficients) {
            if term.parameters.iter().all(|p| p.known) {
                continue;
            }
            admissible &= allowed(term, coefficients, moved, level_holds);
            let (inner, _) = term.effect.linear(&values(term), measure);
            let named = term.effect.named(inner, coefficients, measure);
            let scanned = term.effect.inner();
            for (k, (parameter, value)) in term.parameters.iter_mut().zip(named).enumerate() {
                if !parameter.known && Some(k) != scanned {
                    parameter.value = Some(value);
                    let (least, most) = term.effect.parameters()[k].bounds;
                    admissible &= (least..=most).contains(&value);
                }
            }
        }
        admissible
    }
}

/// The two sides of the equation of motion, before one of them becomes the response.
struct Sides {
    /// Known inertia and gain.
    inertia: Option<f64>,
    gain: Option<f64>,
    input: Column,
    /// That of the measured position less its known errors.
    acceleration: Vec<f64>,
    /// Known torque that resists.
    known: Vec<f64>,
    unknown: Vec<(Unknown, Column)>,
}

impl Sides {
    fn by_acceleration(self) -> System {
        let scale = 1.0 / self.inertia.unwrap_or(1.0);
        let mut response = self.acceleration;
        let mut columns = Vec::new();
        let mut unknowns = Vec::new();
        match (self.inertia, self.gain) {
            (None, gain) => {
                let mut drive = scaled(&self.input, gain.unwrap_or(1.0));
                add(&mut drive, -1.0, &self.known);
                columns.push(drive);
                unknowns.push(Unknown::InverseInertia);
            }
            (Some(_), Some(gain)) => {
                add(&mut response, -gain * scale, &self.input);
                add(&mut response, scale, &self.known);
            }
            (Some(_), None) => {
                add(&mut response, scale, &self.known);
                columns.push(scaled(&self.input, scale));
                unknowns.push(Unknown::Gain);
            }
        }
        System::complete(response, columns, unknowns, self.unknown, [-scale, 1.0])
    }

    fn by_force(self) -> System {
        let mut response = scaled(&self.input, self.gain.unwrap_or(1.0));
        add(&mut response, -1.0, &self.known);
        let mut columns = Vec::new();
        let mut unknowns = Vec::new();
        match self.inertia {
            Some(inertia) => add(&mut response, -inertia, &self.acceleration),
            None => {
                columns.push(self.acceleration);
                unknowns.push(Unknown::Inertia);
            }
        }
        System::complete(response, columns, unknowns, self.unknown, [1.0, -1.0])
    }
}

/// The columns of a term of a model: resisting torques, or accelerations that an error in the measured position feigns.
///
/// An error `e` in the position enters as `J·F2[e] + Fv·F1[e]`, here over `J`. Viscous friction is the one that the model
/// has so far; the joint refinement takes the one that it arrives at.
pub fn columns(problem: &Problem, model: &Model, term: &Term) -> Vec<Column> {
    let effect = term.effect;
    let (inner, coefficients) = effect.linear(&values(term), model.scale());
    if effect.seat() != Seat::Sensor {
        let direction = problem.direction(model);
        return torques(problem, effect, inner, &direction, &path(model));
    }
    let inertia = model.parameters()[model.moving_inertia()].value;
    let damping = match (model.viscous.value, inertia) {
        (Some(viscous), Some(inertia)) if inertia > 0.0 => viscous / inertia,
        _ => 0.0,
    };
    let feigned = |[acceleration, velocity]: &[Column; 2]| {
        let mut column = acceleration.to_vec();
        add(&mut column, damping, velocity);
        Column::new(column)
    };
    let errors = problem.errors(effect, &coefficients);
    errors.iter().map(feigned).collect()
}

/// The columns of an effect that sits in no sensor.
fn torques(
    problem: &Problem,
    effect: &'static dyn Effect,
    inner: Inner,
    direction: &Direction,
    path: &Path,
) -> Vec<Column> {
    let basis = || problem.effect(effect, inner, direction, path);
    match effect.seat() {
        Seat::Load => problem.load(effect, inner),
        Seat::Momentum => {
            let both = basis().into_iter().zip(problem.errors(effect, &[]));
            let sum = |(basis, [momentum, _]): (Column, [Column; 2])| {
                let mut sum = basis.to_vec();
                add(&mut sum, 1.0, &momentum);
                Column::new(sum)
            };
            both.map(sum).collect()
        }
        _ => basis(),
    }
}

fn unknown(sensor: bool, term: usize, index: usize) -> Unknown {
    if sensor {
        Unknown::Error { term, index }
    } else {
        Unknown::Coefficient { term, index }
    }
}

/// The linear problem needs a scale: either inertia or gain must be known.
fn check_scale(model: &Model) -> Result<()> {
    let inertia = model.parameters()[model.moving_inertia()];
    if !model.gain.known && !inertia.known {
        return Err(Error::NotIdentifiable(
            "plant.gain and plant.inertia are both unknown: they scale together with every friction parameter, so no recording can tell them apart; give one of them (gain = 1.0 gives everything in units of u)".to_owned(),
        ));
    }
    if model.causality == Causality::Inverse && !model.gain.known {
        return Err(Error::NotIdentifiable(
            "plant.gain is unknown in an inverse recording: the measured force sets the scale of all parameters; give the gain (1.0 if u is a force)".to_owned(),
        ));
    }
    Ok(())
}

/// The input less what velocity takes off it: `lag[u] − ke·(v − τ·v̇)` behind a winding of the time constant `τ`, whose lag
/// the back-EMF passes, too, here to the first order; behind a gap, what reaches the load.
fn effective_input(problem: &Problem, model: &Model, path: &Path) -> Column {
    let input = problem.input(path);
    let (back_emf, missing) = (model.back_emf(), kept_back(problem, model, path));
    if back_emf == 0.0 && missing.is_none() {
        return input;
    }
    let mut effective = input.to_vec();
    if let Some(missing) = missing {
        add(&mut effective, -1.0, &missing);
    }
    if back_emf != 0.0 {
        add(&mut effective, -back_emf, &problem.velocity(path));
        let winding = model.winding_lag();
        if winding > 0.0 {
            add(&mut effective, back_emf * winding, &problem.acceleration);
        }
    }
    Arc::new(effective)
}

/// Input that the gap on a path keeps from the load; `None` without a gap, and where a start does not say yet how the axis
/// moves.
fn kept_back(problem: &Problem, model: &Model, path: &Path) -> Option<Vec<f64>> {
    let value = |p: &Parameter| p.value.unwrap_or_default();
    let forces = Forces {
        gain: value(&model.gain),
        back_emf: model.back_emf(),
        inertia: value(model.parameters()[model.moving_inertia()]),
        coulomb: value(&model.coulomb),
        viscous: value(&model.viscous),
    };
    let moves = path.gap.width > 0.0 && forces.gain != 0.0 && forces.inertia > 0.0;
    moves.then(|| scaled(&problem.slack(path, &forces), 1.0 / forces.gain))
}

/// RMS of what a gap keeps from the load over that of the input; `None` without a gap.
pub fn lost(problem: &Problem, model: &Model) -> Option<f64> {
    let path = path(model);
    let energy = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let missing = kept_back(problem, model, &path)?;
    let input = energy(&problem.input(&path)).max(f64::MIN_POSITIVE);
    Some((energy(&missing) / input).sqrt())
}

/// Share of the training time in motion in which a limit leaves the input as it is; `None` without a limit.
pub fn uncut(problem: &Problem, model: &Model) -> Option<f64> {
    let limit = path(model).limit;
    limit.is_finite().then(|| {
        let points = problem.points_of_training(&problem.direction(model), &Path::default());
        let below = points.iter().filter(|p| p.moment.u.abs() <= limit).count();
        below as f64 / points.len().max(1) as f64
    })
}

/// What the residuals of a model are multiplied by where they are compared with those of others: by how much less of the input
/// gets through to the axis than was recorded, over the training rows.
///
/// Where the input is part of the response, an effect that lets less of it through makes residuals smaller whether it is
/// there or not: with nothing let through, nothing remains to be explained. So residuals count in units of what gets through,
/// as those of a transformed response do (Box and Cox, Journal of the Royal Statistical Society B 26, 1964, sec. 3): by the RMS
/// of the input where its way changes it, and by the geometric mean of the share that a ripple of the gain leaves, which over a
/// short travel may take the whole gain. Friction in proportion to the input has a bound instead.
pub fn emphasis(problem: &Problem, model: &Model) -> f64 {
    let path = path(model);
    let inertia = model.parameters()[model.moving_inertia()];
    let given = inertia.known || inertia.se == Some(f64::INFINITY);
    if problem.response != Response::Force && !given {
        return 1.0;
    }
    let share = share_left(problem, model, &path);
    if path.bits() == Path::default().bits() {
        return 1.0 / share;
    }
    let energy = |path: &Path| {
        let input = problem.input(path);
        let rows = problem.rows.iter().zip(input.iter());
        let seen = rows.filter(|(row, _)| row.part == Part::Train);
        seen.map(|(_, u)| u * u).sum::<f64>()
    };
    (energy(&Path::default()) / energy(&path).max(f64::MIN_POSITIVE)).sqrt() / share
}

/// The geometric mean of the share of the input that ripples of the gain leave; 1 if they add to it.
fn share_left(problem: &Problem, model: &Model, path: &Path) -> f64 {
    let ripples: Vec<&Term> = model.terms.iter().filter(|t| ripples(t)).collect();
    let Some(gain) = model.gain.value.filter(|_| !ripples.is_empty()) else {
        return 1.0;
    };
    let points = problem.points_of_training(&problem.direction(model), path);
    let mut left = vec![1.0; points.len()];
    for term in ripples {
        let (inner, coefficients) = term.effect.linear(&values(term), model.scale());
        let mut basis = vec![0.0; coefficients.len()];
        for (left, at) in left.iter_mut().zip(&points) {
            term.effect.basis(inner, *at, &mut basis);
            let torque: f64 = coefficients.iter().zip(&basis).map(|(c, b)| c * b).sum();
            *left -= torque / (gain * at.moment.u);
        }
    }
    let logs = left
        .iter()
        .map(|share| share.abs().max(f64::MIN_POSITIVE).ln());
    let mean = logs.sum::<f64>() / points.len().max(1) as f64;
    mean.exp().min(1.0)
}

/// Whether a term is a ripple of the gain over position.
pub fn ripples(term: &Term) -> bool {
    term.effect.driven() && term.effect.wave(Inner::default()).is_some()
}

/// The weak-form residual of a model whose parameters all have values, on the side of the problem's response.
pub fn residual(problem: &Problem, model: &Model) -> Vec<f64> {
    let value = |p: &Parameter| p.value.unwrap_or(0.0);
    let (direction, path) = (problem.direction(model), path(model));
    let mut acceleration = problem.acceleration.to_vec();
    let input = effective_input(problem, model, &path);
    let mut torque = scaled(&input, value(&model.gain));
    add(
        &mut torque,
        -value(&model.coulomb),
        &problem.coulomb(&direction, &path),
    );
    add(
        &mut torque,
        -value(&model.viscous),
        &problem.velocity(&path),
    );
    for term in &model.terms {
        let (inner, coefficients) = term.effect.linear(&values(term), model.scale());
        if term.effect.seat() == Seat::Sensor {
            let [feigned, velocity] = problem.error(term.effect, &coefficients);
            add(&mut acceleration, -1.0, &feigned);
            add(&mut torque, value(&model.viscous), &velocity);
        } else {
            let columns = torques(problem, term.effect, inner, &direction, &path);
            for (column, c) in columns.iter().zip(coefficients) {
                add(&mut torque, -c, column);
            }
        }
    }
    let inertia = value(model.parameters()[model.moving_inertia()]);
    match problem.response {
        Response::Acceleration => {
            add(&mut acceleration, -1.0 / inertia, &torque);
            acceleration
        }
        Response::Force => {
            add(&mut torque, -inertia, &acceleration);
            torque
        }
    }
}

/// Factor from the unit of [`residual`] to a torque or force that drives the axis beyond the model.
pub fn torque_scale(problem: &Problem, model: &Model) -> f64 {
    match problem.response {
        Response::Acceleration => {
            let inertia = model.parameters()[model.moving_inertia()];
            inertia.value.unwrap_or(1.0)
        }
        Response::Force => -1.0,
    }
}

/// Share of the inertia that may hang behind the measured side at most.
const HEAVIEST_LOAD: f64 = 0.95;

/// Whether physics allows the coefficients of a term on an axis of some inertia, whose friction [`level_holds`] or not.
fn allowed(term: &Term, coefficients: &[f64], inertia: Option<f64>, level_holds: bool) -> bool {
    let heaviest = HEAVIEST_LOAD * inertia.unwrap_or(f64::INFINITY);
    let carried = !term.effect.hangs() || coefficients.iter().all(|c| *c < heaviest);
    carried && (!term.effect.shapes_level() || level_holds) && term.effect.admissible(coefficients)
}

/// Whether the Coulomb level of a model opposes motion, as far as it is estimated.
fn level_holds(model: &Model) -> bool {
    let level = &model.coulomb;
    level.known || level.value.is_none_or(|level| level >= 0.0)
}

/// Whether a term was estimated and came to nothing.
pub fn absent(model: &Model, term: usize) -> bool {
    let term = &model.terms[term];
    let (_, coefficients) = term.effect.linear(&values(term), model.scale());
    let estimated = term.parameters.iter().all(|p| p.value.is_some());
    estimated && term.effect.width() > 0 && coefficients.iter().all(|c| *c == 0.0)
}

/// The first estimated term whose coefficients physics does not allow.
pub fn inadmissible(model: &Model) -> Option<usize> {
    inadmissible_among(model, |_| true)
}

/// The same among those that are not part of the friction law.
pub fn inadmissible_beside_law(model: &Model) -> Option<usize> {
    inadmissible_among(model, |term| !term.in_law)
}

fn inadmissible_among(model: &Model, counts: impl Fn(&Term) -> bool) -> Option<usize> {
    let (scale, inertia) = (model.scale(), model.parameters()[model.moving_inertia()]);
    let level_holds = level_holds(model);
    let allowed = |t: &Term| {
        let (_, coefficients) = t.effect.linear(&values(t), scale);
        allowed(t, &coefficients, inertia.value, level_holds)
    };
    model
        .terms
        .iter()
        .position(|t| counts(t) && t.parameters.iter().any(|p| !p.known) && !allowed(t))
}

#[cfg(test)]
mod tests {
    use super::inadmissible;
    use crate::model::Model;

    /// A power law with a low exponent is a Coulomb level: one fits a recording as well as the difference of two larger ones.
    #[test]
    fn what_shapes_the_level_does_not_stand_against_it() {
        let text = "[plant]\nmotion = \"rotary\"\n[friction]\ncoulomb = \"?\"\n[effects.power-law-viscous]\n";
        let mut model = Model::parse(text).unwrap();
        for (parameter, value) in model.terms[0].parameters.iter_mut().zip([70.0, 0.2]) {
            parameter.value = Some(value);
        }
        for (level, term) in [(5.0, None), (-12.0, Some(0))] {
            model.coulomb.value = Some(level);
            assert_eq!(inadmissible(&model), term);
        }
        // One that the file gives is not estimated against it.
        model.coulomb.known = true;
        assert_eq!(inadmissible(&model), None);
    }
}
