//! The sampled loop: encoder, controller, hold, process torque, motion.

use std::f64::consts::TAU;

use super::draw::Setup;
use super::effect::Law;
use super::integrator::{Axis, State};
use super::measure::Point;
use super::recipe::{Control, Recipe};

/// One simulated run.
pub(super) struct Run {
    pub u: Vec<f64>,
    pub encoder: Vec<f64>,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub trace: Vec<Point>,
}

/// Amplitudes that the set-up leaves open.
#[derive(Clone, Copy)]
pub(super) struct Scale {
    /// Torque (open loop) or speed (position control) per unit of the excitation.
    pub excitation: f64,
    /// RMS of the process torque.
    pub noise: f64,
}

/// Position controller or centring loop: proportional, and derivative through a first-order filter.
struct Controller {
    kp: f64,
    kd: f64,
    keep: f64,
    ts: f64,
    last: Option<f64>,
    rate: f64,
}

impl Controller {
    fn new(inertia: f64, bandwidth: f64, damping: f64, corner: f64, ts: f64) -> Self {
        let w = TAU * bandwidth;
        Self {
            kp: inertia * w * w,
            kd: 2.0 * damping * inertia * w,
            keep: (-TAU * corner * ts).exp(),
            ts,
            last: None,
            rate: 0.0,
        }
    }

    fn output(&mut self, error: f64) -> f64 {
        let raw = self.last.map_or(0.0, |last| (error - last) / self.ts);
        self.last = Some(error);
        self.rate = raw + (self.rate - raw) * self.keep;
        self.kp * error + self.kd * self.rate
    }
}

/// Runs the axis with steps no longer than `h`.
pub(super) fn run(recipe: &Recipe, setup: &Setup, axis: &Axis, scale: Scale, h: f64) -> Run {
    let ts = 1.0 / recipe.rate;
    let n = recipe.samples();
    let sub = (ts / h).round().max(1.0) as usize;
    let h = ts / sub as f64;
    let delay = axis
        .effects
        .iter()
        .find(|e| matches!(e.law, Law::Delay))
        .map(|e| e.x);
    let lag = axis
        .effects
        .iter()
        .find(|e| matches!(e.law, Law::ActuatorLag))
        .map(|e| e.x);
    let mut lagged = 0.0;
    let mut controller = setup.controller(recipe, axis.inertia, ts);
    let mut x = State {
        q: setup.start,
        load_q: setup.start,
        ..State::default()
    };
    let mut out = Run {
        u: Vec::with_capacity(n),
        encoder: Vec::with_capacity(n),
        q: Vec::with_capacity(n),
        v: Vec::with_capacity(n),
        trace: Vec::with_capacity(n),
    };
    for k in 0..n {
        let t = k as f64 * ts;
        let count = recipe.count();
        let error: f64 = axis.effects.iter().map(|e| e.error(x.q)).sum();
        let encoder = ((x.q + error + setup.encoder_phase * count) / count).floor() * count;
        let wanted = scale.excitation * setup.excitation.shape[k];
        let u = match recipe.control {
            Control::Open => wanted + controller.output(setup.start - encoder),
            Control::Pd => controller.output(setup.start + wanted - encoder),
        };
        out.u.push(u);
        out.encoder.push(encoder);
        out.q.push(x.q);
        out.v.push(x.v);
        let process = scale.noise * setup.noise[k];
        let mut late = 0.0;
        let before = x;
        for i in 0..sub {
            let held = delay.map_or(u, |d| {
                let from = k as f64 + i as f64 / sub as f64 - d / ts;
                mean_held(&out.u, from, 1.0 / sub as f64)
            });
            let held = lag.map_or(held, |tau| {
                // Trapezoidal rule for tau·dy/dt = u − y.
                let before = lagged;
                let half = 0.5 * h / tau;
                lagged = ((1.0 - half) * before + 2.0 * half * held) / (1.0 + half);
                0.5 * (before + lagged)
            });
            late += (held - u) / sub as f64;
            let at = t + i as f64 * h;
            // Process torque enters through a drive of its own, untouched by effects of the amplifier.
            let next = axis.step(&x, held, process, at, h);
            if i == sub / 2 {
                out.trace.push(point(&x, &next, held, at, h));
            }
            x = next;
        }
        out.trace[k].late = late;
        out.trace[k].hung =
            axis.load_inertia() * ((x.v - before.v) - (x.load_v - before.load_v)) / ts;
    }
    out
}

fn point(x: &State, next: &State, u: f64, t: f64, h: f64) -> Point {
    let v = 0.5 * (x.v + next.v);
    let side = if v == 0.0 { 0.0 } else { v.signum() };
    Point {
        t: t + 0.5 * h,
        q: 0.5 * (x.q + next.q),
        v,
        a: (next.v - x.v) / h,
        side,
        u,
        late: 0.0,
        bristle: next.bristle,
        hung: 0.0,
    }
}

/// Mean of the held samples from `from` over `width` (both in samples, width up to 1); 0 before the start.
fn mean_held(u: &[f64], from: f64, width: f64) -> f64 {
    let at = |index: f64| {
        if index < 0.0 {
            0.0
        } else {
            u[(index as usize).min(u.len() - 1)]
        }
    };
    let first = from.floor();
    let over = (from + width - (first + 1.0)).max(0.0) / width;
    (1.0 - over) * at(first) + over * at(first + 1.0)
}

impl Setup {
    fn controller(&self, recipe: &Recipe, inertia: f64, ts: f64) -> Controller {
        match recipe.control {
            Control::Pd => Controller::new(inertia, self.bandwidth, self.damping, self.corner, ts),
            Control::Open if recipe.centred() => {
                Controller::new(inertia, self.centring, 0.5, 5.0, ts)
            }
            Control::Open => Controller::new(0.0, 0.0, 0.0, 1.0, ts),
        }
    }
}
