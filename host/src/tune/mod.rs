//! From a model and a bandwidth to the parameters of a controller.

mod current;
mod effects;
mod margins;
mod scale;

pub use current::{Inner, Winding, current};
pub use effects::left_alone;
pub use margins::{Margins, margins};
pub use scale::{SI, units};

use bristle_core::control::{
    Adaptation, Compensation, Driver, Friction, Learning, Method, Parameters,
};
use statrs::function::gamma::gamma;

use crate::error::{self, Error, Result};
use crate::model::{Causality, Kind, Label, Model};
use crate::plant::{DcMotor, geared_servo};

/// What the owner of an axis asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// Frequency up to which the position follows its set point (−3 dB), Hz, friction and the integral aside.
    pub bandwidth: f64,
    /// Samples a second.
    pub rate: f64,
    /// Encoder counts a turn or a metre.
    pub counts: f64,
    /// Largest `|u|`.
    pub limit: f64,
    /// A current loop between the controller and `u`, if one is wanted.
    pub current: Option<Inner>,
}

/// An axis as a controller sees it: `J·q̈ = gain·(u − back_emf·q̇) − …`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// `J`, kg·m² or kg.
    pub inertia: f64,
    /// Torque or force per unit of `u`.
    pub gain: f64,
    /// What velocity takes off `u`.
    pub back_emf: f64,
    /// Torque or force per displacement that holds the axis at zero.
    pub stiffness: f64,
}

/// `−3 dB` of a double pole `p²/(s + p)²` is at `√(√2 − 1)·p`.
const DOUBLE_POLE: f64 = 0.643_594_252_905_582_6;
/// How much faster the observer is than the loop that uses it.
const OBSERVER: f64 = 8.0;
/// Fastest rate at which the observer's Coulomb level is learned, 1/s: four time constants are well within the half of a
/// second in which a slow motion shows one direction.
const FASTEST_LEARNING: f64 = 10.0;

/// Share of the prior of `bristle_core::control::Adaptation` that returns after a row. With the prior `P₀ = 16`, in units of
/// a row's noise, the variance comes to rest at `P = (1 − f)·P/(1 + P) + f·P₀`, which for this share is 1/3: of what a row
/// says a quarter is believed, so that a change is learned within ten rows and their noise is halved and more.
const FORGOTTEN: f64 = 0.005;

/// How large an offset is expected beside the Coulomb level. While the axis slides one way only their sum is seen, and where
/// both have come to rest a change is shared out by the roots of what returns to each, `1 : OFFSET`: a level that
/// changes by half is then right within 5 % before the axis has turned round.
const OFFSET: f64 = 0.1;

impl Drive {
    /// The drive of a model; says which values are missing. The armature of a motor is taken as its resistance alone: its
    /// current follows the voltage within a fraction of a millisecond.
    pub fn of(model: &Model) -> Result<Self> {
        if model.causality == Causality::Inverse {
            return Err(Error::Usage(
                "a model with causality = \"inverse\" has no drive to tune; tune a model that u drives"
                    .to_owned(),
            ));
        }
        crate::axis::complete(model)?;
        let value = |k: usize| model.parameters()[k].value.unwrap_or_default();
        let inertia = value(model.moving_inertia());
        let drive = match model.kind {
            Kind::Axis | Kind::MassSpring => Self {
                inertia,
                gain: value(1),
                back_emf: model.back_emf(),
                stiffness: match model.kind {
                    Kind::MassSpring => model.constant("plant.stiffness"),
                    _ => 0.0,
                },
            },
            Kind::DcMotor | Kind::GearedServo => Self::motor(&motor(model)?),
            Kind::WheelSlip => {
                return Err(Error::Usage(
                    "plant.kind = \"wheel-slip\" has no position to control; tune an axis, a motor or a mass-spring"
                        .to_owned(),
                ));
            }
        };
        if drive.inertia > 0.0 && drive.gain != 0.0 {
            return Ok(drive);
        }
        Err(Error::Usage(format!(
            "inertia {} and gain {} cannot be tuned for: the one must be positive and the other not zero",
            drive.inertia, drive.gain
        )))
    }

    fn motor(motor: &DcMotor) -> Self {
        let gain = motor.axis.gain;
        Self {
            inertia: motor.axis.inertia,
            gain: gain * motor.torque_constant / motor.resistance,
            back_emf: motor.back_emf / gain,
            stiffness: 0.0,
        }
    }
}

/// The motor of a model that has one.
fn motor(model: &Model) -> Result<DcMotor> {
    match model.kind {
        Kind::GearedServo => geared_servo(model),
        _ => DcMotor::new(model),
    }
}

impl Wish {
    /// The share of its error that a current loop takes away in a sample, if there is one.
    pub fn pace(&self) -> Option<f64> {
        let inner = self.current.as_ref()?;
        Some(std::f64::consts::TAU * inner.bandwidth / self.rate)
    }

    /// Refuses what makes no sense by itself.
    fn check(&self) -> Result<()> {
        error::positive(&[
            ("--bandwidth", Some(self.bandwidth)),
            ("--rate", Some(self.rate)),
            ("--counts", Some(self.counts)),
            ("--limit", Some(self.limit)),
            ("--current-bandwidth", self.current.map(|c| c.bandwidth)),
            ("--current-limit", self.current.and_then(|c| c.limit)),
        ])
    }
}

/// The parameters of a controller for a model: a cascade whose position loop has a double pole at `p`, where `p/(2π)` is the
/// bandwidth over `√(√2 − 1)`.
///
/// `kp = p/2`, `kv = 2·J·p` and `ki = kv·p/4`; the observer is eight times as fast, which costs little phase. Friction is
/// compensated with the law of the model, by its bristles if it has them, driven by the set point, and with the steepest
/// correction towards it that [`Compensation`] calls safe. The Coulomb level is learned at a sixteenth of the
/// observer's bandwidth at most, where the three are well damped.
///
/// With a current loop below it, the controller's `u` is the current in A, its gain the torque constant, and its limit that
/// of the current: [`current`] gives the loop itself.
pub fn parameters(model: &Model, wish: &Wish) -> Result<Parameters<f64>> {
    wish.check()?;
    let mut drive = Drive::of(model)?;
    let mut limit = wish.limit;
    if let Some(inner) = &wish.current {
        let winding = Winding::of(model)?;
        (drive.gain, drive.back_emf) = (winding.torque_constant, 0.0);
        limit = inner.limit.unwrap_or(wish.limit / winding.resistance);
    }
    let pole = std::f64::consts::TAU * wish.bandwidth / DOUBLE_POLE;
    let period = 1.0 / wish.rate;
    let count = model.motion.turn() / wish.counts;
    let velocity_gain = 2.0 * drive.inertia * pole;
    let observer_bandwidth = OBSERVER * pole;
    let friction = friction(model);
    let torque_limit = (drive.gain * limit).abs();
    let bristles = model.bristle_term().is_some();
    let found = Parameters {
        period,
        count,
        inertia: drive.inertia,
        gain: drive.gain,
        back_emf: drive.back_emf,
        command_limit: limit,
        torque_limit,
        observer_bandwidth,
        position_gain: 0.5 * pole,
        velocity_gain,
        velocity_integral: 0.25 * velocity_gain * pole,
        friction,
        compensation: Compensation {
            method: if bristles {
                Method::Bristles
            } else {
                Method::Static
            },
            driver: if bristles {
                Driver::Desired
            } else {
                Driver::Command
            },
            share: 1.0,
            // As steep as is safe, with room for rounding to single precision.
            slope: 0.999 * velocity_gain,
            crossing: 0.125 * count * pole,
        },
        adaptation: Adaptation {
            method: Learning::Observer,
            speed: 0.25 * count * observer_bandwidth,
            lowest: 0.0,
            highest: torque_limit,
            rate: (observer_bandwidth / 16.0).min(FASTEST_LEARNING),
            window: 40.0 / observer_bandwidth,
            forgotten: FORGOTTEN,
            offset: OFFSET,
        },
        effects: effects::of(model, &drive, count)?,
    };
    found.check().map_err(|invalid| {
        Error::Usage(format!(
            "{} comes out of range for this model and --bandwidth {} Hz at --rate {} Hz; ask for less bandwidth or check the model",
            invalid.parameter, wish.bandwidth, wish.rate
        ))
    })?;
    Ok(found)
}

/// The friction law of a model in the words of the controller, whose exponential Stribeck curve has the exponent 2. For
/// another exponent `δ` its Stribeck velocity is `vs·Γ(1 + 1/δ)/Γ(3/2)`, with which both curves have the same area.
fn friction(model: &Model) -> Friction<f64> {
    let value = |p: &crate::model::Parameter| p.value.unwrap_or_default();
    let coulomb = value(&model.coulomb).max(0.0);
    let labels = model.labels();
    let own = |wanted: &dyn Fn(&Label) -> bool| {
        let at = labels.iter().position(wanted)?;
        model.parameters()[at].value
    };
    let constant = |name: &str| {
        let value = model.constant(&format!("friction.{name}"));
        value.is_finite().then_some(value)
    };
    let named = |name: &str| own(&|l| l.name == name).or_else(|| constant(name));
    let exponent = own(&|l| l.name == "exponent" && l.effect.is_none_or(|e| e == "stribeck"));
    let area = |exponent: f64| gamma(1.0 + 1.0 / exponent);
    let widened = exponent.map_or(1.0, |exponent| area(exponent) / area(2.0));
    Friction {
        coulomb,
        viscous: value(&model.viscous).max(0.0),
        static_level: named("static").unwrap_or(coulomb).max(coulomb),
        stribeck_velocity: widened * named("stribeck_velocity").unwrap_or(1.0),
        curve: model.curve(),
        bristle_stiffness: named("bristle_stiffness").unwrap_or(1.0),
        bristle_damping: named("bristle_damping").unwrap_or(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::{Drive, Wish, margins, parameters};
    use crate::model::Model;

    const WISH: Wish = Wish {
        bandwidth: 6.0,
        rate: 1000.0,
        counts: 4096.0,
        limit: 6.0,
        current: None,
    };

    fn model(effects: &str) -> Model {
        let text = format!(
            "[plant]\nmotion = \"rotary\"\ninput = \"voltage\"\ngain = 0.13\nback_emf = 0.54\ninertia = 0.002\n[friction]\nmodel = \"stribeck\"\ncoulomb = 0.1\nviscous = 0.015\nstatic = 0.13\nstribeck_velocity = 0.2\n{effects}"
        );
        Model::parse(&text).unwrap()
    }

    #[test]
    fn gains_follow_their_equations() {
        let found = parameters(&model(""), &WISH).unwrap();
        let pole = std::f64::consts::TAU * 6.0 / (2.0_f64.sqrt() - 1.0).sqrt();
        assert!((found.position_gain / (0.5 * pole) - 1.0).abs() < 1e-12);
        assert!((found.velocity_gain / (2.0 * 0.002 * pole) - 1.0).abs() < 1e-12);
        assert_eq!(
            (
                found.friction.static_level,
                found.friction.stribeck_velocity
            ),
            (0.13, 0.2)
        );
        assert!(found.is_valid() && found.scaled::<f32>(&super::SI).is_ok());
    }

    #[test]
    fn what_a_diagnosis_adds_to_friction_reaches_the_controller() {
        let plain = "[plant]\nmotion = \"rotary\"\ninertia = 0.002\n[friction]\ncoulomb = 0.1\nviscous = 0.015\n";
        let stribeck =
            "[effects.stribeck]\nstatic = 0.14\nstribeck_velocity = 0.2\nexponent = 2.0\n";
        let drag = "[effects.quadratic-drag]\ncoefficient = 0.01\n";
        let found = Model::parse(&format!("{plain}{stribeck}{drag}")).unwrap();
        let friction = parameters(&found, &WISH).unwrap().friction;
        assert_eq!(
            (friction.static_level, friction.stribeck_velocity),
            (0.14, 0.2)
        );
        assert_eq!(super::left_alone(&found), ["quadratic-drag"]);
    }

    /// `0.2·(q − 0.35)` is a spring about zero and a constant of −0.07 N·m.
    #[test]
    fn a_spring_that_rests_elsewhere_reaches_the_controller() {
        let plain = "[plant]\nmotion = \"rotary\"\ninertia = 0.002\n[friction]\ncoulomb = 0.1\nviscous = 0.015\n";
        let with = |effects: &str| {
            let found = Model::parse(&format!("{plain}{effects}")).unwrap();
            parameters(&found, &WISH).unwrap().effects
        };
        let aside = with("[effects.spring]\nstiffness = 0.2\nrest = 0.35\n");
        let beside = with(
            "[effects.spring]\nstiffness = 0.2\n[effects.direction-asymmetry]\noffset = -0.07\n",
        );
        assert_eq!(aside.stiffness, beside.stiffness);
        assert!((aside.offset - beside.offset).abs() < 1e-12);
        assert!(aside.offset < 0.0);
    }

    /// A controller crosses a gap behind the encoder; before the encoder it is another one, whose parameters mean other things.
    #[test]
    fn a_gap_before_the_encoder_is_left_alone() {
        let plain = "[plant]\nmotion = \"rotary\"\ninertia = 0.002\n[friction]\ncoulomb = 0.1\nviscous = 0.015\n[effects.backlash]\n";
        let with = |gap: &str| Model::parse(&format!("{plain}{gap}")).unwrap();
        let behind = with("load_inertia = 0.001\ngap = 0.02\n");
        assert!(super::left_alone(&behind).is_empty());
        assert_eq!(
            parameters(&behind, &WISH).unwrap().effects.backlash.inertia,
            0.001
        );
        let before = with("matched_gap = 0.02\nmotor_friction = 0.9\n");
        assert_eq!(super::left_alone(&before), ["backlash"]);
        assert_eq!(
            parameters(&before, &WISH).unwrap().effects.backlash.inertia,
            0.0
        );
    }

    /// A controller carries waves of friction and of torque, octaves too, but no spot.
    #[test]
    fn an_octave_is_a_wave_and_a_spot_is_left_alone() {
        let plain = "[plant]\nmotion = \"rotary\"\ninertia = 0.002\n[friction]\ncoulomb = 0.1\nviscous = 0.015\n[effects.";
        let with = |effect: &str| Model::parse(&format!("{plain}{effect}")).unwrap();
        let spot =
            with("position-dependent-friction]\namplitude = 0.05\ncentre = 0.3\nspread = 0.1\n");
        assert_eq!(super::left_alone(&spot), ["position-dependent-friction"]);
        let effects = parameters(&spot, &WISH).unwrap().effects;
        assert_eq!((effects.friction.sine, effects.friction.cosine), (0.0, 0.0));
        let cogs = with(
            "cogging]\namplitude = 0.04\nphase = 0.0\nperiods = 12\nsecond_amplitude = 0.02\nsecond_phase = 0.0\n",
        );
        assert!(super::left_alone(&cogs).is_empty());
        let waves = parameters(&cogs, &WISH).unwrap().effects.waves;
        assert_eq!((waves[0].sine, waves[1].sine), (0.04, 0.02));
        let off = waves[1].cycle.wrapping_sub(waves[0].cycle.wrapping_mul(2));
        assert!(off.wrapping_add(1) <= 2, "{off}: more than rounding");
    }

    /// `∫e^(−v/vs)dv = vs`, and `∫e^(−(v/w)²)dv = w·√π/2`.
    #[test]
    fn another_exponent_keeps_the_area_under_the_stribeck_curve() {
        let found = Model::parse("[plant]\nmotion = \"rotary\"\ninertia = 0.002\n[friction]\ncoulomb = 0.1\nviscous = 0.015\n[effects.power-law-viscous]\ncoefficient = 0.01\nexponent = 0.5\n[effects.stribeck]\nstatic = 0.14\nstribeck_velocity = 0.2\nexponent = 1.0\n").unwrap();
        let width = parameters(&found, &WISH)
            .unwrap()
            .friction
            .stribeck_velocity;
        assert!(
            (width * 0.5 * std::f64::consts::PI.sqrt() - 0.2).abs() < 1e-9,
            "{width}"
        );
    }

    #[test]
    fn the_manual_gives_the_drive_of_the_srv02() {
        let text = include_str!("../../examples/srv02.toml");
        let drive = Drive::of(&Model::parse(text).unwrap()).unwrap();
        // 1.53 rad/s per volt at steady speed without friction, 1/(N·ke).
        assert!((1.0 / drive.back_emf - 1.0 / (70.0 * 7.68e-3)).abs() < 1e-9);
        assert!((drive.gain - 0.9 * 0.69 * 70.0 * 7.68e-3 / 2.6).abs() < 1e-12);
        assert!((drive.inertia - 2.09e-3).abs() < 0.01e-3);
    }

    #[test]
    fn what_makes_no_sense_is_refused_with_its_option() {
        for (wish, option) in [
            (
                Wish {
                    bandwidth: 0.0,
                    ..WISH
                },
                "--bandwidth",
            ),
            (
                Wish {
                    counts: f64::NAN,
                    ..WISH
                },
                "--counts",
            ),
            (
                Wish {
                    limit: -1.0,
                    ..WISH
                },
                "--limit",
            ),
        ] {
            assert!(
                parameters(&model(""), &wish)
                    .err()
                    .unwrap()
                    .to_string()
                    .contains(option)
            );
        }
        let unknown =
            Model::parse("[plant]\nmotion = \"rotary\"\ninertia = \"?\"\n[friction]\n").unwrap();
        assert!(
            parameters(&unknown, &WISH)
                .err()
                .unwrap()
                .to_string()
                .contains("inertia")
        );
    }

    #[test]
    fn more_bandwidth_costs_margin() {
        let at = |bandwidth: f64| {
            margins(
                &parameters(&model(""), &Wish { bandwidth, ..WISH }).unwrap(),
                None,
            )
        };
        let (slow, fast) = (at(2.0), at(30.0));
        assert!(slow.phase > fast.phase && slow.delay > fast.delay);
        assert!(slow.phase > 45.0 && slow.gain.unwrap() > 2.0, "{slow:?}");
    }
}
