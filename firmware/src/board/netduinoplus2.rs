//! Netduino Plus 2 and other boards with an STM32F405: the link is USART1 on PA9 (TX) and PA10 (RX), 115200 8N1.
//!
//! Register names and numbers refer to ST's reference manual RM0090. The clock stays the 16 MHz internal
//! oscillator that the chip resets to: the link needs no more, and the emulator models no clock tree, so waiting for
//! a crystal or PLL would wait forever there.

pub use stm32f4::stm32f405 as device;

use device::{DBGMCU, GPIOA, RCC, USART1};

/// The frequency of the internal oscillator after reset.
const CLOCK_HZ: u32 = 16_000_000;
const BAUD: u32 = 115_200;

/// Rounded to the nearest: 139, which is 0.08 % slow; a receiver tolerates about 2 %.
const BAUD_DIVIDER: u32 = (CLOCK_HZ + BAUD / 2) / BAUD;

/// The serial port. Owned by the interrupt that serves it, so no register access can race.
pub struct Serial {
    usart: USART1,
}

impl Serial {
    /// Connects the pins and starts the receiver, with its interrupt enabled.
    pub fn new(usart: USART1, gpio: &GPIOA, rcc: &RCC) -> Self {
        // A peripheral answers only two cycles after its clock is enabled (errata sheet ES0182): the read of the
        // second enable register covers the port, and the pin setup covers the USART.
        rcc.ahb1enr().modify(|_, w| w.gpioaen().enabled());
        rcc.apb2enr().modify(|_, w| w.usart1en().enabled());
        // The alternate function first: the pins must not switch to one that is not yet chosen.
        gpio.afrh().modify(|_, w| w.afrh9().af7().afrh10().af7());
        // An open RX line must read idle and not noise.
        gpio.pupdr().modify(|_, w| w.pupdr10().pull_up());
        gpio.moder()
            .modify(|_, w| w.moder9().alternate().moder10().alternate());

        usart.brr().write(|w| {
            w.div_mantissa()
                .set((BAUD_DIVIDER / 16) as u16)
                .div_fraction()
                .set((BAUD_DIVIDER % 16) as u8)
        });
        usart.cr1().write(|w| {
            w.ue().enabled();
            w.re().enabled();
            w.te().enabled();
            w.rxneie().enabled()
        });
        Self { usart }
    }

    /// The next received byte, if any.
    ///
    /// A byte with a framing error or noise is passed on, as the frame's checksum judges it. An overrun, which
    /// raises the interrupt by itself, is cleared by the same pair of reads (RM0090, 30.6.1); the frame that lost
    /// a byte fails its checksum.
    pub fn read(&mut self) -> Option<u8> {
        let status = self.usart.sr().read();
        if status.rxne().bit_is_clear() && status.ore().bit_is_clear() {
            return None;
        }
        let byte = self.usart.dr().read().dr().bits() as u8;
        status.rxne().bit_is_set().then_some(byte)
    }

    /// Whether [`Serial::write`] may be called.
    pub fn can_write(&self) -> bool {
        self.usart.sr().read().txe().bit_is_set()
    }

    /// Sends a byte; only after [`Serial::can_write`] said yes, or the byte before it is lost.
    pub fn write(&mut self, byte: u8) {
        self.usart.dr().write(|w| w.dr().set(byte.into()));
    }

    /// Asks for an interrupt as soon as the next byte can be written, or not.
    pub fn interrupt_when_writable(&mut self, wanted: bool) {
        self.usart.cr1().modify(|_, w| w.txeie().bit(wanted));
    }
}

/// Puts every output into the state that is safe with nobody in control.
///
/// This firmware drives no power stage: all pins but the serial port's keep their reset state, input. What is left to
/// do is to stop acting, so interrupts go off and stay off.
pub fn enter_safe_state() {
    cortex_m::interrupt::disable();
}

/// Whether this is QEMU's model of the board and not a chip.
///
/// The model has neither clock nor debug unit and reads both as zero. A chip never does: its reset value of
/// `RCC_CR` has the oscillator on, and `DBGMCU_IDCODE` names the device.
#[allow(unsafe_code)]
pub fn is_emulated() -> bool {
    // SAFETY: both pointers are valid for the whole run, as they are fixed addresses of the chip. The reads have no
    // side effect and the registers are not written here, so no owner of the peripherals can notice.
    let (clock, id) = unsafe { ((*RCC::ptr()).cr().read(), (*DBGMCU::ptr()).idcode().read()) };
    clock.bits() == 0 && id.bits() == 0
}
