//! A hard fault must end the run with the status of `fault`: the emulator's test of the handler.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    cortex_m::asm::udf()
}

// Linked for its handlers and its interrupt vectors.
#[cfg(target_os = "none")]
use bristle_firmware as _;
