//! The link's serial port, 8N1. Both chips have the same kind (RM0090 30, RM0041 23).

use super::device;

/// Bits a second.
pub const BAUD: u32 = 115_200;

/// `GPIO 1` and `GPIO 2` of an `ODrive` v3's header.
#[cfg(target_abi = "eabihf")]
type Port = device::UART4;
/// PA9 and PA10.
#[cfg(not(target_abi = "eabihf"))]
type Port = device::USART1;

/// The serial port. Owned by the interrupt that serves it, so no register access can race.
pub struct Serial {
    port: Port,
}

impl Serial {
    /// Starts a port whose pins are connected, with the receiver's interrupt enabled. `clock` is the frequency of its
    /// bus, Hz.
    pub fn new(port: Port, clock: u32) -> Self {
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
