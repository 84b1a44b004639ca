//! The bridge: TIM1 with complementary outputs on phases B and C.

use crate::board::device::{GPIOA, GPIOB, RCC, TIM1};
use crate::driver::bridge::{Registers, dead_time, repetitions, top};

/// Frequency of the timer (17.3.2, twice that of APB2), Hz.
const CLOCK: u32 = 168_000_000;

/// Where the counter turns, 3500, for a PWM of 24 kHz.
pub const TOP: u16 = top(CLOCK, 24_000);

/// From one update event to the next: three PWM periods, so that the control rate is 8 kHz. The event comes at the top, in the
/// middle of the time in which the low sides conduct and the shunts show the current.
const REPETITIONS: u8 = repetitions(3);

/// 119 ns, 20 periods of the clock; the gate driver adds its own.
const DEAD_TIME: u8 = dead_time(CLOCK, 119);

/// The bridge, on phases B and C.
pub type Bridge = crate::driver::bridge::Bridge<Timer>;

/// The bridge's timer.
pub struct Timer {
    timer: TIM1,
}

impl Timer {
    /// Sets the timer up, with its outputs off, and starts it.
    pub fn off(timer: TIM1, rcc: &RCC, gpioa: &GPIOA, gpiob: &GPIOB) -> Self {
        rcc.apb2enr().modify(|_, w| w.tim1en().enabled());
        rcc.apb2enr().read();
        // 17.3.9, 17.4.18: while the main output is off the pins are driven to their inactive level, low (OSSI); the
        // break is active on a failure of the clock alone, and the outputs do not come back by themselves (AOE = 0).
        timer.bdtr().write(|w| {
            w.ossi().set_bit();
            w.ossr().set_bit();
            w.bke().set_bit();
            w.bkp().set_bit();
            w.dtg().set(DEAD_TIME)
        });
        // 17.3.2: centre-aligned, so that both edges move and the middle stays.
        timer.cr1().write(|w| {
            w.cms().center_aligned1();
            w.arpe().enabled()
        });
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set(TOP));
        timer.rcr().write(|w| w.rep().set(REPETITIONS));
        // 17.4.7, 17.4.8: PWM mode 1, taken over at the update event.
        timer
            .ccmr1_output()
            .write(|w| w.oc2m().pwm_mode1().oc2pe().enabled());
        timer
            .ccmr2_output()
            .write(|w| w.oc3m().pwm_mode1().oc3pe().set_bit());
        timer.ccr(1).write(|w| w.ccr().set(TOP / 2));
        timer.ccr(2).write(|w| w.ccr().set(TOP / 2));
        timer.ccer().write(|w| {
            w.cc2e().set_bit();
            w.cc2ne().set_bit();
            w.cc3e().set_bit();
            w.cc3ne().set_bit()
        });
        // 17.4.2: the update event is the trigger output, which starts the converter.
        timer.cr2().write(|w| w.mms().update());
        // 17.4.6: takes the preloaded values over.
        timer.egr().write(|w| w.ug().update());
        timer.cr1().modify(|_, w| w.cen().enabled());
        connect(gpioa, gpiob);
        Self { timer }
    }
}

impl Registers for Timer {
    fn compare(&mut self, leg: usize, value: u16) {
        // Channels 2 and 3, which are the second and the third in the array.
        self.timer.ccr(1 + leg).write(|w| w.ccr().set(value));
    }

    fn output(&mut self, on: bool) {
        if on {
            self.timer.bdtr().modify(|_, w| w.moe().enabled());
        } else {
            bridge_off();
        }
    }
}

/// 8.3.2: the timer takes the pins over when it drives them low already. DS8626, table 9: AF1 is TIM1.
fn connect(gpioa: &GPIOA, gpiob: &GPIOB) {
    gpioa.afrh().modify(|_, w| w.afrh9().af1().afrh10().af1());
    gpiob.afrh().modify(|_, w| w.afrh14().af1().afrh15().af1());
    gpioa
        .moder()
        .modify(|_, w| w.moder9().alternate().moder10().alternate());
    gpiob
        .moder()
        .modify(|_, w| w.moder14().alternate().moder15().alternate());
}

/// Turns the outputs off: 17.4.18, MOE. Callable from any context and in any state; an emulator ignores it.
#[allow(unsafe_code)]
pub fn bridge_off() {
    // SAFETY: the pointer is valid for the whole run, as it is a fixed address of the chip. The one write clears a bit
    // that only `Bridge::drive` sets; interrupted between reading and writing, that call could set it again, so
    // `drive` runs at the highest priority that uses the bridge, or never again after this, as in a fault handler.
    unsafe { (*TIM1::ptr()).bdtr().modify(|_, w| w.moe().disabled_idle()) };
}
