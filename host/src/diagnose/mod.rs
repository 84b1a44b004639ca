//! Diagnosis: where a model and its recordings part, what was left out, and the proof that adding it helps.

mod beyond;
mod confirm;
mod findings;
mod forms;
mod given;
mod leftover;
mod locate;
mod outcome;
mod pairs;
mod select;
mod sharpen;
mod told;
mod trial;

pub use findings::{estimate, estimates};
pub use locate::Where;
pub use outcome::{
    Baseline, BeforeAfter, Diagnosis, Estimate, Estimates, Evidence, Finding, Outcome, Rival,
    Unexplained, Verdict,
};

use std::cell::OnceCell;

use crate::check::{self, Severity, Warning};
use crate::effects::{Effect, Impostor};
use crate::error::Result;
use crate::fit::{self, Fit};
use crate::format;
use crate::identify::{Identified, Workbench};
use crate::model::{Model, Status, Term};
use crate::recording::Recording;
use crate::system;
use crate::weak::Part;
use beyond::Beyond;
use confirm::{Confirmed, HeldOut, confirmed};
use findings::findings;
use leftover::Leftover;
use select::{Scope, Selected, Selection};
use sharpen::{Fast, sharpened};
use trial::Trial;

/// A model whose free run errs by more than this share of the motion on both parts explains nothing, whatever the weak form can
/// tell apart; nor does one whose does on the part that it was fitted to, and more than without what was found. See [`astray`].
const HOPELESS: f64 = 0.5;

/// Share of what generic functions gain that the named effects must reach: below it, the names are not the physics.
const SHARE_OF_GENERIC: f64 = 0.6;

/// Where the held-out part errs by more than this many times the error of the training part, and its free runs by more than this many
/// times what they do on twins, something acts there that the training part did not show.
const DEPARTS: f64 = 2.0;

/// How much less a name is worth while something unexplained remains, which it may stand in for: of the findings beside an
/// `unknown` verdict about this share is right, as the `validate` example shows for physics outside the catalogue. Wrong data
/// are taken to be as bad.
const BESIDE_UNKNOWN: f64 = 0.3;

/// Diagnoses a baseline that has been fitted on a workbench. `progress` is told what is being done.
///
/// The search starts from the baseline as the rows have it; what is told of it, and compared with what was found, is free of what
/// sensors and smoothing do to estimates, as what was found is.
///
/// Where the encoder is too coarse for a reversal, the direction of friction is a guess there, and a wrong one is what any effect may
/// stand in for. So what is left out must show elsewhere as well, unless its strongest part is one that shows at reversals only;
/// bristles that break away before the position tells that they bend do not show there either.
///
/// Where only the exponent that a law has by itself speaks against it, the law has the rational curve, or the exponent is estimated with
/// the rest. What is adequate is told with the curve that fits better.
pub fn diagnose(
    bench: &Workbench,
    baseline: &Identified,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Outcome> {
    let told = &bench.unbiased(baseline.clone(), recordings)?;
    let start = Start {
        fitted: baseline,
        told,
    };
    let outcome = diagnosed(bench, start, recordings, progress)?;
    let otherwise = under_another_curve(bench, baseline, &outcome, recordings, progress)?;
    if let Some(otherwise) = otherwise {
        return Ok(otherwise);
    }
    let found = &outcome.diagnosis;
    let bends = |breakaway| bench.problem.tracks.iter().any(|t| t.shows(breakaway));
    let resolves = |id| id != "presliding" || outcome.after.breakaway().is_some_and(bends);
    let strongest = found.findings.first().map(|f| f.id);
    // Nothing that rows show, at reversals or elsewhere.
    let shows = strongest.is_some() || found.unexplained.is_some();
    let at_reversals = strongest.is_some_and(|id| AT_REVERSALS.contains(&id) && resolves(id));
    // A jump of the position is no reversal, though it looks like two.
    if !shows || at_reversals || check::jumps(&found.warnings) {
        return Ok(outcome);
    }
    let Some(mut elsewhere) = away_from_unresolved(bench, baseline, recordings, progress) else {
        return Ok(outcome);
    };
    elsewhere.tell(told);
    elsewhere.diagnosis.warnings.push(check::unresolved());
    let warnings = &elsewhere.diagnosis.warnings;
    let nothing = (&[][..], &elsewhere.diagnosis.fit);
    elsewhere.diagnosis.text = verdict_sentence(Verdict::Adequate, nothing, None, warnings);
    Ok(elsewhere)
}

/// The diagnosis under another Stribeck curve than the one that the law has by itself, if that curve alone speaks against the law, or if
/// the baseline is adequate and stays so.
fn under_another_curve(
    bench: &Workbench,
    baseline: &Identified,
    outcome: &Outcome,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Option<Outcome>> {
    let free = (baseline.model.exponent_of_law()).filter(|_| outcome.of_law);
    let free = free.map(|exponent| {
        let mut free = baseline.model.clone();
        free.parameters_mut()[exponent].known = false;
        bench.fit(&free, recordings).map(|free| (exponent, free))
    });
    let free = free.transpose()?;
    let adequate = outcome.diagnosis.verdict == Verdict::Adequate;
    if (free.is_some() || adequate)
        && let Some((rational, less)) = bench.curved(&baseline.model, baseline.chi2)
    {
        progress("the same with another curve of the friction law");
        let rational = bench.fit(&rational, recordings)?;
        // An exponent is one parameter more.
        let price = bench.training_rows().ln();
        let fits = |(_, free): &(usize, Identified)| rational.chi2 <= free.chi2 + price;
        if free.as_ref().is_none_or(fits) {
            let mut otherwise = diagnose(bench, &rational, recordings, progress)?;
            if !adequate || otherwise.diagnosis.verdict == Verdict::Adequate {
                let curve = check::falls_otherwise(less);
                otherwise.diagnosis.warnings.push(curve);
                return Ok(Some(otherwise));
            }
        }
    }
    let Some((exponent, free)) = free else {
        return Ok(None);
    };
    progress("the same with another exponent of the friction law");
    let mut otherwise = diagnose(bench, &free, recordings, progress)?;
    let exponent = check::bends_otherwise(otherwise.after.parameters()[exponent]);
    otherwise.diagnosis.warnings.push(exponent);
    Ok(Some(otherwise))
}

/// A baseline as it was fitted to rows, from which a search starts, and as it is told.
#[derive(Clone, Copy)]
struct Start<'a> {
    fitted: &'a Identified,
    told: &'a Identified,
}

/// The diagnosis away from reversals that the encoder does not resolve, if they are a minority and the model is adequate there.
fn away_from_unresolved(
    bench: &Workbench,
    baseline: &Identified,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Option<Outcome> {
    let resolved = bench.resolved(&baseline.model)?;
    if 2 * resolved.problem.rows.len() < bench.problem.rows.len() {
        return None;
    }
    progress("the same away from reversals that the encoder does not resolve");
    let fitted = &resolved.fit(&baseline.model, recordings).ok()?;
    // Before the long search: without a finding, this alone decides.
    if leftover::of(&resolved, &fitted.model).ok()?.certain {
        return None;
    }
    let told = fitted;
    let start = Start { fitted, told };
    let outcome = diagnosed(&resolved, start, recordings, progress).ok()?;
    (outcome.diagnosis.verdict == Verdict::Adequate).then_some(outcome)
}

/// Effects that show at reversals only, or hardly anywhere else.
const AT_REVERSALS: [&str; 4] = ["stribeck", "presliding", "backlash", "compliance"];

/// What is found leaves less than this share of what was taken for noise where noise was told beside less.
const QUIETER: f64 = 0.5;

/// One diagnosis over all windows of a workbench. Noise is what generic functions leave beside the baseline: where what there is
/// evidence for leaves much less of it, they did not follow that, and with noise told beside it what else is left out has more
/// evidence. What is found then must not predict worse: a noise that is told to be next to none makes much of what is next to
/// nothing. Beside what the held-out part has refuted, what is found then must explain all.
fn diagnosed(
    bench: &Workbench,
    start: Start,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Outcome> {
    let found = found(bench, start, recordings, progress)?;
    let stands = quieter_beside(bench, &found.selection)?;
    let refuted = || -> Result<bool> {
        let quieter = quieter_beside(bench, &found.evident)?;
        Ok(quieter && leftover::of(bench, &found.selection.1)?.certain)
    };
    if stands || refuted()? {
        progress("telling noise anew, beside what there is evidence for");
        let (_, quiet) = if stands {
            &found.selection
        } else {
            &found.evident
        };
        let quieter = bench.with_noise_beside(quiet)?;
        let again = self::found(&quieter, start, recordings, progress)?;
        // What sensors do to a model they do to another of the same effects.
        let same = again.ids().eq(found.ids());
        let error = |bench: &Workbench, found: &Found| {
            let told = (!same).then(|| found.settled.told(bench, recordings));
            let model = told.transpose()?.unwrap_or(&found.settled.model);
            Ok(held_out(bench, model, recordings)?.nrmse)
        };
        if error(&quieter, &again)? <= confirm::FREE_RUN_TOLERANCE * error(bench, &found)? {
            let again = concluded(&quieter, start, recordings, again, progress)?;
            if stands || again.diagnosis.verdict == Verdict::Explained {
                return Ok(again);
            }
        }
    }
    concluded(bench, start, recordings, found, progress)
}

/// Whether what was selected leaves much less than what was taken for noise. What narrow windows alone show is not for usual ones to
/// explain, which would then have to.
fn quieter_beside(bench: &Workbench, (selected, after): &Selection) -> Result<bool> {
    if selected.iter().all(|s| s.fast) {
        return Ok(false);
    }
    let base = trial::Base::new(bench, after)?;
    Ok(base.is_some_and(|base| base.score().chi2 < QUIETER * base.rows()))
}

/// The diagnosis that a search leads to.
fn concluded(
    bench: &Workbench,
    start: Start,
    recordings: &[Recording],
    found: Found,
    progress: &dyn Fn(&str),
) -> Result<Outcome> {
    let (before, baseline) = (&start.fitted.model, start.told);
    let Found {
        selection,
        fine,
        settled,
        ..
    } = found;
    progress("looking for what is left");
    let finer = fine.as_ref().map_or(bench, |fast| &fast.bench);
    let Judged {
        selection: (mut selected, mut after),
        mut leftover,
        significant,
        given,
        nameless,
    } = judged([bench, finer], before, selection)?;
    let (mut settled, mut told) = if selected.is_empty() {
        // Of names that do not hold nothing is told.
        (settled.model.clone(), settled.model)
    } else {
        let told = settled.told(bench, recordings)?.clone();
        (settled.model, told)
    };
    let fitted = after.clone();
    let creep = take_nuisance(&mut selected, [&mut settled, &mut told, &mut after], before);
    let departure = confirm::departure(bench, &after);
    let departs = departure > DEPARTS && leftover::counts(bench, &after);
    progress("how certain it is");
    // Beside a nuisance that goes, the baseline is another one.
    let (after, told) = match &creep {
        _ if !selected.is_empty() => (settled, told),
        Some(_) => (after.clone(), after),
        None => (baseline.model.clone(), baseline.model.clone()),
    };
    // What windows of the usual width do not show is told by those that do.
    let fine = fine.filter(|_| !selected.is_empty());
    let finer = fine.as_ref().map_or(bench, |fast| &fast.bench);
    let from = (before, baseline.fit);
    let (mut findings, after_fit) = findings(finer, from, &selected, (&after, &told), recordings)?;
    let departs = departs && confirm::departs(bench, &told, &after_fit, recordings)?;
    let astray = astray(&baseline.fit, &after_fit)
        && !confirm::scatters(bench, (before, &fitted, &told), recordings)?;
    let doubtful = significant || nameless || departs || astray || given.is_some();
    let fit = BeforeAfter {
        before: baseline.fit,
        after: after_fit,
    };
    let named = !selected.is_empty();
    let noise = || Beyond::noise(bench, &fit, (&fitted, &told), (recordings, named));
    let beyond = (!doubtful).then(noise).transpose()?.flatten();
    beyond.iter().for_each(|b| b.shows_in(&mut leftover));
    let verdict = Verdict::of(doubtful || beyond.is_some(), named);
    let mut warnings = check::warnings(finer, before, recordings);
    warnings.retain(|w| w.id != SHIFTED || shifted(verdict, &findings));
    warnings.extend(creep.map(|term| check::creeps(&term, after.motion)));
    if verdict == Verdict::Unknown || warnings.iter().any(contradicts) {
        findings
            .iter_mut()
            .for_each(|f| f.confidence *= BESIDE_UNKNOWN);
    }
    // What acts in the held-out part alone the rest cannot tell.
    let early = beyond.as_ref().is_some_and(|beyond| !beyond.is_late());
    let certain = leftover.certain || early && leftover.gain > 0.0;
    let leftover = unexplained(&leftover);
    let remains = certain.then_some(&leftover);
    let unexplained = remains.filter(|_| verdict == Verdict::Unknown).cloned();
    let place = match beyond.as_ref().and_then(Beyond::place) {
        Some(place) => place.clone(),
        None => place(finer, before, named.then_some(&after)),
    };
    let text = match &given {
        Some(given) => given_sentence(&given.text),
        None if departs && remains.is_none() => departure_sentence(&when(finer, &after), &findings),
        None if let Some(beyond) = beyond => beyond.sentence(&findings, remains),
        None => verdict_sentence(verdict, (&findings, &fit), remains, &warnings),
    };
    let diagnosis = Diagnosis {
        schema: "bristle.diagnosis/1",
        verdict,
        text,
        warnings,
        baseline: Baseline {
            parameters: estimates(&baseline.model, None),
            fit: baseline.fit,
        },
        place,
        findings,
        unexplained,
        leftover,
        parameters: estimates(&told, None),
        fit,
        departure,
        half_width: finer.problem.half_widths().collect(),
    };
    let mut outcome = Outcome {
        diagnosis,
        before: baseline.model.clone(),
        after: told,
        of_law: given.is_some_and(|given| given.of_law),
    };
    if selected.is_empty() {
        outcome.tell(baseline);
    }
    Ok(outcome)
}

/// A selection, if its names hold, with what it leaves.
struct Judged {
    selection: Selection,
    leftover: Leftover,
    /// Whether that counts.
    significant: bool,
    /// Friction that the model file gives and that does not hold.
    given: Option<given::Refuted>,
    /// Whether the names are not the physics, however well they fit.
    nameless: bool,
}

/// Whether what was selected, under the windows of the first workbench or the finer ones of the second, is what was left out. What
/// is not goes.
fn judged(
    benches: [&Workbench; 2],
    before: &Model,
    (selected, after): Selection,
) -> Result<Judged> {
    let bench = benches[0];
    let base_error = error(bench, before)?;
    let mut leftover = if selected.is_empty() {
        leftover::beside_nothing(bench, before)?
    } else {
        leftover::of(bench, &after)?
    };
    let remaining = error(bench, &after)?;
    let reached = (base_error - remaining)
        / (base_error - remaining * (1.0 - leftover.whitened)).max(f64::MIN_POSITIVE);
    let little = leftover.size() < select::SOUGHT && reached >= 1.0 - select::FLOOR;
    let significant = leftover.certain && (selected.is_empty() || !little);
    let given = given::refuted(bench, before, (base_error, remaining))?;
    let impostor = impostor(benches, &selected, &after, before)?;
    let added = &after.terms[before.terms.len()..];
    // A search that ends at the bound on names has not come to an end.
    let endless = selected.len() >= select::MOST;
    let nameless = endless || pieced(added, leftover.certain) || impostor.is_some();
    let misnamed = given.is_some() || nameless || significant && reached < SHARE_OF_GENERIC;
    let selection = if misnamed && !selected.is_empty() {
        leftover = leftover::of(bench, before)?;
        (Vec::new(), before.clone())
    } else {
        (selected, after)
    };
    if let Some((coordinate, gain)) = impostor {
        leftover.is_told_by(coordinate, gain);
    }
    Ok(Judged {
        selection,
        leftover,
        significant,
        given,
        nameless,
    })
}

/// Whether a model predicts next to nothing, or worse than the baseline that it is to explain: see [`HOPELESS`]. In the held-out
/// part, as far as the axis moves enough there, that is an error of more than the motion itself and than in the training part, or
/// twice the squared error of the baseline. Of axes whose free runs scatter by themselves see [`confirm::scatters`].
fn astray(before: &Fit, after: &Fit) -> bool {
    let (train, held_out) = (&after.train, &after.held_out);
    let hopeless = confirm::hopeless(train, held_out);
    let worse = train.nrmse > before.train.nrmse.max(HOPELESS);
    let nothing = held_out.nrmse > 1.0 && held_out.rmse > train.rmse;
    let lost = nothing || before.held_out.halves(held_out);
    hopeless || worse || lost && confirm::moves(train, held_out)
}

/// What bends the curve of friction over speed.
const CURVES: [&str; 3] = ["stribeck", "quadratic-drag", "power-law-viscous"];
/// What bends a force over the travel.
const PLACES: [&str; 4] = ["gravity", "spring", "hardening-spring", "cogging"];
/// So many of either piece together what none of them is.
const PIECES: usize = 3;

/// Whether effects piece a curve together that none of them is: three that bend it, or two of which one is at the end of what there
/// is of it; of those that bend friction over speed two that leave something, too.
fn pieced(added: &[Term], leaves: bool) -> bool {
    let among = |ids: &[&str], leaves: bool| {
        let pieces = added.iter().filter(|t| ids.contains(&t.effect.id()));
        let at_bound = |term: &Term| {
            let mut parameters = term.parameters.iter();
            parameters.any(|p| p.status == Status::AtBound)
        };
        let ends = pieces.clone().any(at_bound);
        let count = pieces.count();
        count >= PIECES || count > 1 && (leaves || ends)
    };
    among(&CURVES, leaves) || among(&PLACES, false)
}

/// Warnings of what effects of the catalogue do as well: delay, lag and inertia mismatch.
const PHYSICS_TOO: [&str; 3] = [SHIFTED, "given-inertia", "long-delay"];

/// The warning that the drive and the motion look shifted in time, and the effects that shift them.
const SHIFTED: &str = "channels-shifted";
const LATE: [&str; 2] = ["delay", "actuator-lag"];

/// Whether drive and motion may be shifted: what explains all of the mismatch without a shift explains what looked like one.
fn shifted(verdict: Verdict, findings: &[Finding]) -> bool {
    verdict != Verdict::Explained || findings.iter().any(|f| LATE.contains(&f.id))
}

/// Whether a warning says that the data are wrong.
fn contradicts(warning: &Warning) -> bool {
    warning.severity == Severity::Suspect && !PHYSICS_TOO.contains(&warning.id)
}

/// What the search ends with.
struct Found {
    selection: Selection,
    /// What windows of the usual width showed before the held-out part was asked, which may have refuted it because too loud a noise
    /// hides what acts beside it.
    evident: Selection,
    /// The narrower windows that fast effects were found under, if any were.
    fine: Option<Fast>,
    settled: Settled,
}

impl Found {
    /// Ids of what was selected.
    fn ids(&self) -> impl Iterator<Item = &'static str> {
        self.selection.0.iter().map(|s| s.trial.effect.id())
    }
}

/// The model of a selection with errors that count what smoothing does, and as it is told.
struct Settled {
    model: Model,
    told: OnceCell<Model>,
}

impl Settled {
    /// One that [`tell`] tells, once that is asked for.
    fn to_tell(model: Model) -> Self {
        Self {
            model,
            told: OnceCell::new(),
        }
    }

    /// One that is told as it is.
    fn as_it_is(model: Model) -> Self {
        Self {
            told: model.clone().into(),
            model,
        }
    }

    fn told(&self, bench: &Workbench, recordings: &[Recording]) -> Result<&Model> {
        if self.told.get().is_none() {
            // Nobody else asks meanwhile.
            let _ = self.told.set(tell(bench, &self.model, recordings)?);
        }
        Ok(self.told.get().unwrap_or(&self.model))
    }
}

/// What is found, with the encoder on the load only if that predicts better than all that is found without: in the weak form a
/// resonance or a gap before the encoder can stand in for other physics at reversals, which free runs tell apart.
fn found(
    bench: &Workbench,
    start: Start,
    recordings: &[Recording],
    progress: &dyn Fn(&str),
) -> Result<Found> {
    let found = search(bench, start, recordings, true, progress)?;
    let mut added = found.settled.model.terms[start.fitted.model.terms.len()..].iter();
    if !added.any(|t| t.effect.on_load_side()) {
        return Ok(found);
    }
    let without = search(bench, start, recordings, false, progress)?;
    let error = |found: &Found| held_out(bench, found.settled.told(bench, recordings)?, recordings);
    let predicts = error(&found)?.nrmse < sharpen::LOAD_LEAVES * error(&without)?.nrmse;
    Ok(if predicts { found } else { without })
}

/// The error of held-out free runs.
fn held_out(bench: &Workbench, model: &Model, recordings: &[Recording]) -> Result<fit::Error> {
    fit::part(Part::HeldOut, model, recordings, &bench.problem.tracks)
}

/// The search, repeated without the effect that its own errors or free runs refute most as long as there is one; with the encoder
/// on the load or not.
fn search(
    bench: &Workbench,
    start: Start,
    recordings: &[Recording],
    load_side: bool,
    progress: &dyn Fn(&str),
) -> Result<Found> {
    let before = &start.fitted.model;
    let itself = |model: &Model| refuted_by_itself(bench, model, before, recordings);
    let refutes = |selected: &[Selected], settled: &Settled| {
        if let Some(id) = itself(&settled.model)? {
            return Ok(Some(id));
        }
        match refuted_by_runs(bench, start, (selected, settled), recordings)? {
            // Told, it may err by more.
            None => itself(settled.told(bench, recordings)?),
            runs => Ok(runs),
        }
    };
    let nothing = (Vec::new(), before.clone());
    let (mut refuted, mut plain) = (Vec::<&str>::new(), Vec::<&str>::new());
    let mut first = None;
    loop {
        let scope = Scope {
            plain: &plain,
            sought: &|effect: &dyn Effect| load_side || !effect.on_load_side(),
            refuted: &refuted,
            ..Scope::usual(bench)
        };
        let Confirmed {
            selection: usual,
            evident,
        } = confirmed(&scope, before, &nothing, recordings, progress)?;
        let evident = first.get_or_insert(evident);
        let mut model = usual.1.clone();
        let mut settled = if usual.0.is_empty() {
            Settled::as_it_is(model)
        } else {
            bench.settle(&mut model, recordings);
            Settled::to_tell(model)
        };
        if let Some(id) = refutes(&usual.0, &settled)? {
            bar(id, &usual.0, &mut refuted, &mut plain);
            continue;
        }
        if let Some(id) = sharpen::refuted(bench, before, &usual) {
            refuted.push(id);
            continue;
        }
        let (selection, fine) = sharpened(&scope, before, usual, recordings, progress)?;
        if let Some(fast) = &fine {
            settled = Settled::as_it_is(fast.settle(bench, &selection.1, recordings)?);
            if let Some(id) = refutes(&selection.0, &settled)? {
                bar(id, &selection.0, &mut refuted, &mut plain);
                continue;
            }
        }
        return Ok(Found {
            selection,
            evident: evident.clone(),
            fine,
            settled,
        });
    }
}

/// Bars what was refuted of a selection: a form that refines an effect, if it was found in one, as the plain form was found before it,
/// or else the effect.
fn bar(id: &'static str, selected: &[Selected], refuted: &mut Vec<&str>, plain: &mut Vec<&str>) {
    let refined = |s: &Selected| s.trial.effect.id() == id && s.trial.effect.refines();
    if selected.iter().any(refined) && !plain.contains(&id) {
        plain.push(id);
    } else {
        refuted.push(id);
    }
}

/// Share of the time that a saturation leaves the drive as it is, at least: one that cuts all the time leaves nothing of the drive but
/// its sign, which is less torque per unit of drive, or more inertia.
const UNCUT: f64 = 0.05;
/// Share of the travel below which bristles yield at once: no stroke is as short.
const SHORT: f64 = 0.01;

/// The effect that a settled model has beyond a baseline and whose own errors refute it most: an effect may be in doubt only
/// because a nuisance stands beside it, which then goes first.
///
/// Errors say how far an estimate is from where the effect is none as if the way there was straight. Where it is not, as for the
/// exponent of a power law, which next to zero is Coulomb friction, they say so little that evidence beyond doubt may come with
/// an estimate in doubt (Hauck and Donner, Journal of the American Statistical Association 72, 1977). So no errors refute an
/// effect that halves the squared error of free runs on both parts, nor a load that shows again in the held-out part. Where
/// another effect is a part of it, in doubt is what there is beyond that, and free runs with that part in its place decide.
fn refuted_by_itself(
    bench: &Workbench,
    settled: &Model,
    before: &Model,
    recordings: &[Recording],
) -> Result<Option<&'static str>> {
    let added = settled.terms.iter().enumerate().skip(before.terms.len());
    let (nuisances, named): (Vec<_>, Vec<_>) = added.partition(|(_, t)| t.effect.nuisance());
    let nuisance = nuisances.first().map(|(_, t)| t.effect.id());
    let cuts = system::uncut(&bench.problem, settled).is_some_and(|share| share < UNCUT);
    if let Some((_, limit)) = named
        .iter()
        .find(|(_, t)| cuts && t.effect.id() == "saturation")
    {
        return Ok(Some(limit.effect.id()));
    }
    let travel = bench.problem.survey(settled).travel;
    if let Some((_, spring)) = named.iter().find(|(_, t)| pushes(t, travel)) {
        return Ok(Some(spring.effect.id()));
    }
    let lost = system::lost(&bench.problem, settled);
    let slight = lost.is_some_and(|lost| trial::negligible(bench, lost));
    if let Some((_, gap)) = named.iter().find(|(_, t)| slight && t.effect.divides()) {
        return Ok(Some(nuisance.unwrap_or(gap.effect.id())));
    }
    let (least, most) = travel;
    let short = (settled.breakaway()).is_some_and(|distance| distance < SHORT * (most - least));
    let doubts = named
        .iter()
        .filter_map(|(k, t)| Some((told::doubt(t, short)?, *k, t.effect.id())));
    let mut doubts: Vec<(f64, usize, &str)> = doubts.collect();
    doubts.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, k, id) in doubts {
        if nuisance.is_some() || !predicts(bench, settled, k, recordings)? {
            return Ok(Some(nuisance.unwrap_or(id)));
        }
    }
    Ok(None)
}

/// Whether a hardening spring pulls back nowhere on a travel: what pushes away is none, and bends to anything that grows with time
/// where an axis goes one way.
fn pushes(spring: &Term, (least, most): (f64, f64)) -> bool {
    if spring.effect.id() != "hardening-spring" {
        return false;
    }
    let value = |name: &str| {
        let specs = spring.effect.parameters();
        let at = specs.iter().position(|spec| spec.name == name);
        at.and_then(|k| spring.parameters[k].value)
            .unwrap_or_default()
    };
    let farthest = (least - value("rest"))
        .abs()
        .max((most - value("rest")).abs());
    value("stiffness") + value("cubic") * farthest * farthest < 0.0
}

/// A model of what was selected as `identify` tells it: fitted under noise that is told beside it, less what sensors and smoothing do
/// to its values. As it was found, where free runs on the part that it is fitted to speak against that.
fn tell(bench: &Workbench, found: &Model, recordings: &[Recording]) -> Result<Model> {
    let anew = || -> Result<Model> {
        let quiet = bench.with_noise_beside(found)?;
        let (mut fitted, _) = quiet.estimate(found)?;
        quiet.settle(&mut fitted, recordings);
        Ok(quiet.without_bias(&fitted, recordings).unwrap_or(fitted))
    };
    let Ok(anew) = anew() else {
        return Ok(found.clone());
    };
    let error = |model| fit::part(Part::Train, model, recordings, &bench.problem.tracks);
    let worse = error(&anew)?.nrmse > confirm::FREE_RUN_TOLERANCE * error(found)?.nrmse;
    Ok(if worse { found.clone() } else { anew })
}

/// The last effect of a selection that makes free runs worse than they are without, be it those of the baseline or of what else was
/// selected: in the held-out part, as far as the axis moves there, by more than chance, and in the part that it was fitted to. In
/// the weak form, what noise, filters and counts do at reversals may look like physics; free runs start anew from the measured
/// state and go through them.
fn refuted_by_runs(
    bench: &Workbench,
    start: Start,
    (selected, settled): (&[Selected], &Settled),
    recordings: &[Recording],
) -> Result<Option<&'static str>> {
    let named = |selected: &Selected| !selected.trial.effect.nuisance();
    let Some(last) = selected.iter().rposition(named) else {
        return Ok(None);
    };
    let runs = |model: &Model| fit::parts(model, recordings, &bench.problem.tracks);
    let alone = selected.iter().filter(|s| named(s)).count() == 1;
    // As a rule the held-out part alone says that it is not, be the model told or not: no bias takes half of the squared error.
    let before = &start.told.fit.held_out;
    if alone && held_out(bench, &settled.model, recordings)?.halves(before) {
        return Ok(None);
    }
    let told = settled.told(bench, recordings)?;
    let least = confirm::FREE_RUN_TOLERANCE * before.nrmse;
    if alone && held_out(bench, told, recordings)?.nrmse < least {
        return Ok(None);
    }
    let without = if alone {
        runs(&start.told.model)?
    } else {
        let lacking = select::without(&settled.model, start.fitted.model.terms.len() + last);
        let Ok((lacking, _)) = bench.estimate(&lacking) else {
            return Ok(None);
        };
        // No bias is as large.
        if confirm::halves(bench, told, &runs(&lacking)?, recordings)? {
            return Ok(None);
        }
        runs(&tell(bench, &lacking, recordings)?)?
    };
    let with = runs(told)?;
    let worse = with.train().nrmse > without.train().nrmse
        && confirm::worsens(&with, &without, told.causality, !alone);
    Ok(worse.then(|| selected[last].trial.effect.id()))
}

/// Whether a term, or what is more to it than a part of it, halves the squared error of free runs on both parts, or is a load that the held-out rows show again.
fn predicts(
    bench: &Workbench,
    model: &Model,
    term: usize,
    recordings: &[Recording],
) -> Result<bool> {
    let lacking = select::without(model, term);
    let part = model.terms[term].effect.includes().and_then(forms::fullest);
    let instead = part.map(|part| lacking.with_effect(part));
    let Ok((without, _)) = bench.estimate(&instead.unwrap_or(lacking)) else {
        return Ok(true);
    };
    let loads = model.terms[term].effect.divides();
    if loads && HeldOut::of(bench, model, &without).shows_again() {
        return Ok(true);
    }
    let before = fit::parts(&without, recordings, &bench.problem.tracks)?;
    confirm::halves(bench, model, &before, recordings)
}

fn unexplained(leftover: &Leftover) -> Unexplained {
    Unexplained {
        gain: leftover.gain,
        size: leftover.size(),
        coordinates: leftover.coordinates.iter().take(3).copied().collect(),
    }
}

/// Cross-validated squared error of a model per training row.
fn error(bench: &Workbench, model: &Model) -> Result<f64> {
    let base = trial::Base::new(bench, model)?;
    Ok(base.map_or(f64::INFINITY, |b| b.score().cross_validated / b.rows()))
}

/// Where a model errs by more than another, or than noise.
fn place(bench: &Workbench, model: &Model, other: Option<&Model>) -> Where {
    let z = whitened(bench, model);
    let other = other.map_or_else(|| vec![1.0; z.len()], |other| whitened(bench, other));
    locate::locate(bench, model, &z, &other)
}

fn whitened(bench: &Workbench, model: &Model) -> Vec<f64> {
    let emphasis = system::emphasis(&bench.problem, model);
    let mut residual = bench.noise.whiten(&system::residual(&bench.problem, model));
    residual.iter_mut().for_each(|r| *r *= emphasis);
    residual
}

/// The first selected effect that physics outside the catalogue is taken for, if that fits better in its place, under the windows
/// that the effect was found with, the usual or the finer ones: what it depends on, and what it gains.
fn impostor(
    benches: [&Workbench; 2],
    selected: &[Selected],
    after: &Model,
    before: &Model,
) -> Result<Option<(&'static str, f64)>> {
    for (k, selected) in selected.iter().enumerate() {
        let (bench, effect) = (benches[usize::from(selected.fast)], selected.trial.effect);
        let Some(Impostor {
            effect: other,
            coordinate,
        }) = effect.impostor()
        else {
            continue;
        };
        let lacking = select::without(after, before.terms.len() + k);
        let Ok((lacking, _)) = bench.estimate(&lacking) else {
            continue;
        };
        let Some(base) = trial::Base::new(bench, &lacking)? else {
            continue;
        };
        let (own, other) = (base.attempt(effect)?, base.attempt(other)?);
        let evidence = |trial: &Option<Trial>| trial.as_ref().map_or(0.0, |t| t.delta_bic);
        let needed = evidence(&own) + select::LEAST_DELTA_BIC;
        if let Some(other) = other.as_ref().filter(|o| o.delta_bic > needed) {
            return Ok(Some((coordinate, other.gain.share)));
        }
    }
    Ok(None)
}

/// Takes what is no effect of the catalogue out of a selection and its models, which stand on a baseline.
fn take_nuisance(
    selected: &mut Vec<Selected>,
    models: [&mut Model; 3],
    before: &Model,
) -> Option<Term> {
    let k = selected.iter().position(|s| s.trial.effect.nuisance())?;
    selected.remove(k);
    let taken = models.map(|model| model.terms.remove(before.terms.len() + k));
    taken.into_iter().last()
}

/// What to say of friction that the model file gives wrongly.
fn given_sentence(given: &str) -> String {
    format!(
        "The friction that the model file gives, or the law by itself where the file says nothing, does not hold: {given}. Write another value or \"?\" into [friction], and diagnose again; until then, what else is left out cannot be told from it."
    )
}

/// What to say of a held-out part that is unlike the rest.
fn departure_sentence(when: &str, findings: &[Finding]) -> String {
    let even = even_with(findings);
    format!(
        "The last 30 % of the recording, which no fit has seen, depart from what the rest says{even}, most of all at {when}: something acts there that the rest does not show. If something touched the axis then, record again without; otherwise so that all levels of drive, speed and position come early and late."
    )
}

/// When a model errs by more than noise.
fn when(bench: &Workbench, model: &Model) -> String {
    spanned(&place(bench, model, None).time)
}

fn spanned(spans: &[[f64; 2]]) -> String {
    let spans = spans.iter().map(|span| format::range(*span, "s"));
    spans.collect::<Vec<_>>().join(" and ")
}

/// Names and ids of what was found.
fn names(findings: &[Finding]) -> String {
    let names = findings.iter().map(|f| format!("{} ({})", f.name, f.id));
    names.collect::<Vec<_>>().join("; ")
}

/// What follows a sentence that holds with these in the model as well.
fn even_with(findings: &[Finding]) -> String {
    if findings.is_empty() {
        return String::new();
    }
    format!(", even with {} in", names(findings))
}

/// What to say where free runs alone speak against a model.
fn unpredicted_sentence(findings: &[Finding], fit: &BeforeAfter) -> String {
    let (before, after) = (&fit.before.held_out, &fit.after.held_out);
    if before.halves(after) && !confirm::hopeless(&fit.after.train, after) {
        let percent = |part: &fit::Error| format::significant(100.0 * part.nrmse, 3);
        return format!(
            "The last 30 % of the recording, which no fit has seen, speak against what the rest says: with {} in, the model errs there by {} %, without by {} %. What acts is much like that and yet another thing; record again so that all levels of drive, speed and position come early and late.",
            names(findings),
            percent(after),
            percent(before)
        );
    }
    let even = even_with(findings);
    format!(
        "The model hardly predicts the motion{even}, and the recording is too noisy or too uniform to tell what is left out: record again with both directions, several speeds and reversals."
    )
}

fn verdict_sentence(
    verdict: Verdict,
    (findings, fit): (&[Finding], &BeforeAfter),
    remains: Option<&Unexplained>,
    warnings: &[Warning],
) -> String {
    match verdict {
        Verdict::Adequate if !warnings.is_empty() => "The model is adequate as far as this recording can tell, which the warnings limit: nothing significant is left out.".to_owned(),
        Verdict::Adequate => "The model is adequate: nothing significant is left out.".to_owned(),
        Verdict::Explained => {
            let they = if findings.len() > 1 { "them" } else { "it" };
            let rest = match remains {
                None => "nothing significant remains".to_owned(),
                Some(rest) => format!(
                    "no more than {:.1} % of the drive remains unexplained",
                    100.0 * rest.size
                ),
            };
            let doubt = if warnings.iter().any(contradicts) {
                " The recording contradicts itself, as the warnings say: what is named may be an artefact of that."
            } else {
                ""
            };
            format!(
                "The model leaves out: {}. With {they} in, {rest}.{doubt}",
                names(findings)
            )
        }
        Verdict::Unknown => {
            let Some(unexplained) = remains else {
                return unpredicted_sentence(findings, fit);
            };
            let coordinate = unexplained
                .coordinates
                .first()
                .map_or("none of the coordinates alone", |c| c.0);
            let found = if findings.is_empty() {
                String::new()
            } else {
                format!(" besides {}", names(findings))
            };
            format!(
                "Something is left out{found} that no effect of the catalogue explains; it depends on {coordinate}."
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two laws of friction over speed are no names if they leave something, or if one is at its end.
    #[test]
    fn a_curve_of_two_pieces_is_neither() {
        let text = "[plant]\nmotion = \"rotary\"\n[effects.power-law-viscous]\n[effects.quadratic-drag]\n[effects.gravity]\n";
        let mut terms = Model::parse(text).unwrap().terms;
        assert!(!pieced(&terms, false) && pieced(&terms, true));
        let of = |id| terms.iter().position(|t| t.effect.id() == id);
        let (law, gravity) = (of("power-law-viscous"), of("gravity"));
        terms[gravity.unwrap()].parameters[0].status = Status::AtBound;
        assert!(!pieced(&terms, false));
        terms[law.unwrap()].parameters[1].status = Status::AtBound;
        assert!(pieced(&terms, false));
        terms.retain(|t| t.effect.id() != "quadratic-drag");
        assert!(!pieced(&terms, true));
    }

    /// What waves of twice and three times the periods make doubtful may be plain cogging, which is barred the second time.
    #[test]
    fn a_form_that_refines_goes_before_its_effect() {
        let cogging = crate::effects::find("cogging").unwrap();
        let mut forms = cogging.other_forms().iter().copied();
        let selected = |effect| Selected {
            trial: Trial {
                effect,
                inner: [24.0, 0.0],
                delta_bic: 0.0,
                price: 0.0,
                gain: trial::Gain::default(),
                certain: true,
                reopens: false,
            },
            fast: false,
            others: Vec::new(),
        };
        let refined = [selected(forms.find(|form| form.refines()).unwrap())];
        let (mut refuted, mut plain) = (Vec::new(), Vec::new());
        bar("cogging", &refined, &mut refuted, &mut plain);
        assert!(refuted.is_empty() && plain == ["cogging"]);
        bar("cogging", &refined, &mut refuted, &mut plain);
        assert!(refuted == ["cogging"]);
        let (mut refuted, mut plain) = (Vec::new(), Vec::new());
        bar("cogging", &[selected(cogging)], &mut refuted, &mut plain);
        assert!(refuted == ["cogging"] && plain.is_empty());
    }

    /// Up to 3 rad a cubic outdoes a stiffness of −9 rad² times it.
    #[test]
    fn a_spring_pulls_back_somewhere_on_the_travel() {
        let text = "[plant]\nmotion = \"rotary\"\n[effects.hardening-spring]\nstiffness = -0.8\ncubic = 0.1\n";
        let mut model = Model::parse(text).unwrap();
        assert!(!pushes(&model.terms[0], (-2.0, 3.0)));
        model.terms[0].parameters[0].value = Some(-1.0);
        assert!(pushes(&model.terms[0], (-2.0, 3.0)));
    }

    /// Twice the squared error, or more than the motion and than in the training part; where the axis hardly moves, errors say
    /// nothing.
    #[test]
    fn held_out_errors_count_where_the_axis_moves() {
        let part = |nrmse, signal| fit::Error {
            nrmse,
            signal,
            rmse: nrmse * signal,
        };
        let fit = |train, held_out| Fit {
            train: part(train, 1.0),
            held_out,
            ..Fit::default()
        };
        let before = fit(0.1, part(0.1, 1.0));
        assert!(astray(&before, &fit(0.1, part(0.142, 1.0))));
        assert!(!astray(&before, &fit(0.1, part(0.141, 1.0))));
        assert!(!astray(&before, &fit(0.1, part(0.5, 0.09))));
        let (wild, small) = (fit(0.1, part(1.1, 0.2)), fit(0.3, part(1.1, 0.2)));
        assert!(astray(&wild, &wild) && !astray(&small, &small));
    }
}
