//! The options that say where a board is: the same for every verb that works with one.

use std::path::{Path, PathBuf};

use clap::Args;

use super::emulate::chosen_image;
use crate::emulate::{self, Axis, Sensors, Setup};
use crate::error::{self, Error, Result};
use crate::image::F405;
use crate::model::Model;
use crate::place::Place;
use crate::plant;
use crate::ports;
use crate::tune::Wish;

/// Where a board is.
#[derive(Args, Debug)]
pub(super) struct Where {
    /// Serial port of the board [default: the one port at which a board answers]
    #[arg(value_name = "PORT", conflicts_with = "emulate")]
    port: Option<String>,
    /// An emulated board, with the axis of this model file simulated around it
    #[arg(long, value_name = "MODEL.toml")]
    pub emulate: Option<PathBuf>,
    /// Model file that tells the name and the units of the axis at a port
    #[arg(long, value_name = "M.toml", conflicts_with = "emulate")]
    pub model: Option<PathBuf>,
    #[command(flatten)]
    pub emulated: Emulated,
}

/// Options of an emulated board.
#[derive(Args, Debug)]
#[command(next_help_heading = "With --emulate")]
pub(super) struct Emulated {
    /// Model file of what the board knows of the axis [default: the same]
    #[arg(long, value_name = "KNOWN.toml", requires = "emulate")]
    pub known: Option<PathBuf>,
    /// Compensate the friction and the effects that the board knows of
    #[arg(long, requires = "emulate")]
    compensate: bool,
    /// Frequency up to which the position follows its set point, Hz [default: a hundredth of the rate]
    #[arg(
        long,
        value_name = "HZ",
        requires = "emulate",
        allow_negative_numbers = true
    )]
    bandwidth: Option<f64>,
    /// Control periods a second
    #[arg(
        long,
        value_name = "HZ",
        default_value_t = 1000.0,
        allow_negative_numbers = true
    )]
    pub rate: f64,
    /// Encoder counts per turn or per metre
    #[arg(
        long,
        value_name = "N",
        default_value_t = 16384.0,
        allow_negative_numbers = true
    )]
    counts: f64,
    /// Image of the firmware [default: built from the sources by cargo]
    #[arg(
        long,
        value_name = "ELF",
        requires = "emulate",
        conflicts_with = "on_host"
    )]
    pub image: Option<PathBuf>,
    /// Run the same drive on the host, without the emulator
    #[arg(long, requires = "emulate")]
    on_host: bool,
}

impl Where {
    pub fn check(&self) -> Result<()> {
        error::positive(&[
            ("--bandwidth", self.emulated.bandwidth),
            ("--rate", Some(self.emulated.rate)),
            ("--counts", Some(self.emulated.counts)),
        ])
    }

    /// The files that are read.
    pub fn inputs(&self) -> Vec<&Path> {
        let emulated = &self.emulated;
        let all = [&self.emulate, &self.model, &emulated.known, &emulated.image];
        all.into_iter().filter_map(Option::as_deref).collect()
    }

    /// An emulated board, whose `|u|` may reach what `limit` says of the model of its axis, and that model.
    pub fn emulated(
        &self,
        path: &Path,
        limit: impl FnOnce(&Model) -> Result<f64>,
    ) -> Result<(Place, Option<Model>)> {
        let emulated = &self.emulated;
        let axis = emulated.axis(path, limit)?;
        let model = axis.model.clone();
        let image = if emulated.on_host {
            None
        } else {
            Some(chosen_image(emulated.image.as_deref(), F405, false)?)
        };
        let axis = Box::new(axis);
        Ok((Place::Emulated { image, axis }, Some(model)))
    }

    /// A board at a port, and the model of its axis if one is given.
    pub fn at_port(&self) -> Result<(Place, Option<Model>)> {
        let model = self.model.as_deref().map(Model::read).transpose()?;
        let port = match &self.port {
            Some(port) => port.clone(),
            None => only_board()?,
        };
        Ok((Place::Port(port), model))
    }
}

impl Emulated {
    fn axis(&self, path: &Path, limit: impl FnOnce(&Model) -> Result<f64>) -> Result<Axis> {
        let model = Model::read(path)?;
        let limit = limit(&model)?;
        plant::new(&model).map_err(|e| e.in_model(path))?;
        let known_path = self.known.as_deref().unwrap_or(path);
        let known = Model::read(known_path)?;
        let sensors = Sensors::emulated(model.motion.turn() / self.counts);
        let setup = Setup {
            wish: Wish {
                bandwidth: self.bandwidth.unwrap_or(self.rate / 100.0),
                rate: self.rate,
                counts: self.counts,
                limit,
                current: None,
            },
            compensate: self.compensate,
        };
        let parameters = emulate::parameters(&known, &setup, &sensors);
        Ok(Axis {
            parameters: parameters.map_err(|e| e.in_model(known_path))?,
            model,
            sensors,
        })
    }
}

/// The port at which the only board answers.
fn only_board() -> Result<String> {
    let mut ports = ports::list()?;
    ports.iter_mut().for_each(ports::Port::ask);
    let boards: Vec<&str> = ports
        .iter()
        .filter(|p| p.has_board())
        .map(|p| p.name.as_str())
        .collect();
    match boards.as_slice() {
        [one] => Ok((*one).to_owned()),
        [] => Err(Error::Usage(
            "no board answers at any serial port (bristle ports says what is at each); name its port, or use --emulate".to_owned(),
        )),
        several => Err(Error::Usage(format!(
            "boards answer at {}; name the port of one",
            several.join(", ")
        ))),
    }
}
