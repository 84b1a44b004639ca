//! 168 MHz from the 8 MHz crystal, under the clock security system.

use crate::board::device::{FLASH, PWR, RCC};

/// Attempts to see the crystal or the loop ready: tens of milliseconds at 16 MHz, where a crystal takes 2.
const PATIENCE: u32 = 100_000;

/// Frequencies, Hz, with the crystal and with the internal oscillator alone.
const FAST: (u32, u32) = (168_000_000, 42_000_000);
const SLOW: (u32, u32) = (16_000_000, 16_000_000);

/// The clock tree, set up once.
pub struct Clock {
    rcc: RCC,
    /// Processor and APB1.
    frequencies: (u32, u32),
}

impl Clock {
    /// Starts the crystal and the loop. Without the crystal everything runs on from the internal oscillator, at 16 MHz,
    /// and [`Clock::has_failed`] says so.
    pub fn start(rcc: RCC, flash: &FLASH, pwr: &PWR) -> Self {
        let frequencies = if start_crystal(&rcc) && start_loop(&rcc, flash, pwr) {
            FAST
        } else {
            SLOW
        };
        Self { rcc, frequencies }
    }

    /// Whether the system does not run from the loop (7.3.3, SWS). After a failure of the crystal the hardware has
    /// switched to the internal oscillator by itself (7.2.7).
    pub fn has_failed(&self) -> bool {
        !self.rcc.cfgr().read().sws().is_pll()
    }

    /// Frequency of the processor, Hz, as it was set up.
    pub fn cpu_hz(&self) -> u32 {
        self.frequencies.0
    }

    /// Frequency of APB1, Hz.
    pub fn apb1_hz(&self) -> u32 {
        self.frequencies.1
    }

    /// The registers, for enabling peripherals.
    pub fn rcc(&self) -> &RCC {
        &self.rcc
    }
}

/// Clears the flag of a clock failure (7.3.4, CSSC), or its interrupt would come again at once.
#[allow(unsafe_code)]
pub fn acknowledge_clock_failure() {
    // SAFETY: the address is fixed, and the register is written nowhere else.
    unsafe { (*RCC::ptr()).cir().modify(|_, w| w.cssc().set_bit()) };
}

fn becomes(mut condition: impl FnMut() -> bool) -> bool {
    (0..PATIENCE).any(|_| condition())
}

/// 7.2.1 and 7.2.7: the crystal, and the security system that raises a non-maskable interrupt when it stops.
fn start_crystal(rcc: &RCC) -> bool {
    rcc.cr().modify(|_, w| w.hseon().on());
    let ready = becomes(|| rcc.cr().read().hserdy().is_ready());
    if ready {
        rcc.cr().modify(|_, w| w.csson().on());
    }
    ready
}

/// 7.3.2: 8 MHz / 4 · 168 / 2 = 168 MHz, whose input of 2 MHz gives the least jitter; by 7, 48 MHz for USB.
#[allow(unsafe_code)]
fn start_loop(rcc: &RCC, flash: &FLASH, pwr: &PWR) -> bool {
    // 5.1.4, 5.4.1: regulator scale 1, which 168 MHz need.
    rcc.apb1enr().modify(|_, w| w.pwren().enabled());
    rcc.apb1enr().read();
    pwr.cr().modify(|_, w| w.vos().set_bit());
    rcc.pllcfgr().modify(|_, w| {
        w.pllsrc().hse();
        w.pllp().div2();
        // SAFETY: 7.3.2 allows dividers of 2 to 63 and 2 to 15, and factors of 50 to 432.
        unsafe { w.pllm().bits(4).plln().bits(168).pllq().bits(7) }
    });
    rcc.cr().modify(|_, w| w.pllon().on());
    if !becomes(|| rcc.cr().read().pllrdy().is_ready()) {
        return false;
    }
    // 3.5.1, table 10: five wait states at 168 MHz and 2.7 to 3.6 V; they must be in force before the switch.
    flash.acr().write(|w| {
        w.latency().ws5();
        w.prften().enabled();
        w.icen().enabled();
        w.dcen().enabled()
    });
    if !becomes(|| flash.acr().read().latency().is_ws5()) {
        return false;
    }
    // 7.3.3: APB1 at most 42 MHz, APB2 at most 84 MHz.
    rcc.cfgr().modify(|_, w| {
        w.hpre().div1();
        w.ppre1().div4();
        w.ppre2().div2()
    });
    rcc.cfgr().modify(|_, w| w.sw().pll());
    becomes(|| rcc.cfgr().read().sws().is_pll())
}
