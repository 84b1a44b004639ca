//! What happens when something that must not happen does.
//!
//! Always the same: outputs into their safe state, then stop. In the emulator the run ends with an exit status, so
//! that a test fails at once instead of waiting; on a chip the processor sleeps until a reset, because restarting by
//! itself would hide the fault and might repeat it with the motor attached.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};

use crate::board;

/// The emulator's exit status after a panic.
pub const PANIC_STATUS: i32 = 101;
/// The emulator's exit status after a hard fault.
pub const HARD_FAULT_STATUS: i32 = 102;
/// The emulator's exit status after an interrupt or exception that nobody handles.
pub const UNHANDLED_STATUS: i32 = 103;

/// Ends everything: bridge off, then the emulation with this status, or sleep until a reset.
pub fn stop(status: i32) -> ! {
    cortex_m::interrupt::disable();
    board::enter_safe_state();
    // Semihosting is a breakpoint instruction: on a chip without a debugger it would fault again.
    if board::emulated::is_emulated() {
        semihosting::process::exit(status);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    stop(PANIC_STATUS)
}

// SAFETY: cortex-m-rt demands `unsafe` because this handler may run in any context, with memory in any state. It
// reads two registers, masks interrupts and stops; it touches no memory that others own.
#[allow(unsafe_code)]
#[exception]
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    stop(HARD_FAULT_STATUS)
}

// SAFETY: as above.
#[allow(unsafe_code)]
#[exception]
unsafe fn NonMaskableInt() {
    board::non_maskable();
}

// SAFETY: as above; it never returns to the code that it interrupted.
#[allow(unsafe_code)]
#[exception]
unsafe fn DefaultHandler(_: i16) -> ! {
    stop(UNHANDLED_STATUS)
}
