//! From what a person asks for to what the board is sent: every change of velocity is a ramp, every move a profile.

use bristle_core::control::{Limits, Position, Profile, SetPoint};
use serde::{Deserialize, Serialize};

use super::About;

/// What the axis is asked for. In JSON: `"off"`, `{"velocity": 0.5}`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Nothing: `u = 0`.
    #[default]
    Off,
    /// This `u`.
    Input(f64),
    /// This torque or force, N·m or N.
    Torque(f64),
    /// This velocity, rad/s or m/s.
    Velocity(f64),
    /// To go to this position, rad or m from where the encoder began to count, and stay there.
    Position(f64),
}

impl Mode {
    /// All of them, at zero, in the order that they are offered in.
    pub const ALL: [Self; 5] = [
        Self::Off,
        Self::Input(0.0),
        Self::Torque(0.0),
        Self::Velocity(0.0),
        Self::Position(0.0),
    ];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Input(_) => "input",
            Self::Torque(_) => "torque",
            Self::Velocity(_) => "velocity",
            Self::Position(_) => "position",
        }
    }

    /// Its value; zero for nothing.
    pub const fn value(self) -> f64 {
        match self {
            Self::Off => 0.0,
            Self::Input(x) | Self::Torque(x) | Self::Velocity(x) | Self::Position(x) => x,
        }
    }

    /// The same with another value.
    #[must_use]
    pub const fn with(self, value: f64) -> Self {
        match self {
            Self::Off => Self::Off,
            Self::Input(_) => Self::Input(value),
            Self::Torque(_) => Self::Torque(value),
            Self::Velocity(_) => Self::Velocity(value),
            Self::Position(_) => Self::Position(value),
        }
    }

    /// Its largest value either way; none for a position.
    pub fn limit(self, about: &About) -> Option<f64> {
        match self {
            Self::Off | Self::Position(_) => None,
            Self::Input(_) => Some(about.command_limit),
            Self::Torque(_) => Some(about.torque_limit),
            Self::Velocity(_) => Some(about.speed),
        }
    }

    /// What is wrong with it.
    pub fn check(self, about: &About) -> Result<(), String> {
        let value = self.value();
        if !value.is_finite() {
            return Err(format!("{value} is no number to ask for"));
        }
        match self.limit(about) {
            Some(limit) if value.abs() > limit => Err(format!(
                "{} {value} is beyond the limit, {limit}; ask for less",
                self.name()
            )),
            _ => Ok(()),
        }
    }
}

/// How fast moves are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moves {
    /// rad/s or m/s.
    pub speed: f64,
    /// rad/s² or m/s².
    pub acceleration: f64,
}

/// Acceleration is built up within a tenth of a second.
const JERKS: f64 = 10.0;
/// What a profile is sampled by, s.
const STEP: f64 = 1e-3;

/// What is asked for, and how far the axis has been brought towards it.
#[derive(Clone, Debug)]
pub(super) struct Aim {
    mode: Mode,
    moves: Moves,
    /// rad or m to an encoder count.
    count: f64,
    /// What was sent last, rad/s or m/s.
    velocity: f64,
    profile: Option<Profile<f64>>,
    /// Of the profile's next step, s.
    owed: f64,
}

impl Aim {
    pub fn new(moves: Moves, count: f64) -> Self {
        Self {
            mode: Mode::Off,
            moves,
            count,
            velocity: 0.0,
            profile: None,
            owed: 0.0,
        }
    }

    /// rad or m to an encoder count.
    pub const fn count(&self) -> f64 {
        self.count
    }

    /// Asks for something else from now on, of an axis that moves at `velocity`.
    pub fn set(&mut self, mode: Mode, velocity: f64) {
        let was_ruled = matches!(self.mode, Mode::Velocity(_) | Mode::Position(_));
        if !was_ruled {
            self.velocity = velocity;
        }
        self.mode = mode;
        self.profile = None;
    }

    /// Nothing from now on.
    pub fn drop_all(&mut self) {
        *self = Self::new(self.moves, self.count);
    }

    /// What to send `dt` seconds after the last one, to an axis whose encoder shows `counts`.
    pub fn next(&mut self, dt: f64, counts: i32) -> SetPoint<f32> {
        match self.mode {
            Mode::Off => SetPoint::Off,
            Mode::Input(u) => SetPoint::Command(u as f32),
            Mode::Torque(torque) => SetPoint::Torque(torque as f32),
            Mode::Velocity(velocity) => self.ramp(velocity, dt),
            Mode::Position(position) => self.travel(position, dt, counts),
        }
    }

    fn ramp(&mut self, wanted: f64, dt: f64) -> SetPoint<f32> {
        let most = self.moves.acceleration * dt;
        let change = (wanted - self.velocity).clamp(-most, most);
        self.velocity += change;
        let arrived = self.velocity == wanted;
        SetPoint::Velocity {
            velocity: self.velocity as f32,
            acceleration: if arrived { 0.0 } else { (change / dt) as f32 },
        }
    }

    /// A move begins at rest: an axis in motion is brought there first.
    fn travel(&mut self, to: f64, dt: f64, counts: i32) -> SetPoint<f32> {
        if self.profile.is_none() {
            if self.velocity != 0.0 {
                return self.ramp(0.0, dt);
            }
            let limits = Limits {
                velocity: self.moves.speed,
                acceleration: self.moves.acceleration,
                jerk: JERKS * self.moves.acceleration,
            };
            let to = Position::from_f64(to / self.count);
            let from = Position::at(counts);
            self.profile = Profile::new(from, to, self.count, &limits, STEP);
            self.owed = 0.0;
        }
        let Some(profile) = &mut self.profile else {
            return SetPoint::Off;
        };
        self.owed += dt / STEP;
        let mut set_point = profile.step();
        for _ in 1..self.owed as u32 {
            set_point = profile.step();
        }
        self.owed = self.owed.fract();
        match set_point {
            SetPoint::Position {
                position,
                velocity,
                acceleration,
            } => {
                self.velocity = velocity;
                SetPoint::Position {
                    position: Position::from_f64(position.minus(Position::at(0))),
                    velocity: velocity as f32,
                    acceleration: acceleration as f32,
                }
            }
            _ => SetPoint::Off,
        }
    }
}

#[cfg(test)]
mod tests {
    use bristle_core::control::{Position, SetPoint};

    use super::{Aim, Mode, Moves};

    const MOVES: Moves = Moves {
        speed: 2.0,
        acceleration: 10.0,
    };
    const COUNT: f64 = 1e-3;
    const TICK: f64 = 5e-3;

    fn velocity(set_point: SetPoint<f32>) -> f64 {
        match set_point {
            SetPoint::Velocity { velocity, .. } | SetPoint::Position { velocity, .. } => {
                velocity.into()
            }
            _ => 0.0,
        }
    }

    #[test]
    fn no_change_of_velocity_is_faster_than_the_ramp() {
        let mut aim = Aim::new(MOVES, COUNT);
        let (mut before, mut q) = (0.0, 0.0);
        let script = [
            Mode::Velocity(2.0),
            Mode::Velocity(-1.5),
            Mode::Position(0.7),
            Mode::Position(-0.2),
            Mode::Velocity(0.5),
        ];
        for mode in script {
            aim.set(mode, before);
            // Each is left while it moves.
            for _ in 0..60 {
                let now = velocity(aim.next(TICK, (q / COUNT) as i32));
                // The jerk-limited profile and the ramp both stay below the acceleration; numbers are rounded to f32.
                assert!((now - before).abs() <= 10.0 * TICK + 1e-6, "{mode:?}");
                assert!(now.abs() <= 2.0 + 1e-6);
                q += now * TICK;
                before = now;
            }
        }
    }

    #[test]
    fn a_move_ends_where_it_should_and_stays() {
        let mut aim = Aim::new(MOVES, COUNT);
        aim.set(Mode::Position(0.5), 0.0);
        // 0.5 rad at 2 rad/s and 10 rad/s², with jerks of 0.1 s: 0.25 s and two ramps of 0.3 s at most.
        let last = (0..200).map(|_| aim.next(TICK, 0)).last();
        let expected = SetPoint::Position {
            position: Position::<f32>::from_f64(500.0),
            velocity: 0.0,
            acceleration: 0.0,
        };
        assert_eq!(last, Some(expected));
    }

    #[test]
    fn modes_travel_as_the_page_writes_them() {
        let mode = Mode::Velocity(1.5);
        let text = serde_json::to_string(&mode).unwrap();
        assert_eq!(text, r#"{"velocity":1.5}"#);
        assert_eq!(serde_json::from_str::<Mode>(&text).unwrap(), mode);
        let off = serde_json::from_str::<Mode>(r#""off""#).unwrap();
        assert_eq!(off, Mode::Off);
    }
}
