//! Where the log's frames go.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering};

use critical_section::RestoreState;
use defmt::Encoder;
use semihosting::io::{Write, stderr};

use crate::board::emulated::is_emulated;

/// The latest control period, which every line carries.
static PERIOD: AtomicU32 = AtomicU32::new(0);

defmt::timestamp!("{=u32}", PERIOD.load(Ordering::Relaxed));

/// The number of the control period has gone on.
pub fn set_period(period: u32) {
    PERIOD.store(period, Ordering::Relaxed);
}

/// Opens the channel, before the first line.
#[cfg(target_abi = "eabihf")]
pub fn start() {
    // The name is what probe-rs looks for. Where nobody reads, new lines are dropped.
    rtt_target::rtt_init! { up: { 0: { size: 1024, name: "defmt" } } };
}

/// The board in 8 KB runs in the emulator alone, and needs no channel.
#[cfg(not(target_abi = "eabihf"))]
pub const fn start() {}

#[defmt::global_logger]
struct Log;

/// What a line needs while it is written.
struct Writer {
    encoder: UnsafeCell<Encoder>,
    restore: UnsafeCell<RestoreState>,
}

// SAFETY: it is used between `acquire` and `release` only, with interrupts masked, on one core.
#[allow(unsafe_code)]
unsafe impl Sync for Writer {}

static WRITER: Writer = Writer {
    encoder: UnsafeCell::new(Encoder::new()),
    restore: UnsafeCell::new(RestoreState::invalid()),
};

// SAFETY: a line holds a critical section from `acquire` to `release`, in which no other can begin, and defmt calls the
// functions in this order.
#[allow(unsafe_code)]
unsafe impl defmt::Logger for Log {
    fn acquire() {
        // SAFETY: released by `release`; nobody else is using the writer, as interrupts are masked now.
        unsafe {
            let restore = critical_section::acquire();
            *WRITER.restore.get() = restore;
            (*WRITER.encoder.get()).start_frame(write);
        }
    }

    unsafe fn flush() {}

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: between `acquire` and `release`.
        unsafe { (*WRITER.encoder.get()).write(bytes, write) }
    }

    unsafe fn release() {
        // SAFETY: as above, and the critical section is the one of `acquire`.
        unsafe {
            (*WRITER.encoder.get()).end_frame(write);
            critical_section::release(*WRITER.restore.get());
        }
    }
}

fn write(bytes: &[u8]) {
    if is_emulated() {
        // A log that cannot be written is no reason to stop.
        let _ = stderr().and_then(|mut out| out.write_all(bytes));
    } else {
        write_to_probe(bytes);
    }
}

#[cfg(target_abi = "eabihf")]
#[allow(unsafe_code)]
fn write_to_probe(bytes: &[u8]) {
    // SAFETY: the caller holds the critical section, so this is the only handle of the channel.
    if let Some(mut channel) = unsafe { rtt_target::UpChannel::conjure(0) } {
        channel.write(bytes);
    }
}

#[cfg(not(target_abi = "eabihf"))]
const fn write_to_probe(_: &[u8]) {}
