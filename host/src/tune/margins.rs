//! How far a loop is from instability.

use std::f64::consts::PI;

use bristle_core::Scalar;
use bristle_core::control::Parameters;
use nalgebra::{Complex, Matrix3, Vector3};
use serde::Serialize;

/// Margins of a loop, cut at the command.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Margins {
    /// Highest frequency at which the loop gain is 1, Hz.
    pub crossover: f64,
    /// What the phase lacks to −180° there, degrees; the least one if there are several crossovers, and negative if the loop is
    /// unstable.
    pub phase: f64,
    /// Factor by which the gain may rise before the loop is unstable; none if no rise makes it so.
    pub gain: Option<f64>,
    /// Further delay that the loop bears, s.
    pub delay: f64,
}

/// Frequencies of the sweep, from a thousandth of a crossover to half of the sampling rate.
const FREQUENCIES: u32 = 4000;

/// The margins of a controller on the axis that it knows, without dry friction, which only helps: the sampled loop of
/// [`bristle_core::control::Controller`], its observer, and the axis under a held command. With a current loop in between,
/// `pace` is the share of its error that it takes away in a sample.
pub fn margins(parameters: &Parameters<f64>, pace: Option<f64>) -> Margins {
    let looped = Loop::new(parameters, pace);
    let nyquist = PI / parameters.period;
    let lowest = 1e-3 * parameters.position_gain.min(nyquist);
    let ratio = (nyquist / lowest).powf(1.0 / f64::from(FREQUENCIES));
    let points: Vec<(f64, f64, f64)> = {
        let mut last = None;
        (0..FREQUENCIES)
            .map(|k| {
                let omega = lowest * ratio.powf(f64::from(k));
                let value = looped.at(omega);
                let mut phase = value.arg();
                // The phase goes on where the principal value jumps.
                while last.is_some_and(|before: f64| phase - before > PI) {
                    phase -= 2.0 * PI;
                }
                while last.is_some_and(|before: f64| phase - before < -PI) {
                    phase += 2.0 * PI;
                }
                last = Some(phase);
                (omega, value.norm(), phase)
            })
            .collect()
    };
    let mut found = Margins {
        crossover: 0.0,
        phase: f64::INFINITY,
        gain: None,
        delay: f64::INFINITY,
    };
    for pair in points.windows(2) {
        let [(omega, gain, phase), (_, next_gain, next_phase)] = [pair[0], pair[1]];
        if (gain - 1.0) * (next_gain - 1.0) <= 0.0 {
            // Between −180° and 180°: what is beyond is a loop that is unstable already.
            let ahead = (phase + PI).rem_euclid(2.0 * PI);
            let margin = if ahead > PI { ahead - 2.0 * PI } else { ahead };
            found.crossover = found.crossover.max(omega / (2.0 * PI));
            found.phase = found.phase.min(margin.to_degrees());
            found.delay = found.delay.min(margin.max(0.0) / omega);
        }
        let odd = |phase: f64| ((phase + PI) / (2.0 * PI)).floor();
        if odd(phase) != odd(next_phase) && gain < 1.0 {
            let margin = 1.0 / gain;
            found.gain = Some(found.gain.map_or(margin, |least: f64| least.min(margin)));
        }
    }
    found
}

/// The sampled loop from command to command.
///
/// The controller is linear in position and command: with the surprise `e = q − q̄` its estimates are
/// `v̄ = a·v̂ + b·τ`, `q̄ = q̂ + h·(v̂ + v̄)/2`, `q̂′ = q̄ + l₁·e`, `v̂′ = v̄ + l₂·e/h`, and
/// `τ = −(kv·(kp·q̂ + v̂) + s)`, where the integral part `s` takes in `ki·h·(kp·q̂ + Δq̂/h)`.
///
/// Under a current loop the current obeys `i′ = i + p·(i_ref − i)`, and what acts over a sample, which the observer is told
/// afterwards, is the mean of its ends: `M = (1 + z)/2·p/(z − 1 + p)` times the command, both on the axis and in the observer.
struct Loop {
    parameters: Parameters<f64>,
    pace: Option<f64>,
    observer: [f64; 2],
}

impl Loop {
    fn new(parameters: &Parameters<f64>, pace: Option<f64>) -> Self {
        let (gone, _) = (parameters.observer_bandwidth * parameters.period).relax();
        Self {
            parameters: *parameters,
            pace,
            observer: [2.0 * gone - gone * gone, gone * gone],
        }
    }

    /// The loop gain at an angular frequency.
    fn at(&self, omega: f64) -> Complex<f64> {
        let p = &self.parameters;
        let h = p.period;
        let z = Complex::new(0.0, omega * h).exp();
        let one = Complex::new(1.0, 0.0);
        let damping = p.friction.viscous;
        // What the observer believes of a sample: forward Euler in the viscous part.
        let (a, b) = (1.0 - damping * h / p.inertia, h / p.inertia);
        let [l1, l2] = self.observer;
        // Unknowns at sample k: q̂, v̂, s. Inputs: position q and torque τ/z of the last sample.
        let (qq, qv, qt) = (1.0, 0.5 * h * (1.0 + a), 0.5 * h * b);
        let estimate = [
            [qq * (1.0 - l1), qv * (1.0 - l1)],
            [-l2 / h * qq, a - l2 / h * qv],
        ];
        let from_torque = [qt * (1.0 - l1), b - l2 / h * qt];
        let row = |k: usize, j: usize| {
            let identity = if k == j { one } else { Complex::default() };
            identity - estimate[k][j] / z
        };
        let zero = Complex::default();
        // s′ = s + ki·(h·kp·q̂ + q̂ − q̂/z), in force from the next sample on.
        let (ki, kp) = (p.velocity_integral, p.position_gain);
        let taken = -ki * (one * (h * kp) + one - one / z) / z;
        let system = Matrix3::new(
            row(0, 0),
            row(0, 1),
            zero,
            row(1, 0),
            row(1, 1),
            zero,
            taken,
            zero,
            one - one / z,
        );
        let solve = |x: Complex<f64>, y: Complex<f64>| {
            let right = Vector3::new(x, y, zero);
            let found = system.lu().solve(&right).unwrap_or_else(Vector3::zeros);
            let kv = p.velocity_gain;
            -(found[0] * kv * kp + found[1] * kv + found[2])
        };
        let by_position = solve(one * l1, one * (l2 / h));
        let by_torque = solve(one * from_torque[0] / z, one * from_torque[1] / z);
        // τ = by_position·q + by_torque·τ, and the loop is cut at τ.
        let made = self
            .pace
            .map_or(one, |pace| 0.5 * pace * (one + z) / (z - 1.0 + pace));
        -(by_position * made / (one - by_torque * made)) * self.axis(z)
    }

    /// Position over held torque: `1/(J·s² + Fv·s)` sampled, with the back-EMF compensated by the controller.
    fn axis(&self, z: Complex<f64>) -> Complex<f64> {
        let p = &self.parameters;
        let (h, one) = (p.period, Complex::new(1.0, 0.0));
        let x = p.friction.viscous * h / p.inertia;
        // v′ = e^(−x)·v + r·h/J·τ, q′ = q + r·h·v + m·h²/J·τ with r = (1 − e^(−x))/x and m = (1 − r)/x.
        let (gone, mean) = x.relax();
        let second = if x < 1e-6 {
            0.5 - x / 6.0
        } else {
            (1.0 - mean) / x
        };
        let velocity = one * (mean * h / p.inertia) / (z - (1.0 - gone));
        (velocity * (mean * h) + second * h * h / p.inertia) / (z - one)
    }
}

#[cfg(test)]
mod tests {
    use bristle_core::control::{Controller, Learning, Method, Parameters, Position, SetPoint};

    use super::margins;
    use crate::model::Model;
    use crate::tune::{Wish, parameters};

    fn tuned(bandwidth: f64) -> Parameters<f64> {
        let text = "[plant]\nmotion = \"rotary\"\ninertia = 0.002\n[friction]\ncoulomb = 0.0\nviscous = 0.004\n";
        let wish = Wish {
            bandwidth,
            rate: 1000.0,
            // So fine that counts do not show.
            counts: 1e7,
            limit: 1e3,
            current: None,
        };
        let mut found = parameters(&Model::parse(text).unwrap(), &wish).unwrap();
        found.compensation.method = Method::Off;
        found.adaptation.method = Learning::Off;
        found
    }

    /// Largest swing in the last quarter of a second after a small push, under the controller itself with its command
    /// multiplied by `gain` and late by `late` samples, made by a current loop of such a pace.
    fn swing(parameters: &Parameters<f64>, pace: f64, gain: f64, late: usize) -> f64 {
        let mut controller = Controller::new(*parameters, 0).unwrap();
        let (mut q, mut v, mut most) = (0.01, 0.0, 0.0_f64);
        let mut made = [0.0; 2];
        let mut commands = vec![0.0; late + 1];
        for k in 0..2000 {
            let counts = (q / parameters.count).floor() as i32;
            // A velocity of next to nothing keeps the integral at work.
            let set_point = SetPoint::Position {
                position: Position::at(0),
                velocity: 1e-12,
                acceleration: 0.0,
            };
            commands.push(controller.step(counts, set_point).command);
            // The current all at once, or in the course of the sample; what is believed knows nothing of being late.
            let mut mean = |which: usize, asked: f64| {
                let before = made[which];
                made[which] += pace * (asked - before);
                let course = 0.5 * (before + made[which]);
                if pace == 1.0 { asked } else { course }
            };
            let asked = commands[commands.len() - 1];
            let believed = mean(0, asked);
            let torque = gain * mean(1, commands[commands.len() - 1 - late]);
            controller.amend(believed - asked, 0.0);
            for _ in 0..10 {
                let dt = 0.1 * parameters.period;
                let next = v + (torque - 0.004 * v) * dt / parameters.inertia;
                q += 0.5 * (v + next) * dt;
                v = next;
            }
            if !q.is_finite() || q.abs() > 100.0 {
                return f64::INFINITY;
            }
            if k >= 1750 {
                most = most.max(q.abs());
            }
        }
        most
    }

    #[test]
    fn the_controller_itself_is_stable_just_inside_its_margins_and_not_beyond() {
        for (bandwidth, pace) in [(5.0, 1.0), (12.0, 1.0), (5.0, 0.25), (12.0, 0.25)] {
            let tuned = tuned(bandwidth);
            let found = margins(&tuned, (pace < 1.0).then_some(pace));
            let most = found.gain.unwrap();
            let swing = |gain, late| swing(&tuned, pace, gain, late);
            assert!(swing(0.9 * most, 0) < 0.01, "{found:?}");
            assert!(swing(1.1 * most, 0) > 0.05, "{found:?}");
            let samples = found.delay / tuned.period;
            assert!(swing(1.0, (0.8 * samples) as usize) < 0.01, "{found:?}");
            let beyond = (1.2 * samples).ceil() as usize;
            assert!(swing(1.0, beyond) > 0.05, "{found:?}");
        }
    }

    #[test]
    fn a_current_loop_that_is_too_slow_leaves_no_margin() {
        let tuned = tuned(12.0);
        let slow = margins(&tuned, Some(0.02));
        assert!(slow.phase < 0.0 && slow.delay == 0.0, "{slow:?}");
        assert!(swing(&tuned, 0.02, 1.0, 0) > 0.05);
        assert!(margins(&tuned, None).phase > 45.0);
    }
}
