//! Identification by the weak form (DBI): from recordings and a model with unknowns to values with errors.

mod bend;
mod excess;
mod profile;
mod settle;
mod side;
mod smoothing;
mod steady;
mod twin;
mod way;
mod width;

use std::borrow::Cow;
use std::sync::OnceLock;

use crate::dictionary::Dictionary;
use crate::effects::{self, Path, Scale, Search, Survey};
use crate::error::{Error, Result};
use crate::fit::{self, Fit};
use crate::linear::{self, Score};
use crate::model::{Causality, Model, Parameter, Status, Term};
use crate::noise::Noise;
use crate::problem::{Direction, Problem, Response};
use crate::recording::Recording;
use crate::refine::{self, Refined};
use crate::scan::{self, Found, Ground, Inertias, Memo, Setting};
use crate::system::{self, System};
use crate::weak::{Balance, Part, Track};

pub(crate) use bend::{reopened, reopened_throughout};
use side::choose_response;
pub use steady::steadied;
use width::choose_width;
pub use width::{Tried, Width};

/// Rows that a fit needs at least.
const FEWEST_ROWS: usize = 40;

/// How far beyond the ends of its grid a fit may take an inner parameter, as a factor: the grid covers what a recording can show,
/// and further out a term is another one, as a load on no spring is a smaller inertia.
const BEYOND: f64 = 2.0;
/// Bristles that many times stiffer than the stiffest that are sought yield within a ten-thousandth of the motion in a sampling
/// interval at top speed: no fit tells them from stiff ones, and free runs with them take ever longer.
const STIFFER: f64 = 1000.0;

/// Time that the axis may rest at reversals without its positions showing it, as a share of all, from which on the drive
/// is asked: it then biases the Coulomb level by as much.
const LEAST_DOUBT: f64 = 0.002;

/// Everything that fits of one set of recordings share: rows, blocks and noise.
pub struct Workbench {
    /// The weak form of the recordings.
    pub problem: Problem,
    /// Block of every training row, by which it is cross-validated: see [`linear::score`].
    pub blocks: Vec<Option<usize>>,
    /// Noise of the rows.
    pub noise: Noise,
    /// Generic functions of each coordinate.
    pub dictionary: Dictionary,
    /// What it takes to move the axis, where the drive was asked how long it rests.
    pub balance: Option<Balance>,
    /// How wide the windows are, and why.
    pub width: Width,
    /// Whether windows over reversals that the encoder does not resolve are left out.
    pub skips_unresolved: bool,
    /// What is known of the inertia with all generic functions in.
    inertias: Option<Inertias>,
    /// Hz from which on lines are sought: slower ones are for wider windows.
    slowest: f64,
    /// The same windows on velocities smoothed half as wide, with their blocks, made when first asked for.
    finer: OnceLock<(Problem, Vec<Option<usize>>)>,
    /// What terms did on models before.
    memo: Memo,
}

/// What the user decides instead of the tool.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Half-width of the test functions, s.
    pub half_width: Option<f64>,
}

/// A model with estimated values, and how well it predicts.
#[derive(Clone)]
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

/// Fall of χ² from which on recordings tell one Stribeck curve from another of as many parameters: odds of e³.
const TELLS_CURVES: f64 = 6.0;

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
        let groups = self.dictionary.groups(&self.problem);
        let position = groups.iter().filter(|g| g.coordinate == "position");
        let position = position.flat_map(|g| &g.columns).map(|c| c.as_slice());
        if self.solved_beside(&mut model, position)?.is_none() {
            return Ok(None);
        }
        let value = |p: &Parameter| p.value.unwrap_or_default();
        let gain = value(&model.gain);
        let balance = Balance {
            inertia: value(model.parameters()[model.moving_inertia()]) / gain,
            coulomb: value(&model.coulomb) / gain,
        };
        let usable = balance.inertia > 0.0 && balance.coulomb > 0.0;
        Ok(usable.then_some(balance))
    }

    /// Gives the linear parameters of a model the values that they have beside other columns, and says how both fit. `None` if the
    /// recordings do not determine them.
    fn solved_beside<'a>(
        &self,
        model: &mut Model,
        others: impl IntoIterator<Item = &'a [f64]>,
    ) -> Result<Option<(System, Score)>> {
        let system = System::new(&self.problem, model)?.whitened(&self.noise);
        let others = self.noise.whiten_all(others);
        let columns = system.columns_and(others.iter().map(Vec::as_slice));
        let errors = system.errors();
        let score = linear::score(
            &system.response,
            &columns,
            &self.blocks,
            GENERIC_RIDGE,
            errors,
        );
        let Some(score) = score else { return Ok(None) };
        let own = score.beta.rows(0, system.columns.len()).into_owned();
        system.decode(&own, model);
        Ok(Some((system, score)))
    }

    fn on(tracks: &[Track], model: &Model, options: Options) -> Result<Self> {
        Self::beside(None, tracks, model, options)
    }

    /// On a side of the equation and with a room for inertias, if they are known already.
    fn beside(
        known: Option<(Response, Option<Inertias>)>,
        tracks: &[Track],
        model: &Model,
        options: Options,
    ) -> Result<Self> {
        let dictionary = Dictionary::new(tracks, model.motion);
        let (mut problem, width) = choose_width(tracks, &dictionary, model, options)?;
        let train = problem.count(Part::Train);
        if train < FEWEST_ROWS {
            return Err(Error::NotIdentifiable(format!(
                "only {train} windows of motion are left in the first 70 % of the recording after standstill and gaps are set aside; at least {FEWEST_ROWS} are needed: record for longer, or drive above break-away for more of the time"
            )));
        }
        let blocks = system::blocks(&problem);
        let start = with_starts(&problem, model);
        let (response, inertias) = match known {
            Some(known) => known,
            None => choose_response(&mut problem, &start, &dictionary, &blocks)?,
        };
        problem.response = response;
        let system = System::new(&problem, &start)?;
        let (residual, unknowns) = follow_everything(&problem, &system, &dictionary, &blocks)?;
        let noise = Noise::estimate(&problem, &residual, unknowns, &blocks);
        Ok(Self {
            balance: None,
            skips_unresolved: false,
            problem,
            blocks,
            noise,
            dictionary,
            width,
            inertias,
            slowest: 0.0,
            finer: OnceLock::new(),
            memo: Memo::default(),
        })
    }

    /// Number of training rows.
    pub fn training_rows(&self) -> f64 {
        self.blocks.iter().flatten().count() as f64
    }

    /// The same tracks under windows of another half-width, in seconds.
    pub fn with_half_width(&self, model: &Model, half_width: f64) -> Result<Self> {
        let options = Options {
            half_width: Some(half_width),
        };
        Self::on(&self.problem.tracks, model, options)
    }

    /// The same with noise estimated beside another model.
    pub fn with_noise_beside(&self, model: &Model) -> Result<Self> {
        self.with_response(model, self.problem.response)
    }

    /// The same with the error of one side of the equation to minimise, and noise estimated there beside a model.
    pub fn with_response(&self, model: &Model, response: Response) -> Result<Self> {
        let options = Options {
            half_width: Some(self.problem.half_width()),
        };
        let known = Some((response, self.inertias));
        Ok(Self {
            balance: self.balance,
            skips_unresolved: self.skips_unresolved,
            ..Self::beside(known, &self.problem.tracks, model, options)?
        })
    }

    /// The same tracks with nothing held out, under windows and noise of their own.
    pub fn on_whole(&self, model: &Model, options: Options) -> Result<Self> {
        let tracks = self.problem.tracks.iter().cloned();
        let tracks: Vec<Track> = tracks.map(Track::trained_on_whole).collect();
        Ok(Self {
            balance: self.balance,
            ..Self::on(&tracks, model, options)?
        })
    }

    /// The same without windows over reversals that the encoder does not resolve. `None` if it resolves them all, or if too little
    /// is left without them.
    pub fn resolved(&self, model: &Model) -> Option<Self> {
        let mut tracks = self.problem.tracks.to_vec();
        let reaches = self.problem.windows.iter().map(|w| w.reach);
        let barred: usize = (tracks.iter_mut().zip(reaches))
            .map(|(track, reach)| track.bar_unresolved(reach))
            .sum();
        let options = Options {
            half_width: Some(self.problem.half_width()),
        };
        let rest = (barred > 0).then(|| Self::on(&tracks, model, options));
        Some(Self {
            balance: self.balance,
            skips_unresolved: true,
            ..rest?.ok()?
        })
    }

    /// The same under narrower windows, whose rows minimise the error of the same side of the equation. Which side a
    /// disturbance is independent of is for the wider windows to say: narrow ones hold more noise of the encoder, and a hum
    /// that only they pass is in the comparison of the sides, where no generic function follows it.
    ///
    /// They are for lines from `slowest` on, in Hz, of which the strongest is followed before noise is estimated. As noise, a
    /// line would hide itself: rows are whitened by what is taken for noise.
    pub fn narrowed(&self, model: &Model, half_width: f64, slowest: f64) -> Result<Self> {
        let options = Options {
            half_width: Some(half_width),
        };
        let known = Some((self.problem.response, self.inertias));
        let mut narrow = Self::beside(known, &self.problem.tracks, model, options)?;
        narrow.slowest = slowest;
        narrow.follow_a_line(model)?;
        Ok(narrow)
    }

    /// Estimates the noise anew with the strongest line in the spectrum followed, too.
    fn follow_a_line(&mut self, model: &Model) -> Result<()> {
        let Some(effect) = effects::find("periodic-disturbance") else {
            return Ok(());
        };
        let start = with_starts(&self.problem, model);
        let Some(found) = self.best_on(&start, &scan::open(effect))? else {
            return Ok(());
        };
        let (sliding, path) = (Direction::default(), Path::default());
        let line = self.problem.effect(effect, found.inner, &sliding, &path);
        let mut system = System::new(&self.problem, &start)?;
        system.columns.extend(line.iter().map(|c| c.to_vec()));
        let (residual, unknowns) =
            follow_everything(&self.problem, &system, &self.dictionary, &self.blocks)?;
        self.noise = Noise::estimate(&self.problem, &residual, unknowns, &self.blocks);
        self.memo = Memo::default();
        Ok(())
    }

    /// Estimates all unknown parameters of a model: linear start, scan of inner parameters, joint refinement.
    pub fn estimate(&self, model: &Model) -> Result<(Model, f64)> {
        let found = self.estimated(model)?;
        // Bristles that were found beside less than the model has now may have no way from there to where they fit.
        Ok(if self.ran_away(&found.0) {
            self.or_anew(reopened(model), found)
        } else {
            found
        })
    }

    /// What was found, or what is with some of the model sought anew, if anything is to be and that fits better.
    pub fn or_anew(&self, opened: Option<Model>, found: (Model, f64)) -> (Model, f64) {
        match opened.map(|open| self.estimated(&open)) {
            Some(Ok(anew)) if anew.1 < found.1 => anew,
            _ => found,
        }
    }

    /// The χ² of an estimated model. That of a [`Ground`], whose columns follow from the numbers of the model where a gap is, is of
    /// numbers that may be others.
    pub fn chi2(&self, model: &Model) -> f64 {
        refine::chi2(&self.problem, model, &self.noise, &self.blocks)
    }

    /// The same with bristles from where they were found before, if they were.
    fn estimated(&self, model: &Model) -> Result<(Model, f64)> {
        let mut model = self.scan(with_starts(&self.problem, model))?;
        self.solve(&mut model)?;
        let starts = self.bend(&model);
        let refined = starts.models.into_iter().map(|s| self.refined(s));
        // A start that leads nowhere is no reason to give up the others.
        let rank = |(model, chi2): &(Model, f64)| (!bend::yields(model), *chi2);
        let best = refined.reduce(|best, other| match (&best, &other) {
            (Ok(one), Ok(two)) if rank(two) < rank(one) => other,
            (Err(_), Ok(_)) => other,
            _ => best,
        });
        match (best, starts.stiff) {
            (Some(Ok(found)), _) if self.yields(&found.0) => Ok(found),
            (best, Some(stiff)) => self.stiffly_refined(stiff).or(best.unwrap_or_else(nothing)),
            (best, None) => best.unwrap_or_else(nothing),
        }
    }

    /// The joint refinement of all unknown parameters from where they are, within what physics allows and the recordings show.
    fn refined(&self, mut model: Model) -> Result<(Model, f64)> {
        let own: Vec<_> = model.parameters().iter().map(|p| (p.min, p.max)).collect();
        keep_in_reach(&self.problem, &mut model);
        let (mut model, chi2) = self.descended(model)?;
        for (parameter, bounds) in model.parameters_mut().into_iter().zip(own) {
            (parameter.min, parameter.max) = bounds;
        }
        Ok((model, chi2))
    }

    /// The same within the bounds that the parameters have.
    fn descended(&self, mut model: Model) -> Result<(Model, f64)> {
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
        let Refined { chi2, stopped_by } =
            refine::refine(&self.problem, &mut model, &self.noise, &self.blocks);
        // What is allowed depends on other parameters, which have moved: a load is part of the inertia.
        if let Some(term) = system::inadmissible(&model) {
            return self.with_nothing_of(term, &model);
        }
        // At a bound that no step may cross, the others have not come to rest.
        if let Some(term) = stopped_by {
            let rest = self.with_nothing_of(term, &model)?;
            if rest.1 < chi2 {
                return Ok(rest);
            }
        }
        Ok((model, chi2))
    }

    /// Gives the linear parameters of a model their values. Its columns are those of bristles that yield after some distance,
    /// which they go on to do at other levels.
    fn solve(&self, model: &mut Model) -> Result<f64> {
        let breakaway = model.breakaway();
        let system = System::new(self.problem.training(), model)?;
        let score = system
            .whitened(&self.noise)
            .score(&self.blocks)
            .ok_or_else(|| undetermined(model))?;
        system.decode(&score.beta, model);
        if let Some(distance) = breakaway {
            model.break_away_after(distance);
        }
        Ok(score.chi2)
    }

    /// The inertia to take where a model leaves so much out that its own estimate is negative.
    fn fallback_inertia(&self, model: &Model) -> Result<f64> {
        if model.causality == Causality::Inverse {
            // Nothing is integrated, so none at all will do.
            return Ok(0.0);
        }
        self.inertias.map(|i| i.fallback).ok_or_else(|| {
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
            status: Status::NotExcited,
            ..bounds
        };
        Ok((model, chi2))
    }

    /// Estimates the rest of a model without a term that would have to be unphysical to fit better, and puts the term
    /// back with coefficients of zero.
    fn with_nothing_of(&self, term: usize, model: &Model) -> Result<(Model, f64)> {
        let mut rest = model.clone();
        let mut absent = rest.terms.remove(term);
        // Of nothing no place is better than another; what comes later begins in the middle.
        if let Some(inner) = absent.effect.inner().filter(|_| !absent.bends()) {
            let middle = middle(&absent, inner, &self.problem.survey(model));
            let parameter = &mut absent.parameters[inner];
            parameter.value = parameter.value.filter(|_| parameter.known).or(Some(middle));
        }
        let (mut rest, chi2) = self.estimate(&rest)?;
        if let Some(elsewhere) = self.elsewhere(term, model, &rest, chi2)? {
            return Ok(elsewhere);
        }
        empty(&mut absent, rest.scale());
        for parameter in absent.parameters.iter_mut().filter(|p| !p.known) {
            (parameter.se, parameter.status) = (Some(f64::INFINITY), Status::AtBound);
        }
        rest.terms.insert(term, absent);
        Ok((rest, chi2))
    }

    /// The model with one of its terms where it does most on the rest of the model, of a given χ², if it takes something off
    /// that there: next to another effect that was found later it may be another one.
    fn elsewhere(
        &self,
        term: usize,
        model: &Model,
        rest: &Model,
        chi2: f64,
    ) -> Result<Option<(Model, f64)>> {
        let of = &model.terms[term];
        let scanned = of.effect.inner().filter(|_| !of.bends());
        if scanned.is_none_or(|k| of.parameters[k].known) {
            return Ok(None);
        }
        let found = self.best_on(rest, &of.forgotten())?;
        let Some(found) = found.filter(|f| f.score.chi2 < chi2) else {
            return Ok(None);
        };
        let mut next = rest.clone();
        next.terms.insert(term, of.forgotten());
        scan::set_inner(&mut next.terms[term], found.inner);
        self.solve(&mut next)?;
        if system::inadmissible(&next).is_some() {
            return Ok(None);
        }
        let Refined { chi2: less, .. } =
            refine::refine(&self.problem, &mut next, &self.noise, &self.blocks);
        let holds = less < chi2 && system::inadmissible(&next).is_none();
        Ok(holds.then_some((next, less)))
    }

    /// A model, which fits with a χ², under the rational Stribeck curve, and by how much χ² is less then: if the file leaves open which
    /// curve it is, and the rows say that one.
    pub fn curved(&self, model: &Model, chi2: f64) -> Option<(Model, f64)> {
        let rational = model.with_rational_curve()?;
        // One that cannot be fitted is not it.
        let (_, with_it) = self.estimate(&rational).ok()?;
        let less = chi2 - with_it;
        (less > TELLS_CURVES).then_some((rational, less))
    }

    /// Estimates and judges a model under the curve that the rows say: see [`Workbench::curved`]. With it come the model that was to be
    /// fitted then, and by how much χ² is less under the rational curve.
    pub fn fit_curved(
        &self,
        model: &Model,
        recordings: &[Recording],
    ) -> Result<(Identified, Model, Option<f64>)> {
        let found = self.fit(model, recordings)?;
        Ok(match self.curved(model, found.chi2) {
            Some((rational, less)) => (self.fit(&rational, recordings)?, rational, Some(less)),
            None => (found, model.clone(), None),
        })
    }

    /// Estimates and judges a model.
    pub fn fit(&self, model: &Model, recordings: &[Recording]) -> Result<Identified> {
        let (optimum, chi2) = self.estimate(model)?;
        let mut model = optimum.clone();
        self.settle(&mut model, recordings);
        self.widen(&mut model, &optimum);
        steady::add_levels(&mut model, recordings);
        let fit = fit::judge(&model, recordings, &self.problem.tracks)?;
        Ok(Identified { model, chi2, fit })
    }

    /// The same with the bias of measured regressors taken off, and standard errors of what is left, by simulated twins of
    /// the recordings (indirect inference).
    ///
    /// All that twins do not have is noise to them, what the model leaves out among it. A model that leaves out as much as
    /// the noise is keeps what [`Workbench::fit`] found, and a diagnosis starts from that.
    pub fn unbiased(&self, found: Identified, recordings: &[Recording]) -> Result<Identified> {
        let Some(model) = self.without_bias(&found.model, recordings) else {
            return Ok(found);
        };
        let fit = fit::judge(&model, recordings, &self.problem.tracks)?;
        // What doubles the squared error where it was fitted puts nothing right.
        if found.fit.train.halves(&fit.train) {
            return Ok(found);
        }
        Ok(Identified {
            model,
            fit,
            ..found
        })
    }

    /// The model of [`Workbench::unbiased`] alone; `None` where it is what was found.
    pub fn without_bias(&self, found: &Model, recordings: &[Recording]) -> Option<Model> {
        let mut model = self.settled_on_twins(found, recordings)?;
        self.widen(&mut model, found);
        steady::add_levels(&mut model, recordings);
        Some(model)
    }

    /// Gives unknown inner parameters the values that fit best, one term after the other.
    fn scan(&self, mut model: Model) -> Result<Model> {
        for at in 0..model.terms.len() {
            let Some(inner) = model.terms[at].effect.inner() else {
                continue;
            };
            let parameter = &model.terms[at].parameters[inner];
            let settled = parameter.se.is_some() && !system::absent(&model, at);
            if model.terms[at].bends() || parameter.known || settled {
                continue;
            }
            let mut rest = model.clone();
            let term = rest.terms.remove(at);
            if let Some(found) = self.best_on(&rest, &term)? {
                scan::set_inner(&mut model.terms[at], found.inner);
            }
        }
        Ok(model)
    }

    /// The best that a term can do on a model; `None` if the recordings do not determine it.
    fn best_on(&self, model: &Model, term: &Term) -> Result<Option<Found>> {
        let ground = self.ground(model)?;
        ground.map_or(Ok(None), |ground| ground.best(term))
    }

    /// A model as the ground for one more term; `None` if the recordings do not determine it.
    pub fn ground<'a>(&'a self, model: &'a Model) -> Result<Option<Ground<'a>>> {
        self.ground_under(model, &self.noise)
    }

    /// The same with rows that are weighed by another noise: for looks at what is left, as what terms do at best is kept for the
    /// workbench's own noise.
    pub fn ground_under<'a>(
        &'a self,
        model: &'a Model,
        noise: &'a Noise,
    ) -> Result<Option<Ground<'a>>> {
        let setting = Setting {
            problem: &self.problem,
            noise,
            blocks: &self.blocks,
            inertias: self.inertias,
            slowest: self.slowest,
            memo: &self.memo,
        };
        Ground::new(setting, Cow::Borrowed(model))
    }
}

/// Gives the unknown parameters of a term the values that stand for coefficients of zero.
fn empty(term: &mut Term, scale: Scale) {
    let effect = term.effect;
    let (inner, _) = effect.linear(&system::values(term), scale);
    let named = effect.named(inner, &vec![0.0; effect.width()], scale);
    let unknown = term.parameters.iter_mut().zip(named);
    for (parameter, value) in unknown.filter(|(p, _)| !p.known) {
        parameter.value = Some(value);
    }
}

/// The model with a middle-of-the-grid value for each inner parameter that has none; bristles wait for the level that
/// they yield at.
fn with_starts(problem: &Problem, model: &Model) -> Model {
    let mut started = model.clone();
    let survey = problem.survey(model);
    for term in &mut started.terms {
        model.begin_fall(term);
        if let Some(shape) = term.effect.shape() {
            let middle = || {
                let tried = term.effect.shapes(&survey);
                tried[tried.len() / 2]
            };
            let start = term.effect.textbook().unwrap_or_else(middle);
            let parameter = &mut term.parameters[shape];
            parameter.value = Some(parameter.value.unwrap_or_else(|| parameter.clamp(start)));
        }
        if let Some(inner) = term.effect.inner()
            && term.parameters[inner].value.is_none()
            && !term.bends()
        {
            term.parameters[inner].value = Some(middle(term, inner, &survey));
        }
    }
    started
}

/// Bounds the inner parameters that are left to a fit to where they are sought and a factor of [`BEYOND`]; bristles may be softer
/// at will, and stiffer by a factor of [`STIFFER`].
fn keep_in_reach(problem: &Problem, model: &mut Model) {
    let survey = problem.survey(model);
    for term in &mut model.terms {
        let on_grid = term.effect.search() == Search::Grid;
        let Some(inner) = term.effect.inner().filter(|_| on_grid) else {
            continue;
        };
        let (least, most) = if term.bends() {
            (0.0, STIFFER)
        } else {
            (1.0 / BEYOND, BEYOND)
        };
        let grid = term.effect.grid(&survey);
        let parameter = &mut term.parameters[inner];
        if let [low, .., high] = grid[..]
            && !parameter.known
        {
            // A factor is no measure of places on both sides of zero.
            let (low, high) = if low > 0.0 {
                (low * least, high * most)
            } else {
                (low, high)
            };
            parameter.min = Some(parameter.min.map_or(low, |min| min.max(low)));
            parameter.max = Some(parameter.max.map_or(high, |max| max.min(high)));
        }
    }
}

/// The middle of the grid that the inner parameter of a term is sought on, within its bounds.
fn middle(term: &Term, inner: usize, survey: &Survey) -> f64 {
    let grid = term.effect.grid(survey);
    term.parameters[inner].clamp(grid[grid.len() / 2])
}

/// Relative ridge on generic columns, some of which add up to columns of the model.
const GENERIC_RIDGE: f64 = 1e-6;

/// Residual, in every row, of a fit of the system and the whole dictionary to the training rows, and how many
/// unknowns that fit had.
pub fn follow_everything(
    problem: &Problem,
    system: &System,
    dictionary: &Dictionary,
    blocks: &[Option<usize>],
) -> Result<(Vec<f64>, usize)> {
    let groups = dictionary.groups(problem);
    let columns = system.columns_and(groups.iter().flat_map(|g| &g.columns).map(|c| c.as_slice()));
    let score = linear::score(&system.response, &columns, blocks, GENERIC_RIDGE, None)
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

fn nothing<T>() -> Result<T> {
    Err(Error::Internal("nothing to begin with".to_owned()))
}

fn undetermined(model: &Model) -> Error {
    let names: Vec<String> = model
        .labels()
        .iter()
        .zip(model.parameters())
        .filter(|(_, p)| !p.known)
        .map(|(l, _)| l.to_string())
        .collect();
    Error::NotIdentifiable(format!(
        "the recording does not excite the model: {} cannot be told apart; drive both directions at several speeds",
        names.join(", ")
    ))
}
