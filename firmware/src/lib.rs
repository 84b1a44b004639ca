//! The firmware beside its tasks: drivers, boards, and what happens on a processor fault.
//!
//! [`driver`] is written against `embedded-hal` and tested on the host. The rest exists on the target only, where linking
//! this crate installs the panic and fault handlers of `fault`.
//!
//! The target decides on the chip and on the numbers of the control path: see `board`. `main.rs` has the tasks of the motor
//! driver, and `vldiscovery.rs` those of the chip without a floating-point unit.
#![cfg_attr(target_os = "none", no_std)]

#[cfg(target_os = "none")]
pub mod board;
pub mod driver;
#[cfg(target_os = "none")]
pub mod fault;
#[cfg(target_os = "none")]
pub mod inlet;
#[cfg(all(target_os = "none", not(target_abi = "eabihf")))]
pub mod line;
#[cfg(target_os = "none")]
pub mod log;
#[cfg(all(target_os = "none", target_abi = "eabihf"))]
pub mod outbox;
#[cfg(target_os = "none")]
pub mod stack;
