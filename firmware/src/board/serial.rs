//! The link's serial port: UART4 on PA0 (TX) and PA1 (RX), the header's `GPIO 1` and `GPIO 2` of an `ODrive` v3, 8N1.

use super::device::{GPIOA, RCC, UART4};

/// Bits a second.
pub const BAUD: u32 = 115_200;

/// The serial port. Owned by the interrupt that serves it, so no register access can race.
pub struct Serial {
    port: UART4,
}

impl Serial {
    /// Connects the pins and starts the receiver, with its interrupt enabled. `clock` is the frequency of APB1, Hz.
    pub fn new(port: UART4, gpio: &GPIOA, rcc: &RCC, clock: u32) -> Self {
        // A peripheral answers only two cycles after its clock is enabled (errata sheet ES0182): the read of the
        // second enable register covers the port, and the pin setup covers the UART.
        rcc.ahb1enr().modify(|_, w| w.gpioaen().enabled());
        rcc.apb1enr().modify(|_, w| w.uart4en().enabled());
        // The alternate function first (8.4.9; datasheet DS8626, table 9: AF8 is UART4): the pins must not switch to
        // one that is not yet chosen.
        gpio.afrl().modify(|_, w| w.afrl0().af8().afrl1().af8());
        // An open RX line must read idle and not noise.
        gpio.pupdr().modify(|_, w| w.pupdr1().pull_up());
        gpio.moder()
            .modify(|_, w| w.moder0().alternate().moder1().alternate());

        // 30.3.4: with 16-fold oversampling the divider in sixteenths is clock/baud, here to nearest.
        let divider = (clock + BAUD / 2) / BAUD;
        port.brr().write(|w| {
            w.div_mantissa()
                .set((divider / 16) as u16)
                .div_fraction()
                .set((divider % 16) as u8)
        });
        port.cr1().write(|w| {
            w.ue().enabled();
            w.re().enabled();
            w.te().enabled();
            w.rxneie().enabled()
        });
        Self { port }
    }

    /// The next received byte, if any.
    ///
    /// A byte with a framing error or noise is passed on, as the frame's checksum judges it. An overrun, which
    /// raises the interrupt by itself, is cleared by the same pair of reads (30.6.1); the frame that lost a byte fails
    /// its checksum.
    pub fn read(&mut self) -> Option<u8> {
        let status = self.port.sr().read();
        if status.rxne().bit_is_clear() && status.ore().bit_is_clear() {
            return None;
        }
        let byte = self.port.dr().read().dr().bits() as u8;
        status.rxne().bit_is_set().then_some(byte)
    }

    /// Whether [`Serial::write`] may be called.
    pub fn can_write(&self) -> bool {
        self.port.sr().read().txe().bit_is_set()
    }

    /// Sends a byte; only after [`Serial::can_write`] said yes, or the byte before it is lost.
    pub fn write(&mut self, byte: u8) {
        self.port.dr().write(|w| w.dr().set(byte.into()));
    }

    /// Asks for an interrupt as soon as the next byte can be written, or not.
    pub fn interrupt_when_writable(&mut self, wanted: bool) {
        self.port.cr1().modify(|_, w| w.txeie().bit(wanted));
    }
}
