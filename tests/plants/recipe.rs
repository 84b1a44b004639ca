//! What to simulate.

use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Process torque that acts on the axis and is not recorded, as a fraction of RMS `u`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Noise {
    /// 1 %.
    Low,
    /// 3 %.
    Medium,
    /// 10 %.
    High,
}

impl Noise {
    /// RMS of the noise over RMS of `u`.
    pub fn fraction(self) -> f64 {
        match self {
            Self::Low => 0.01,
            Self::Medium => 0.03,
            Self::High => 0.10,
        }
    }
}

/// How `u` comes about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// A given torque. Linear axes, and rotary ones that an effect would drive away, are kept in place
    /// by a slow centring loop (0.15 to 0.5 Hz), whose torque is part of the recorded `u`.
    Open,
    /// A position controller at the sample rate on the quantised encoder.
    Pd,
}

/// The kind of axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// rad, N·m.
    Rotary,
    /// m, N.
    Linear,
}

/// What to simulate; everything not said here is drawn from the seed.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// The same recipe with the same seed gives the same recording.
    pub seed: u64,
    /// Ids of the effects, none for a clean axis.
    pub effects: Vec<&'static str>,
    /// Size of each effect as a fraction of RMS `u`.
    pub size: f64,
    /// Level of the process torque.
    pub noise: Noise,
    /// s.
    pub duration: f64,
    /// Samples a second.
    pub rate: f64,
    /// Encoder counts a turn; a linear axis has a 40.96 mm lead, so 4096 counts are 10 µm each.
    pub counts: u32,
    /// Open loop or position control.
    pub control: Control,
    /// Rotary or linear.
    pub motion: Motion,
}

/// Effects in position: they need travel that is bounded, hence position control.
const BOUNDED: [&str; 6] = [
    "centrifugal",
    "gravity",
    "spring",
    "hardening-spring",
    "position-dependent-friction",
    "position-dependent-viscous",
];

/// Effects that push an axis in open loop away.
const DRIFTING: [&str; 4] = [
    "direction-asymmetry",
    "viscous-asymmetry",
    "load-step",
    "torque-ripple",
];

impl Recipe {
    /// Draws motion, control, rate and counts from the seed; 24 s.
    pub fn random(seed: u64, effect: Option<&'static str>, size: f64, noise: Noise) -> Self {
        Self::with_effects(seed, effect.as_slice(), size, noise)
    }

    /// As [`Recipe::random`], for several effects at once.
    pub fn with_effects(seed: u64, effects: &[&'static str], size: f64, noise: Noise) -> Self {
        let mut rng = stream(seed, 0, 0);
        let rotary = rng.random_bool(0.65);
        let open = rng.random_bool(0.5);
        let rate = [1000.0, 1000.0, 1000.0, 500.0, 2000.0][rng.random_range(0..5)];
        let counts = [4096, 16384, 65536][rng.random_range(0..3)];
        let recipe = Self {
            seed,
            effects: effects.to_vec(),
            size,
            noise,
            duration: 24.0,
            rate,
            counts,
            control: if open { Control::Open } else { Control::Pd },
            motion: if rotary {
                Motion::Rotary
            } else {
                Motion::Linear
            },
        };
        Self {
            control: if recipe.bounded() {
                Control::Pd
            } else {
                recipe.control
            },
            motion: if recipe.turns() || effects.contains(&"gravity") {
                Motion::Rotary
            } else {
                recipe.motion
            },
            ..recipe
        }
    }

    /// Encoder count, rad or m.
    pub fn count(&self) -> f64 {
        match self.motion {
            Motion::Rotary => std::f64::consts::TAU / f64::from(self.counts),
            Motion::Linear => (0.040_96 / f64::from(self.counts)).max(1e-6),
        }
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        (self.duration * self.rate).round() as usize
    }

    /// Whether an effect needs bounded travel.
    pub(super) fn bounded(&self) -> bool {
        self.effects.iter().any(|id| BOUNDED.contains(id))
    }

    /// Whether an effect needs whole turns.
    pub(super) fn turns(&self) -> bool {
        self.effects.contains(&"sensor-eccentricity")
    }

    /// Whether an axis in open loop needs the centring loop.
    pub(super) fn centred(&self) -> bool {
        self.motion == Motion::Linear || self.effects.iter().any(|id| DRIFTING.contains(id))
    }

    /// Says what makes the recipe impossible.
    pub(super) fn check(&self) {
        let known = |id: &&str| super::NAMED.contains(id) || super::OTHERS.contains(id);
        assert!(self.effects.iter().all(known), "unknown effect in {self:?}");
        assert!(
            self.control == Control::Pd || !self.bounded(),
            "effects in position need Control::Pd: {self:?}"
        );
        assert!(
            self.motion == Motion::Rotary || !(self.turns() || self.effects.contains(&"gravity")),
            "effects in sin q need Motion::Rotary: {self:?}"
        );
    }
}

/// Two effects that an axis can have at once, and that are not one by their very equations: there is one load, a spring beside a
/// hardening spring is a hardening spring, and one beside an offset rests elsewhere.
pub fn pair(rng: &mut ChaCha8Rng) -> [&'static str; 2] {
    const ONE: [[&str; 2]; 3] = [
        ["backlash", "compliance"],
        ["spring", "hardening-spring"],
        ["spring", "direction-asymmetry"],
    ];
    loop {
        let two = super::NAMED.choose_multiple_array(rng).expect("24 effects");
        if !ONE.iter().any(|one| two.iter().all(|id| one.contains(id))) {
            return two;
        }
    }
}

/// A generator for one purpose of one attempt at a seed.
pub(super) fn stream(seed: u64, purpose: u64, attempt: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(purpose + 16 * attempt);
    rng
}

/// Uniform between a and b.
pub(super) fn between(rng: &mut ChaCha8Rng, a: f64, b: f64) -> f64 {
    a + (b - a) * rng.random::<f64>()
}

/// Log-uniform between a and b.
pub(super) fn log_between(rng: &mut ChaCha8Rng, a: f64, b: f64) -> f64 {
    a * (b / a).powf(rng.random())
}

/// Plus or minus one.
pub(super) fn sign(rng: &mut ChaCha8Rng) -> f64 {
    if rng.random_bool(0.5) { 1.0 } else { -1.0 }
}
