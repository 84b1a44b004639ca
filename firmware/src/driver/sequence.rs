//! The injected conversions of an STM32's converter. Section numbers refer to RM0090.

/// 13.13.12, JSQR: the register for these channels, one after the other. Of four places the last ones are used: with two
/// conversions the third and the fourth.
///
/// # Panics
/// For none or more than four channels, or one that there is not; when it is compiled, as a constant.
#[must_use]
pub const fn injected<const N: usize>(channels: [u8; N]) -> u32 {
    assert!(N > 0 && N <= 4, "up to four conversions");
    let mut bits = (N as u32 - 1) << 20;
    let mut k = 0;
    while k < N {
        assert!(channels[k] <= 18, "no such channel");
        bits |= (channels[k] as u32) << (5 * (4 - N + k));
        k += 1;
    }
    bits
}

/// The registers of a converter that has done two injected conversions.
pub trait Registers {
    /// 13.13.1: whether the injected conversions are done, since the flag was cleared.
    fn is_done(&self) -> bool;
    /// Clears the flag.
    fn acknowledge(&mut self);
    /// The result of a conversion, counted in the order of the sequence.
    fn result(&self, conversion: usize) -> u16;
}

/// Current and bus voltage.
pub struct Converter<R> {
    registers: R,
}

impl<R: Registers> Converter<R> {
    /// A converter that is set up to be triggered.
    pub const fn new(registers: R) -> Self {
        Self { registers }
    }

    /// The two readings. The conversion is acknowledged first: one that is done meanwhile is seen by [`Converter::is_done`].
    #[inline]
    pub fn read(&mut self) -> (u16, u16) {
        self.registers.acknowledge();
        (self.registers.result(0), self.registers.result(1))
    }

    /// Whether another conversion is done.
    #[inline]
    pub fn is_done(&self) -> bool {
        self.registers.is_done()
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use bristle_core::control::SetPoint;
    use bristle_core::drive::signal::Signal;
    use bristle_core::drive::{Drive, Faults, News, Parameters, Sample};

    use super::{Converter, Registers, injected};

    #[test]
    fn the_last_places_are_used_in_order() {
        // Channel 10 in JSQ3, channel 6 in JSQ4, and a length of two.
        assert_eq!(injected([10, 6]), 1 << 20 | 10 << 10 | 6 << 15);
        assert_eq!(injected([7]), 7 << 15);
        assert_eq!(
            injected([1, 2, 3, 4]),
            3 << 20 | 1 | 2 << 5 | 3 << 10 | 4 << 15
        );
    }

    /// Converts once more while it is read.
    struct Hasty {
        done: Cell<bool>,
        results: [u16; 2],
        conversions_to_come: Cell<u32>,
    }

    impl Registers for Hasty {
        fn is_done(&self) -> bool {
            self.done.get()
        }
        fn acknowledge(&mut self) {
            self.done.set(false);
        }
        fn result(&self, conversion: usize) -> u16 {
            let left = self.conversions_to_come.get();
            if left > 0 {
                self.conversions_to_come.set(left - 1);
                self.done.set(true);
            }
            self.results[conversion]
        }
    }

    #[test]
    fn a_conversion_that_is_done_while_one_is_read_is_not_lost() {
        let mut converter = Converter::new(Hasty {
            done: Cell::new(true),
            results: [2050, 1600],
            conversions_to_come: Cell::new(1),
        });
        assert_eq!(converter.read(), (2050, 1600));
        assert!(converter.is_done());
        assert_eq!(converter.read(), (2050, 1600));
        assert!(!converter.is_done());
    }

    /// From the circuit of an `ODrive` v3 to amperes and volts: 40 V/V over 0.5 mΩ around the middle, and a divider of 11.
    #[test]
    fn readings_become_amperes_and_volts() {
        let volts = 3.3_f32 / 4096.0;
        for (sign, wired) in [(1.0, 1.0_f32), (-1.0, -1.0)] {
            let mut set = Parameters::<f32>::harmless();
            set.limits.current_per_count = wired * volts / (40.0 * 0.5e-3);
            set.limits.current_zero = 2040;
            set.limits.bus_per_count = 11.0 * volts;
            (set.limits.current, set.limits.bus_max) = (100.0, 100.0);
            let mut drive = Drive::new(set, Faults::NONE, &mut []).unwrap();
            for current in [-50.0_f32, -1.0, 0.0, 0.3, 79.0] {
                let pin = 2040.0 + sign * current * 40.0 * 0.5e-3 / volts;
                let (current_count, bus) =
                    (pin.round() as u16, (24.0 / 11.0 / volts).round() as u16);
                let mut converter = Converter::new(Hasty {
                    done: Cell::new(true),
                    results: [current_count, bus],
                    conversions_to_come: Cell::new(0),
                });
                let (current_read, bus_read) = converter.read();
                let sample = Sample {
                    count: 0,
                    current: current_read,
                    bus: bus_read,
                    gate_fault: false,
                };
                let news = News {
                    set_point: Some(SetPoint::Off),
                    ..News::NONE
                };
                drive.step(&sample, &news);
                let shown = |signal| f32::from_bits(drive.snapshot().get(signal));
                // Half of a count.
                assert!((shown(Signal::Current) - current).abs() <= 0.501 * volts / 0.02);
                assert!((shown(Signal::Bus) - 24.0).abs() <= 0.501 * 11.0 * volts);
                assert!(drive.faults().is_empty());
            }
        }
    }
}
