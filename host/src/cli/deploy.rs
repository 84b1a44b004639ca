//! `bristle deploy`

use std::path::PathBuf;

use bristle_core::drive::Parameters;
use bristle_core::link::{Board as Kind, Hello};
use clap::Args;
use serde::Serialize;

use super::diagnose::json;
use super::emulate::chosen_image;
use super::output::{self, Outputs};
use super::tune::{refuse_unstable, standing};
use super::{DONE, Outcome, terminal};
use crate::deploy::{self, Difference, Rig};
use crate::emulate::{Board, Launch, Setup, Transport};
use crate::error::{Error, Result};
use crate::image::F405;
use crate::link::{Peer, SerialLine, Wire};
use crate::model::Model;
use crate::tune::{self, Drive, Wish};

/// Exit status of `--check` when the board holds other parameters.
const DIFFERS: u8 = 3;

/// Put the compensation of a model on a board
///
/// Computes gains, friction and effects from the model as `bristle tune` does, checks them against what the board can do,
/// sends them, has the board write them to its flash, reads back what is in force and compares it bit for bit. The axis
/// must not be running. A board takes the set whole or not at all.
///
/// With --emulated a fresh board in QEMU takes its place, is restarted as after a loss of power, and must still hold the
/// parameters. On a real board restart it yourself, and see by --check that its flash holds them.
///
/// Exit status: 0 done, 1 the board failed, 2 unusable input or arguments, 3 only with --check: the board holds others.
#[derive(Args, Debug)]
#[command(group = clap::ArgGroup::new("board").required(true))]
pub(super) struct Command {
    /// Model file with a value for every parameter, as identify and diagnose write it
    #[arg(value_name = "MODEL.toml")]
    model: PathBuf,
    /// Serial port of the board, as in /dev/ttyUSB0
    #[arg(long, value_name = "PORT", group = "board")]
    port: Option<String>,
    /// An emulated board
    #[arg(long, group = "board")]
    emulated: bool,
    /// Frequency up to which the position is to follow its set point, Hz
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    bandwidth: f64,
    /// Largest |u|, in the unit of u
    #[arg(long, value_name = "U", allow_negative_numbers = true)]
    limit: f64,
    /// Encoder counts per turn or per metre
    #[arg(
        long,
        value_name = "N",
        default_value_t = 4096.0,
        allow_negative_numbers = true
    )]
    counts: f64,
    /// Control periods a second [default: those of the board, 1000 for an emulated one]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Nominal supply of the bridge, V
    #[arg(
        long,
        value_name = "V",
        default_value_t = 24.0,
        allow_negative_numbers = true
    )]
    bus: f64,
    /// Largest motor current, A; a real board needs it
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    current: Option<f64>,
    /// The controller alone, without compensation of friction and effects
    #[arg(long)]
    plain: bool,
    /// Change nothing: say whether the board holds these parameters
    #[arg(long, conflicts_with = "emulated")]
    check: bool,
    /// Image of the firmware for --emulated [default: built from the sources by cargo]
    #[arg(long, value_name = "ELF", conflicts_with = "port")]
    image: Option<PathBuf>,
    /// Where to write what was deployed
    #[arg(long, value_name = "OUT.json")]
    json: Option<PathBuf>,
}

/// What `--json` holds.
#[derive(Serialize)]
struct Deployed<'a> {
    schema: &'static str,
    board: Option<&'a Hello>,
    parameters: &'a Parameters<f32>,
    /// Whether this command wrote them.
    written: bool,
    /// Whether the board was restarted before they were read back.
    restarted: bool,
    /// Where the board holds others.
    differences: &'a [Difference],
    not_compensated: Vec<&'static str>,
}

impl Command {
    pub fn run(&self) -> Outcome {
        let mut inputs = vec![self.model.as_path()];
        inputs.extend(self.image.as_deref());
        output::check(&inputs, &[self.json.as_ref()])?;
        let model = Model::read(&self.model)?;
        // What is wrong with the model shows before a board is looked for.
        Drive::of(&model).map_err(|e| e.in_model(&self.model))?;
        match &self.port {
            Some(name) => {
                let mut board = Peer::called(SerialLine::open(name)?)?;
                board.wire().be_patient()?;
                self.serve(&model, &mut board, |_| Ok(false))
            }
            None => {
                self.parameters(&model, Kind::Emulated)?;
                let image = chosen_image(self.image.as_deref(), F405, false)?;
                let mut board: Board<f32> = Board::boot(&image, Launch::F405, Transport::Fast)?;
                self.serve(&model, &mut board, |board| board.restart().map(|()| true))
            }
        }
    }

    fn serve<W: Wire>(
        &self,
        model: &Model,
        board: &mut Peer<f32, W>,
        restart: impl FnOnce(&mut Peer<f32, W>) -> Result<bool>,
    ) -> Outcome {
        let parameters = self.parameters(model, board.in_same_numbers("deploy")?.board)?;
        let (restarted, differences) = if self.check {
            let held = deploy::in_force(board)?;
            (false, deploy::differences(&parameters, &held)?)
        } else {
            deploy::deploy(board, &parameters)?;
            let restarted = restart(board)?;
            deploy::verify(board, &parameters)?;
            (restarted, Vec::new())
        };
        let deployed = Deployed {
            schema: "bristle.deployment/1",
            board: board.hello(),
            parameters: &parameters,
            written: !self.check,
            restarted,
            differences: &differences,
            not_compensated: tune::left_alone(model),
        };
        let mut outputs = Outputs::default();
        outputs.add(self.json.as_ref(), || json(&deployed))?;
        let written = outputs.write()?;
        self.print(&deployed);
        terminal::written(&written);
        Ok(if differences.is_empty() {
            DONE
        } else {
            DIFFERS
        })
    }

    fn parameters(&self, model: &Model, board: Kind) -> Result<Parameters<f32>> {
        let rig = Rig {
            board,
            bus: self.bus,
            current: self.current,
        };
        if board != Kind::Emulated && self.current.is_none() {
            return Err(Error::Usage(
                "a real board needs --current, the largest motor current in A: beyond it the bridge goes off"
                    .to_owned(),
            ));
        }
        let wish = Wish {
            bandwidth: self.bandwidth,
            rate: self.rate.or(rig.rate()).unwrap_or(1000.0),
            counts: self.counts,
            limit: self.limit,
        };
        let gains = tune::parameters(model, &wish).map_err(|e| e.in_model(&self.model))?;
        refuse_unstable(&tune::margins(&gains), &standing(&gains), &wish)?;
        let setup = Setup {
            wish,
            compensate: !self.plain,
        };
        deploy::parameters(model, &setup, &rig).map_err(|e| e.in_model(&self.model))
    }

    fn print(&self, deployed: &Deployed) {
        let on = self.port.as_deref().unwrap_or("the emulated board");
        if !deployed.differences.is_empty() {
            anstream::println!("{on} holds other parameters:");
            for difference in deployed.differences {
                anstream::println!("  {difference}");
            }
            return;
        }
        let how = match (deployed.written, deployed.restarted) {
            (false, _) => "has them in force; nothing was changed",
            (true, true) => "took them, stored them, and holds them after a restart",
            (true, false) => "took them, stored them, and has them in force",
        };
        anstream::println!("Deployed {}: {on} {how}.", self.model.display());
        if !self.plain && !deployed.not_compensated.is_empty() {
            anstream::println!(
                "Not compensated by a controller: {}.",
                deployed.not_compensated.join(", ")
            );
        }
    }
}
