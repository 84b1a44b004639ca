//! The encoder: TIM3 counts both edges of both channels.

use crate::board::device::{GPIOB, RCC, TIM3};

/// The encoder's counter.
pub struct Encoder {
    timer: TIM3,
}

impl Encoder {
    /// Connects the pins and starts counting.
    pub fn start(timer: TIM3, rcc: &RCC, gpio: &GPIOB) -> Self {
        rcc.apb1enr().modify(|_, w| w.tim3en().enabled());
        rcc.apb1enr().read();
        // DS8626, table 9: AF2 is TIM3. Open-collector encoders need the pull-up. PB4 leaves its reset function, JTAG
        // reset, by this (8.3.1).
        gpio.afrl().modify(|_, w| w.afrl4().af2().afrl5().af2());
        gpio.pupdr()
            .modify(|_, w| w.pupdr4().pull_up().pupdr5().pull_up());
        gpio.moder()
            .modify(|_, w| w.moder4().alternate().moder5().alternate());
        // 18.3.12, 18.4.3: encoder mode 3; 18.4.7: both inputs direct, and eight equal samples make an edge (filter 3).
        timer.ccmr1_input().write(|w| {
            w.cc1s().ti1();
            w.cc2s().ti2();
            w.ic1f().fck_int_n8();
            w.ic2f().set(3)
        });
        timer.smcr().write(|w| w.sms().encoder_mode_3());
        timer.arr().write(|w| w.arr().set(u16::MAX));
        timer.cr1().write(|w| w.cen().enabled());
        Self { timer }
    }

    /// The counter, which wraps.
    pub fn count(&self) -> u16 {
        self.timer.cnt().read().cnt().bits()
    }
}
