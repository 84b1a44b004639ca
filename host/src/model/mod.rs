//! Models of an axis: what is known, what is to be estimated, and what was found.

mod bristles;
mod file;
mod kind;
mod parameter;
mod place;

use std::collections::BTreeMap;
use std::fmt;

pub use bristles::Bristles;
pub use kind::{Constant, Kind};
pub use parameter::{Parameter, Status};

use bristle_core::friction::Curve;

use crate::effects::{self, Effect, Given, Quantity, Scale, Seat, Spec};
pub use crate::motion::Motion;

/// Canonical column name to the name in the recording.
pub type Columns = BTreeMap<String, String>;

/// Which side of the axis is imposed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// `u` drives the motion.
    Forward,
    /// The motion is imposed and `u` is the measured reaction force.
    Inverse,
}

/// Friction laws that a model file can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// Coulomb and viscous friction.
    CoulombViscous,
    /// Coulomb, viscous and the Stribeck curve: the exponential one, or where the file says so, or recordings do, the rational one.
    Stribeck,
    /// The same with the exponent 1 (thesis eq. 11), named for its sticking condition, which every law without a bristle
    /// state obeys.
    Static,
    /// Bristles that deflect and yield at the Coulomb level, and viscous friction.
    Dahl,
    /// Bristles that yield at a level with the exponential Stribeck curve.
    LuGre,
    /// Bristles that yield at a level with the rational Stribeck curve.
    ModifiedLuGre,
}

/// An effect that is part of a model, with its parameters in the order of [`Effect::parameters`].
#[derive(Clone)]
pub struct Term {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// One parameter for each of the effect's specifications.
    pub parameters: Vec<Parameter>,
    /// Part of the friction law, so that its parameters live under `[friction]` in the file.
    pub in_law: bool,
}

impl Term {
    /// The term with nothing known of it but what is given.
    #[must_use]
    pub fn forgotten(&self) -> Self {
        let mut term = self.clone();
        for parameter in term.parameters.iter_mut().filter(|p| !p.known) {
            (parameter.value, parameter.se) = (None, None);
        }
        term
    }
}

/// A model of one axis: `J·q̈ = k·u(t − d) − Fc·sgn v − Fv·v − Σ effects`.
#[derive(Clone)]
pub struct Model {
    /// Free text.
    pub name: String,
    /// Rotary or linear.
    pub motion: Motion,
    /// What `u` is: torque, force, voltage or current.
    pub input: String,
    /// Which side is imposed.
    pub causality: Causality,
    /// What moves.
    pub kind: Kind,
    /// The friction law that the file names.
    pub law: Law,
    /// Torque or force per unit of `u`.
    pub gain: Parameter,
    /// `J`, kg·m² or kg.
    pub inertia: Parameter,
    /// `Fc`, N·m or N.
    pub coulomb: Parameter,
    /// `Fv`, N·m·s/rad or N·s/m.
    pub viscous: Parameter,
    /// Effects beyond Coulomb and viscous friction.
    pub terms: Vec<Term>,
    /// What plants and laws have beyond the parameters that fits know.
    pub constants: Vec<Constant>,
    /// Column mapping of the recordings.
    pub columns: Columns,
    document: toml_edit::DocumentMut,
}

/// What a parameter is called and measured in, for messages, JSON and the report.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// `None` for the plant and its friction law, else the id of the effect.
    pub effect: Option<&'static str>,
    /// Name within the plant, the law or the effect.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
}

impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.effect {
            Some(id) => write!(f, "{id}.{}", self.name),
            None => f.write_str(self.name),
        }
    }
}

impl Model {
    /// All parameters in the order that fits use: inertia, gain, Coulomb, viscous, then the effects'.
    pub fn parameters(&self) -> Vec<&Parameter> {
        let plant = [&self.inertia, &self.gain, &self.coulomb, &self.viscous];
        plant
            .into_iter()
            .chain(self.terms.iter().flat_map(|t| &t.parameters))
            .collect()
    }

    /// The same, for writing.
    pub fn parameters_mut(&mut self) -> Vec<&mut Parameter> {
        let plant = [
            &mut self.inertia,
            &mut self.gain,
            &mut self.coulomb,
            &mut self.viscous,
        ];
        plant
            .into_iter()
            .chain(self.terms.iter_mut().flat_map(|t| &mut t.parameters))
            .collect()
    }

    /// Moves parameter `k` of [`Model::parameters`] to a value, kept within the bounds of the file and of physics.
    pub fn move_to(&mut self, k: usize, value: f64) {
        let physical = self.physical_bounds(k);
        let parameter = &mut *self.parameters_mut().swap_remove(k);
        parameter.value = Some(parameter.clamp(value.clamp(physical.0, physical.1)));
    }

    /// The unit of the column `u`.
    pub fn input_unit(&self) -> &'static str {
        match (self.input.as_str(), self.motion) {
            ("voltage", _) => "V",
            ("current", _) => "A",
            (_, Motion::Rotary) => "N*m",
            (_, Motion::Linear) => "N",
        }
    }

    /// Whether parameter `k` of [`Model::parameters`] is a whole number, which no gradient finds.
    pub fn is_whole(&self, k: usize) -> bool {
        self.spec(k)
            .is_some_and(|spec| spec.quantity.is_whole(self.motion))
    }

    /// Whether the residual is linear in parameter `k` of [`Model::parameters`] while the others stay.
    pub fn is_linear(&self, k: usize) -> bool {
        let mut first = 4;
        for term in &self.terms {
            let shape = term.effect.shape();
            if let Some(own) = k.checked_sub(first)
                && own < term.parameters.len()
            {
                return Some(own) != term.effect.inner() && Some(own) != shape;
            }
            first += term.parameters.len();
        }
        true
    }

    /// Whether a bound of the file or of physics holds parameter `k` of [`Model::parameters`].
    pub fn at_bound(&self, k: usize) -> bool {
        let physical = self.physical_bounds(k);
        let parameter = self.parameters()[k];
        let bounds = [
            parameter.min,
            parameter.max,
            Some(physical.0),
            Some(physical.1),
        ];
        bounds
            .into_iter()
            .flatten()
            .any(|bound| parameter.value == Some(bound))
    }

    fn physical_bounds(&self, k: usize) -> (f64, f64) {
        self.spec(k)
            .map_or((f64::NEG_INFINITY, f64::INFINITY), |spec| spec.bounds)
    }

    /// Declaration of parameter `k` of [`Model::parameters`], if it belongs to an effect.
    fn spec(&self, k: usize) -> Option<&'static Spec> {
        let mut specs = self.terms.iter().flat_map(|t| t.effect.parameters());
        specs.nth(k.checked_sub(4)?)
    }

    /// A label for each of [`Model::parameters`].
    pub fn labels(&self) -> Vec<Label> {
        let plant = [
            ("inertia", Quantity::Inertia),
            ("gain", Quantity::Gain),
            ("coulomb", Quantity::Torque),
            ("viscous", Quantity::Viscous),
        ];
        let plant = plant.into_iter().map(|(name, quantity)| Label {
            effect: None,
            name,
            unit: self.unit(quantity),
        });
        let effects = self.terms.iter().flat_map(|term| {
            term.effect.parameters().iter().map(|spec| Label {
                effect: (!term.in_law).then(|| term.effect.id()),
                name: spec.name,
                unit: self.unit(spec.quantity),
            })
        });
        plant.chain(effects).collect()
    }

    /// The place in [`Model::parameters`] of the exponent of the friction law if the law gives it, and the file nothing.
    pub fn exponent_of_law(&self) -> Option<usize> {
        if self.file_gives("exponent") {
            return None;
        }
        let labels = self.labels();
        let at = labels
            .iter()
            .position(|l| l.effect.is_none() && l.name == "exponent")?;
        self.parameters()[at].known.then_some(at)
    }

    /// Whether the file says something under a key of its friction.
    fn file_gives(&self, key: &str) -> bool {
        let friction = self.document.get("friction");
        friction.is_some_and(|friction| friction.get(key).is_some())
    }

    /// The curve by which friction of the law falls.
    pub fn curve(&self) -> Curve {
        let rational: &dyn Effect = &effects::law::RATIONAL;
        let fixed = |term: &Term| term.in_law && effects::same_form(term.effect, rational);
        match self.law {
            Law::ModifiedLuGre => Curve::Rational,
            Law::Stribeck if self.terms.iter().any(fixed) => Curve::Rational,
            _ => Curve::Exponential,
        }
    }

    /// The same under the rational Stribeck curve, of which nothing is known but what is given, if the file leaves to recordings which
    /// one it is.
    pub fn with_rational_curve(&self) -> Option<Self> {
        if self.law != Law::Stribeck || self.file_gives("curve") || self.exponent_of_law().is_none()
        {
            return None;
        }
        let mut rational = self.clone();
        let fall = rational.terms.iter_mut().find(|t| t.in_law && t.falls())?;
        fall.effect = &effects::law::RATIONAL;
        fall.parameters.truncate(fall.effect.parameters().len());
        *fall = fall.forgotten();
        fall.parameters.iter().any(|p| !p.known).then_some(rational)
    }

    /// The unit of a quantity on this axis.
    pub fn unit(&self, quantity: Quantity) -> &'static str {
        if quantity == Quantity::Gain {
            return match (self.motion, self.input.as_str()) {
                (Motion::Rotary, "voltage") => "N*m/V",
                (Motion::Rotary, "current") => "N*m/A",
                (Motion::Linear, "voltage") => "N/V",
                (Motion::Linear, "current") => "N/A",
                _ => "1",
            };
        }
        if quantity == Quantity::Input {
            return match self.input.as_str() {
                "voltage" => "V",
                "current" => "A",
                _ => quantity.unit(self.motion),
            };
        }
        quantity.unit(self.motion)
    }

    /// The model with one more effect, all of its parameters to be estimated.
    #[must_use]
    pub fn with_effect(&self, effect: &'static dyn Effect) -> Self {
        let mut model = self.clone();
        model.terms.push(Term {
            effect,
            parameters: vec![Parameter::unknown(); effect.parameters().len()],
            in_law: false,
        });
        model
    }

    /// What decides whether an effect can be told on this axis.
    pub fn given(&self) -> Given {
        Given {
            motion: self.motion,
            driven: self.causality == Causality::Forward,
            inertia: self.inertia.known && self.gain.known,
            friction: self.coulomb.known || self.viscous.known,
        }
    }

    /// What the parameters of effects are measured against; zero and one where unknown.
    pub fn scale(&self) -> Scale {
        Scale {
            coulomb: self.coulomb.value.unwrap_or(0.0),
            gain: self.gain.value.unwrap_or(1.0),
        }
    }

    /// The inertia that moves, by its place among [`Model::parameters`]: the given one, or what takes its place.
    pub fn moving_inertia(&self) -> usize {
        let mut at = 4;
        for term in &self.terms {
            if term.effect.seat() == Seat::Inertia {
                return at;
            }
            at += term.parameters.len();
        }
        0
    }

    /// Whether an effect is part of the model already.
    pub fn has(&self, id: &str) -> bool {
        self.terms.iter().any(|t| t.effect.id() == id)
    }

    /// The first parameter without a value, as the user would look for it in the file.
    pub fn first_unknown(&self) -> Option<String> {
        let labels = self.labels();
        let Some(at) = self.parameters().iter().position(|p| p.value.is_none()) else {
            let mut constants = self.constants.iter();
            return constants
                .find(|c| c.parameter.value.is_none())
                .map(|c| c.key.clone());
        };
        let label = &labels[at];
        Some(match (label.effect, label.name) {
            (Some(_), _) => format!("effects.{label}"),
            (None, name @ ("inertia" | "gain")) => format!("plant.{name}"),
            (None, name) => format!("friction.{name}"),
        })
    }
}
