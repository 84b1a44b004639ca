//! The catalogue of physical effects.
//!
//! One effect, one file: its equation, its weak-form columns, its simulation term (the same basis, summed), its
//! bounds, its doc and its test. A new effect is a new file and one line in the list below; `identify`,
//! `diagnose`, `simulate`, `explain` and the tests pick it up from there.
//!
//! Most effects are a torque (or force) that resists motion, linear in its coefficients for given *inner* parameters:
//! `τ = Σⱼ cⱼ·bⱼ(inner; t, q, v, s, u)`. Others sit elsewhere in the equation of motion: see [`Seat`]. Inner parameters (a
//! Stribeck velocity, a delay, the instants of a load step, …) are scanned: see [`Search`].

mod backlash_braked;
mod backlash_load_side;
mod compliance_load_side;
mod creep;
mod hardening_spring_off_centre;
mod input_dead_zone_jump;
mod load_dependent_friction_two_way;
mod overtone;
mod path;
mod point;
mod position_dependent_friction_spot;
mod position_dependent_viscous;
mod quantity;
mod saturation_soft;
mod sensor_eccentricity_harmonic;
mod spring_off_centre;
mod swing;
mod thermal_drift_from_cold;
mod wave;

pub use backlash::CONTACT;
pub use creep::CREEP;
pub use path::{Gap, Path, Swing};
pub use point::{Given, Moment, Point, Scale, Survey};
pub use quantity::{Quantity, Spec};
pub use wave::Wave;

use crate::motion::Motion;

/// Where an effect sits in the equation of motion `J·q̈ = k·u − τ`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seat {
    /// In `τ`, by [`Effect::basis`].
    Torque,
    /// In `u`, by [`Effect::transmit`].
    Input,
    /// In the measured `q`, by [`Effect::error`].
    Sensor,
    /// In `τ`, by [`Effect::basis`] and the second derivative of [`Effect::error`] over time.
    Momentum,
    /// In a load behind the measured side, by [`Effect::load`]: its coefficient is the part of `J` that hangs there.
    Load,
    /// In `J`: its first parameter takes the place of the inertia that the model gives.
    Inertia,
}

/// How inner parameters are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// Each value of [`Effect::grid`] is tried, and the best refined between its neighbours.
    Grid,
    /// Both inner parameters are instants: the ends of the interval in time in which the effect acts.
    Interval,
    /// The inner parameter is a frequency in time, in Hz, of a sine and a cosine.
    Line,
}

/// What joins a load to the driven side: a spring and a damper, beyond a gap if there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Inertia of the load, kg·m² or kg.
    pub inertia: f64,
    /// Torque or force per displacement.
    pub stiffness: f64,
    /// Torque or force per speed.
    pub damping: f64,
    /// Displacement in all within which nothing joins them, rad or m.
    pub gap: f64,
    /// Coulomb friction that brakes the load rather than the driven side, N·m or N.
    pub friction: f64,
    /// Viscous friction that does, per rad/s or m/s.
    pub viscous: f64,
    /// Whether the encoder measures the load, and not the driven side.
    pub load_side: bool,
}

/// Where a load stands that the measured side carries along, and what its friction does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Carried {
    /// Position at every sample, relative to the measured one, rad or m.
    pub ahead: Vec<f64>,
    /// What the load's own friction resists more than it would if the load moved as the measured side does, over the load's
    /// inertia: means over the intervals between the samples, rad/s² or m/s². Empty if all friction is the measured side's.
    pub resisting: Vec<f64>,
}

impl Coupling {
    /// What drives the load while it is ahead by `y` and moves ahead at `rate`.
    pub fn torque(&self, y: f64, rate: f64) -> f64 {
        let beyond = y - y.clamp(-0.5 * self.gap, 0.5 * self.gap);
        if self.gap == 0.0 {
            return -self.stiffness * y - self.damping * rate;
        }
        if beyond == 0.0 {
            return 0.0;
        }
        // The wall at an end pushes and does not pull.
        let push = self.stiffness * beyond.abs() + self.damping * rate * beyond.signum();
        -push.max(0.0) * beyond.signum()
    }
}

/// A confusion that one kind of data cannot resolve.
#[derive(Clone, Copy, Debug)]
pub struct Confusion {
    /// The other effect.
    pub id: &'static str,
    /// The experiment that decides, in one sentence.
    pub tell_apart_by: &'static str,
}

/// Physics outside the catalogue, with as many parameters as the effect that it is taken for. Where it fits better in the place
/// of that effect, what is left out has no name.
#[derive(Clone, Copy)]
pub struct Impostor {
    /// Its equation.
    pub effect: &'static dyn Effect,
    /// What it depends on.
    pub coordinate: &'static str,
}

/// Parameters on which an effect depends nonlinearly: the scanned one and, where there is one, a second.
pub type Inner = [f64; 2];

/// Share of the inertia that is the motor's where an encoder on the load cannot tell: gears are chosen so that both sides weigh
/// alike.
pub const MOTOR: f64 = 0.5;

/// The inner parameters of an effect that has none.
const FREE: Inner = [0.0; 2];

/// One effect of the catalogue.
pub trait Effect: Sync {
    /// The stable id.
    fn id(&self) -> &'static str;
    /// The name that a person reads.
    fn name(&self) -> &'static str;
    /// The file's own documentation: what `explain` prints.
    fn doc(&self) -> &'static str;
    /// The parameters, in the order used throughout.
    fn parameters(&self) -> &'static [Spec];
    /// Effects that it is confused with.
    fn confusions(&self) -> &'static [Confusion];
    /// One sentence that a person can act on, from the estimated parameters.
    fn sentence(&self, parameters: &[f64], motion: Motion) -> String;

    /// The same physics in other forms, which take other parameters: with more to it, or as an encoder on the load shows it.
    /// They have the same id.
    fn other_forms(&self) -> &'static [&'static dyn Effect] {
        &[]
    }
    /// What is taken for it and is no effect of the catalogue, if there is such physics.
    fn impostor(&self) -> Option<Impostor> {
        None
    }
    /// Why the effect cannot be told on such an axis, if it cannot: what follows "because".
    fn unsuited(&self, _axis: Given) -> Option<&'static str> {
        None
    }
    /// Where it sits in the equation of motion.
    fn seat(&self) -> Seat {
        Seat::Torque
    }
    /// Whether it is a load behind the measured side.
    fn hangs(&self) -> bool {
        self.seat() == Seat::Load
    }
    /// Whether the inertia is in two parts with it, of which one swings or rattles: there can be one such effect.
    fn divides(&self) -> bool {
        self.hangs()
    }
    /// Whether it is the form of an effect that an encoder on the load shows.
    fn on_load_side(&self) -> bool {
        self.divides() && !self.hangs()
    }
    /// Whether it is no effect of the catalogue but what such effects must not be taken for: it is sought beside them and
    /// neither named nor simulated.
    fn nuisance(&self) -> bool {
        false
    }
    /// Whether its torque depends on the input.
    fn driven(&self) -> bool {
        false
    }
    /// Whether its torque depends on time.
    fn timed(&self) -> bool {
        false
    }
    /// Whether it may act faster than windows of the usual width pass.
    fn fast(&self) -> bool {
        false
    }
    /// The form with less to it in which its inner parameters are found, if they are.
    fn found_as(&self) -> Option<&'static dyn Effect> {
        None
    }
    /// Whether it is sought only in the place of the plain form that was found: by itself it bends to too much else.
    fn refines(&self) -> bool {
        false
    }
    /// Whether recordings can show it with these inner parameters.
    fn shows(&self, _inner: Inner, _survey: &Survey) -> bool {
        true
    }
    /// How its inner parameters are found.
    fn search(&self) -> Search {
        Search::Grid
    }
    /// Number of linear coefficients.
    fn width(&self) -> usize {
        1
    }
    /// Which parameter is the scanned one, if any.
    fn inner(&self) -> Option<usize> {
        None
    }
    /// Which parameter makes it what it is, if one does: at none of it, it is another effect of the catalogue.
    fn essential(&self) -> Option<usize> {
        None
    }
    /// The effect of the catalogue that is a part of it: both together are it alone.
    fn includes(&self) -> Option<&'static str> {
        None
    }
    /// Which parameter is a second inner one, if any; without a search of its own it is only refined.
    fn shape(&self) -> Option<usize> {
        None
    }
    /// The value of the second inner parameter where nothing says otherwise, if there is one.
    fn textbook(&self) -> Option<f64> {
        None
    }
    /// Values of the second inner parameter to try with each value of the scanned one.
    fn shapes(&self, _survey: &Survey) -> Vec<f64> {
        vec![self.textbook().unwrap_or_default()]
    }
    /// Values of the scanned parameter to try, ascending; neighbours bracket an optimum.
    fn grid(&self, _survey: &Survey) -> Vec<f64> {
        vec![0.0]
    }
    /// The resisting torque of each unit coefficient, into `out` (length [`Effect::width`]).
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        // Both places first, so that sine and cosine are computed in one.
        if let (Some(wave), [sin, cos, ..]) = (self.wave(inner), out) {
            (*sin, *cos) = wave.at(&at);
        }
    }
    /// The same at many points, one signal for each coefficient: within the loop it is known which effect it is.
    fn bases(&self, inner: Inner, points: &[Point], signals: &mut [Vec<f64>]) {
        let mut out = vec![0.0; signals.len()];
        for &at in points {
            self.basis(inner, at, &mut out);
            signals.iter_mut().zip(&out).for_each(|(s, b)| s.push(*b));
        }
    }
    /// The wave that its basis is, if it is one: then many values of its scanned parameter are tried together.
    fn wave(&self, _inner: Inner) -> Option<Wave> {
        None
    }
    /// What the effect does to the way of the input, for named parameters.
    fn transmit(&self, _parameters: &[f64], _path: &mut Path) {}
    /// The error of the measured position where the true one is `q`, of each unit coefficient, and its slope over `q`, into
    /// `out`; of what sits in the momentum, what takes the place of the error.
    fn error(&self, _q: f64, _out: &mut [(f64, f64)]) {}
    /// Where a load that the measured motion carries along stands, relative to the measured position `q`; `v` is the
    /// smoothed velocity.
    fn load(&self, _inner: Inner, _q: &[f64], _v: &[f64], _period: f64) -> Carried {
        Carried::default()
    }
    /// What the load hangs on, for simulation, on an axis of some inertia and some friction, Coulomb and viscous, of both
    /// sides together.
    fn coupling(
        &self,
        _parameters: &[f64],
        _inertia: f64,
        _friction: [f64; 2],
    ) -> Option<Coupling> {
        None
    }
    /// Named parameters from the linear solution. As it stands, the coefficients and then the inner parameters.
    fn named(&self, inner: Inner, coefficients: &[f64], _scale: Scale) -> Vec<f64> {
        let inner = inner.into_iter();
        let all = coefficients.iter().copied().chain(inner);
        all.take(self.parameters().len()).collect()
    }
    /// The linear solution from named parameters: inner parameters and coefficients. As it stands, the other way round.
    fn linear(&self, parameters: &[f64], _scale: Scale) -> (Inner, Vec<f64>) {
        let (coefficients, rest) = parameters.split_at(self.width());
        let mut inner = FREE;
        inner[..rest.len()].copy_from_slice(rest);
        (inner, coefficients.to_vec())
    }
    /// Whether it shapes friction next to standstill, beside a Coulomb level that must then oppose motion: next to one that comes out
    /// negative it only bends the curve to what else is left out.
    fn shapes_level(&self) -> bool {
        false
    }
    /// Whether physics allows these coefficients.
    fn admissible(&self, _coefficients: &[f64]) -> bool {
        true
    }
    /// Stiffness of bristles between the surfaces, through which all friction then acts; `None` for a stiff contact.
    fn bristle_stiffness(&self, _parameters: &[f64]) -> Option<f64> {
        None
    }
    /// Further quantities worth reporting with a finding: name, quantity, value as a function of all that is
    /// needed (own parameters, Coulomb, viscous).
    fn derived(&self) -> &'static [Derived] {
        &[]
    }
}

/// Room for the basis of any effect.
pub const WIDEST: usize = 6;

/// What an effect of these coefficients adds to a measured position where the true one is `q`, and its slope.
pub fn error(effect: &dyn Effect, coefficients: &[f64], q: f64) -> (f64, f64) {
    let mut units = [(0.0, 0.0); WIDEST];
    effect.error(q, &mut units);
    let each = coefficients.iter().zip(units);
    each.fold((0.0, 0.0), |sum, (c, (value, slope))| {
        (sum.0 + c * value, sum.1 + c * slope)
    })
}

/// Where an axis stands that a sensor shows at `shown`, if its error there, which comes with its slope, is added: by Newton's
/// method from a guess, as slopes are above -1.
pub fn behind(shown: f64, guess: f64, error: impl Fn(f64) -> (f64, f64)) -> f64 {
    const ITERATIONS: usize = 30;
    /// After a step like this a next one would be as its square, which is no more than rounding.
    const SMALL: f64 = 1e-7;
    let mut q = guess;
    for _ in 0..ITERATIONS {
        let (value, slope) = error(q);
        let step = (shown - value - q) / (1.0 + slope);
        q += step;
        if step.abs() < SMALL {
            break;
        }
    }
    q
}

/// A quantity that follows from an effect's parameters and the friction law: `a·own[0] + b·coulomb + c·viscous`.
#[derive(Clone, Copy, Debug)]
pub struct Derived {
    /// Name in the JSON.
    pub name: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// Weights of the effect's first parameter, of Coulomb and of viscous friction.
    pub weights: [f64; 3],
}

/// Declares the modules of the catalogue and lists them.
macro_rules! catalogue {
    ($($module:ident :: $effect:ident),* $(,)?) => {
        $(mod $module;)*
        /// Every effect that this version diagnoses.
        pub static ALL: &[&dyn Effect] = &[$(&$module::$effect),*];
    };
}

catalogue! {
    direction_asymmetry::DirectionAsymmetry,
    viscous_asymmetry::ViscousAsymmetry,
    stribeck::Stribeck,
    quadratic_drag::QuadraticDrag,
    power_law_viscous::PowerLawViscous,
    gravity::Gravity,
    spring::Spring,
    hardening_spring::HardeningSpring,
    cogging::Cogging,
    delay::Delay,
    presliding::Presliding,
    torque_ripple::TorqueRipple,
    load_step::LoadStep,
    periodic_disturbance::PeriodicDisturbance,
    thermal_drift::ThermalDrift,
    position_dependent_friction::PositionDependentFriction,
    load_dependent_friction::LoadDependentFriction,
    inertia_mismatch::InertiaMismatch,
    saturation::Saturation,
    input_dead_zone::InputDeadZone,
    actuator_lag::ActuatorLag,
    sensor_eccentricity::SensorEccentricity,
    backlash::Backlash,
    compliance::Compliance,
}

/// What friction laws with bristles are made of, beside the effects of the catalogue.
pub mod law {
    pub use super::presliding::{BRISTLES, DAMPED_BRISTLES};
    pub use super::stribeck::{EXPONENTIAL, RATIONAL};
}

/// Finds an effect by id.
pub fn find(id: &str) -> Option<&'static dyn Effect> {
    ALL.iter().copied().find(|e| e.id() == id)
}

/// Whether two are the same effect in the same form.
pub fn same_form(one: &dyn Effect, other: &dyn Effect) -> bool {
    let names = |effect: &dyn Effect| effect.parameters().iter().map(|spec| spec.name);
    one.id() == other.id() && names(one).eq(names(other))
}

/// Which of the forms of its effect one is; the plain one comes first.
pub fn form(effect: &dyn Effect) -> usize {
    let others = find(effect.id()).map_or(&[][..], Effect::other_forms);
    let other = others.iter().position(|form| same_form(*form, effect));
    other.map_or(0, |place| place + 1)
}

/// The text under a heading of an effect's documentation, on one line.
pub fn section(doc: &str, heading: &str) -> Option<String> {
    let lines = doc
        .lines()
        .map_while(|l| l.strip_prefix("//!"))
        .map(str::trim);
    let body: Vec<&str> = lines
        .skip_while(|l| l.strip_prefix("# ") != Some(heading))
        .skip(1)
        .take_while(|l| !l.starts_with("# "))
        .filter(|l| !l.is_empty())
        .collect();
    (!body.is_empty()).then(|| body.join(" "))
}

/// The experiment that tells two effects apart: as either of them documents it, else one that excites both.
pub fn tell_apart(one: &dyn Effect, other: &dyn Effect) -> String {
    let documented = |a: &dyn Effect, b: &dyn Effect| {
        let mut confusions = a.confusions().iter();
        confusions
            .find(|c| c.id == b.id())
            .map(|c| c.tell_apart_by.to_owned())
    };
    let excites = |e: &dyn Effect| section(e.doc(), "What excites it").unwrap_or_default();
    documented(one, other)
        .or_else(|| documented(other, one))
        .unwrap_or_else(|| {
            format!(
                "excite both in one recording; {}: {} {}: {}",
                one.id(),
                excites(one),
                other.id(),
                excites(other)
            )
        })
}

/// Amplitude and phase of `c₀·sin x + c₁·cos x = amplitude·sin(x + phase)`.
fn polar(c: &[f64]) -> [f64; 2] {
    [c[0].hypot(c[1]), c[1].atan2(c[0])]
}

/// The coefficients of sine and cosine: [`polar`] undone.
fn cartesian(amplitude: f64, phase: f64) -> Vec<f64> {
    vec![amplitude * phase.cos(), amplitude * phase.sin()]
}

/// Most periods per turn that are tried.
const MOST_PER_TURN: u32 = 120;
/// Most periods within the travel of a linear axis that are tried.
const MOST_IN_TRAVEL: u32 = 120;

/// Periods per turn, whole numbers from `first` on, or per metre, as far as the travel tells them apart and samples show
/// them: of which more than half a one goes by in a sampling interval passes for another, and at that for noise.
fn periodicities(survey: &Survey, first: u32) -> Vec<f64> {
    let all: Vec<f64> = match survey.motion {
        // Only a whole number of periods closes on itself.
        Motion::Rotary => (first..=MOST_PER_TURN).map(f64::from).collect(),
        Motion::Linear => {
            // Two frequencies are told apart by half a period over the travel; a third of that scans safely.
            let travel = (survey.travel.1 - survey.travel.0).max(f64::MIN_POSITIVE);
            (6..=3 * MOST_IN_TRAVEL)
                .map(|k| f64::from(k) / (3.0 * travel))
                .collect()
        }
    };
    let shown = |&periods: &f64| survey.hertz(periods) * survey.period < 0.5;
    let count = all.iter().take_while(|periods| shown(periods)).count();
    all[..count.max(1)].to_vec()
}

/// Why an axis cannot show what hangs on it, if it cannot.
fn undriven(axis: Given) -> Option<&'static str> {
    (!axis.driven).then_some(
        "under causality = \"inverse\" the motion is imposed, and what hangs behind it answers to nothing else",
    )
}

/// Why an axis cannot show that its input is cut, if it cannot.
fn uncut(axis: Given) -> Option<&'static str> {
    (!axis.driven)
        .then_some("under causality = \"inverse\" the input is a reaction, which nothing cuts")
}

/// `count` values from `low` to `high`, equal ratios apart.
fn geometric(low: f64, high: f64, count: usize) -> Vec<f64> {
    let ratio = (high / low).powf(1.0 / (count - 1) as f64);
    (0..count).map(|k| low * ratio.powf(k as f64)).collect()
}

#[cfg(test)]
mod tests;
