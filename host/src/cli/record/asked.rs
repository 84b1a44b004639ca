//! What the options of `bristle record` ask for, checked before anything moves.

use std::io::IsTerminal;

use bristle_core::control::SetPoint;
use bristle_core::drive::signal::{Selection, Signal as Word};
use bristle_core::drive::{Bounds, Parameters};

use super::Command;
use crate::cli::emulate::Follow;
use crate::cli::output;
use crate::emulate;
use crate::error::{self, Error, Result};
use crate::excite::Excitation;
use crate::format::{decimal, shortest};
use crate::guided::Signal;
use crate::model::{Columns, Model, Motion};
use crate::place::Place;
use crate::plant;
use crate::tune;

impl Command {
    pub(super) fn check(&self) -> Result<()> {
        let mut inputs = self.place.inputs();
        inputs.extend(self.signal.as_deref());
        output::check(&inputs, &[Some(&self.out)])?;
        self.place.check()?;
        error::positive(&[
            ("--duration", Some(self.duration)),
            ("--travel", Some(self.travel)),
            ("--speed", Some(self.speed)),
            ("--limit", self.limit),
            ("--current", self.current),
        ])?;
        if let Some(amplitude) = self.amplitude.filter(|a| *a == 0.0 || !a.is_finite()) {
            return Err(Error::Usage(format!(
                "--amplitude {amplitude} drives nothing; give a number other than zero"
            )));
        }
        if !self.yes && !std::io::stdin().is_terminal() {
            return Err(Error::Usage(
                "the axis will move, and there is no terminal to ask whether it may; make sure that it may, and add --yes"
                    .to_owned(),
            ));
        }
        Ok(())
    }

    /// Where the board is, and the model of its axis if one is known.
    pub(super) fn place(&self) -> Result<(Place, Option<Model>)> {
        match &self.place.emulate {
            Some(path) => self.place.emulated(path, |model| self.most(model)),
            None => self.place.at_port(),
        }
    }

    /// What `|u|` of an emulated board may reach.
    fn most(&self, model: &Model) -> Result<f64> {
        match (self.limit, self.follow) {
            // What the signal asks for beyond --limit is cut by the bound of the run.
            (limit, Follow::Input) => {
                let rate = self.place.emulated.rate;
                let asked = self.signal(Some(model), rate)?.largest();
                Ok(limit.map_or(asked, |limit| limit.max(asked)))
            }
            (Some(limit), _) => Ok(limit),
            (None, _) => Err(Error::Usage(
                "a controller needs --limit, the largest input that it may apply, in the unit of u"
                    .to_owned(),
            )),
        }
    }

    pub(super) fn signal(&self, model: Option<&Model>, rate: f64) -> Result<Signal> {
        if let Some(path) = &self.signal {
            let none = Columns::new();
            let columns = model.map_or(&none, |model| &model.columns);
            let motion = model.map_or(Motion::Rotary, |model| model.motion);
            return Signal::read(path, columns, motion, rate);
        }
        let samples = (self.duration * rate).round();
        if !(200.0..=1e7).contains(&samples) {
            return Err(Error::Usage(format!(
                "--duration {} at {rate} control periods a second makes {samples} samples; a recording has 200 to 10000000",
                self.duration
            )));
        }
        if self.band.1 >= 0.5 * rate {
            return Err(Error::Usage(format!(
                "--band goes up to {} Hz, but with {rate} control periods a second nothing above {} Hz can be made; lower it",
                self.band.1,
                0.5 * rate
            )));
        }
        let excitation = Excitation {
            shape: self.excite.into(),
            amplitude: self.amplitude.unwrap_or_default(),
            band: self.band,
            duration: self.duration,
            seed: self.seed,
        };
        Ok(Signal::made(&excitation, rate))
    }

    /// What the board is to keep to, or what to change if it cannot.
    pub(super) fn bounds(
        &self,
        signal: &Signal,
        parameters: &Parameters<f32>,
    ) -> Result<Bounds<f32>> {
        let most = decimal(parameters.control.command_limit);
        let asked = signal.largest();
        // A decimal and its nearest number in single precision differ by less.
        if self.follow == Follow::Input && asked > most * (1.0 + 1e-6) {
            return Err(Error::Usage(format!(
                "the signal goes up to u = {}, and the board was deployed with {} at most (deploy --limit); lower --amplitude, or deploy anew",
                shortest(asked, 4),
                shortest(most, 4)
            )));
        }
        let default = if self.follow == Follow::Input {
            asked
        } else {
            most
        };
        let counts = self.travel / f64::from(parameters.control.count);
        if !(1.0..f64::from(i32::MAX)).contains(&counts) {
            return Err(Error::Usage(format!(
                "--travel {} is {} encoder counts; it must be 1 to 2147483647",
                self.travel,
                shortest(counts, 4)
            )));
        }
        let bounds = Bounds {
            travel: counts as u32,
            speed: self.speed as f32,
            input: self.limit.unwrap_or(default) as f32,
            current: self
                .current
                .map_or(parameters.limits.current, |current| current as f32),
        };
        if !bounds.is_valid() {
            return Err(Error::Usage(
                "--speed, --limit or --current is too small or too large for the board's numbers"
                    .to_owned(),
            ));
        }
        Ok(bounds)
    }

    pub(super) fn set_points(
        &self,
        signal: &Signal,
        rate: f64,
        count: f64,
        origin: i32,
    ) -> Vec<SetPoint<f32>> {
        let from = match self.follow {
            Follow::Position => f64::from(origin) * count,
            Follow::Input | Follow::Velocity => 0.0,
        };
        let values: Vec<f64> = signal.values.iter().map(|x| from + x).collect();
        let follow = emulate::Follow::from(self.follow);
        follow.set_points(&values, (rate, signal.smooth), count, &tune::SI)
    }
}

/// What is recorded: the current only where there may be one.
pub(super) fn selection(place: &Place) -> Result<Selection> {
    let has_motor = match place {
        Place::Port(_) => true,
        Place::Emulated { axis, .. } => plant::new(&axis.model)?.current().is_some(),
    };
    Ok(if has_motor {
        Selection::of(&[Word::Input, Word::Position, Word::Current])
    } else {
        Selection::of(&[Word::Input, Word::Position])
    })
}
