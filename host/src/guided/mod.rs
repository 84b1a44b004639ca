//! An excitation of a board's axis, from what a person is told before it to the recording that comes of it.
//!
//! The host sends set points; what must not happen, the board prevents, in every control period and whatever becomes of the
//! host: see [`Bounds`](bristle_core::drive::Bounds). Time is the board's own: a set point follows on each telemetry frame, so that a
//! board that is not heard is sent nothing, and turns its bridge off by itself.
//!
//! - [`Signal`]: what the axis is driven with.
//! - [`Line`]: how the recording comes to the host.
//! - [`run`]: the run itself.
//! - [`Rows`]: what was recorded.

mod line;
mod rows;
mod run;
mod signal;

pub use line::Line;
pub use rows::{Row, Rows};
pub use run::{Ending, Excited, Run, run};
pub use signal::Signal;
