//! What a diagnosis says: the contract's JSON, as types.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{Where, estimates};
use crate::check::Warning;
use crate::fit::Fit;
use crate::identify::Identified;
use crate::model::Model;

/// A value with its standard error and unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Standard error; `None` for a value that was given, 0 in JSON.
    #[serde(serialize_with = "number")]
    pub se: Option<f64>,
    /// SI unit.
    pub unit: &'static str,
    /// What the recordings say of it: see [`crate::model::Status`].
    pub status: String,
}

/// A number whatever the case, as other programs expect; an error without bound becomes the largest one.
#[allow(clippy::ref_option)] // The signature that serde asks for.
fn number<S: serde::Serializer>(se: &Option<f64>, to: S) -> std::result::Result<S::Ok, S::Error> {
    to.serialize_f64(se.unwrap_or(0.0).min(f64::MAX))
}

/// Parameters by name.
pub type Estimates = BTreeMap<String, Estimate>;

/// What the verdict says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Nothing significant is left out.
    Adequate,
    /// The findings account for the mismatch.
    Explained,
    /// A significant mismatch stays that no effect explains.
    Unknown,
}

impl Verdict {
    /// That of a mismatch that stays or not, with names or without.
    pub(super) fn of(stays: bool, named: bool) -> Self {
        match (stays, named) {
            (true, _) => Self::Unknown,
            (false, false) => Self::Adequate,
            (false, true) => Self::Explained,
        }
    }
}

/// The baseline and how it predicts.
#[derive(Clone, Debug, Serialize)]
pub struct Baseline {
    /// Its parameters.
    pub parameters: Estimates,
    /// Its prediction errors.
    pub fit: Fit,
}

/// How strongly the data speak for a finding.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Evidence {
    /// Fall of BIC when the effect joins the others found.
    pub delta_bic: f64,
    /// Share of the baseline's cross-validated squared error that goes with it.
    pub share_of_residual: f64,
}

/// Another effect that would explain much the same.
#[derive(Clone, Debug, Serialize)]
pub struct Rival {
    /// Its id.
    pub id: &'static str,
    /// Its fall of BIC at the stage where the finding was preferred.
    pub delta_bic: f64,
    /// Whether the data tells it from the finding: in its place it leaves a larger error.
    pub separated: bool,
    /// All parameters of the model with it in the place of the finding.
    pub model: Estimates,
    /// The fit of that model.
    pub fit: Fit,
    /// The experiment that decides.
    pub tell_apart_by: String,
}

/// An effect that was left out.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// Stable id.
    pub id: &'static str,
    /// Name that a person reads.
    pub name: &'static str,
    /// Probability that this effect, and no rival, is the right name.
    pub confidence: f64,
    /// One sentence that a person can act on.
    pub text: String,
    /// Where it shows.
    #[serde(rename = "where")]
    pub place: Where,
    /// Its parameters in the final model, with quantities that follow from them.
    pub parameters: Estimates,
    /// Evidence for it.
    pub evidence: Evidence,
    /// All parameters of the model with this finding and those before it.
    pub model: Estimates,
    /// The fit of that model.
    pub fit: Fit,
    /// Rivals.
    pub rivals: Vec<Rival>,
}

/// Something that generic functions follow and no effect explains.
#[derive(Clone, Debug, Serialize)]
pub struct Unexplained {
    /// Share of the cross-validated squared error that generic functions take away.
    pub gain: f64,
    /// RMS of the torque or force that goes with it, as a share of the RMS of the drive.
    pub size: f64,
    /// Coordinates it may depend on with their own shares, best first.
    pub coordinates: Vec<(&'static str, f64)>,
}

/// Fit of the baseline and of the final model.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BeforeAfter {
    /// Baseline.
    pub before: Fit,
    /// Final model.
    pub after: Fit,
}

/// The outcome: the contract's `bristle.diagnosis/1`.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// `bristle.diagnosis/1`.
    pub schema: &'static str,
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in a sentence.
    pub text: String,
    /// What there is to know about the recordings before the rest is trusted.
    pub warnings: Vec<Warning>,
    /// The baseline.
    pub baseline: Baseline,
    /// Where the baseline fails.
    #[serde(rename = "where")]
    pub place: Where,
    /// What was left out, strongest first.
    pub findings: Vec<Finding>,
    /// What stays unexplained.
    pub unexplained: Option<Unexplained>,
    /// What generic functions of each coordinate would still gain, significant or not.
    pub leftover: Unexplained,
    /// Parameters of the final model.
    pub parameters: Estimates,
    /// Before and after.
    pub fit: BeforeAfter,
    /// By which factor the whitened residual of the final model is larger in the held-out part than in the training part.
    pub departure: f64,
    /// Half-width of the test functions, s, of each recording.
    pub half_width: Vec<f64>,
}

/// A diagnosis together with the models behind it.
pub struct Outcome {
    /// What goes into the JSON.
    pub diagnosis: Diagnosis,
    /// The baseline with its estimates.
    pub before: Model,
    /// The final model.
    pub after: Model,
    /// Whether of the baseline only the exponent that its friction law has by itself does not hold.
    pub(super) of_law: bool,
}

impl Outcome {
    /// Tells a baseline that nothing is added to as it is, whatever the verdict came of.
    pub(super) fn tell(&mut self, baseline: &Identified) {
        let Self {
            diagnosis,
            before,
            after,
            ..
        } = self;
        (*before, *after) = (baseline.model.clone(), baseline.model.clone());
        diagnosis.fit.before = baseline.fit;
        diagnosis.fit.after = baseline.fit;
        diagnosis.parameters = estimates(&baseline.model, None);
        diagnosis.baseline = Baseline {
            parameters: estimates(&baseline.model, None),
            fit: baseline.fit,
        };
    }
}
