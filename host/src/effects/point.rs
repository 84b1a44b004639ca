//! What an effect sees: an instant of the motion, and what the recordings cover.

use std::f64::consts::TAU;

use crate::motion::Motion;

/// An instant as the drive sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// Time since the first sample of the recording, s.
    pub t: f64,
    /// Length of the interval that this instant is the middle of, s.
    pub dt: f64,
    /// The input that acts, in its own unit: its mean over the interval.
    pub u: f64,
}

/// An instant of the motion, as an effect sees it.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Rotary or linear.
    pub motion: Motion,
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
    /// When, and under which input.
    pub moment: Moment,
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
            motion,
            q,
            v,
            angle,
            s,
            bending: 0.0,
            moment: Moment::default(),
        }
    }

    /// The same point at some moment.
    #[must_use]
    pub fn at(self, moment: Moment) -> Self {
        Self { moment, ..self }
    }
}

/// What the recordings at hand cover: the ground on which inner parameters are scanned.
#[derive(Clone, Copy, Debug)]
pub struct Survey {
    /// Rotary or linear.
    pub motion: Motion,
    /// Sampling interval, s.
    pub period: f64,
    /// Length of the longest recording, s.
    pub duration: f64,
    /// Half-width of the test functions, s.
    pub half_width: f64,
    /// Speed that 98 % of the samples stay below.
    pub top_speed: f64,
    /// Median speed while it moves, of the slowest recording.
    pub usual_speed: f64,
    /// Speed below which the sign of the measured velocity is in doubt.
    pub slow: f64,
    /// Smallest and largest position.
    pub travel: (f64, f64),
    /// Standard deviation of the position noise.
    pub position_noise: f64,
    /// Level of friction at rest, as far as it is known; zero before anything is.
    pub level: f64,
    /// How fast friction at that level slows the axis, as far as both are known, rad/s² or m/s².
    pub deceleration: f64,
    /// Root mean square and largest size of the input, in its own unit.
    pub input: (f64, f64),
}

impl Survey {
    /// How often what repeats so many times per turn or per metre does so in a second, at top speed.
    pub fn hertz(&self, periods: f64) -> f64 {
        self.hertz_at(self.top_speed, periods)
    }

    /// The same at the usual speed.
    pub fn usual_hertz(&self, periods: f64) -> f64 {
        self.hertz_at(self.usual_speed, periods)
    }

    fn hertz_at(&self, speed: f64, periods: f64) -> f64 {
        match self.motion {
            Motion::Rotary => periods * speed / TAU,
            Motion::Linear => periods * speed,
        }
    }
}

/// What decides whether an effect can be told at all.
#[derive(Clone, Copy, Debug)]
pub struct Given {
    /// Rotary or linear.
    pub motion: Motion,
    /// Whether the input drives the motion, rather than being the reaction to an imposed one.
    pub driven: bool,
    /// Whether the model file gives the inertia, and the gain with it.
    pub inertia: bool,
    /// Whether it gives a friction that is not told from the recording.
    pub friction: bool,
}

/// Parameters of the model that those of an effect are measured against.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Coulomb level.
    pub coulomb: f64,
    /// Torque or force per unit of the input.
    pub gain: f64,
}
