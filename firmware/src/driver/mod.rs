//! Drivers of chips on the boards, written against `embedded-hal` and tested against mocks.

pub mod drv8301;
