//! Start and end of the image on the target.

use crate::{Number, law, step, velocities};
use bristle_core::Scalar;
use core::arch::asm;

/// The initial stack pointer and the entry.
#[repr(C)]
pub struct Vectors(u32, extern "C" fn() -> !);

#[used]
#[unsafe(link_section = ".vectors")]
static VECTORS: Vectors = Vectors(0x2000_8000, reset);

#[unsafe(no_mangle)]
extern "C" fn reset() -> ! {
    let law = law();
    let mut state = [Number::ZERO; 2];
    for velocity in velocities() {
        step(&law, &mut state, velocity, Number::ONE);
    }
    core::hint::black_box(state);
    // SAFETY: semihosting's SYS_EXIT with ADP_Stopped_ApplicationExit; the emulator ends here.
    unsafe { asm!("bkpt 0xab", in("r0") 0x18, in("r1") 0x2_0026) };
    loop {}
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
