//! What a model leaves beyond the noise of its recordings, though functions of no coordinate follow it: free runs that go wrong, and
//! blows so short that every fit takes them for outliers, as at an end stop. Both are held against twins of the recordings.

use super::leftover::{self, Leftover};
use super::locate::{self, Where};
use super::select::SOUGHT;
use super::{
    BeforeAfter, DEPARTS, Finding, SHARE_OF_GENERIC, Unexplained, departure_sentence, even_with,
    spanned,
};
use crate::error::Result;
use crate::fit;
use crate::identify::Workbench;
use crate::model::Model;
use crate::recording::Recording;
use crate::system;
use crate::weak::Part;

/// What is beyond noise.
pub(super) enum Beyond {
    /// Outliers.
    Blows(Blows),
    /// Errors of free runs.
    Runs(Runs),
}

impl Beyond {
    /// What a model leaves beyond noise, if it leaves anything: as it was `fitted` to rows, with any nuisance in, and as it is told,
    /// beside what was `named` or not.
    pub fn noise(
        bench: &Workbench,
        fit: &BeforeAfter,
        (fitted, after): (&Model, &Model),
        (recordings, named): (&[Recording], bool),
    ) -> Result<Option<Self>> {
        if let Some(blows) = blows(bench, (fitted, after), recordings, named) {
            return Ok(Some(Self::Blows(blows)));
        }
        Ok(runs(bench, fit, after, recordings)?.map(Self::Runs))
    }

    /// Has blows come first in what is left; what free runs err by has no coordinate of its own.
    pub fn shows_in(&self, leftover: &mut Leftover) {
        if let Self::Blows(blows) = self
            && !blows.late
        {
            leftover.is_told_by(blows.coordinate, blows.share);
        }
    }

    /// Whether it acts in the held-out part alone.
    pub fn is_late(&self) -> bool {
        match self {
            Self::Blows(blows) => blows.late,
            Self::Runs(runs) => runs.late,
        }
    }

    /// Where blows are.
    pub fn place(&self) -> Option<&Where> {
        match self {
            Self::Blows(blows) => Some(&blows.place),
            Self::Runs(_) => None,
        }
    }

    pub fn sentence(&self, findings: &[Finding], remains: Option<&Unexplained>) -> String {
        match self {
            Self::Blows(blows) => blows.sentence(findings),
            Self::Runs(runs) => runs.sentence(findings, remains),
        }
    }
}

/// Outliers that noise does not explain.
pub(super) struct Blows {
    /// RMS of their torque over all rows, over the RMS of the drive.
    size: f64,
    /// Their share of the square of all that is left.
    share: f64,
    /// How many times as large as those of any twin they are.
    times: f64,
    /// Whether they come in the held-out part alone.
    late: bool,
    /// What they depend on most.
    coordinate: &'static str,
    /// Where they are.
    place: Where,
}

impl Blows {
    fn sentence(&self, findings: &[Finding]) -> String {
        let when = spanned(&self.place.time);
        if self.late {
            return departure_sentence(&when, findings);
        }
        let even = even_with(findings);
        let size = 100.0 * self.size;
        let noise = if self.times.is_finite() && self.times < 1000.0 {
            format!("{:.1} times as much as noise explains", self.times)
        } else {
            "of which noise explains nothing".to_owned()
        };
        let (coordinate, place) = (self.coordinate, &self.place.text);
        format!(
            "Something is left out{even} that acts in short blows, as an end stop does: {size:.0} % of the drive (RMS), {noise}. It depends on {coordinate}. {place} Look at {when}."
        )
    }
}

/// The outliers of a model, if they are as large as effects that are looked for and more than [`DEPARTS`] times as large as on any twin
/// of the recordings. Who touches the axis strikes it, too: beside what was `named` they must come in both parts.
fn blows(
    bench: &Workbench,
    (fitted, after): (&Model, &Model),
    recordings: &[Recording],
    named: bool,
) -> Option<Blows> {
    let residual = system::residual(&bench.problem, fitted);
    let outliers = bench.noise.law.outliers(&bench.problem, &residual);
    let size = leftover::relative(bench, fitted, &outliers);
    if size < SOUGHT {
        return None;
    }
    let parts: [&[Part]; 3] = [
        &[Part::Train, Part::HeldOut],
        &[Part::Train],
        &[Part::HeldOut],
    ];
    let [all, train, held_out] = bench.outlying(&outliers, after, recordings, parts)?;
    let times = if named { train.min(held_out) } else { all };
    let left = leftover::relative(bench, fitted, &residual);
    (times > DEPARTS).then(|| Blows {
        size,
        share: (size / left).powi(2),
        times,
        late: train <= DEPARTS,
        coordinate: locate::coordinate(bench, &outliers),
        place: locate::locate(bench, fitted, &outliers, &vec![0.0; outliers.len()]),
    })
}

/// Free runs that go wrong further than noise explains.
pub(super) struct Runs {
    /// How many times as far.
    times: f64,
    /// Whether they do in the held-out part alone.
    late: bool,
    /// When they go wrong most.
    when: String,
}

impl Runs {
    fn sentence(&self, findings: &[Finding], remains: Option<&Unexplained>) -> String {
        let Self { times, late, when } = self;
        if *late {
            return departure_sentence(when, findings);
        }
        let even = even_with(findings);
        let depends = remains.and_then(|rest| rest.coordinates.first());
        let depends = depends.map_or_else(String::new, |(coordinate, _)| {
            format!("; if anything, it depends on {coordinate}")
        });
        format!(
            "Something is left out{even}: free runs of 1 s go wrong {times:.1} times as far as the noise of the recording explains. It is too rare or too slow to be told from noise otherwise{depends}. Look at {when}, where they go wrong most."
        )
    }
}

/// How many times as far as noise explains free runs go wrong in one part or the other, if that is more than [`DEPARTS`]. Over a
/// second, errors add up that a window of the weak form takes for noise, and what acts in the held-out part alone no fit has seen.
/// Where what was found takes [`SHARE_OF_GENERIC`] or more off their squared error, and where reversals are left out that the encoder
/// does not resolve, which free runs go through all the same, they must go wrong in both parts. Sampling and simulation may be all
/// there is to errors below the size of effects that are looked for: those of the model, or where most was found, of the baseline.
fn runs(
    bench: &Workbench,
    fit: &BeforeAfter,
    after: &Model,
    recordings: &[Recording],
) -> Result<Option<Runs>> {
    let (before, now) = (&fit.before, &fit.after);
    let left = |before: &fit::Error, now: &fit::Error| {
        now.nrmse > SOUGHT && now.nrmse.powi(2) > (1.0 - SHARE_OF_GENERIC) * before.nrmse.powi(2)
    };
    let both = [
        (Part::Train, &before.train, &now.train),
        (Part::HeldOut, &before.held_out, &now.held_out),
    ];
    let asked = both.iter().filter(|(_, before, now)| left(before, now));
    let mut parts: Vec<Part> = asked.map(|(part, ..)| *part).collect();
    let found_most = parts.is_empty();
    if found_most && before.held_out.nrmse <= SOUGHT {
        return Ok(None);
    }
    if found_most {
        parts = both.map(|(part, ..)| part).to_vec();
    }
    let own = fit::parts(after, recordings, &bench.problem.tracks)?;
    let Some(times) = bench.excess(after, recordings, (&own, &parts), DEPARTS)? else {
        return Ok(None);
    };
    let far = parts
        .into_iter()
        .zip(times)
        .filter(|(_, times)| *times > DEPARTS);
    let far: Vec<(Part, f64)> = far.collect();
    if far.len() == 1 && (found_most || bench.skips_unresolved) {
        return Ok(None);
    }
    let Some(&(part, times)) = far.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return Ok(None);
    };
    Ok(Some(Runs {
        times,
        late: far.iter().all(|(part, _)| *part == Part::HeldOut),
        when: spanned(&own.worst(part, recordings)),
    }))
}
