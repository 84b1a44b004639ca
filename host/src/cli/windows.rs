//! Options on the windows of the weak form, common to the commands that fit.

use clap::Args;

use crate::error::{Error, Result};
use crate::identify::Options;

#[derive(Args, Debug, Default)]
pub(super) struct Windows {
    /// Half-width of the test functions, instead of the one chosen by encoder noise
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    half_width: Option<f64>,
}

impl Windows {
    pub fn options(&self) -> Result<Options> {
        match self.half_width {
            Some(width) if !(width.is_finite() && width > 0.0) => Err(Error::Usage(format!(
                "--half-width {width} must be a positive number of seconds"
            ))),
            half_width => Ok(Options { half_width }),
        }
    }
}
