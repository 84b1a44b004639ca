//! From a recipe to a recording: reach the speed, draw the effects, size them, judge, try again.

use super::draw::{Basis, Setup};
use super::effect::{Effect, Law};
use super::integrator::{Axis, Place};
use super::measure::{Look, Point, look, remainder, rms};
use super::recipe::{Control, Motion, Recipe, stream};
use super::run::{Run, Scale, run};
use super::{Case, Recording};

/// Step of the recording, s.
const FINE: f64 = 50e-6;
/// Step while amplitudes are sought, s.
const COARSE: f64 = 250e-6;
/// Attempts at a seed before the best is taken as it is.
const ATTEMPTS: u64 = 8;

/// One attempt: an axis with amplitudes.
struct Trial<'a> {
    recipe: &'a Recipe,
    setup: Setup,
    axis: Axis,
    scale: Scale,
}

/// Simulates a recipe; `None` if no attempt moves. Panics if it asks for an effect that its motion or control cannot
/// show.
pub fn simulate(recipe: &Recipe) -> Option<Recording> {
    recipe.check();
    let mut best: Option<(f64, Recording)> = None;
    for attempt in 0..ATTEMPTS {
        let Some(mut trial) = Trial::calibrated(recipe, attempt) else {
            continue;
        };
        if !trial.size_effects(attempt) && attempt + 1 < ATTEMPTS {
            continue;
        }
        let (cost, recording) = trial.record();
        if recording.truth.met {
            return Some(recording);
        }
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, recording));
        }
    }
    best.map(|(_, recording)| recording)
}

impl<'a> Trial<'a> {
    /// Scales excitation and friction, without effects, until the speed is the one wanted and friction
    /// has its shares of the torque.
    fn calibrated(recipe: &'a Recipe, attempt: u64) -> Option<Self> {
        let setup = Setup::draw(recipe, attempt);
        let excitation = match recipe.control {
            // A guess: top speed from rest in 0.1 s at RMS torque.
            Control::Open => setup.inertia * setup.top_speed / 0.1,
            Control::Pd => setup.top_speed,
        };
        let guess = setup.inertia * setup.top_speed / 0.2;
        let mut trial = Self {
            recipe,
            axis: Axis::plain(
                setup.inertia,
                setup.coulomb * guess,
                setup.viscous * guess / setup.top_speed,
            ),
            scale: Scale {
                excitation,
                noise: 0.0,
            },
            setup,
        };
        for _ in 0..5 {
            let (seen, u_rms) = trial.coarse();
            if recipe.control == Control::Open {
                let mut gain = trial.setup.top_speed / seen.top_speed;
                let travel = seen.hi - seen.lo;
                if recipe.motion == Motion::Linear && gain * travel > 0.9 {
                    gain = 0.9 / travel;
                }
                trial.scale.excitation *= gain.clamp(0.1, 10.0);
            }
            trial.axis.coulomb = trial.setup.coulomb * u_rms;
            trial.axis.viscous = trial.setup.viscous * u_rms / seen.top_speed;
            trial.scale.noise = recipe.noise.fraction() * u_rms;
        }
        let (seen, u_rms) = trial.coarse();
        trial.scale.noise = recipe.noise.fraction() * u_rms;
        trial.sane(&seen).then_some(trial)
    }

    fn run(&self, h: f64) -> Run {
        run(self.recipe, &self.setup, &self.axis, self.scale, h)
    }

    fn coarse(&self) -> (Look, f64) {
        let out = self.run(COARSE);
        (look(&out.trace), rms(&out.u))
    }

    fn sane(&self, seen: &Look) -> bool {
        let travel = seen.hi - seen.lo;
        let bounded = match self.recipe.motion {
            Motion::Rotary => travel < 600.0 && seen.top_speed < 120.0,
            Motion::Linear => travel < 1.3 && seen.top_speed < 2.0,
        };
        let enough = self.recipe.duration / 24.0 * 8.0;
        bounded && seen.moving > 0.6 && seen.reversals as f64 >= enough
    }

    /// Draws the effects and finds their scales by a secant in logarithms. False if that failed.
    fn size_effects(&mut self, attempt: u64) -> bool {
        if self.recipe.effects.is_empty() {
            return true;
        }
        let out = self.run(COARSE);
        let seen = look(&out.trace);
        let basis = Basis {
            recipe: self.recipe,
            look: &seen,
            u_rms: rms(&out.u),
            u_peak: out.u.iter().fold(0.0, |m, u| u.abs().max(m)),
        };
        let mut rng = stream(self.recipe.seed, 4, attempt);
        for id in &self.recipe.effects {
            let effect = basis.effect(&mut rng, id, &mut self.axis);
            self.axis.effects.push(effect);
        }
        let mut last: Vec<Option<(f64, f64)>> = vec![None; self.axis.effects.len()];
        for _ in 0..8 {
            let out = self.run(COARSE);
            let u_rms = rms(&out.u);
            if !u_rms.is_finite() {
                return false;
            }
            self.scale.noise = self.recipe.noise.fraction() * u_rms;
            let sizes = self.sizes(&out, u_rms);
            let off = |size: &f64| (size / self.recipe.size - 1.0).abs();
            if sizes.iter().all(|s| off(s) < 0.06) {
                return true;
            }
            for ((effect, size), last) in self.axis.effects.iter_mut().zip(&sizes).zip(&mut last) {
                effect.rescale(*size, self.recipe.size, last);
            }
        }
        false
    }

    /// Size of each effect along a run.
    fn sizes(&self, out: &Run, u_rms: f64) -> Vec<f64> {
        let size = |e: &Effect| {
            let torque: Vec<f64> = out.trace.iter().map(|p| e.torque(p, &self.axis)).collect();
            // The encoder's noise in u is not what a delay is seen by: look below 50 Hz.
            let average = match e.law {
                Law::Delay | Law::ActuatorLag | Law::Compliance { .. } | Law::Backlash { .. } => {
                    (0.01 * self.recipe.rate) as usize
                }
                _ => 0,
            };
            match e.law {
                // All of it is what a free inertia imitates; the model's is given.
                Law::InertiaMismatch { .. } => rms(&torque) / u_rms,
                _ => remainder(&out.trace, &torque, average) / u_rms,
            }
        };
        self.axis.effects.iter().map(size).collect()
    }

    /// Runs with fine steps; the cost tells how far the result is from what was asked for.
    fn record(&self) -> (f64, Recording) {
        let out = self.run(FINE);
        let u_rms = rms(&out.u);
        let seen = look(&out.trace);
        let sizes = self.sizes(&out, u_rms);
        let off = |s: &f64| (s / self.recipe.size).ln().abs();
        let worst = sizes.iter().map(off).fold(0.0, f64::max);
        let finite = out.u.iter().chain(&out.q).all(|x| x.is_finite());
        let sane = finite && self.sane(&seen);
        let truth = Case {
            seed: self.recipe.seed,
            effects: self.recipe.effects.iter().copied().zip(sizes).collect(),
            parameters: self
                .axis
                .effects
                .iter()
                .flat_map(Effect::parameters)
                .collect(),
            inertia: self.axis.inertia,
            coulomb: self.axis.coulomb,
            viscous: self.axis.viscous,
            u_rms,
            noise_rms: self.scale.noise,
            top_speed: seen.top_speed,
            travel: seen.hi - seen.lo,
            reversals: seen.reversals,
            moving: seen.moving,
            count: self.recipe.count(),
            excitation: self.setup.excitation.kind,
            q: out.q,
            v: out.v,
            met: sane && worst < 0.18,
        };
        let recording = Recording {
            t: (0..out.u.len())
                .map(|k| k as f64 / self.recipe.rate)
                .collect(),
            u: out.u,
            q: out.encoder,
            motion: self.recipe.motion,
            truth,
        };
        (worst + if sane { 0.0 } else { 10.0 }, recording)
    }
}

impl Effect {
    /// Torque that the effect adds to an axis with Coulomb and viscous friction.
    fn torque(&self, p: &Point, axis: &Axis) -> f64 {
        let at = Place {
            q: p.q,
            t: p.t,
            load: p.u.abs(),
        };
        match self.law {
            Law::Delay | Law::ActuatorLag => p.late,
            Law::Compliance { .. } | Law::Backlash { .. } => p.hung,
            Law::InertiaMismatch { .. } => axis.inertia * p.a * self.x,
            Law::SensorEccentricity { phase } => {
                // The second derivative of the error, which the encoder feigns.
                let (sin, cos) = (p.q + phase).sin_cos();
                axis.inertia * self.x * (cos * p.a - sin * p.v * p.v)
            }
            Law::Presliding { .. } => axis.coulomb * p.side - p.bristle,
            _ => {
                let friction = self.friction(p.v.abs(), p.side, &at);
                self.drive(p.u, p.q, p.t) - p.u + self.external(p.q, p.v, p.t) - p.side * friction
            }
        }
    }

    /// Moves the scale towards the size wanted, along the slope seen since the last call.
    fn rescale(&mut self, size: f64, wanted: f64, last: &mut Option<(f64, f64)>) {
        let here = (self.x.ln(), size.max(1e-9).ln());
        let slope = match *last {
            Some((x, y)) if (here.0 - x).abs() > 1e-3 => {
                ((here.1 - y) / (here.0 - x)).clamp(0.3, 4.0)
            }
            _ => 1.0,
        };
        *last = Some(here);
        self.x *= ((wanted.ln() - here.1) / slope).clamp(-1.5, 1.5).exp();
        if matches!(self.law, Law::Compliance { .. }) {
            // 6 to 60 Hz.
            self.x = self.x.clamp(1.0 / 3600.0, 1.0 / 36.0);
        }
        if matches!(self.law, Law::Delay | Law::ActuatorLag) {
            self.x = self.x.clamp(1e-3, 8e-3);
        }
    }
}
