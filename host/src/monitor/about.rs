//! What does not change while a board is watched.

use bristle_core::drive::signal::{SIGNALS, Signal};
use bristle_core::drive::{Fault, Parameters};
use bristle_core::link::{Board, Hello};
use serde::Serialize;

use super::Moves;
use crate::model::{Model, Motion};

/// The board, its signals and its limits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct About {
    /// Where the board is.
    pub place: String,
    /// What it is.
    pub board: &'static str,
    /// Its firmware.
    pub firmware: String,
    /// Name of the axis, if a model file tells it.
    pub axis: String,
    /// The signals in the order of the values of a sample.
    pub signals: [Channel; SIGNALS],
    /// Control periods a second.
    pub rate: f64,
    /// Control periods from one telemetry frame to the next.
    pub every: u16,
    /// Largest `|u|` that the board may be told, which under a current loop is a current.
    pub command_limit: f64,
    /// Its unit.
    pub command_unit: &'static str,
    /// Largest torque or force.
    pub torque_limit: f64,
    /// Unit of torque or force.
    pub torque_unit: &'static str,
    /// Largest speed that is asked for, rad/s or m/s.
    pub speed: f64,
    /// Least and largest level that the board may learn; none if it learns nothing.
    pub learned_range: Option<[f64; 2]>,
    /// Whether the board was never set up.
    pub harmless: bool,
    /// Every fault that a board knows.
    pub faults: Vec<FaultText>,
}

/// A signal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Channel {
    /// As the page's elements are called.
    pub id: &'static str,
    /// As a person calls it.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
}

/// A fault in words.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FaultText {
    id: &'static str,
    number: u8,
    detection: &'static str,
    remedy: &'static str,
}

/// Units of an axis; of one without a model file they are not known.
struct Units {
    position: &'static str,
    velocity: &'static str,
    torque: &'static str,
    input: &'static str,
}

impl Units {
    fn of(model: Option<&Model>) -> Self {
        let Some(model) = model else {
            return Self {
                position: "rad or m",
                velocity: "rad/s or m/s",
                torque: "N·m or N",
                input: "",
            };
        };
        let (position, velocity, torque) = match model.motion {
            Motion::Rotary => ("rad", "rad/s", "N·m"),
            Motion::Linear => ("m", "m/s", "N"),
        };
        Self {
            position,
            velocity,
            torque,
            input: match model.input.as_str() {
                "voltage" => "V",
                "current" => "A",
                _ => torque,
            },
        }
    }
}

impl About {
    pub(super) fn new(
        place: &str,
        hello: Option<&Hello>,
        parameters: &Parameters<f32>,
        model: Option<&Model>,
        moves: Moves,
        (period, every): (f64, u16),
    ) -> Self {
        let units = Units::of(model);
        let control = &parameters.control;
        let adaptation = &control.adaptation;
        let learns = adaptation.method != bristle_core::control::Learning::Off;
        let version = hello.map_or([0; 3], |hello| hello.version);
        Self {
            place: place.to_owned(),
            board: match hello.map(|hello| hello.board) {
                Some(Board::OdriveV3) => "ODrive v3",
                Some(Board::Emulated) | None => "emulated board",
            },
            firmware: version.map(|part| part.to_string()).join("."),
            axis: model.map_or_else(String::new, |model| model.name.clone()),
            signals: Signal::ALL.map(|signal| channel(signal, &units)),
            rate: 1.0 / period,
            every,
            command_limit: control.command_limit.into(),
            command_unit: match parameters.current {
                Some(_) => "A",
                None => units.input,
            },
            torque_limit: control.torque_limit.into(),
            torque_unit: units.torque,
            speed: moves.speed,
            learned_range: learns.then(|| [adaptation.lowest.into(), adaptation.highest.into()]),
            harmless: *parameters == Parameters::harmless(),
            faults: Fault::ALL.map(text).to_vec(),
        }
    }
}

fn channel(signal: Signal, units: &Units) -> Channel {
    let (id, name, unit) = match signal {
        Signal::Input => ("input", "input u", units.input),
        Signal::Position => ("position", "position", units.position),
        Signal::Velocity => ("velocity", "velocity", units.velocity),
        Signal::Current => ("current", "motor current", "A"),
        Signal::Bus => ("bus", "bus voltage", "V"),
        Signal::Error => ("error", "position error", units.position),
        Signal::Friction => ("friction", "compensated friction", units.torque),
        Signal::Coulomb => ("coulomb", "Coulomb level", units.torque),
    };
    Channel { id, name, unit }
}

fn text(fault: Fault) -> FaultText {
    let page = fault.page();
    FaultText {
        id: page.id,
        number: fault.number(),
        detection: page.detection,
        remedy: page.remedy,
    }
}
