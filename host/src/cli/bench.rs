//! The options of `bristle simulate --excite`, and the recording that comes of them.

use clap::{Args, ValueEnum};

use crate::bench::{self, Control, Record, Sensors};
use crate::error::{self, Error, Result};
use crate::excite::{Excitation, Shape};
use crate::model::Motion;
use crate::plant::Plant;

/// Options of a test bench.
#[derive(Args, Debug)]
#[command(next_help_heading = "With --excite")]
pub(super) struct Bench {
    /// Largest value of the test signal, in the unit of u; under --control in rad or m
    #[arg(
        long,
        value_name = "A",
        conflicts_with = "input",
        allow_negative_numbers = true
    )]
    amplitude: Option<f64>,
    /// Lowest and highest frequency of the test signal, Hz
    #[arg(long, value_name = "LOW:HIGH", value_parser = band, default_value = "0.1:10", conflicts_with = "input")]
    band: (f64, f64),
    /// Length of the recording, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 20.0,
        conflicts_with = "input"
    )]
    duration: f64,
    /// Samples a second
    #[arg(
        long,
        value_name = "HZ",
        default_value_t = 1000.0,
        conflicts_with = "input"
    )]
    rate: f64,
    /// What random phases, levels and noise are drawn from
    #[arg(long, default_value_t = 1, conflicts_with = "input")]
    seed: u64,
    /// Follow the test signal by a position controller instead of applying it as u
    #[arg(long, value_name = "KIND", conflicts_with = "input")]
    control: Option<Controller>,
    /// Bandwidth of the controller, Hz [default: twice the band's upper edge, at most a thirtieth of the rate]
    #[arg(
        long,
        value_name = "HZ",
        requires = "control",
        allow_negative_numbers = true
    )]
    bandwidth: Option<f64>,
    /// Encoder counts per turn or per metre [default: no quantisation]
    #[arg(
        long,
        value_name = "N",
        conflicts_with = "input",
        allow_negative_numbers = true
    )]
    counts: Option<f64>,
    /// RMS of a torque or force that acts on the plant and is not recorded, N*m or N
    #[arg(
        long,
        value_name = "RMS",
        default_value_t = 0.0,
        conflicts_with = "input"
    )]
    noise: f64,
    /// RMS of the noise on the measured position, rad or m
    #[arg(
        long,
        value_name = "RMS",
        default_value_t = 0.0,
        conflicts_with = "input"
    )]
    sensor_noise: f64,
}

/// Shapes of the test signal.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum Excite {
    /// A sine that sweeps through the band once
    Chirp,
    /// Sines over the whole band at once, with random phases
    Multisine,
    /// One straight line from zero to the amplitude
    Ramp,
    /// Straight lines up and down at the lower edge of the band
    Triangle,
    /// Random levels, each held for half a period of some frequency in the band
    Steps,
    /// Zero for a tenth of the time, then the amplitude
    Hold,
    /// Slow ramps both ways, then steps both ways, then sines over the whole band
    Sequence,
}

impl From<Excite> for Shape {
    fn from(excite: Excite) -> Self {
        match excite {
            Excite::Chirp => Self::Chirp,
            Excite::Multisine => Self::Multisine,
            Excite::Ramp => Self::Ramp,
            Excite::Triangle => Self::Triangle,
            Excite::Steps => Self::Steps,
            Excite::Hold => Self::Hold,
            Excite::Sequence => Self::Sequence,
        }
    }
}

/// Position controllers.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Controller {
    /// Proportional and derivative, critically damped
    Pd,
}

/// Fewest and most samples of a recording.
const SAMPLES: std::ops::RangeInclusive<f64> = 200.0..=2e7;

/// `LOW:HIGH` in Hz.
pub(super) fn band(text: &str) -> std::result::Result<(f64, f64), String> {
    let pair = text
        .split_once(':')
        .map(|(low, high)| (low.trim().parse(), high.trim().parse()));
    match pair {
        Some((Ok(low), Ok(high))) if 0.0 < low && low <= high && f64::is_finite(high) => {
            Ok((low, high))
        }
        _ => Err("write two frequencies in Hz, the lower one first, as in 0.1:10".to_owned()),
    }
}

impl Bench {
    /// The recording that a plant gives under these options.
    pub fn record(&self, plant: &mut dyn Plant, shape: Shape, motion: Motion) -> Result<Record> {
        self.check()?;
        let t: Vec<f64> = (0..(self.duration * self.rate).round() as usize)
            .map(|k| k as f64 / self.rate)
            .collect();
        let excitation = Excitation {
            shape,
            amplitude: self.amplitude.unwrap_or_default(),
            band: self.band,
            duration: self.duration,
            seed: self.seed,
        };
        let signal = excitation.values(&t);
        let bandwidth = self
            .bandwidth
            .unwrap_or((2.0 * self.band.1).min(self.rate / 30.0));
        let control = self
            .control
            .map(|Controller::Pd| Control::of_bandwidth(bandwidth, plant.authority()));
        let sensors = Sensors {
            count: self.counts.map_or(0.0, |counts| motion.turn() / counts),
            position_noise: self.sensor_noise,
            load_noise: self.noise,
            seed: self.seed,
        };
        Ok(bench::record(plant, t, &signal, control, sensors))
    }

    /// Refuses numbers that make no sense, alone or together.
    fn check(&self) -> Result<()> {
        let fail = |what: String| Err(Error::Usage(what));
        error::positive(&[
            ("--duration", Some(self.duration)),
            ("--rate", Some(self.rate)),
            ("--bandwidth", self.bandwidth),
            ("--counts", self.counts),
        ])?;
        for (name, value) in [
            ("--noise", self.noise),
            ("--sensor-noise", self.sensor_noise),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return fail(format!("{name} {value} must be zero or a positive number"));
            }
        }
        let amplitude = self.amplitude.unwrap_or_default();
        if amplitude == 0.0 || !amplitude.is_finite() {
            return fail(format!(
                "--amplitude {amplitude} drives nothing; give a number other than zero"
            ));
        }
        let samples = (self.duration * self.rate).round();
        if !SAMPLES.contains(&samples) {
            return fail(format!(
                "--duration {} at --rate {} makes {samples} samples; a recording has {} to {}",
                self.duration,
                self.rate,
                SAMPLES.start(),
                SAMPLES.end()
            ));
        }
        if self.band.1 >= 0.5 * self.rate {
            return fail(format!(
                "--band goes up to {} Hz, but at --rate {} nothing above {} Hz can be made; lower the one or raise the other",
                self.band.1,
                self.rate,
                0.5 * self.rate
            ));
        }
        Ok(())
    }
}
