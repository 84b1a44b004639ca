//! The boards, one file each. A board gives the rest of the firmware:
//!
//! - `device`: its register definitions, for RTIC;
//! - `Serial`: the serial port of the link, byte by byte;
//! - `enter_safe_state()`: outputs off, callable from any context;
//! - `is_emulated()`: whether the semihosting breakpoint has someone to answer it.

mod netduinoplus2;

pub use netduinoplus2::{Serial, device, enter_safe_state, is_emulated};
