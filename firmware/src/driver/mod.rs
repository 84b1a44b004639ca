//! Drivers of the chips on the boards and of the processor's own peripherals, written against `embedded-hal` or a few
//! registers behind a trait, and tested against mocks.

pub mod bridge;
pub mod drv8301;
pub mod flash;
pub mod sequence;
pub mod spi;
