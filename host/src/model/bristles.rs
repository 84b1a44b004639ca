//! The law of the bristles that a model has, by its friction law or by an effect.

use bristle_core::friction::{Curve, Dahl, Dynamic, LuGre, ModifiedLuGre};

use super::{Law, Model, Term};

/// A friction law with a bristle state.
pub type Bristles = Box<dyn Dynamic<f64> + Send + Sync>;

/// The level of bristles under any exponent of the Stribeck curve: [`LuGre`] with
/// `g(v) = Fc + (Fs − Fc)·e^(−|v/vs|^exponent)`.
struct Shaped {
    lugre: LuGre<f64>,
    exponent: f64,
}

impl Dynamic<f64> for Shaped {
    fn level(&self, velocity: f64) -> f64 {
        let LuGre {
            coulomb,
            static_level,
            stribeck_velocity,
            ..
        } = self.lugre;
        let decay = (-(velocity / stribeck_velocity).abs().powf(self.exponent)).exp();
        coulomb + (static_level - coulomb) * decay
    }
    fn stiffness(&self) -> f64 {
        self.lugre.bristle_stiffness
    }
    fn damping(&self) -> f64 {
        self.lugre.bristle_damping
    }
    fn viscosity(&self) -> f64 {
        self.lugre.viscous
    }
}

/// Bristles need a level to yield at; a fit may come by zero.
const LEAST_LEVEL: f64 = 1e-12;

fn value(term: &Term, k: usize) -> f64 {
    term.parameters
        .get(k)
        .and_then(|p| p.value)
        .unwrap_or_default()
}

impl Term {
    /// Whether this term puts bristles between the surfaces.
    pub fn bends(&self) -> bool {
        self.bristle_stiffness_of(1.0).is_some()
    }

    /// Stiffness of the bristles that this term puts between the surfaces, if it does and has a value for it.
    pub fn bristle_stiffness(&self) -> Option<f64> {
        let inner = self.parameters.get(self.effect.inner()?)?;
        self.bristle_stiffness_of(inner.value?)
    }

    fn bristle_stiffness_of(&self, inner: f64) -> Option<f64> {
        let mut values: Vec<f64> = (0..self.parameters.len()).map(|k| value(self, k)).collect();
        *values.get_mut(self.effect.inner()?)? = inner;
        self.effect.bristle_stiffness(&values)
    }

    /// Whether this term belongs to the law of the bristles, where a model has any.
    pub fn is_of_contact(&self) -> bool {
        self.falls() || self.bends()
    }

    /// Whether this term is the part of friction that falls with speed.
    pub fn falls(&self) -> bool {
        self.effect.id() == "stribeck"
    }
}

impl Model {
    /// Which term has the bristles, if the model has any.
    pub fn bristle_term(&self) -> Option<usize> {
        self.terms.iter().position(Term::bends)
    }

    /// Whether its friction law has inner parameters, a Stribeck velocity or bristles: the law that the file names, which a fit may
    /// have left without them.
    pub fn has_curved_law(&self) -> bool {
        self.law != Law::CoulombViscous
    }

    /// Begins the fall of a friction law that is still open where the bristles are as they are without it: from their level.
    pub fn begin_fall(&self, term: &mut Term) {
        if term.falls() && self.bristle_term().is_some() {
            let level = &mut term.parameters[0];
            level.value = level.value.or(self.coulomb.value);
        }
    }

    /// Bits of all that the deflection of the bristles depends on: levels, fall and stiffness.
    pub fn bristle_key(&self) -> [u64; 5] {
        let fall = self.terms.iter().find(|t| t.falls());
        let of_fall = |k| fall.map_or(0.0, |t| value(t, k));
        let bristles = self.bristle_term().map(|k| &self.terms[k]);
        let coulomb = self.coulomb.value.unwrap_or_default();
        let stiffness = bristles.map_or(0.0, |t| value(t, 0));
        [coulomb, of_fall(0), of_fall(1), of_fall(2), stiffness].map(f64::to_bits)
    }

    /// Level of friction at rest, as far as it has a value.
    pub fn level_at_rest(&self) -> f64 {
        let falls = self.terms.iter().filter(|term| term.falls());
        let levels = falls.map(|term| value(term, 0));
        levels
            .fold(self.coulomb.value.unwrap_or_default(), f64::max)
            .max(0.0)
    }

    /// How far its bristles bend at rest before they yield, if it has any and their level is known so far.
    pub fn breakaway(&self) -> Option<f64> {
        let law = (self.level_at_rest() > LEAST_LEVEL).then(|| self.bristles())??;
        Some(law.level(0.0) / law.stiffness())
    }

    /// Makes bristles whose stiffness is not known as stiff as yields after this distance.
    pub fn break_away_after(&mut self, distance: f64) {
        let (Some(now), Some(bristles)) = (self.breakaway(), self.bristle_term()) else {
            return;
        };
        let stiffness = self.terms[bristles].effect.inner();
        if let Some(stiffness) = stiffness.map(|k| &mut self.terms[bristles].parameters[k])
            && !stiffness.known
        {
            let kept = stiffness.value.map(|value| value * now / distance);
            stiffness.value = kept.map(|value| stiffness.clamp(value));
        }
    }

    /// The law of the model's bristles, if it has any: what its Coulomb level, viscous friction, Stribeck curve and
    /// bristles make together. Other parameters without a value count as zero; bristles without one are stiff: none.
    pub fn bristles(&self) -> Option<Bristles> {
        let term = &self.terms[self.bristle_term()?];
        let bristle_stiffness = term.bristle_stiffness()?.max(f64::MIN_POSITIVE);
        let coulomb = self.coulomb.value.unwrap_or_default().max(LEAST_LEVEL);
        let viscous = self.viscous.value.unwrap_or_default();
        let bristle_damping = value(term, 1);
        let Some(fall) = self.terms.iter().find(|t| t.falls()) else {
            let dahl = Dahl {
                coulomb,
                viscous,
                bristle_stiffness,
            };
            return Some(if bristle_damping == 0.0 {
                Box::new(dahl)
            } else {
                Box::new(LuGre {
                    coulomb,
                    viscous,
                    static_level: coulomb,
                    stribeck_velocity: 1.0,
                    bristle_stiffness,
                    bristle_damping,
                })
            });
        };
        let lugre = LuGre {
            coulomb,
            viscous,
            static_level: value(fall, 0).max(LEAST_LEVEL),
            stribeck_velocity: value(fall, 1).max(f64::MIN_POSITIVE),
            bristle_stiffness,
            bristle_damping,
        };
        let exponent = fall.parameters.get(2).and_then(|p| p.value);
        Some(match exponent {
            Some(exponent) if exponent != 2.0 => Box::new(Shaped { lugre, exponent }),
            _ if self.curve() == Curve::Rational => Box::new(ModifiedLuGre {
                coulomb,
                viscous,
                static_level: lugre.static_level,
                stribeck_velocity: lugre.stribeck_velocity,
                bristle_stiffness,
                bristle_damping,
            }),
            _ => Box::new(lugre),
        })
    }
}
