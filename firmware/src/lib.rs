//! What every Bristle firmware binary shares: the board's registers and what happens on a fault.
//!
//! Linking this crate installs the panic and fault handlers of `fault`. On the host it is empty.
#![cfg_attr(target_os = "none", no_std)]

#[cfg(target_os = "none")]
pub mod board;
#[cfg(target_os = "none")]
pub mod fault;
#[cfg(target_os = "none")]
pub mod outbox;
