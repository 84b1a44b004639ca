//! The physics and the estimation of Bristle, shared by the host and the motor driver.
//!
//! Everything here is pure: no clock, no allocation, no I/O. Time arrives as an argument and storage is
//! lent by the caller, so the code that a simulation tests is the code that the board runs.
//!
//! - [`scalar`]: the arithmetic a law needs, so that one source serves `f64`, `f32` and fixed point.
//! - [`friction`]: friction laws with and without state, contacts of several dimensions, sticking and slipping.
//! - [`weak`]: test functions, windowed functionals and least squares with covariance.
//! - [`control`]: observers, friction compensation and controllers for an axis.
//! - [`drive`]: a control period: units, faults, run states, recording; parameters and their place in flash.
//! - [`link`]: the messages between the host and a board, and their framing.
//!
//! A module uses only those before it in this order, which `tests/structure.rs` checks:
//!
//! scalar → friction → weak → control → drive → link
//!
//! Sign convention throughout: friction `F` *opposes* motion and is positive for positive velocity, so the
//! equation of motion is `J·q̈ = k·u − F`.
#![no_std]

#[cfg(test)]
extern crate std;

pub mod control;
pub mod drive;
pub mod friction;
pub mod link;
pub mod scalar;
pub mod weak;

pub use scalar::Scalar;
