//! `bristle tune`

use std::path::PathBuf;

use bristle_core::control::{Compensation, CurrentLoop, Parameters};
use clap::Args;
use serde::Serialize;

use super::diagnose::json;
use super::output::{self, Outputs};
use super::{DONE, Outcome, terminal};
use crate::effects::Quantity;
use crate::error::{Error, Result};
use crate::format::{shortest, significant};
use crate::model::Model;
use crate::tune::{self, Inner, Margins, Wish};

/// Compute the gains of a controller from a model and a bandwidth
///
/// The controller is a cascade of position and velocity with an observer, friction compensation and an adapted Coulomb
/// level, as the firmware runs it. Prints the gains and how far the loop is from instability: phase, gain and delay
/// margin, once as it follows and once with the correction that compensates friction at standstill.
#[derive(Args, Debug)]
pub(super) struct Command {
    /// Model file with a value for every parameter, as identify and diagnose write it
    #[arg(value_name = "MODEL.toml")]
    model: PathBuf,
    /// Frequency up to which the position is to follow its set point, Hz
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    bandwidth: f64,
    /// Samples a second
    #[arg(
        long,
        value_name = "HZ",
        default_value_t = 1000.0,
        allow_negative_numbers = true
    )]
    rate: f64,
    /// Encoder counts per turn or per metre
    #[arg(
        long,
        value_name = "N",
        default_value_t = 4096.0,
        allow_negative_numbers = true
    )]
    counts: f64,
    /// Largest |u|, in the unit of u
    #[arg(long, value_name = "U", allow_negative_numbers = true)]
    limit: f64,
    #[command(flatten)]
    winding: Winding,
    /// Where to write the parameters and the margins
    #[arg(long, value_name = "OUT.json")]
    json: Option<PathBuf>,
}

/// Options of a current loop.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct Winding {
    /// Put a current loop of this bandwidth between controller and u, Hz; for a motor (kind = "dc-motor" or "geared-servo")
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    current_bandwidth: Option<f64>,
    /// Largest current that it may ask for, A [default: what --limit drives at standstill]
    #[arg(
        long,
        value_name = "A",
        requires = "current_bandwidth",
        allow_negative_numbers = true
    )]
    current_limit: Option<f64>,
}

impl Winding {
    pub const fn wish(self) -> Option<Inner> {
        match self.current_bandwidth {
            Some(bandwidth) => Some(Inner {
                bandwidth,
                limit: self.current_limit,
            }),
            None => None,
        }
    }
}

/// What `--json` holds.
#[derive(Serialize)]
struct Tuned<'a> {
    schema: &'static str,
    wish: [f64; 4],
    parameters: &'a Parameters<f64>,
    /// The current loop, if one is wished for.
    current: Option<CurrentLoop<f64>>,
    following: Margins,
    standing: Margins,
    not_compensated: Vec<&'static str>,
}

impl Command {
    pub fn run(&self) -> Outcome {
        output::check(&[&self.model], &[self.json.as_ref()])?;
        let model = Model::read(&self.model)?;
        let wish = Wish {
            bandwidth: self.bandwidth,
            rate: self.rate,
            counts: self.counts,
            limit: self.limit,
            current: self.winding.wish(),
        };
        let parameters = tune::parameters(&model, &wish).map_err(|e| e.in_model(&self.model))?;
        let current = tune::current(&model, &wish).map_err(|e| e.in_model(&self.model))?;
        let following = tune::margins(&parameters, wish.pace());
        let standing = standing(&parameters, &wish);
        refuse_unstable(&following, &standing, &wish)?;
        let tuned = Tuned {
            schema: "bristle.tuning/1",
            wish: [wish.bandwidth, wish.rate, wish.counts, wish.limit],
            parameters: &parameters,
            current,
            following,
            standing,
            not_compensated: tune::left_alone(&model),
        };
        let mut outputs = Outputs::default();
        outputs.add(self.json.as_ref(), || json(&tuned))?;
        let written = outputs.write()?;
        print(&model, &tuned);
        terminal::written(&written);
        Ok(DONE)
    }
}

/// The margins where the correction of friction adds its slope to the position loop.
pub(super) fn standing(parameters: &Parameters<f64>, wish: &Wish) -> Margins {
    let Compensation { slope, driver, .. } = parameters.compensation;
    let share = match driver {
        bristle_core::control::Driver::Command => slope / parameters.velocity_gain,
        _ => 0.0,
    };
    // As the slope acts on kp·(q_ref − q) alone, it is kp that grows; the integral sees the old one.
    let grown = Parameters {
        position_gain: parameters.position_gain * (1.0 + share),
        velocity_integral: parameters.velocity_integral / (1.0 + share),
        ..*parameters
    };
    tune::margins(&grown, wish.pace())
}

/// Below these, what a model leaves out makes a loop ring or worse (a phase margin of 30° peaks at twice the gain).
const LEAST_PHASE: f64 = 30.0;
const LEAST_GAIN: f64 = 2.0;

pub(super) fn refuse_unstable(following: &Margins, standing: &Margins, wish: &Wish) -> Result<()> {
    let poor = |m: &Margins| m.phase < LEAST_PHASE || m.gain.is_some_and(|gain| gain < LEAST_GAIN);
    if !poor(following) && !poor(standing) {
        return Ok(());
    }
    let worse = if standing.phase < following.phase {
        standing
    } else {
        following
    };
    Err(Error::Usage(format!(
        "--bandwidth {} Hz leaves a phase margin of {}° and a gain margin of {} at {} samples a second, and {LEAST_PHASE}° and {LEAST_GAIN} are the least; ask for less bandwidth or sample faster",
        shortest(wish.bandwidth, 4),
        significant(worse.phase, 3),
        gain(worse),
        shortest(wish.rate, 4)
    )))
}

fn gain(margins: &Margins) -> String {
    margins
        .gain
        .map_or_else(|| "∞".to_owned(), |gain| significant(gain, 3))
}

fn print(model: &Model, tuned: &Tuned) {
    let p = tuned.parameters;
    let viscous = model.unit(Quantity::Viscous);
    let torque = model.unit(Quantity::Torque);
    let speed = model.unit(Quantity::Speed);
    anstream::println!(
        "Gains for a bandwidth of {} Hz at {} samples a second:",
        shortest(tuned.wish[0], 4),
        shortest(tuned.wish[1], 4)
    );
    for (name, value, unit) in [
        ("position gain", p.position_gain, "1/s"),
        ("velocity gain", p.velocity_gain, viscous),
        (
            "velocity integral",
            p.velocity_integral,
            model.unit(Quantity::Stiffness),
        ),
        ("observer bandwidth", p.observer_bandwidth, "rad/s"),
        ("friction slope", p.compensation.slope, viscous),
        ("adaptation rate", p.adaptation.rate, "1/s"),
        ("adaptation speed", p.adaptation.speed, speed),
        ("torque limit", p.torque_limit, torque),
    ] {
        anstream::println!("  {name:<20} {:>10} {unit}", significant(value, 4));
    }
    if let Some(current) = &tuned.current {
        for (name, value, unit) in [
            ("current gain", current.proportional, "V/A"),
            (
                "current integral",
                current.reset * current.proportional / p.period,
                "V/(A*s)",
            ),
            ("current limit", p.command_limit, "A"),
        ] {
            anstream::println!("  {name:<20} {:>10} {unit}", significant(value, 4));
        }
    }
    anstream::println!("Margins:                  crossover    phase     gain    delay");
    for (name, m) in [
        ("following", &tuned.following),
        ("correcting friction", &tuned.standing),
    ] {
        anstream::println!(
            "  {name:<22} {:>8} Hz {:>7}° {:>8} {:>5} ms",
            significant(m.crossover, 3),
            significant(m.phase, 3),
            gain(m),
            significant(1e3 * m.delay, 3)
        );
    }
    if !tuned.not_compensated.is_empty() {
        anstream::println!(
            "Not compensated by a controller: {}.",
            tuned.not_compensated.join(", ")
        );
    }
}
