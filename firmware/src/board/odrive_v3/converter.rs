//! Current and bus voltage: two injected conversions of ADC1, started by the bridge's timer.

use crate::board::device::{ADC1, GPIOA, GPIOC, RCC};
use crate::driver::sequence::{Registers, injected};

/// Current and bus voltage.
pub type Converter = crate::driver::sequence::Converter<Channels>;

/// The converter's registers.
pub struct Channels {
    adc: ADC1,
}

impl Channels {
    #[allow(unsafe_code)]
    /// Connects the pins and waits for the timer's triggers, with the interrupt enabled.
    pub fn start(adc: ADC1, rcc: &RCC, gpioa: &GPIOA, gpioc: &GPIOC) -> Self {
        rcc.apb2enr().modify(|_, w| w.adc1en().enabled());
        rcc.apb2enr().read();
        gpioc.moder().modify(|_, w| w.moder0().analog());
        gpioa.moder().modify(|_, w| w.moder6().analog());
        // 13.13.16: the reset value of the common prescaler is 2, which 84 MHz would make 42; at most 36 are allowed.
        prescale_by_four();
        // 13.13.2: scan both, and interrupt when both are done.
        adc.cr1().write(|w| w.scan().enabled().jeocie().enabled());
        // 13.13.4, 13.13.5: 15 and 28 cycles of sampling, 0.7 µs and 1.3 µs; the bus divider is the weaker source.
        adc.smpr1().write(|w| w.smp10().cycles15());
        adc.smpr2().write(|w| w.smp6().cycles28());
        // SAFETY: `injected` makes nothing but lengths and channels that there are.
        adc.jsqr().write(|w| unsafe { w.bits(injected([10, 6])) });
        // 13.13.3: rising edge of TIM1's trigger output.
        adc.cr2().write(|w| {
            w.jexten().rising_edge();
            w.jextsel().tim1trgo();
            w.adon().enabled()
        });
        Self { adc }
    }
}

impl Registers for Channels {
    fn is_done(&self) -> bool {
        self.adc.sr().read().jeoc().is_complete()
    }

    fn acknowledge(&mut self) {
        // The flag is cleared by writing zero.
        self.adc.sr().write(|w| w.jeoc().clear());
    }

    fn result(&self, conversion: usize) -> u16 {
        if conversion == 0 {
            self.adc.jdr1().read().jdata().bits()
        } else {
            self.adc.jdr2().read().jdata().bits()
        }
    }
}

/// The one register that the three converters share.
#[allow(unsafe_code)]
fn prescale_by_four() {
    use crate::board::device::ADC_COMMON;
    // SAFETY: the address is fixed, the other converters are not used, and nothing else writes this register.
    unsafe { (*ADC_COMMON::ptr()).ccr().modify(|_, w| w.adcpre().div4()) };
}
