//! Identification by the weak form (DBI): from recordings and a model with unknowns to values with errors.

use std::rc::Rc;

use crate::dictionary::Dictionary;
use crate::error::{Error, Result};
use crate::fit::{self, Fit};
use crate::format::{quantity, whole_percent};
use crate::linear;
use crate::model::{Causality, Model, Parameter, Term};
use crate::noise::Noise;
use crate::problem::{Problem, Response};
use crate::recording::Recording;
use crate::refine;
use crate::scan::{self, Ground};
use crate::system::{self, System};
use crate::weak::{Balance, Part, Track};

/// Half-widths of test functions that are tried, s. The narrowest passes motion up to 7 Hz (−3 dB), the band in which an
/// axis is a rigid body and its drive an ideal one; narrower windows bring in current loops and resonances.
const HALF_WIDTHS: [f64; 4] = [0.07, 0.1, 0.14, 0.2];
/// Samples under half a test function at least: below, the trapezoidal sums lose their accuracy.
const FEWEST_SAMPLES: usize = 8;
/// Encoder noise in `∫q φ̈` falls with the width to the power −5/2, everything else with −1/2 at most. Where it makes up
/// this share of the residual variance or less, widening gains little precision and loses resolution in time.
const MOST_ENCODER_SHARE: f64 = 1.0 / 3.0;
/// Rows that a fit needs at least.
const FEWEST_ROWS: usize = 40;

/// Time that the axis may rest at reversals without its positions showing it, as a share of all, from which on the drive
/// is asked: it then biases the Coulomb level by as much.
const LEAST_DOUBT: f64 = 0.002;

/// Everything that fits of one set of recordings share: rows, folds and noise.
pub struct Workbench {
    /// The weak form of the recordings.
    pub problem: Problem,
    /// Cross-validation fold of every training row.
    pub folds: Vec<Option<usize>>,
    /// Noise of the rows.
    pub noise: Noise,
    /// Generic functions of each coordinate.
    pub dictionary: Dictionary,
    /// What it takes to move the axis, where the drive was asked how long it rests.
    pub balance: Option<Balance>,
    /// How wide the windows are, and why.
    pub width: Width,
    /// Inertia found with all generic functions in: what a model falls back to that leaves so much out that its own
    /// inertia would be negative.
    robust_inertia: Option<f64>,
}

/// What the user decides instead of the tool.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Half-width of the test functions, s.
    pub half_width: Option<f64>,
}

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

/// A model with estimated values, and how well it predicts.
pub struct Identified {
    /// All parameters have values; estimated ones have standard errors.
    pub model: Model,
    /// χ² of the whitened training rows.
    pub chi2: f64,
    /// Prediction errors.
    pub fit: Fit,
}

/// Fits a model to recordings.
pub fn identify(
    recordings: &[Recording],
    model: &Model,
    options: Options,
) -> Result<(Workbench, Identified)> {
    let bench = Workbench::new(recordings, model, options)?;
    let identified = bench.fit(model, recordings)?;
    Ok((bench, identified))
}

impl Workbench {
    /// Chooses the width of the windows, lays them out and estimates the noise.
    pub fn new(recordings: &[Recording], model: &Model, options: Options) -> Result<Self> {
        Self::of(model, options, |balance| {
            Problem::tracks(recordings, model.motion, balance)
        })
    }

    /// The same for tracks that are made by whatever means.
    pub fn of(
        model: &Model,
        options: Options,
        make: impl Fn(Option<Balance>) -> Vec<Track>,
    ) -> Result<Self> {
        let bench = Self::on(&make(None), model, options)?;
        let doubt = bench
            .problem
            .tracks
            .iter()
            .map(|t| t.doubt)
            .fold(0.0, f64::max);
        match bench.balance(model)? {
            Some(balance) if doubt > LEAST_DOUBT => {
                let bench = Self::on(&make(Some(balance)), model, options)?;
                Ok(Self {
                    balance: Some(balance),
                    ..bench
                })
            }
            _ => Ok(bench),
        }
    }

    /// A rough estimate of what it takes to move the axis, functions of position included.
    fn balance(&self, model: &Model) -> Result<Option<Balance>> {
        let mut model = with_starts(&self.problem, model);
        let system = System::new(&self.problem, &model)?.whitened(&self.noise);
        let groups = self.dictionary.groups(&self.problem);
        let position: Vec<Vec<f64>> = groups
            .iter()
            .filter(|g| g.coordinate == "position")
            .flat_map(|g| &g.columns)
            .map(|c| self.noise.whiten(c))
            .collect();
        let columns = system.columns.iter().chain(&position);
        let columns: Vec<&[f64]> = columns.map(Vec::as_slice).collect();
        let score = linear::score(
            &system.response,
            &columns,
            &self.folds,
            GENERIC_RIDGE,
            system.errors(),
        );
        let Some(score) = score else { return Ok(None) };
        let own = score.beta.rows(0, system.columns.len()).into_owned();
        system.decode(&own, &mut model);
        let value = |p: &Parameter| p.value.unwrap_or_default();
        let gain = value(&model.gain);
        let balance = Balance {
            inertia: value(model.parameters()[model.moving_inertia()]) / gain,
            coulomb: value(&model.coulomb) / gain,
        };
        let usable = balance.inertia > 0.0 && balance.coulomb > 0.0;
        Ok(usable.then_some(balance))
    }

    fn on(tracks: &[Track], model: &Model, options: Options) -> Result<Self> {
        let dictionary = Dictionary::new(tracks);
        let (mut problem, width) = choose_width(tracks, &dictionary, model, options)?;
        let train = problem.count(Part::Train);
        if train < FEWEST_ROWS {
            return Err(Error::NotIdentifiable(format!(
                "only {train} windows of motion are left in the first 70 % of the recording after standstill and gaps are set aside; at least {FEWEST_ROWS} are needed: record for longer, or drive above break-away for more of the time"
            )));
        }
        let folds = system::folds(&problem);
        let start = with_starts(&problem, model);
        let (response, robust_inertia) =
            choose_response(&mut problem, &start, &dictionary, &folds)?;
        problem.response = response;
        let system = System::new(&problem, &start)?;
        let (residual, unknowns) = follow_everything(&problem, &system, &dictionary, &folds)?;
        let noise = Noise::estimate(&problem, &residual, unknowns, &folds);
        Ok(Self {
            balance: None,
            problem,
            folds,
            noise,
            dictionary,
            width,
            robust_inertia,
        })
    }

    /// The same tracks under windows of another half-width, in seconds.
    pub fn with_half_width(&self, model: &Model, half_width: f64) -> Result<Self> {
        let options = Options {
            half_width: Some(half_width),
        };
        Self::on(&self.problem.tracks, model, options)
    }

    /// Estimates all unknown parameters of a model: linear start, scan of inner parameters, joint refinement.
    pub fn estimate(&self, model: &Model) -> Result<(Model, f64)> {
        let mut model = self.scan(with_starts(&self.problem, model))?;
        self.solve(&mut model)?;
        if let Some(bent) = self.bend(&model) {
            model = bent;
        }
        let moving = model.parameters()[model.moving_inertia()];
        if moving.value.is_some_and(|j| j <= 0.0) && !moving.known {
            return self.with_inertia(self.fallback_inertia(&model)?, model);
        }
        if let Some(term) = system::inadmissible(&model) {
            return self.with_nothing_of(term, &model);
        }
        for k in 0..model.parameters().len() {
            if let Some(value) = model.parameters()[k]
                .value
                .filter(|_| !model.parameters()[k].known)
            {
                model.move_to(k, value);
            }
        }
        let chi2 = refine::refine(&self.problem, &mut model, &self.noise, &self.folds);
        Ok((model, chi2))
    }

    /// Gives the linear parameters of a model their values.
    fn solve(&self, model: &mut Model) -> Result<f64> {
        let system = System::new(&self.problem, model)?;
        let score = system
            .whitened(&self.noise)
            .score(&self.folds)
            .ok_or_else(|| undetermined(model))?;
        system.decode(&score.beta, model);
        Ok(score.chi2)
    }

    /// The last step of the hierarchy: the breakaway distance of bristles that fits best, together with the Stribeck
    /// velocity where that is unknown. `None` where there is nothing to find, or nothing that physics allows.
    fn bend(&self, model: &Model) -> Option<Model> {
        let bristles = model.bristle_term()?;
        let free = |term: usize| {
            let inner = model.terms[term].effect.inner()?;
            let parameter = &model.terms[term].parameters[inner];
            (!parameter.known && parameter.se.is_none()).then_some(inner)
        };
        let stiffness = free(bristles)?;
        let fall = model.terms.iter().position(Term::falls);
        let velocity = fall.and_then(|k| free(k).map(|inner| (k, inner)));
        // What the motion does to bristles depends on the ratios of stiffness and levels alone. Sliding levels found
        // without bristles can be anything where most of the motion is bending, so ratios come first.
        let mut scaled = model.clone();
        if !model.coulomb.known {
            scaled.coulomb.value = Some(1.0);
        }
        if let Some(level) = fall.map(|k| &mut scaled.terms[k].parameters[0])
            && !level.known
        {
            level.value = scaled.coulomb.value;
        }
        let survey = self.problem.survey(&scaled);
        let velocities = velocity.map_or(vec![None], |(k, inner)| {
            let grid = model.terms[k].effect.grid(&survey).into_iter();
            grid.map(|v| Some((k, inner, v))).collect()
        });
        let mut best: Option<(f64, Model)> = None;
        for start in model.terms[bristles].effect.grid(&survey) {
            for velocity in &velocities {
                let mut model = scaled.clone();
                model.terms[bristles].parameters[stiffness].value = Some(start);
                if let Some((k, inner, v)) = *velocity {
                    model.terms[k].parameters[inner].value = Some(v);
                }
                let level = survey.coulomb;
                let Some((chi2, mut model)) = self.solve_undamped(model, bristles) else {
                    continue;
                };
                let ratio = model.coulomb.value.unwrap_or_default() / level;
                if ratio > 0.0 && best.as_ref().is_none_or(|(least, _)| chi2 < *least) {
                    model.terms[bristles].parameters[stiffness].value = Some(start * ratio);
                    best = Some((chi2, model));
                }
            }
        }
        if let Some((_, model)) = best {
            return Some(model);
        }
        // Nothing shows them: next to stiff, with an error without bound.
        let mut stiff = model.clone();
        let stiffest = model.terms[bristles].effect.grid(&survey).last().copied()?;
        let level = model.coulomb.value.unwrap_or_default().max(0.0);
        for (k, parameter) in stiff.terms[bristles].parameters.iter_mut().enumerate() {
            if !parameter.known {
                let value = if k == stiffness {
                    stiffest * level / survey.coulomb
                } else {
                    0.0
                };
                (parameter.value, parameter.se) = (Some(value), Some(f64::INFINITY));
            }
        }
        Some(stiff)
    }

    /// The linear parameters of a model with given bristles, these without damping if it would be negative.
    fn solve_undamped(&self, mut model: Model, bristles: usize) -> Option<(f64, Model)> {
        let chi2 = self.solve(&mut model).ok()?;
        match system::inadmissible(&model) {
            None => Some((chi2, model)),
            Some(term) if term == bristles => {
                let damping = model.terms[bristles].parameters.last_mut()?;
                let free = std::mem::replace(damping, Parameter::known(0.0));
                let chi2 = self.solve(&mut model).ok()?;
                *model.terms[bristles].parameters.last_mut()? = Parameter {
                    value: Some(0.0),
                    ..free
                };
                system::inadmissible(&model)
                    .is_none()
                    .then_some((chi2, model))
            }
            Some(_) => None,
        }
    }

    /// The inertia to take where a model leaves so much out that its own estimate is negative.
    fn fallback_inertia(&self, model: &Model) -> Result<f64> {
        if model.causality == Causality::Inverse {
            // Nothing is integrated, so none at all will do.
            return Ok(0.0);
        }
        self.robust_inertia.ok_or_else(|| {
            Error::NotIdentifiable(
                "the motion does not follow u: the estimated inertia is negative; check the signs of u and q and which columns they are, and that the recording accelerates the axis".to_owned(),
            )
        })
    }

    /// Estimates the rest of a model around a given inertia.
    fn with_inertia(&self, inertia: f64, mut model: Model) -> Result<(Model, f64)> {
        let moving = model.moving_inertia();
        let bounds = std::mem::replace(
            &mut *model.parameters_mut().swap_remove(moving),
            Parameter::known(inertia),
        );
        let (mut model, chi2) = self.estimate(&model)?;
        // Taken rather than estimated here, so without a bound on its error.
        *model.parameters_mut().swap_remove(moving) = Parameter {
            value: Some(inertia),
            se: Some(f64::INFINITY),
            ..bounds
        };
        Ok((model, chi2))
    }

    /// Estimates the rest of a model without a term that would have to be unphysical to fit better, and puts the term
    /// back with coefficients of zero.
    fn with_nothing_of(&self, term: usize, model: &Model) -> Result<(Model, f64)> {
        let mut rest = model.clone();
        let mut absent = rest.terms.remove(term);
        let (mut rest, chi2) = self.estimate(&rest)?;
        let (effect, scale) = (absent.effect, rest.scale());
        let (inner, _) = effect.linear(&system::values(&absent), scale);
        let named = effect.named(inner, &vec![0.0; effect.width()], scale);
        for (parameter, value) in absent.parameters.iter_mut().zip(named) {
            if !parameter.known {
                (parameter.value, parameter.se) = (Some(value), Some(f64::INFINITY));
            }
        }
        rest.terms.insert(term, absent);
        Ok((rest, chi2))
    }

    /// Estimates and judges a model.
    pub fn fit(&self, model: &Model, recordings: &[Recording]) -> Result<Identified> {
        let (model, chi2) = self.estimate(model)?;
        let fit = fit::judge(&model, recordings, &self.problem.tracks)?;
        Ok(Identified { model, chi2, fit })
    }

    /// Gives unknown inner parameters the values that fit best, one term after the other.
    fn scan(&self, mut model: Model) -> Result<Model> {
        for at in 0..model.terms.len() {
            let Some(inner) = model.terms[at].effect.inner() else {
                continue;
            };
            let parameter = &model.terms[at].parameters[inner];
            if model.terms[at].bends() || parameter.known || parameter.se.is_some() {
                continue;
            }
            let mut rest = model.clone();
            let term = rest.terms.remove(at);
            let found = match self.ground(&rest)? {
                Some(ground) => ground.best(&term)?,
                None => None,
            };
            if let Some(found) = found {
                scan::set_inner(&mut model.terms[at], found.inner);
            }
        }
        Ok(model)
    }

    /// A model as the ground for one more term; `None` if the recordings do not determine it.
    pub fn ground<'a>(&'a self, model: &'a Model) -> Result<Option<Ground<'a>>> {
        Ground::new(
            &self.problem,
            &self.noise,
            &self.folds,
            model,
            self.robust_inertia,
        )
    }
}

/// The model with a middle-of-the-grid value for each inner parameter that has none; bristles wait for the level that
/// they yield at.
fn with_starts(problem: &Problem, model: &Model) -> Model {
    let mut model = model.clone();
    let survey = problem.survey(&model);
    for term in &mut model.terms {
        if let Some((shape, start)) = term.effect.shape() {
            let parameter = &mut term.parameters[shape];
            parameter.value = Some(parameter.value.unwrap_or_else(|| parameter.clamp(start)));
        }
        if let Some(inner) = term.effect.inner() {
            let stiff = term.bends();
            let parameter = &mut term.parameters[inner];
            if parameter.value.is_none() && !stiff {
                let grid = term.effect.grid(&survey);
                parameter.value = Some(parameter.clamp(grid[grid.len() / 2]));
            }
        }
    }
    model
}

/// The side of the equation whose error to minimise.
///
/// A disturbance torque must be independent of the regressors. It is independent of `u` where `u` is imposed, and of
/// the motion where the motion is. The wrong side attenuates: too large an inertia with acceleration as the response
/// (of a motion that a stiff loop imposes), too small a one with force. Where both sides agree, acceleration it is,
/// which keeps encoder noise out of the regressors; where they differ by more than [`DISAGREEMENT`], little of the
/// torque goes into acceleration, so the motion is next to imposed. A baseline that leaves much out disturbs alike,
/// hence the second comparison, with the tolerance of a rough model.
///
/// Also gives the inertia that the force side finds, with all generic functions in if that is positive.
fn choose_response(
    problem: &mut Problem,
    model: &Model,
    dictionary: &Dictionary,
    folds: &[Option<usize>],
) -> Result<(Response, Option<f64>)> {
    const DISAGREEMENT: f64 = 1.1;
    const ROUGH_DISAGREEMENT: f64 = 2.0;
    if model.causality == Causality::Inverse {
        return Ok((Response::Force, None));
    }
    if model.parameters()[model.moving_inertia()].known {
        return Ok((Response::Acceleration, None));
    }
    let generic = |keep: &dyn Fn(&str) -> bool| -> Vec<Rc<Vec<f64>>> {
        dictionary
            .groups(problem)
            .into_iter()
            .filter(|g| keep(g.coordinate))
            .flat_map(|g| g.columns)
            .collect()
    };
    let all = generic(&|coordinate| !coordinate.starts_with("input"));
    let position = generic(&|coordinate| coordinate == "position");
    let mut inertia = |response: Response, generic: &[Rc<Vec<f64>>]| -> Result<Option<f64>> {
        problem.response = response;
        let system = System::new(problem, model)?;
        let columns: Vec<&[f64]> = system
            .columns
            .iter()
            .map(Vec::as_slice)
            .chain(generic.iter().map(|c| c.as_slice()))
            .collect();
        let score = linear::score(&system.response, &columns, folds, GENERIC_RIDGE, None);
        // The inertia, or its inverse, is the first unknown of the system.
        Ok(score.map(|s| {
            if response == Response::Force {
                s.beta[0]
            } else {
                1.0 / s.beta[0]
            }
        }))
    };
    let mut by_both_sides = |generic: &[Rc<Vec<f64>>]| -> Result<(Option<f64>, Option<f64>)> {
        Ok((
            inertia(Response::Acceleration, generic)?,
            inertia(Response::Force, generic)?,
        ))
    };
    let (full, plain) = (by_both_sides(&all)?, by_both_sides(&[])?);
    let positive = |j: Option<f64>| j.filter(|j| *j > 0.0);
    // A short recording may carry functions of position, gravity and springs among them, but not the whole dictionary.
    let robust = positive(full.1)
        .or(positive(by_both_sides(&position)?.1))
        .or(positive(plain.1));
    let disagree = |(acceleration, force): (Option<f64>, Option<f64>), tolerance: f64| match (
        acceleration,
        force,
    ) {
        (Some(a), Some(f)) => !(a > 0.0 && a < tolerance * f),
        _ => false,
    };
    if disagree(full, DISAGREEMENT) || disagree(plain, ROUGH_DISAGREEMENT) {
        return Ok((Response::Force, robust));
    }
    Ok((Response::Acceleration, robust))
}

/// Relative ridge on generic columns, some of which add up to columns of the model.
const GENERIC_RIDGE: f64 = 1e-6;

/// Residual, in every row, of a fit of the system and the whole dictionary to the training rows, and how many
/// unknowns that fit had.
pub fn follow_everything(
    problem: &Problem,
    system: &System,
    dictionary: &Dictionary,
    folds: &[Option<usize>],
) -> Result<(Vec<f64>, usize)> {
    let generic: Vec<Rc<Vec<f64>>> = dictionary
        .groups(problem)
        .into_iter()
        .flat_map(|g| g.columns)
        .collect();
    let columns: Vec<&[f64]> = system
        .columns
        .iter()
        .map(Vec::as_slice)
        .chain(generic.iter().map(|c| c.as_slice()))
        .collect();
    let score = linear::score(&system.response, &columns, folds, GENERIC_RIDGE, None)
        .ok_or_else(|| Error::Internal("the generic dictionary is degenerate".to_owned()))?;
    let mut residual = system.response.clone();
    for (column, beta) in columns.iter().zip(score.beta.iter()) {
        residual
            .iter_mut()
            .zip(*column)
            .for_each(|(r, c)| *r -= beta * c);
    }
    Ok((residual, columns.len()))
}

/// The tracks under windows of the narrowest width at which the encoder's noise no longer dominates, or of the width
/// asked for.
fn choose_width(
    tracks: &[Track],
    dictionary: &Dictionary,
    model: &Model,
    options: Options,
) -> Result<(Problem, Width)> {
    let reach = |track: &Track, width: f64| {
        let most = (track.whole / 40).max(FEWEST_SAMPLES);
        ((width / track.period).round() as usize).clamp(FEWEST_SAMPLES, most)
    };
    let problem = |width: f64| {
        let reaches: Vec<usize> = tracks.iter().map(|t| reach(t, width)).collect();
        Problem::new(
            tracks.to_vec(),
            &reaches,
            model.motion,
            Response::Acceleration,
        )
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
    let system = System::new(problem, &with_starts(problem, model))?;
    let folds = system::folds(problem);
    let (residual, unknowns) = follow_everything(problem, &system, dictionary, &folds)?;
    let mut squares: Vec<f64> = residual
        .iter()
        .zip(&folds)
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
        .map(|(t, w)| t.position_noise.powi(2) * w.acceleration_noise());
    Ok(encoder.fold(0.0, f64::max) / variance.max(1e-300))
}

fn undetermined(model: &Model) -> Error {
    let names: Vec<String> = model
        .labels()
        .iter()
        .zip(model.parameters())
        .filter(|(_, p)| !p.known)
        .map(|(l, _)| {
            l.effect
                .map_or_else(|| l.name.to_owned(), |id| format!("{id}.{}", l.name))
        })
        .collect();
    Error::NotIdentifiable(format!(
        "the recording does not excite the model: {} cannot be told apart; drive both directions at several speeds",
        names.join(", ")
    ))
}
