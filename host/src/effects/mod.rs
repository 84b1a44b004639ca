//! The catalogue of physical effects.
//!
//! One effect, one file: its equation, its weak-form columns, its simulation term (the same basis, summed), its
//! bounds, its doc and its test. A new effect is a new file and one line in the list below; `identify`,
//! `diagnose`, `simulate`, `explain` and the tests pick it up from there.
//!
//! An effect is a torque (or force) that resists motion, linear in its coefficients for a given *inner* parameter:
//! `τ = Σⱼ cⱼ·bⱼ(inner; t, q, v, s)`. The inner parameter (a Stribeck velocity, a delay, …) is scanned.

use crate::motion::Motion;

/// An instant of the motion, as an effect sees it.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Position, rad or m.
    pub q: f64,
    /// Velocity, rad/s or m/s.
    pub v: f64,
    /// `2π` times turns (rotary: the position itself) or metres: what periodic effects count in.
    pub angle: f64,
    /// Direction of sliding, −1 to 1; a mean over the sampling interval where it changes inside. Under bristles, their
    /// force over its level, which follows the direction as far as they yield.
    pub s: f64,
    /// Rate of the bristles' deflection, rad/s or m/s; zero without bristles.
    pub bending: f64,
}

impl Point {
    /// The point of an axis that moves by `motion`.
    pub fn new(motion: Motion, q: f64, v: f64, s: f64) -> Self {
        let angle = if motion == Motion::Rotary {
            q
        } else {
            std::f64::consts::TAU * q
        };
        Self {
            q,
            v,
            angle,
            s,
            bending: 0.0,
        }
    }
}

/// What the recordings at hand cover: the ground on which inner parameters are scanned.
#[derive(Clone, Copy, Debug)]
pub struct Survey {
    /// Rotary or linear.
    pub motion: Motion,
    /// Sampling interval, s.
    pub period: f64,
    /// Half-width of the test functions, s.
    pub half_width: f64,
    /// Speed that 98 % of the samples stay below.
    pub top_speed: f64,
    /// Speed below which the sign of the measured velocity is in doubt.
    pub slow: f64,
    /// Smallest and largest position.
    pub travel: (f64, f64),
    /// Standard deviation of the position noise.
    pub position_noise: f64,
    /// Coulomb level, as far as it is known; zero before anything is.
    pub coulomb: f64,
}

/// What a parameter measures; the unit follows from it and from the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// kg·m² or kg.
    Inertia,
    /// Torque or force per unit of `u`.
    Gain,
    /// N·m or N.
    Torque,
    /// Torque or force per speed.
    Viscous,
    /// Torque or force per squared speed.
    Quadratic,
    /// Torque or force per speed to a power below one.
    PowerLaw,
    /// Torque or force per displacement.
    Stiffness,
    /// Torque or force per cubed displacement.
    Cubic,
    /// rad/s or m/s.
    Speed,
    /// rad or m.
    Position,
    /// rad.
    Phase,
    /// Periods per turn or per metre.
    Periodicity,
    /// s.
    Time,
    /// A pure number.
    Number,
}

impl Quantity {
    /// Whether only whole numbers make sense: what repeats within a turn closes on itself.
    pub fn is_whole(self, motion: Motion) -> bool {
        self == Self::Periodicity && motion == Motion::Rotary
    }

    /// The SI unit on an axis of this motion.
    pub fn unit(self, motion: Motion) -> &'static str {
        let (rotary, linear) = match self {
            Self::Inertia => ("kg*m^2", "kg"),
            Self::Torque => ("N*m", "N"),
            Self::Viscous => ("N*m*s/rad", "N*s/m"),
            Self::Quadratic => ("N*m*s^2/rad^2", "N*s^2/m^2"),
            Self::PowerLaw => ("N*m*(s/rad)^exponent", "N*(s/m)^exponent"),
            Self::Stiffness => ("N*m/rad", "N/m"),
            Self::Cubic => ("N*m/rad^3", "N/m^3"),
            Self::Speed => ("rad/s", "m/s"),
            Self::Position => ("rad", "m"),
            Self::Phase => ("rad", "rad"),
            Self::Periodicity => ("1/turn", "1/m"),
            Self::Time => ("s", "s"),
            Self::Gain | Self::Number => ("1", "1"),
        };
        if motion == Motion::Rotary {
            rotary
        } else {
            linear
        }
    }
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spec {
    /// Name in the model file and in the JSON.
    pub name: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// Values that physics allows.
    pub bounds: (f64, f64),
}

impl Spec {
    /// A parameter of any sign and size.
    const fn new(name: &'static str, quantity: Quantity) -> Self {
        Self::within(name, quantity, (f64::NEG_INFINITY, f64::INFINITY))
    }

    /// A parameter within bounds.
    const fn within(name: &'static str, quantity: Quantity, bounds: (f64, f64)) -> Self {
        Self {
            name,
            quantity,
            bounds,
        }
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

/// Parameters on which an effect depends nonlinearly: the scanned one and, where there is one, a shape.
pub type Inner = [f64; 2];

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

    /// Whether the effect exists on an axis of this motion.
    fn applies(&self, _motion: Motion) -> bool {
        true
    }
    /// Number of linear coefficients.
    fn width(&self) -> usize {
        1
    }
    /// Which parameter is the scanned one, if any.
    fn inner(&self) -> Option<usize> {
        None
    }
    /// Which parameter is a shape that is only refined, if any, and the value it starts from.
    fn shape(&self) -> Option<(usize, f64)> {
        None
    }
    /// Values of the scanned parameter to try, ascending; neighbours bracket an optimum.
    fn grid(&self, _survey: &Survey) -> Vec<f64> {
        vec![0.0]
    }
    /// The resisting torque of each unit coefficient, into `out` (length [`Effect::width`]).
    fn basis(&self, _inner: Inner, _at: Point, _out: &mut [f64]) {}
    /// Named parameters from the linear solution.
    fn named(&self, inner: Inner, coefficients: &[f64], coulomb: f64) -> Vec<f64>;
    /// The linear solution from named parameters: inner parameter and coefficients.
    fn linear(&self, parameters: &[f64], coulomb: f64) -> (Inner, Vec<f64>);
    /// Whether physics allows these coefficients.
    fn admissible(&self, _coefficients: &[f64]) -> bool {
        true
    }
    /// Stiffness of bristles between the surfaces, through which all friction then acts; `None` for a stiff contact.
    fn bristle_stiffness(&self, _parameters: &[f64]) -> Option<f64> {
        None
    }
    /// How much later than recorded the input acts, in seconds.
    fn delay(&self, _parameters: &[f64]) -> f64 {
        0.0
    }
    /// Further quantities worth reporting with a finding: name, quantity, value as a function of all that is
    /// needed (own parameters, Coulomb, viscous).
    fn derived(&self) -> &'static [Derived] {
        &[]
    }
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

/// An effect of the catalogue that this version does not diagnose yet.
#[derive(Clone, Copy, Debug)]
pub struct Planned {
    /// The stable id.
    pub id: &'static str,
    /// What it is.
    pub summary: &'static str,
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

macro_rules! planned {
    ($($id:literal : $summary:literal),* $(,)?) => {
        /// Effects that have an id but are not diagnosed yet.
        pub const PLANNED: &[Planned] = &[$(Planned { id: $id, summary: $summary }),*];
    };
}

planned! {
    "load-dependent-friction": "friction that grows with the transmitted torque",
    "position-dependent-friction": "friction level that varies with position",
    "thermal-drift": "friction that changes over the run as the axis warms",
    "torque-ripple": "drive gain periodic in position: torque ripple in proportion to u",
    "backlash": "lost motion between the driven and the measured side",
    "compliance": "elastic transmission: a resonance between motor and load",
    "actuator-lag": "first-order lag between u and torque (electrical time constant)",
    "saturation": "torque limited at large u",
    "input-dead-zone": "small u produces no torque (inverter dead time, amplifier dead band)",
    "inertia-mismatch": "inertia given as known is wrong",
    "sensor-eccentricity": "measured position has a once-per-turn error",
    "periodic-disturbance": "external torque periodic in time",
    "load-step": "external torque that switches on or off at some instant",
}

/// `count` values from `low` to `high`, equal ratios apart.
fn geometric(low: f64, high: f64, count: usize) -> Vec<f64> {
    let ratio = (high / low).powf(1.0 / (count - 1) as f64);
    (0..count).map(|k| low * ratio.powf(k as f64)).collect()
}

#[cfg(test)]
mod tests {
    use super::{ALL, Motion, PLANNED, Point, find, section, tell_apart};

    #[test]
    fn the_catalogue_has_the_24_ids_once_each() {
        let mut ids: Vec<&str> = ALL
            .iter()
            .map(|e| e.id())
            .chain(PLANNED.iter().map(|p| p.id))
            .collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), 24);
        assert!(find("stribeck").is_some() && find("backlash").is_none());
    }

    #[test]
    fn sections_of_the_documentation_are_found() {
        assert_eq!(
            section("//! # A\n//! b\n//! c\n//! # D\n", "A").unwrap(),
            "b c"
        );
        assert!(section("//! # A\n", "B").is_none());
    }

    #[test]
    fn any_two_effects_can_be_told_apart() {
        for one in ALL {
            for other in ALL.iter().filter(|o| o.id() != one.id()) {
                let text = tell_apart(*one, *other);
                assert!(text.len() > 30 && !text.contains("//!"), "{text}");
            }
        }
    }

    #[test]
    fn every_doc_has_the_fixed_headings() {
        for effect in ALL {
            for heading in [
                "What it is",
                "What it looks like in a recording",
                "What excites it",
                "Confused with",
                "Example",
                "References",
            ] {
                assert!(
                    effect.doc().contains(&format!("//! # {heading}\n")),
                    "{}: {heading}",
                    effect.id()
                );
            }
        }
    }

    #[test]
    fn named_and_linear_parameters_are_inverse_to_each_other() {
        for effect in ALL {
            let named: Vec<f64> = (0..effect.parameters().len())
                .map(|k| 0.7 + 0.2 * k as f64)
                .collect();
            let (inner, coefficients) = effect.linear(&named, 0.3);
            assert_eq!(coefficients.len(), effect.width());
            let again = effect.named(inner, &coefficients, 0.3);
            assert!(
                named.iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-12),
                "{}: {named:?} {again:?}",
                effect.id()
            );
        }
    }

    #[test]
    fn sentences_read_well_for_tiny_and_huge_numbers() {
        let exponent = |text: &str| {
            let bytes = text.as_bytes();
            bytes.windows(3).any(|w| {
                w[0].is_ascii_digit() && w[1] == b'e' && (w[2] == b'-' || w[2].is_ascii_digit())
            })
        };
        assert!(exponent("3.644e-1 N*m") && !exponent("0.364 N·m"));
        for effect in ALL {
            for size in [1.234_567e-9, 0.364_4, -0.364_4, 8.043_21e7] {
                for motion in [Motion::Rotary, Motion::Linear] {
                    let text = effect.sentence(&vec![size; effect.parameters().len()], motion);
                    let digits = text.split(|c: char| !c.is_ascii_digit() && c != '.');
                    assert!(
                        !exponent(&text)
                            && !text.contains('*')
                            && text.ends_with('.')
                            && digits.clone().all(|d| d.len() <= 8),
                        "{}: {text}",
                        effect.id()
                    );
                }
            }
        }
    }

    #[test]
    fn a_sentence_has_three_digits_and_a_printed_unit() {
        let text = find("stribeck")
            .unwrap()
            .sentence(&[0.364_4, 0.481_6, 1.39], Motion::Rotary);
        assert!(
            text.starts_with(
                "Friction rises to 0.364 N·m towards zero speed, below about 0.482 rad/s:"
            ),
            "{text}"
        );
        let text = find("gravity")
            .unwrap()
            .sentence(&[0.2, 0.01], Motion::Rotary);
        assert!(text.contains("towards q = −0.0100 rad"), "{text}");
    }

    #[test]
    fn confusions_name_effects_of_the_catalogue() {
        for effect in ALL {
            for confusion in effect.confusions() {
                let known =
                    find(confusion.id).is_some() || PLANNED.iter().any(|p| p.id == confusion.id);
                assert!(
                    known && confusion.id != effect.id(),
                    "{} and {}",
                    effect.id(),
                    confusion.id
                );
            }
        }
    }

    #[test]
    fn dissipative_effects_oppose_motion() {
        for id in ["stribeck", "quadratic-drag", "power-law-viscous"] {
            let effect = find(id).unwrap();
            for v in [-2.0, -0.1, 0.1, 2.0_f64] {
                let mut b = [0.0];
                effect.basis(
                    [0.5, 2.0],
                    Point::new(Motion::Linear, 0.3, v, v.signum()),
                    &mut b,
                );
                assert!(
                    b[0] * v > 0.0 && effect.applies(Motion::Linear),
                    "{id} at {v}"
                );
            }
        }
    }
}
