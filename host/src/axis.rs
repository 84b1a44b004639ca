//! The equation of motion of a complete model, ready to be integrated.

use std::cmp::Ordering;

use bristle_core::friction::{CoulombViscous, Dynamic, Friction};

use crate::effects::{self, Coupling, Effect, Inner, Moment, Path, Point, Seat, Swing, WIDEST};
use crate::error::{Error, Result};
use crate::model::{Bristles, Model, Parameter, Term};
use crate::motion::Motion;
use crate::slack::{Forces, Slack};
use crate::system;
use crate::weak::Track;

/// Position and velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Position, rad or m.
    pub q: f64,
    /// Velocity, rad/s or m/s.
    pub v: f64,
}

/// What resists motion at one place: a friction law and the effects beside it.
pub struct Contact {
    law: CoulombViscous<f64>,
    bristles: Option<Bristles>,
    terms: Vec<(&'static dyn Effect, Inner, Vec<f64>)>,
    motion: Motion,
}

/// A model with numbers: `J·v̇ = k·u − F(q, v)`.
pub struct Axis {
    /// `J`.
    pub inertia: f64,
    /// `k`.
    pub gain: f64,
    /// What velocity takes off `u`, per rad/s or m/s.
    pub back_emf: f64,
    /// The way of the input to the axis; a spring or a gap on it is the coupling, too.
    pub path: Path,
    /// `F`.
    pub contact: Contact,
    /// Part of the inertia that hangs behind the driven side, if any does.
    pub coupling: Option<Coupling>,
    /// The effect that hangs it there, with its inner parameters.
    hanging: Option<(&'static dyn Effect, Inner)>,
    /// Errors in the measured position, with their coefficients.
    errors: Vec<(&'static dyn Effect, Vec<f64>)>,
}

impl Contact {
    /// The friction law and the effects of a model in which every value is known.
    pub fn new(model: &Model) -> Self {
        Self::law(model).with_effects(model)
    }

    /// The friction law of a model alone.
    pub fn law(model: &Model) -> Self {
        let value = |p: &Parameter| p.value.unwrap_or(0.0);
        let law = CoulombViscous {
            coulomb: value(&model.coulomb),
            viscous: value(&model.viscous),
        };
        let bristles = model.bristles();
        let within = |term: &Term| bristles.is_some() && term.is_of_contact();
        Self {
            terms: numbers(model, |term| term.in_law && !within(term)),
            law: if bristles.is_some() { NONE } else { law },
            bristles,
            motion: model.motion,
        }
    }

    /// The effects of a model alone.
    pub fn effects(model: &Model) -> Self {
        let none = Self {
            law: NONE,
            bristles: None,
            terms: Vec::new(),
            motion: model.motion,
        };
        none.with_effects(model)
    }

    fn with_effects(mut self, model: &Model) -> Self {
        let bristles = model.bristle_term().is_some();
        let within = |term: &Term| bristles && term.is_of_contact();
        self.terms
            .extend(numbers(model, |term| !term.in_law && !within(term)));
        self
    }

    /// One more effect, in its own linear form.
    pub fn push(&mut self, effect: &'static dyn Effect, inner: Inner, coefficients: Vec<f64>) {
        self.terms.push((effect, inner, coefficients));
    }

    /// An effect whose torque jumps where velocity changes sign, if there is one.
    pub fn jumping(&self) -> Option<&'static dyn Effect> {
        let jumps = |(effect, inner, _): &&(&'static dyn Effect, Inner, Vec<f64>)| {
            let at = |s: f64| {
                let mut basis = [0.0; WIDEST];
                let moment = Moment {
                    u: 1.0,
                    ..Moment::default()
                };
                let at = Point::new(self.motion, 0.0, 0.0, s).at(moment);
                effect.basis(*inner, at, &mut basis);
                basis
            };
            at(1.0) != at(-1.0)
        };
        self.terms.iter().find(jumps).map(|(effect, ..)| *effect)
    }

    /// The law, if it is one with a bristle state.
    pub fn bristles(&self) -> Option<&dyn Dynamic<f64>> {
        self.bristles.as_ref().map(|law| law.as_ref() as _)
    }

    /// The viscous coefficient, where resistance beside it depends on the direction of sliding alone.
    pub fn lone_viscous(&self) -> Option<f64> {
        let plain = self.terms.is_empty() && self.bristles.is_none();
        plain.then_some(self.law.viscous)
    }

    /// Whether anything here depends on the input.
    pub fn driven(&self) -> bool {
        self.terms.iter().any(|(effect, ..)| effect.driven())
    }

    /// Everything that resists steady sliding in direction `s`, in N·m or N, while nothing drives, at the first instant.
    pub fn steady(&self, state: State, s: f64) -> f64 {
        self.resisting(Moment::default(), state, s)
    }

    /// The same under an input, at some moment.
    fn resisting(&self, moment: Moment, state: State, s: f64) -> f64 {
        let v = state.v;
        let bristles = |law: &Bristles| s * law.level(v) + law.viscosity() * v;
        self.resistance(moment, state, s) + self.bristles.as_ref().map_or(0.0, bristles)
    }

    /// Everything that resists motion at `q`, `v` while sliding in direction `s`, in N·m or N, but for bristles; under
    /// these, `s` is their force over its level.
    pub fn resistance(&self, moment: Moment, State { q, v }: State, s: f64) -> f64 {
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
        let at = Point::new(self.motion, q, v, s).at(moment);
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

/// No friction.
const NONE: CoulombViscous<f64> = CoulombViscous {
    coulomb: 0.0,
    viscous: 0.0,
};

/// Some of a model's terms in linear form.
fn numbers(
    model: &Model,
    wanted: impl Fn(&Term) -> bool,
) -> Vec<(&'static dyn Effect, Inner, Vec<f64>)> {
    let in_torque =
        |t: &&Term| t.effect.seat() == Seat::Torque && t.effect.width() > 0 && !t.effect.nuisance();
    let terms = model.terms.iter().filter(|t| wanted(t)).filter(in_torque);
    terms
        .map(|t| {
            let (inner, coefficients) = t.effect.linear(&system::values(t), model.scale());
            (t.effect, inner, coefficients)
        })
        .collect()
}

/// The effect that hangs a load behind the measured side, if one does.
fn hanging(model: &Model) -> Option<(&'static dyn Effect, Inner)> {
    let mut loads = model.terms.iter().filter(|t| t.effect.hangs());
    let term = loads.next()?;
    let (inner, _) = term.effect.linear(&system::values(term), model.scale());
    Some((term.effect, inner))
}

/// What hangs behind the driven side, which a load without inertia does not; refuses two loads, and one that is all of the
/// inertia.
fn coupling(model: &Model, inertia: f64) -> Result<Option<Coupling>> {
    let friction = [&model.coulomb, &model.viscous].map(|p| p.value.unwrap_or_default());
    let of = |t: &Term| {
        let coupling = t.effect.coupling(&system::values(t), inertia, friction)?;
        Some((t.effect.id(), coupling))
    };
    let mut all = model.terms.iter().filter_map(of);
    let (first, second) = (all.next(), all.next());
    if let (Some((one, _)), Some((other, _))) = (first, second) {
        return Err(Error::Usage(format!(
            "[effects.{one}] and [effects.{other}] each hang a load on the axis, and only one can; leave one out"
        )));
    }
    match first {
        Some((_, coupling)) if coupling.inertia == 0.0 => Ok(None),
        Some((id, coupling)) if coupling.inertia < 0.0 || coupling.inertia >= inertia => {
            Err(Error::Usage(format!(
                "effects.{id}.load_inertia must lie between zero and plant.inertia, of which it is a part"
            )))
        }
        _ => Ok(first.map(|(_, coupling)| coupling)),
    }
}

/// The inertia that a winding lets an input feel, `J − k·ke·τ`: back-EMF passes the winding's lag, `v − τ·v̇` to the first
/// order, so that it takes less off where the axis speeds up. Both make an oscillator where `k·ke·τ` exceeds a quarter of
/// `J`, which this does not describe.
fn felt(inertia: f64, gain: f64, model: &Model) -> f64 {
    let helped = gain * model.back_emf() * model.winding_lag();
    inertia - helped.min(0.25 * inertia)
}

/// Refuses a model in which a value is missing; the message names the first one.
pub fn complete(model: &Model) -> Result<()> {
    match model.first_unknown() {
        None => Ok(()),
        Some(missing) if model.constants.iter().any(|c| c.key == missing) => Err(Error::Usage(
            format!("the model has no value for {missing}; write a number, as it is not estimated"),
        )),
        Some(missing) => Err(Error::Usage(format!(
            "the model has no value for {missing}; take the file that bristle identify --model-out writes, or write a number"
        ))),
    }
}

impl Axis {
    /// Takes the numbers out of a model of an axis with a law that fits know; a message names the first one missing.
    pub fn new(model: &Model) -> Result<Self> {
        match model.unfittable() {
            Some((_, what)) => Err(Error::Usage(what)),
            None => Self::simulated(model),
        }
    }

    /// The same with any law, for simulation.
    pub fn simulated(model: &Model) -> Result<Self> {
        complete(model)?;
        let moving = model.parameters()[model.moving_inertia()];
        let of_sensor = |t: &&Term| t.effect.seat() == Seat::Sensor;
        let errors = model.terms.iter().filter(of_sensor).map(|t| {
            let (_, coefficients) = t.effect.linear(&system::values(t), model.scale());
            (t.effect, coefficients)
        });
        let gain = model.gain.value.unwrap_or_default();
        Ok(Self {
            inertia: felt(moving.value.unwrap_or_default(), gain, model),
            gain,
            back_emf: model.back_emf(),
            path: system::path(model),
            contact: Contact::new(model),
            coupling: coupling(model, moving.value.unwrap_or_default())?,
            hanging: hanging(model),
            errors: errors.collect(),
        })
    }

    /// Whether how it goes on depends on more than the position and the velocity that an encoder sees.
    pub fn remembers_more(&self) -> bool {
        let within = self.coupling.is_some() || self.contact.bristles.is_some();
        within || self.path.lag > 0.0 || !self.errors.is_empty()
    }

    /// Where the load stands at every node of a track, and how fast it moves, both relative to the driven side; empty without
    /// a load.
    pub fn carried(&self, track: &Track) -> Vec<[f64; 2]> {
        match self.coupling {
            Some(coupling) if coupling.load_side => self.pulled(track, coupling),
            _ => self.drawn_along(&track.v, track.period),
        }
    }

    /// The same of a load that is measured: it is pulled by a spring, which what moves the axis bends, or through a gap.
    fn pulled(&self, track: &Track, coupling: Coupling) -> Vec<[f64; 2]> {
        if coupling.gap > 0.0 {
            let forces = Forces {
                gain: self.gain,
                back_emf: self.back_emf,
                inertia: self.inertia,
                coulomb: self.contact.law.coulomb,
                viscous: self.contact.law.viscous,
            };
            return Slack::new(track, &track.input(&self.path), &forces, &self.path).load;
        }
        let input = self.driven_by(track);
        let swung = self
            .path
            .swung(&input, track.period)
            .map(|(_, swing)| swing);
        let (omega, driven) = (self.path.resonance, self.inertia - coupling.inertia);
        let behind =
            |swing: Swing| [-swing.a, -swing.b * omega].map(|x| x / (driven * omega.powi(2)));
        let first = Swing::at_ease(input.first().copied().unwrap_or_default());
        [first].into_iter().chain(swung).map(behind).collect()
    }

    /// Torque or force that moves the axis in every cell of a track, friction taken off; none while it rests.
    fn driven_by(&self, track: &Track) -> Vec<f64> {
        let input = track.input(&self.path);
        let cells = track.cells.iter().zip(&track.sliding).zip(input);
        let net = |((cell, sliding), u): ((&Point, &f64), f64)| {
            let state = self.truth(State {
                q: cell.q,
                v: cell.v,
            });
            let moment = Moment { u, ..cell.moment };
            let friction = self.contact.resisting(moment, state, cell.s);
            sliding * (self.gain * (u - self.back_emf * state.v) - friction)
        };
        cells.map(net).collect()
    }

    /// The same of a load behind the measured side, which moves at velocity `v`; empty if there is none.
    fn drawn_along(&self, v: &[f64], period: f64) -> Vec<[f64; 2]> {
        let Some((effect, inner)) = self.hanging else {
            return Vec::new();
        };
        // Of the smoothed motion: an encoder's counts would shake the load.
        let mut q = vec![0.0; v.len()];
        for k in 1..v.len() {
            q[k] = q[k - 1] + 0.5 * (v[k - 1] + v[k]) * period;
        }
        let relative = effect.load(inner, &q, v, period).ahead;
        let last = relative.len() - 1;
        let rate = |k: usize| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
            (relative[b] - relative[a]) / ((b - a).max(1) as f64 * period)
        };
        (0..=last).map(|k| [relative[k], rate(k)]).collect()
    }

    /// What the sensor adds to a true position, and its slope.
    fn error(&self, q: f64) -> (f64, f64) {
        let mut sum = (0.0, 0.0);
        for (effect, coefficients) in &self.errors {
            let (value, slope) = effects::error(*effect, coefficients, q);
            sum = (sum.0 + value, sum.1 + slope);
        }
        sum
    }

    /// The true state behind a measured one.
    pub fn truth(&self, measured: State) -> State {
        if self.errors.is_empty() {
            return measured;
        }
        let q = effects::behind(measured.q, measured.q, |q| self.error(q));
        State {
            q,
            v: measured.v / (1.0 + self.error(q).1),
        }
    }

    /// What the sensor makes of a true state.
    pub fn seen(&self, truth: State) -> State {
        let (error, slope) = self.error(truth.q);
        State {
            q: truth.q + error,
            v: truth.v * (1.0 + slope),
        }
    }
}
