//! How far the stack has grown: memory below it is painted at the start, and where the paint ends, it has been.

use core::ptr::{addr_of, addr_of_mut};

/// What no code is likely to leave on a stack.
const PAINT: u32 = 0xA5C3_965A;

/// Bytes left alone below the stack pointer, for the frame of the function that paints.
const MARGIN: usize = 256;

// Symbols of the linker script, of which only the addresses are used.
#[allow(unsafe_code)]
unsafe extern "C" {
    /// End of all variables, and with it of the room that the stack has.
    static mut __sheap: u32;
    /// Where the stack begins, from which it grows down.
    static _stack_start: u32;
}

/// Paints what the stack has not reached yet. Only for the start, with interrupts off.
#[allow(unsafe_code)]
pub fn paint() {
    let mut place = addr_of_mut!(__sheap);
    let end = cortex_m::register::msp::read() as usize - MARGIN;
    while (place as usize) < end {
        // SAFETY: the linker puts nothing between the end of variables and the stack, and the stack is below its margin
        // only in functions that this one calls, which are none.
        unsafe {
            place.write_volatile(PAINT);
            place = place.add(1);
        }
    }
}

/// The most bytes of stack that were in use since [`paint`].
#[allow(unsafe_code)]
pub fn deepest() -> u32 {
    let mut place = addr_of!(__sheap);
    let start = addr_of!(_stack_start);
    // SAFETY: the same memory, aligned as the linker script asserts, and only read; other tasks may write there
    // meanwhile, which ends the search a word earlier or later.
    while place < start && unsafe { place.read_volatile() } == PAINT {
        place = place.wrapping_add(1);
    }
    (start as usize - place as usize) as u32
}
