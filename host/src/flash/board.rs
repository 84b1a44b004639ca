//! The boards that an image can be put onto. A new one is one entry here and a module of the firmware.

use crate::image::{F405, Target};

/// What has to be known of a board to flash it.
#[derive(Debug)]
pub struct Board {
    /// The stable id.
    pub id: &'static str,
    /// The name that a person reads.
    pub name: &'static str,
    /// The target of the Rust compiler, the program for it, and its memory.
    pub target: Target,
    /// What probe-rs calls its chip.
    pub chip: &'static str,
    /// Vendor and product of the chip's loader on USB.
    pub loader: &'static str,
    /// How to connect a probe.
    pub probe_wiring: &'static str,
    /// How to start the chip's loader.
    pub start_loader: &'static str,
    /// How to go back to the firmware from there.
    pub leave_loader: &'static str,
}

/// All boards.
pub static ALL: [Board; 1] = [Board {
    id: "odrive-v3",
    name: "ODrive v3.5 or v3.6 (STM32F405)",
    target: F405,
    chip: "STM32F405RGTx",
    // ST's application note AN2606: the loader in the system memory of the STM32F4.
    loader: "0483:df11",
    probe_wiring: "connect SWDIO, SWCLK and GND of the board to a probe such as an ST-LINK, and power the board",
    start_loader: "set the board's switch to DFU, connect its USB port, and power the board off and on",
    leave_loader: "Set the board's switch back to RUN, and power the board off and on.",
}];

/// Finds a board by its id.
pub fn find(id: &str) -> Option<&'static Board> {
    ALL.iter().find(|board| board.id == id)
}
