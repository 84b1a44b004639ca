//! The axis, its excitation and its controller, drawn from the seed.

use std::f64::consts::TAU;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::effect::{Effect, Fall, Law};
use super::excitation::Excitation;
use super::integrator::Axis;
use super::measure::Look;
use super::recipe::{Control, Motion, Recipe, between, log_between, sign, stream};

/// Purpose of the generator of what was added later, so that all else of a seed is as it was.
const LATER: u64 = 5;

/// All that does not depend on amplitudes.
pub(super) struct Setup {
    pub inertia: f64,
    /// Speed to reach without effects.
    pub top_speed: f64,
    /// Coulomb level over RMS torque.
    pub coulomb: f64,
    /// Viscous torque at top speed over RMS torque.
    pub viscous: f64,
    pub excitation: Excitation,
    /// Position controller: natural frequency in Hz, damping ratio, corner of the derivative in Hz.
    pub bandwidth: f64,
    pub damping: f64,
    pub corner: f64,
    /// Natural frequency of the centring loop, Hz.
    pub centring: f64,
    /// Position at the start, and the middle of a reference.
    pub start: f64,
    /// Encoder phase in counts.
    pub encoder_phase: f64,
    /// Process torque of unit RMS.
    pub noise: Vec<f64>,
}

impl Setup {
    /// Draws one attempt.
    pub fn draw(recipe: &Recipe, attempt: u64) -> Self {
        let mut plant = stream(recipe.seed, 1, attempt);
        let rng = &mut plant;
        let ts = 1.0 / recipe.rate;
        let n = recipe.samples();
        let mut drive = stream(recipe.seed, 2, attempt);
        let excitation = Excitation::draw(&mut drive, recipe.control, n, ts);
        let (inertia, mut top_speed) = match recipe.motion {
            Motion::Rotary => (log_between(rng, 1e-4, 1e-1), log_between(rng, 5.0, 60.0)),
            Motion::Linear => (log_between(rng, 0.5, 100.0), log_between(rng, 0.05, 1.0)),
        };
        if recipe.control == Control::Pd {
            top_speed = fit_travel(recipe, top_speed, excitation.half_range());
        }
        let reach = match recipe.control {
            Control::Pd => top_speed * excitation.half_range(),
            Control::Open => 0.0,
        };
        let start = match (recipe.motion, recipe.control) {
            (Motion::Rotary, Control::Open) => between(rng, 0.0, TAU),
            _ => reach * between(rng, -0.1, 0.1),
        };
        // Bristles show only as far as they carry torque.
        let most = if recipe.effects.contains(&"presliding") {
            (0.05 + 2.5 * recipe.size, 0.1 + 3.0 * recipe.size)
        } else {
            (0.05, 0.30)
        };
        let centring = match recipe.motion {
            Motion::Rotary => 0.15,
            Motion::Linear => between(rng, 0.3, 0.5),
        };
        Self {
            inertia,
            top_speed,
            coulomb: between(rng, most.0, most.1),
            viscous: between(rng, 0.05, 0.40),
            excitation,
            bandwidth: between(rng, 4.0, 7.0),
            damping: between(rng, 0.7, 1.1),
            corner: between(rng, 35.0, 60.0),
            centring,
            start,
            encoder_phase: rng.random(),
            noise: process(&mut stream(recipe.seed, 3, attempt), n, ts),
        }
    }
}

/// Speed of a reference that keeps its travel sane.
fn fit_travel(recipe: &Recipe, speed: f64, half_range: f64) -> f64 {
    let (least, most) = match recipe.motion {
        Motion::Rotary if recipe.turns() => (12.0, 60.0),
        Motion::Rotary if recipe.bounded() => (1.8, 15.0),
        Motion::Rotary => (0.3, 60.0),
        Motion::Linear => (0.05, 0.5),
    };
    (speed * half_range).clamp(least, most) / half_range
}

/// White or first-order coloured noise of unit RMS.
fn process(rng: &mut ChaCha8Rng, n: usize, ts: f64) -> Vec<f64> {
    let keep = if rng.random_bool(0.5) {
        0.0
    } else {
        (-TAU * log_between(rng, 20.0, 200.0) * ts).exp()
    };
    let fresh = (1.0 - keep * keep).sqrt();
    let mut y = normal(rng);
    (0..n)
        .map(|_| {
            y = keep * y + fresh * normal(rng);
            y
        })
        .collect()
}

/// Box and Muller, "A note on the generation of random normal deviates", 1958.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
}

/// What the shapes of effects are drawn against: the motion without them.
pub(super) struct Basis<'a> {
    pub recipe: &'a Recipe,
    pub look: &'a Look,
    pub u_rms: f64,
    pub u_peak: f64,
}

impl Basis<'_> {
    /// Draws an effect's shape, with a first guess of its scale.
    pub fn effect(&self, rng: &mut ChaCha8Rng, id: &'static str, axis: &mut Axis) -> Effect {
        let size = self.recipe.size;
        let torque = size * self.u_rms;
        let top = self.look.top_speed;
        let reach = self.look.lo.abs().max(self.look.hi.abs());
        let phase = between(rng, 0.0, TAU);
        let (law, x) = match id {
            "direction-asymmetry" => (self.asymmetry(rng, axis), torque),
            "viscous-asymmetry" => (
                Law::ViscousAsymmetry { side: sign(rng) },
                4.0 * torque / top,
            ),
            "stribeck" => (self.stribeck(rng), 3.0 * torque),
            "quadratic-drag" => (Law::QuadraticDrag, 8.0 * torque / (top * top)),
            "power-law-viscous" => {
                let exponent = between(rng, 0.25, 0.7);
                if rng.random_bool(0.5) {
                    axis.viscous = 0.0;
                }
                (
                    Law::PowerLawViscous { exponent },
                    8.0 * torque / top.powf(exponent),
                )
            }
            "gravity" => (Law::Gravity { phase }, 1.4 * torque),
            "spring" => {
                let rest = reach * self.off_centre();
                (Law::Spring { rest }, 3.0 * torque / reach)
            }
            "hardening-spring" => {
                let knee = reach / between(rng, 1.0, 2.0);
                let rest = reach * self.off_centre();
                (Law::HardeningSpring { knee, rest }, torque / reach)
            }
            "cogging" => {
                let second = if rng.random_bool(0.3) { 0.2 } else { 0.0 };
                let wave = self.wave(rng);
                (
                    Law::Cogging {
                        wave,
                        phase,
                        second,
                    },
                    1.4 * torque,
                )
            }
            "delay" => (Law::Delay, 1e-3 + 0.02 * size),
            "presliding" => self.bristles(rng, axis),
            "position-dependent-friction" => {
                let wave = self.slow_wave(rng);
                (Law::PositionDependentFriction { wave, phase }, 3.0 * torque)
            }
            "thermal-drift" => {
                let tau = between(rng, 4.0, 15.0);
                (Law::ThermalDrift { tau }, 5.0 * torque / top)
            }
            "load-dependent-friction" => (Law::LoadDependentFriction, 2.0 * size),
            "periodic-disturbance" => {
                let frequency = log_between(rng, 1.0, 30.0);
                (Law::PeriodicDisturbance { frequency, phase }, 1.4 * torque)
            }
            "load-step" => (self.load_step(rng), 2.0 * torque),
            "input-dead-zone" => (Law::InputDeadZone, torque),
            "saturation" => (Law::Saturation { peak: self.u_peak }, 0.3 + size),
            "torque-ripple" => {
                let wave = self.wave(rng);
                (Law::TorqueRipple { wave, phase }, 1.4 * size)
            }
            "compliance" => {
                let law = Law::Compliance {
                    share: between(rng, 0.3, 0.8),
                    damping: between(rng, 0.02, 0.1),
                };
                (law, 1.0 / 400.0)
            }
            "backlash" => {
                let share = between(rng, 0.3, 0.8);
                let travel = (self.look.hi - self.look.lo).min(6.0);
                let friction = self.load_friction();
                (Law::Backlash { share, friction }, 0.05 * size * travel)
            }
            "actuator-lag" => (Law::ActuatorLag, 1e-3 + 0.02 * size),
            "inertia-mismatch" => (Law::InertiaMismatch { side: sign(rng) }, size),
            "sensor-eccentricity" => {
                let speed = 0.3 * top;
                let error = torque / (axis.inertia * speed * speed);
                (Law::SensorEccentricity { phase }, error)
            }
            _ => self.outside(rng, id),
        };
        Effect { id, x, law }
    }

    /// The shape of an effect that no catalogue names, with a first guess of its scale.
    fn outside(&self, rng: &mut ChaCha8Rng, id: &str) -> (Law, f64) {
        let torque = self.recipe.size * self.u_rms;
        let top = self.look.top_speed;
        let phase = between(rng, 0.0, TAU);
        match id {
            "position-dependent-viscous" => {
                let wave = self.slow_wave(rng);
                (
                    Law::PositionDependentViscous { wave, phase },
                    5.0 * torque / top,
                )
            }
            "centrifugal" => {
                let wave = self.slow_wave(rng);
                (Law::Centrifugal { wave, phase }, 6.0 * torque / (top * top))
            }
            "fading-gain" => {
                let end = self.recipe.duration;
                (Law::FadingGain { end }, 4.0 * self.recipe.size)
            }
            "jamming" => {
                let periods = [between(rng, 2.0, 4.0), between(rng, 5.0, 9.0)];
                (Law::Jamming { periods, phase }, 3.0 * torque)
            }
            _ => unreachable!("checked with the recipe: {id}"),
        }
    }

    fn asymmetry(&self, rng: &mut ChaCha8Rng, axis: &Axis) -> Law {
        let friction = rng.random_bool(0.5);
        Law::DirectionAsymmetry {
            side: sign(rng),
            most: if friction { 0.7 * axis.coulomb } else { 0.0 },
        }
    }

    fn stribeck(&self, rng: &mut ChaCha8Rng) -> Law {
        // A large effect needs the larger velocities, or its peak would hold the axis.
        let least = if self.recipe.size > 0.15 { 0.07 } else { 0.02 };
        let fall = match rng.random_range(0..3) {
            0 => Fall::Exponential(1.0),
            1 => Fall::Exponential(2.0),
            _ => Fall::Rational,
        };
        Law::Stribeck {
            velocity: self.look.top_speed * log_between(rng, least, 0.15),
            fall,
        }
    }

    /// Where a spring rests, in units of the travel to either side: half of them where the position counts from.
    fn off_centre(&self) -> f64 {
        let mut rng = stream(self.recipe.seed, LATER, 0);
        let aside = rng.random_bool(0.5);
        if aside {
            between(&mut rng, -0.4, 0.4)
        } else {
            0.0
        }
    }

    /// Share of the friction that is the load's: a load in bearings of its own has some, one that sits on the shaft next to none.
    fn load_friction(&self) -> f64 {
        let mut rng = stream(self.recipe.seed, LATER, 1);
        let own = rng.random_bool(0.5);
        if own {
            between(&mut rng, 0.1, 0.8)
        } else {
            0.0
        }
    }

    /// About one period in the travel.
    fn slow_wave(&self, rng: &mut ChaCha8Rng) -> f64 {
        TAU / (between(rng, 0.4, 1.2) * (self.look.hi - self.look.lo))
    }

    /// 4 to 40 whole periods a turn, or 10 to 60 in the travel; below a twelfth of the sample rate.
    fn wave(&self, rng: &mut ChaCha8Rng) -> f64 {
        let most = TAU * self.recipe.rate / 12.0 / self.look.top_speed;
        match self.recipe.motion {
            Motion::Rotary => between(rng, 4.0, 40.0_f64.min(most).max(4.0)).round(),
            Motion::Linear => {
                let travel = self.look.hi - self.look.lo;
                (TAU * log_between(rng, 10.0, 60.0) / travel).min(most)
            }
        }
    }

    /// Dahl's model in a third of the cases, else `LuGre` with a small Stribeck rise.
    fn bristles(&self, rng: &mut ChaCha8Rng, axis: &Axis) -> (Law, f64) {
        let dahl = rng.random_range(0..3) == 0;
        let (rise, damping) = if dahl {
            (0.0, 0.0)
        } else {
            (between(rng, 0.0, 0.2), between(rng, 0.3, 1.5))
        };
        let law = Law::Presliding {
            rise,
            stribeck: self.look.top_speed * log_between(rng, 0.01, 0.05),
            damping,
        };
        let share = axis.coulomb / self.u_rms;
        let travel = self.look.hi - self.look.lo;
        (law, travel.min(1.0) * 0.02 * self.recipe.size / share)
    }

    fn load_step(&self, rng: &mut ChaCha8Rng) -> Law {
        let end = self.recipe.duration;
        let on = between(rng, 0.2, 0.6) * end;
        let off = if rng.random_bool(0.5) {
            2.0 * end
        } else {
            on + between(rng, 0.15, 0.35) * end
        };
        Law::LoadStep {
            side: sign(rng),
            on,
            off,
        }
    }
}
