//! The equation of motion of a complete model, ready to be integrated.

use std::cmp::Ordering;

use bristle_core::friction::{CoulombViscous, Friction};

use crate::effects::{Effect, Inner, Point};
use crate::error::{Error, Result};
use crate::model::{Model, Term};
use crate::motion::Motion;
use crate::system;

/// What resists motion at one place: a friction law and the effects beside it.
pub struct Contact {
    law: CoulombViscous<f64>,
    terms: Vec<(&'static dyn Effect, Inner, Vec<f64>)>,
    motion: Motion,
}

/// A model with numbers: `J·v̇ = k·u − F(q, v)`.
pub struct Axis {
    /// `J`.
    pub inertia: f64,
    /// `k`.
    pub gain: f64,
    /// How much later than recorded the input acts, s.
    pub delay: f64,
    /// `F`.
    pub contact: Contact,
}

/// Room for the basis of any effect.
const WIDEST: usize = 4;

impl Contact {
    /// The friction law and the effects of a model in which every value is known.
    pub fn new(model: &Model) -> Self {
        let value = |p: &crate::model::Parameter| p.value.unwrap_or(0.0);
        let coulomb = value(&model.coulomb);
        let numbers = |t: &Term| {
            let (inner, coefficients) = t.effect.linear(&system::values(t), coulomb);
            (t.effect, inner, coefficients)
        };
        Self {
            law: CoulombViscous {
                coulomb,
                viscous: value(&model.viscous),
            },
            terms: model
                .terms
                .iter()
                .filter(|t| t.effect.width() > 0)
                .map(numbers)
                .collect(),
            motion: model.motion,
        }
    }

    /// Everything that resists motion at `q`, `v` while sliding in direction `s`, in N·m or N.
    pub fn resistance(&self, q: f64, v: f64, s: f64) -> f64 {
        // The branch of direction s goes on smoothly past v = 0, by reflection at the level it starts from: an
        // integration step may look a little way beyond the standstill that it will be cut at.
        let along = s * v;
        let friction = match along.partial_cmp(&0.0).unwrap_or(Ordering::Equal) {
            Ordering::Greater => self.law.sliding(along),
            Ordering::Equal => self.law.break_away(),
            Ordering::Less => 2.0 * self.law.break_away() - self.law.sliding(-along),
        };
        let mut sum = s * friction;
        if self.terms.is_empty() {
            return sum;
        }
        let at = Point::new(self.motion, q, v, s);
        let mut basis = [0.0; WIDEST];
        for (effect, inner, coefficients) in &self.terms {
            effect.basis(*inner, at, &mut basis);
            sum += coefficients
                .iter()
                .zip(&basis)
                .map(|(c, b)| c * b)
                .sum::<f64>();
        }
        sum
    }
}

impl Axis {
    /// Takes the numbers out of a model; a message names the first one missing.
    pub fn new(model: &Model) -> Result<Self> {
        if let Some(missing) = model.first_unknown() {
            return Err(Error::Usage(format!(
                "the model has no value for {missing}; run bristle identify first, or write a number"
            )));
        }
        Ok(Self {
            inertia: model.inertia.value.unwrap_or_default(),
            gain: model.gain.value.unwrap_or_default(),
            delay: system::delay(model),
            contact: Contact::new(model),
        })
    }

    /// Everything that resists motion at `q`, `v` while sliding in direction `s`, in N·m or N.
    pub fn resistance(&self, q: f64, v: f64, s: f64) -> f64 {
        self.contact.resistance(q, v, s)
    }
}
