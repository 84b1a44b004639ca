//! How a run of a position ends: a step, and a move back to a standstill.

use bristle_core::control::{Limits, Position, Profile, SetPoint};

use crate::error::{Error, Result};
use crate::servo::{Aim, Servo};

/// When and how far.
pub(super) struct Finish {
    /// Size of the step, rad or m.
    pub step: f64,
    /// Until when the axis stays there, and until when it stands where it came from, s.
    pub until: [f64; 2],
    /// Limits of the move back.
    pub limits: Limits<f64>,
    /// rad or m to a count.
    pub count: f64,
    /// Sampling period, s.
    pub period: f64,
}

impl Finish {
    /// Runs to the end.
    pub fn run(&self, servo: &mut Servo<'_>) -> Result<()> {
        let here = servo.samples().last().map_or(0.0, |s| s.truth.q);
        // In the middle of counts, as an encoder would be asked for.
        let middle = |q: f64| ((q / self.count).floor() + 0.5) * self.count;
        let (start, top) = (middle(here), middle(here + self.step));
        let still = Aim::Position {
            q: top,
            v: 0.0,
            a: 0.0,
        };
        while servo.now() < self.until[0] - 1e-9 {
            servo.step(still)?;
        }
        let [from, to] = [top, start].map(|q| Position::from_f64(q / self.count));
        let mut profile = Profile::new(from, to, self.count, &self.limits, self.period)
            .ok_or_else(|| Error::Internal("a move was refused".to_owned()))?;
        while servo.now() < self.until[1] - 1e-9 {
            if let SetPoint::Position {
                position,
                velocity: v,
                acceleration: a,
            } = profile.step()
            {
                let q = (f64::from(position.counts) + position.fraction) * self.count;
                servo.step(Aim::Position { q, v, a })?;
            }
        }
        Ok(())
    }
}
