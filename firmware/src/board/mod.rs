//! The boards, and which of them this is.
//!
//! The target decides on the chip, and with it on the numbers of the control path:
//!
//! | target | chip | numbers | boards |
//! | --- | --- | --- | --- |
//! | `thumbv7em-none-eabihf` | STM32F405 | `f32` | `odrive_v3`, and QEMU's `netduinoplus2` |
//! | `thumbv7m-none-eabi` | STM32F100 | [`Q16`](bristle_core::scalar::Q16) | QEMU's `stm32vldiscovery` |
//!
//! QEMU's models have neither clock tree, converters nor bridge. The host plays them ([`emulated`]): a sensor frame takes the
//! place of the converter's interrupt, and a report that of the bridge. One image serves the `ODrive` and the model
//! of its chip, so what the tests run is what is flashed.

pub mod emulated;
#[cfg(target_abi = "eabihf")]
mod f405;
#[cfg(target_abi = "eabihf")]
pub mod odrive_v3;
mod serial;
#[cfg(not(target_abi = "eabihf"))]
mod vldiscovery;

#[cfg(target_abi = "eabihf")]
pub use f405::*;
pub use serial::Serial;
#[cfg(not(target_abi = "eabihf"))]
pub use stm32f1::stm32f100 as device;
#[cfg(target_abi = "eabihf")]
pub use stm32f4::stm32f405 as device;
#[cfg(not(target_abi = "eabihf"))]
pub use vldiscovery::*;

use bristle_core::drive::store;
use bristle_core::link::{Board as Kind, Hello, Numbers};

/// What this image says of itself; recordings hold `ring` words.
fn greeting(board: Kind, numbers: Numbers, ring: usize) -> Hello {
    Hello::new(board, numbers, build(), ring as u32)
}

/// The CRC-32 of the image, from the vector table to the initial values of variables.
#[allow(unsafe_code)]
fn build() -> u32 {
    unsafe extern "C" {
        static __vector_table: u8;
        static __sidata: u8;
        static __sdata: u8;
        static __edata: u8;
    }
    let start = &raw const __vector_table;
    let data = (&raw const __edata as usize).wrapping_sub(&raw const __sdata as usize);
    let end = (&raw const __sidata as usize).wrapping_add(data);
    let length = end.wrapping_sub(start as usize);
    // SAFETY: the linker script puts all of this into flash, one section behind the other, and nothing writes there
    // while the image runs.
    let image = unsafe { core::slice::from_raw_parts(start, length) };
    store::checksum(image)
}
