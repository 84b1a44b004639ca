//! The motor driver in the emulator, with its axis on the host.
//!
//! QEMU runs the image that would be flashed; this module plays the hardware around it, period by period: the plant moves
//! under the last input, its sensors are read as the board's converters would, the readings go to the board as a frame,
//! and the board answers what its bridge does. Neither side goes on before the other has answered, so a run is
//! the same every time, whatever the machine is busy with.
//!
//! - [`Machine`]: the emulator's process and the line to it.
//! - [`Board`]: the emulated board behind the link.
//! - [`Sensors`]: from the plant's state to the readings of converters.
//! - [`tuned`]: from a model file to what a board has to be told, in units that fit its numbers.
//! - [`run`]: the lockstep of all of them.
//! - [`decode`]: what the board has logged meanwhile.
//! - [`Live`]: the same lockstep in real time, to be used like a board on a port; [`Twin`] takes the emulator's place in it
//!   where there is none.

mod board;
mod follow;
mod live;
mod log;
mod machine;
mod run;
mod sensors;
mod setup;
mod twin;

pub use board::Board;
pub use follow::Follow;
pub use live::{Axis, Live};
pub use log::decode;
pub use machine::{Launch, Machine, QEMU, Transport};
pub use run::{Driver, OnHost, Outcome, Period, Plan, position, run, velocity};
pub use sensors::Sensors;
pub use setup::{Setup, Tuned, check_current, parameters, tuned};
pub use twin::Twin;
