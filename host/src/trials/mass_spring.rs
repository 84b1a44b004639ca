//! A mass on a spring with friction, tuned by its own identification (the source's fig. 6).
//!
//! A mass around 1 kg on a spring around 200 N/m under a force of at most 20 N, whose friction is around 30 % of that; a
//! scale of 10 µm, 1 kHz. The controller starts from the catalogue: a mass of 1 kg, no spring, no friction. DBI sees each
//! stretch of 8 s and gives θ̂ and its status; where the status allows, both the friction model and the gains are computed
//! anew. Mass, spring and friction change after the second stretch, and the last stretch is judged. A step and a move
//! back to a standstill end the run.

use std::f64::consts::TAU;

use bristle_core::control::{Learning, Limits, Parameters};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::finish::Finish;
use super::{
    Layout, Merit, Played, Shown, Trial, Way, between, classic, found, levels_over, said, tracked,
    usable,
};
use crate::error::{Error, Result};
use crate::model::Model;
use crate::servo::{Aim, Make, Servo, settled, step};
use crate::tune::{Wish, parameters};

const WISH: Wish = Wish {
    bandwidth: 6.0,
    rate: 1000.0,
    counts: 1e5,
    limit: 20.0,
    current: None,
};
const SHARE: f64 = 0.3;
const DISTURBANCE: f64 = 0.05;
const PERIOD: f64 = 1e-3;
/// Stretches of tracking: before and after the first identification, then the change, and after the second one.
const STRETCH: f64 = 8.0;
const CHANGE: f64 = 2.0 * STRETCH;
const TRACKED: f64 = 4.0 * STRETCH;
const STEP: f64 = 5e-3;
const STEPPED: f64 = TRACKED + 2.0;
const END: f64 = STEPPED + 4.0;

pub(super) fn layout() -> Layout {
    Layout {
        period: PERIOD,
        count: 1.0 / WISH.counts,
        changes: vec![CHANGE],
        judged: vec![[3.0 * STRETCH, TRACKED]],
    }
}

struct Drawn {
    mass: [f64; 2],
    spring: [f64; 2],
    viscous: f64,
    levels: [f64; 2],
    amplitude: f64,
    frequency: f64,
}

impl Drawn {
    fn new(rng: &mut ChaCha8Rng) -> Self {
        let mut pair = |nominal: f64, low: f64, high: f64| {
            let first = nominal * rng.random_range(low..high);
            [first, first * rng.random_range(0.7..1.4)]
        };
        let (mass, spring) = (pair(1.0, 0.7, 1.5), pair(200.0, 0.6, 1.6));
        let level = SHARE * WISH.limit * rng.random_range(0.9..1.1);
        let drawn = Self {
            mass,
            spring,
            viscous: rng.random_range(1.0..4.0),
            levels: [level, level * rng.random_range(0.6..1.4)],
            amplitude: rng.random_range(0.015..0.03),
            frequency: rng.random_range(0.25..0.5),
        };
        Self {
            amplitude: drawn.amplitude.min(drawn.reach()),
            ..drawn
        }
    }

    /// The largest amplitude for which mass, spring and friction leave a fifth of the force in reserve, all the time.
    fn reach(&self) -> f64 {
        let omega = TAU * self.frequency;
        let most = |pair: [f64; 2]| pair[0].max(pair[1]);
        let shares = WAVES.map(|(share, ratio)| {
            [
                share,
                share * (ratio * omega),
                share * (ratio * omega).powi(2),
            ]
        });
        let [q, v, a] = [0, 1, 2].map(|k| shares.iter().map(|s| s[k]).sum::<f64>());
        let per_amplitude = most(self.spring) * q + self.viscous * v + most(self.mass) * a;
        (0.8 * WISH.limit - most(self.levels)) / per_amplitude
    }

    fn model(&self, changed: usize) -> Result<Model> {
        let text = format!(
            "[plant]\nkind = \"mass-spring\"\nmotion = \"linear\"\ninput = \"force\"\ninertia = {}\nstiffness = {}\n[friction]\ncoulomb = {}\nviscous = {}\n",
            self.mass[changed], self.spring[changed], self.levels[changed], self.viscous
        );
        Model::parse(&text).map_err(Error::Internal)
    }

    /// A slow sine with a quarter of a faster one on top, which shows the mass.
    fn aim(&self, t: f64) -> Aim {
        let mut sum = [0.0; 3];
        for (share, ratio) in WAVES {
            let (a, omega) = (share * self.amplitude, ratio * TAU * self.frequency);
            let (sine, cosine) = (omega * t).sin_cos();
            sum[0] += a * sine;
            sum[1] += a * omega * cosine;
            sum[2] -= a * omega * omega * sine;
        }
        let [q, v, a] = sum;
        Aim::Position { q, v, a }
    }
}

/// What is tracked: the share of each sine, and its frequency over the slow one's.
const WAVES: [(f64, f64); 2] = [(1.0, 1.0), (0.25, 5.0)];

/// What DBI is asked.
const ASKED: &str = "[plant]\nmotion = \"linear\"\ninput = \"force\"\ninertia = \"?\"\n[friction]\nmodel = \"coulomb-viscous\"\ncoulomb = \"?\"\nviscous = \"?\"\n[effects.spring]\nstiffness = \"?\"\n";
/// What is believed before anything was identified.
const CATALOGUE: &str = "[plant]\nmotion = \"linear\"\ninput = \"force\"\ninertia = 1.0\n[friction]\ncoulomb = 0.0\nviscous = 0.0\n";

fn tuned(model: &Model) -> Result<Parameters<f64>> {
    let mut tuned = parameters(model, &WISH)?;
    tuned.adaptation.method = Learning::Off;
    Ok(tuned)
}

fn parse(text: &str) -> Result<Model> {
    Model::parse(text).map_err(Error::Internal)
}

pub(super) fn play(number: u64, mut rng: ChaCha8Rng, make: &mut dyn Make) -> Result<Played> {
    let drawn = Drawn::new(&mut rng);
    let seed = rng.random();
    let mut identified = Vec::new();
    let (mut merits, mut shown) = (Vec::new(), Vec::new());
    for way in [Way::Classic, Way::OffLine, Way::Tuned, Way::SelfTuned] {
        let first = classic(&tuned(&parse(CATALOGUE)?)?);
        let mut servo = Servo::new(make, &drawn.model(0)?, &first, DISTURBANCE, seed)?;
        for stretch in 1..=4_u8 {
            let until = f64::from(stretch) * STRETCH;
            while servo.now() < until - 1e-9 {
                servo.step(drawn.aim(servo.now()))?;
            }
            let changed = usize::from(stretch > 2);
            let asks = match way {
                Way::SelfTuned | Way::Tuned => stretch < 4,
                // Once, before the change.
                _ => way == Way::OffLine && stretch == 1,
            };
            if asks
                && let Some(model) = found(&servo.recording(until - STRETCH, until), &parse(ASKED)?)
            {
                if way == Way::SelfTuned {
                    identified.push(said(&model.coulomb, drawn.levels[changed]));
                }
                // (θ̂, status): what the stretch does not show changes nothing.
                if usable(&model.inertia) && usable(&model.coulomb) {
                    let all = tuned(&model)?;
                    servo.change_parameters(&if way == Way::Tuned {
                        classic(&all)
                    } else {
                        all
                    })?;
                }
            }
            if stretch == 2 {
                servo.change_plant(&drawn.model(1)?)?;
            }
        }
        let finish = Finish {
            step: STEP,
            until: [STEPPED, END],
            limits: Limits {
                velocity: 0.1,
                acceleration: 1.0,
                jerk: 20.0,
            },
            count: layout().count,
            period: PERIOD,
        };
        finish.run(&mut servo)?;
        merits.push(judge(way, &servo));
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
        truth: levels_over(&drawn.levels, &[CHANGE], END, PERIOD),
    })
}

fn judge(way: Way, servo: &Servo<'_>) -> Merit {
    let (samples, layout) = (servo.samples(), layout());
    let (standstill, travel) = settled(between(samples, [END - 1.0, END], PERIOD), layout.count);
    Merit {
        step: Some(step(between(samples, [TRACKED, STEPPED], PERIOD), PERIOD)),
        standstill: Some(standstill),
        travel: Some(travel),
        ..tracked(way, samples, &layout, TRACKED)
    }
}
