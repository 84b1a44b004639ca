//! The firmware beside its tasks: drivers, boards, and what happens on a processor fault.
//!
//! [`driver`] is written against `embedded-hal` and tested on the host. The rest exists on the target only, where linking
//! this crate installs the panic and fault handlers of `fault`.
//!
//! One image serves the board and the emulator, which it tells apart at the start: see `board`.
#![cfg_attr(target_os = "none", no_std)]

#[cfg(target_os = "none")]
pub mod board;
pub mod driver;
#[cfg(target_os = "none")]
pub mod fault;
#[cfg(target_os = "none")]
pub mod inlet;
#[cfg(target_os = "none")]
pub mod outbox;
#[cfg(target_os = "none")]
pub mod stack;
