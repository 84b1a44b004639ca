//! Angular position of the Quanser SRV02 with an on-line estimate of Coulomb friction.
//!
//! The plant is that of `host/src/plant/geared_servo.rs` with a load of its own on the shaft, 4096 counts a turn, 1 kHz and
//! 6 V, its nominal voltage. Rated torque is that of its recommended continuous current of 1 A, 0.33 N·m at the shaft, and
//! Coulomb friction starts around 30 % of it, with up to 15 % more at break-away. A slow sine, friction changing on the way,
//! then a slow triangle with another change, then a step, and a move back to a standstill.
//!
//! Off-line, DBI identifies inertia and friction from a recording before any change.

use std::f64::consts::TAU;

use bristle_core::control::{Learning, Limits, Parameters};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::commission::{Bench, commission};
use super::finish::Finish;
use super::{
    Layout, Merit, Played, Shown, Trial, Way, between, classic, convergence, levels_over, said,
    tracked,
};
use crate::error::{Error, Result};
use crate::model::Model;
use crate::servo::{Aim, Make, Servo, settled, step};
use crate::tune::{Drive, Wish, parameters};

const WISH: Wish = Wish {
    bandwidth: 6.0,
    rate: 1000.0,
    counts: 4096.0,
    limit: 6.0,
    current: None,
};
/// Torque of 1 A at the shaft, N·m.
const RATED: f64 = 0.90 * 0.69 * 70.0 * 7.68e-3;
/// Share of rated torque that friction takes.
const SHARE: f64 = 0.3;
/// Torque that nobody knows, RMS, as a share of rated torque.
const DISTURBANCE: f64 = 0.005;

const PERIOD: f64 = 1e-3;
/// End of the sine, of the triangle, of the step and of the whole, s.
const ENDS: [f64; 4] = [10.0, 20.0, 22.0, 26.0];
const CHANGES: [f64; 2] = [4.0, 14.0];
/// Within this time an adaptation is to have converged, s.
const TIME_TO_CONVERGE: f64 = 2.0;
const STEP: f64 = 0.5;

pub(super) fn layout() -> Layout {
    let judged = |change: f64, end: f64| [change + TIME_TO_CONVERGE, end];
    Layout {
        period: PERIOD,
        count: TAU / WISH.counts,
        changes: CHANGES.to_vec(),
        judged: vec![judged(CHANGES[0], ENDS[0]), judged(CHANGES[1], ENDS[1])],
    }
}

/// A servo as drawn.
struct Drawn {
    load: f64,
    viscous: f64,
    excess: f64,
    levels: [f64; 3],
    /// Of the sine and of the triangle: amplitude in rad, and rad/s² rad/s of the slope.
    amplitude: f64,
    frequency: f64,
}

impl Drawn {
    fn new(rng: &mut ChaCha8Rng) -> Self {
        let start = SHARE * RATED * rng.random_range(0.9..1.1);
        Self {
            load: rng.random_range(0.0..2e-3),
            viscous: 0.015 * rng.random_range(0.7..1.3),
            excess: rng.random_range(1.0..1.15),
            levels: [
                start,
                start * rng.random_range(0.6..1.5),
                start * rng.random_range(0.6..1.5),
            ],
            amplitude: rng.random_range(0.4..0.8),
            frequency: rng.random_range(0.2..0.4),
        }
    }

    /// The plant after so many changes.
    fn model(&self, changes: usize) -> Result<Model> {
        let coulomb = self.levels[changes];
        let text = format!(
            "[plant]\nkind = \"geared-servo\"\nmotion = \"rotary\"\ninput = \"voltage\"\ninertia = {:e}\nresistance = 2.6\ninductance = 0.18e-3\ntorque_constant = 7.68e-3\nmotor_inertia = 4.61e-7\ngear_ratio = 70\ngear_efficiency = 0.90\nmotor_efficiency = 0.69\n[friction]\nmodel = \"stribeck\"\ncoulomb = {coulomb}\nviscous = {}\nstatic = {}\nstribeck_velocity = 0.1\n",
            5.3e-5 + self.load,
            self.viscous,
            coulomb * self.excess,
        );
        Model::parse(&text).map_err(Error::Internal)
    }

    /// What is asked for at an instant of tracking.
    fn track(&self, t: f64) -> Aim {
        let omega = TAU * self.frequency;
        if t < ENDS[0] {
            let (sine, cosine) = (omega * t).sin_cos();
            let a = self.amplitude;
            return Aim::Position {
                q: a * sine,
                v: a * omega * cosine,
                a: -a * omega * omega * sine,
            };
        }
        self.triangle(t - ENDS[0])
    }

    /// A triangle whose corners are rounded within 20 ms to either side, from where the sine ended.
    fn triangle(&self, t: f64) -> Aim {
        const CORNER: f64 = 0.02;
        let begun = (TAU * self.frequency * ENDS[0]).sin() * self.amplitude;
        let speed = 4.0 * self.amplitude * self.frequency;
        let half = 0.5 / self.frequency;
        // Speed as a function of time: trapezoids between +speed and −speed, which start from rest.
        let (mut q, mut sign, mut at) = (begun, 1.0, 0.0);
        let mut rest = t;
        let first = (rest / CORNER).min(1.0);
        if rest < CORNER {
            let a = speed / CORNER;
            return Aim::Position {
                q: q + 0.5 * a * rest * rest,
                v: speed * first,
                a,
            };
        }
        q += 0.5 * speed * CORNER;
        rest -= CORNER;
        // A quarter of a period up, then halves down and up.
        let mut straight = 0.5 * half - CORNER;
        loop {
            if rest < straight {
                return Aim::Position {
                    q: q + sign * speed * rest,
                    v: sign * speed,
                    a: 0.0,
                };
            }
            q += sign * speed * straight;
            rest -= straight;
            at += 1.0;
            if rest < 2.0 * CORNER {
                let a = -sign * speed / CORNER;
                return Aim::Position {
                    q: q + sign * speed * rest + 0.5 * a * rest * rest,
                    v: sign * speed + a * rest,
                    a,
                };
            }
            rest -= 2.0 * CORNER;
            sign = -sign;
            straight = half - 2.0 * CORNER;
            debug_assert!(at < 1e6);
        }
    }
}

/// What DBI makes of the servo before any change.
fn identified(drawn: &Drawn, seed: u64) -> Result<Model> {
    let truth = drawn.model(0)?;
    let drive = Drive::of(&truth)?;
    let asked = format!(
        "[plant]\nmotion = \"rotary\"\ninput = \"voltage\"\ngain = {}\nback_emf = {}\ninertia = \"?\"\n[friction]\nmodel = \"coulomb-viscous\"\ncoulomb = \"?\"\nviscous = \"?\"\n",
        drive.gain, drive.back_emf
    );
    let asked = Model::parse(&asked).map_err(Error::Internal)?;
    let bench = Bench {
        amplitude: 0.8,
        band: (0.2, 3.0),
        load_noise: DISTURBANCE * RATED,
        seed,
    };
    commission(&truth, &asked, &WISH, &bench)
}

pub(super) fn play(number: u64, mut rng: ChaCha8Rng, make: &mut dyn Make) -> Result<Played> {
    let drawn = Drawn::new(&mut rng);
    let seed = rng.random();
    let model = identified(&drawn, seed)?;
    let tuned = parameters(&model, &WISH)?;
    let learning = |method: Learning| {
        let mut parameters = tuned;
        parameters.adaptation.method = method;
        parameters
    };
    let ways = [
        (Way::Classic, classic(&tuned)),
        (Way::OffLine, learning(Learning::Off)),
        (Way::Observer, learning(Learning::Observer)),
        (Way::Rows, learning(Learning::Rows)),
    ];
    let truth = levels_over(&drawn.levels, &CHANGES, ENDS[3], PERIOD);
    let (mut merits, mut shown) = (Vec::new(), Vec::new());
    for (way, parameters) in ways {
        let servo = drive(make, &drawn, &parameters, seed)?;
        merits.push(judge(way, &servo, &truth));
        shown.push(Shown::of(way, &servo));
    }
    Ok(Played {
        trial: Trial {
            plant: number,
            levels: drawn.levels.to_vec(),
            identified: vec![said(&model.coulomb, drawn.levels[0])],
            merits,
        },
        shown,
        truth,
    })
}

fn drive<'a>(
    make: &'a mut dyn Make,
    drawn: &Drawn,
    parameters: &Parameters<f64>,
    seed: u64,
) -> Result<Servo<'a>> {
    let mut servo = Servo::new(
        make,
        &drawn.model(0)?,
        parameters,
        DISTURBANCE * RATED,
        seed,
    )?;
    let mut changes = 0;
    while servo.now() < ENDS[1] - 1e-9 {
        if changes < CHANGES.len() && servo.now() >= CHANGES[changes] - 1e-9 {
            changes += 1;
            servo.change_plant(&drawn.model(changes)?)?;
        }
        servo.step(drawn.track(servo.now()))?;
    }
    let finish = Finish {
        step: STEP,
        until: [ENDS[2], ENDS[3]],
        limits: Limits {
            velocity: 2.0,
            acceleration: 10.0,
            jerk: 200.0,
        },
        count: TAU / WISH.counts,
        period: PERIOD,
    };
    finish.run(&mut servo)?;
    Ok(servo)
}

fn judge(way: Way, servo: &Servo<'_>, truth: &[f64]) -> Merit {
    let (samples, layout) = (servo.samples(), layout());
    let learned = matches!(way, Way::Observer | Way::Rows);
    let (standstill, travel) = settled(
        between(samples, [ENDS[3] - 1.0, ENDS[3]], PERIOD),
        layout.count,
    );
    Merit {
        step: Some(step(between(samples, [ENDS[1], ENDS[2]], PERIOD), PERIOD)),
        standstill: Some(standstill),
        travel: Some(travel),
        convergence: learned
            .then(|| convergence(samples, truth, &layout, ENDS[1]))
            .flatten(),
        ..tracked(way, samples, &layout, ENDS[1])
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{Aim, Drawn, ENDS, PERIOD};

    #[test]
    fn the_set_point_is_smooth_and_its_rates_are_its_own() {
        let drawn = Drawn::new(&mut ChaCha8Rng::seed_from_u64(3));
        let at = |t: f64| match drawn.track(t) {
            Aim::Position { q, v, a } => (q, v, a),
            Aim::Velocity { .. } => unreachable!("a position is tracked"),
        };
        for k in 1..20_000 {
            let t = f64::from(k) * PERIOD;
            let ((q, v, _), (next, w, _)) = (at(t), at(t + PERIOD));
            // Where sine and triangle meet, the speed jumps.
            if (t - ENDS[0]).abs() > 2.0 * PERIOD {
                let mean = 0.5 * (v + w) * PERIOD;
                assert!((next - q - mean).abs() < 2e-5, "{t}: {} {mean}", next - q);
            }
        }
        let far = (0..20_000)
            .map(|k| at(f64::from(k) * PERIOD).0.abs())
            .fold(0.0, f64::max);
        assert!(far < 2.0 * drawn.amplitude);
    }
}
