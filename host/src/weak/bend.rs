//! Bristles driven by the measured motion: a regressor that needs no simulation of the axis.

use bristle_core::friction::Dynamic;

use super::Track;

/// Bristles in one cell of a track, by their means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bent {
    /// Their force over the level that it would reach by sliding on: `σ0·z/g(v)`, the direction of sliding with a memory.
    pub direction: f64,
    /// Rate of their deflection, rad/s or m/s.
    pub rate: f64,
}

/// A law without what does not bend its bristles, whose numbers they are not to depend on, not even in the last bit: columns are
/// kept by what bends them.
struct Elastic<'a>(&'a dyn Dynamic<f64>);

impl Dynamic<f64> for Elastic<'_> {
    fn level(&self, velocity: f64) -> f64 {
        self.0.level(velocity)
    }
    fn stiffness(&self) -> f64 {
        self.0.stiffness()
    }
    fn damping(&self) -> f64 {
        0.0
    }
    fn viscosity(&self) -> f64 {
        0.0
    }
}

/// Displacement of this many standard deviations of the position noise bends bristles; less of it is noise.
const CERTAIN: f64 = 4.0;

impl Track {
    /// What the measured motion does to the bristles of a law, cell by cell.
    ///
    /// At rest velocity is noise, whose path would bend them to and fro. What is left there is the displacement from one
    /// end of the rest to the other; where the breakaway distance is too short for the encoder to show it, an axis that
    /// moves on has bent them fully in the direction that it moves to.
    ///
    /// A recording that begins at rest begins with straight bristles, and one that begins in motion with those that coming up to
    /// its speed has bent.
    pub fn bend(&self, law: &dyn Dynamic<f64>) -> Vec<Bent> {
        self.bend_of(self.cells.len(), law)
    }

    /// The same in the first cells at least.
    pub fn bend_of(&self, cells: usize, law: &dyn Dynamic<f64>) -> Vec<Bent> {
        let law = Elastic(law);
        let breakaway = law.level(0.0) / law.stiffness();
        let shows = self.shows(breakaway);
        let mut bent = Vec::with_capacity(cells);
        let mut z = law.advance(0.0, self.v[0], self.run_up());
        while bent.len() < cells {
            let from = bent.len();
            let rest = self.sliding[from..]
                .iter()
                .take_while(|s| **s == 0.0)
                .count();
            if rest > 0 {
                let end = from + rest;
                if shows {
                    let time = rest as f64 * self.period;
                    z = law.advance(z, (self.q[end] - self.q[from]) / time, time);
                } else if let Some(next) = self.cells.get(end) {
                    z = breakaway * next.s;
                }
                let direction = law.stiffness() * z / law.level(0.0);
                bent.resize(
                    end,
                    Bent {
                        direction,
                        rate: 0.0,
                    },
                );
                continue;
            }
            let v = self.cells[from].v;
            let level = law.level(v);
            let step = law.step_at(level, z, v, self.period);
            let rate = (step.deflection - z) / self.period;
            z = step.deflection;
            bent.push(Bent {
                direction: step.force / level,
                rate,
            });
        }
        bent
    }

    /// Whether a displacement at rest is told from the noise of the position.
    pub fn shows(&self, displacement: f64) -> bool {
        displacement >= CERTAIN * self.position_noise
    }

    /// Seconds at the speed of the first node that go as far as the axis went to come up to it, at the largest acceleration of
    /// the track: `½·v/a`.
    fn run_up(&self) -> f64 {
        let rises = self.v.windows(2).map(|v| (v[1] - v[0]).abs());
        let largest = rises.fold(0.0, f64::max) / self.period;
        if largest > 0.0 {
            0.5 * self.v[0].abs() / largest
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use bristle_core::friction::LuGre;

    use crate::model::Motion;
    use crate::recording::Recording;
    use crate::weak::Track;

    /// They did in the last bits, and kept columns were those of whichever model had asked first.
    #[test]
    fn damping_and_viscosity_do_not_change_how_bristles_bend() {
        let t: Vec<f64> = (0..2000).map(|k| 1e-3 * f64::from(k)).collect();
        let recording = Recording {
            q: Some(t.iter().map(|t| (7.0 * t).sin()).collect()),
            u: vec![0.0; t.len()],
            t,
            ..Recording::default()
        };
        let track = Track::new(&recording, Motion::Rotary, None);
        let bent = |bristle_damping: f64, viscous: f64| {
            track.bend(&LuGre {
                coulomb: 0.3,
                static_level: 0.5,
                stribeck_velocity: 0.7,
                viscous,
                bristle_stiffness: 11.0,
                bristle_damping,
            })
        };
        assert_eq!(bent(0.83, 0.037), bent(0.0, 0.0));
    }
}
