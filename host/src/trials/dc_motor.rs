//! Angular velocity of a DC motor with simplified Dahl friction, adapted by DBI off-line (the source's fig. 5).
//!
//! A motor of 0.1 N·m rated torque under voltage, 4096 counts a turn, 1 kHz; Coulomb friction starts around 30 % of rated
//! torque and acts through bristles that yield at about a degree. Their stiffness σ is known off-line; DBI gives the level,
//! the viscous coefficient and their status s, and only what is excited is put to use. The compensator is F̂v and the state
//! of the bristles, driven by the set point. Three stretches of a slow sine and a slow triangle in velocity: under the
//! friction of before, under the changed one, and, after DBI has seen the second stretch, under the changed one again.

use std::f64::consts::TAU;

use bristle_core::control::{Learning, Parameters};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::commission::{Bench, commission};
use super::{
    Layout, Played, Shown, Trial, Way, classic, found, levels_over, said, tracked, usable,
};
use crate::error::{Error, Result};
use crate::model::Model;
use crate::servo::{Aim, Make, Servo};
use crate::tune::{Wish, parameters};

const WISH: Wish = Wish {
    bandwidth: 8.0,
    rate: 1000.0,
    counts: 4096.0,
    limit: 24.0,
    current: None,
};
const RATED: f64 = 0.1;
const SHARE: f64 = 0.3;
const DISTURBANCE: f64 = 0.005;
const TORQUE_CONSTANT: f64 = 0.05;
const RESISTANCE: f64 = 1.0;
const PERIOD: f64 = 1e-3;
/// Stretches begin here; friction changes with the second, and DBI has its say before the third.
const STRETCH: f64 = 8.0;
const END: f64 = 3.0 * STRETCH;

pub(super) fn layout() -> Layout {
    Layout {
        period: PERIOD,
        count: TAU / WISH.counts,
        changes: vec![STRETCH],
        judged: vec![[2.0 * STRETCH, END]],
    }
}

struct Drawn {
    inertia: f64,
    viscous: [f64; 2],
    levels: [f64; 2],
    stiffness: f64,
    amplitude: f64,
    frequency: f64,
}

impl Drawn {
    fn new(rng: &mut ChaCha8Rng) -> Self {
        let level = SHARE * RATED * rng.random_range(0.9..1.1);
        let viscous = 1e-4 * rng.random_range(0.7..1.3);
        Self {
            inertia: 5e-5 * rng.random_range(0.7..1.4),
            viscous: [viscous, viscous * rng.random_range(0.5..2.0)],
            levels: [level, level * rng.random_range(0.6..1.5)],
            // Yields after 0.7 to 1.5 degrees.
            stiffness: level / (TAU / 360.0 * rng.random_range(0.7..1.5)),
            amplitude: rng.random_range(4.0..10.0),
            frequency: rng.random_range(0.4..0.8),
        }
    }

    fn model(&self, changed: usize) -> Result<Model> {
        let text = format!(
            "[plant]\nkind = \"dc-motor\"\nmotion = \"rotary\"\ninput = \"voltage\"\ninertia = {:e}\nresistance = {RESISTANCE}\ninductance = 0.5e-3\ntorque_constant = {TORQUE_CONSTANT}\n[friction]\nmodel = \"dahl\"\ncoulomb = {}\nviscous = {:e}\nbristle_stiffness = {}\n",
            self.inertia, self.levels[changed], self.viscous[changed], self.stiffness
        );
        Model::parse(&text).map_err(Error::Internal)
    }

    /// What DBI is asked: the motor's constants are those of its data sheet, σ is known.
    fn asked(&self, inertia: &str) -> Result<Model> {
        let text = format!(
            "[plant]\nmotion = \"rotary\"\ninput = \"voltage\"\ngain = {}\nback_emf = {TORQUE_CONSTANT}\ninertia = {inertia}\n[friction]\nmodel = \"dahl\"\ncoulomb = \"?\"\nviscous = \"?\"\nbristle_stiffness = {}\n",
            TORQUE_CONSTANT / RESISTANCE,
            self.stiffness
        );
        Model::parse(&text).map_err(Error::Internal)
    }

    /// A sine for the first half of a stretch, a triangle for the second; both through zero.
    fn aim(&self, t: f64) -> Aim {
        let within = t.rem_euclid(STRETCH);
        // Whole periods to a half, so that each begins and ends at zero.
        let half = 0.5 * STRETCH;
        let frequency = (self.frequency * half).round() / half;
        if within < half {
            let (sine, cosine) = (TAU * frequency * within).sin_cos();
            let v = self.amplitude * sine;
            return Aim::Velocity {
                v,
                a: self.amplitude * TAU * frequency * cosine,
            };
        }
        let phase = (frequency * (within - half) + 0.25).fract();
        let slope = 4.0 * self.amplitude * frequency;
        let rising = phase < 0.5;
        Aim::Velocity {
            v: self.amplitude * (1.0 - 4.0 * (phase - 0.5).abs()),
            a: if rising { slope } else { -slope },
        }
    }
}

fn tuned(model: &Model) -> Result<Parameters<f64>> {
    let mut tuned = parameters(model, &WISH)?;
    // Adapted off-line, by DBI alone.
    tuned.adaptation.method = Learning::Off;
    Ok(tuned)
}

pub(super) fn play(number: u64, mut rng: ChaCha8Rng, make: &mut dyn Make) -> Result<Played> {
    let drawn = Drawn::new(&mut rng);
    let seed = rng.random();
    let bench = Bench {
        amplitude: 2.0,
        band: (0.3, 5.0),
        load_noise: DISTURBANCE * RATED,
        seed,
    };
    let before = commission(&drawn.model(0)?, &drawn.asked("\"?\"")?, &WISH, &bench)?;
    let start = tuned(&before)?;
    let mut identified = vec![said(&before.coulomb, drawn.levels[0])];
    let layout = layout();
    let (mut merits, mut shown) = (Vec::new(), Vec::new());
    for way in [Way::Classic, Way::OffLine, Way::Reidentified] {
        let first = if way == Way::Classic {
            classic(&start)
        } else {
            start
        };
        let mut servo = Servo::new(make, &drawn.model(0)?, &first, DISTURBANCE * RATED, seed)?;
        run(&mut servo, &drawn, STRETCH)?;
        servo.change_plant(&drawn.model(1)?)?;
        run(&mut servo, &drawn, 2.0 * STRETCH)?;
        if way == Way::Reidentified {
            let inertia = before.inertia.value.unwrap_or_default();
            let again = found(
                &servo.recording(STRETCH, 2.0 * STRETCH),
                &drawn.asked(&format!("{inertia:e}"))?,
            );
            if let Some(again) = again {
                identified.push(said(&again.coulomb, drawn.levels[1]));
                // What the stretch does not show stays as it was.
                if usable(&again.coulomb) {
                    servo.change_parameters(&tuned(&again)?)?;
                }
            }
        }
        run(&mut servo, &drawn, END)?;
        merits.push(tracked(way, servo.samples(), &layout, END));
        shown.push(Shown::of(way, &servo));
    }
    Ok(Played {
        trial: Trial {
            plant: number,
            levels: drawn.levels.to_vec(),
            identified,
            merits,
        },
        shown,
        truth: levels_over(&drawn.levels, &[STRETCH], END, PERIOD),
    })
}

fn run(servo: &mut Servo<'_>, drawn: &Drawn, until: f64) -> Result<()> {
    while servo.now() < until - 1e-9 {
        servo.step(drawn.aim(servo.now()))?;
    }
    Ok(())
}
