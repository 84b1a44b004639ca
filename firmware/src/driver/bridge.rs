//! A bridge on an advanced timer of an STM32: what its registers hold, and in which order they are written. Section numbers
//! refer to RM0090.

/// Where a centre-aligned counter of `clock` Hz turns for a PWM of `frequency` Hz.
///
/// # Panics
/// If that is not within 16 bits; when it is compiled, as a constant.
#[must_use]
pub const fn top(clock: u32, frequency: u32) -> u16 {
    let top = clock / (2 * frequency);
    assert!(top > 1 && top <= 0xFFFF, "16 bits");
    top as u16
}

/// RCR for an update event every so many periods of a centre-aligned PWM: turns of the counter, of which there are two in a
/// period, less one. Odd, and written before the counter starts, so that the event comes at the top (17.3.2).
///
/// # Panics
/// Likewise, beyond 128 periods.
#[must_use]
pub const fn repetitions(periods: u8) -> u8 {
    assert!(periods > 0 && periods <= 128, "8 bits");
    2 * (periods - 1) + 1
}

/// 17.4.18, DTG: the shortest dead time of at least so many ns that a timer of `clock` Hz can make.
///
/// # Panics
/// Likewise, for a time longer than it can make, 1008 ticks.
#[must_use]
pub const fn dead_time(clock: u32, nanoseconds: u32) -> u8 {
    let ticks = (clock as u64 * nanoseconds as u64).div_ceil(1_000_000_000);
    // Up to 127 ticks; (64 + n)·2 with 6 bits; (32 + n)·8 and (32 + n)·16 with 5.
    if ticks < 128 {
        ticks as u8
    } else if ticks <= 127 * 2 {
        0x80 | (ticks.div_ceil(2) - 64) as u8
    } else if ticks <= 63 * 8 {
        0xC0 | (ticks.div_ceil(8) - 32) as u8
    } else {
        assert!(ticks <= 63 * 16, "longer than the timer can make");
        0xE0 | (ticks.div_ceil(16) - 32) as u8
    }
}

/// The registers that change while the bridge works.
pub trait Registers {
    /// The compare value of a leg, 0 or 1, taken over at the next update event.
    fn compare(&mut self, leg: usize, value: u16);
    /// The main output bit.
    fn output(&mut self, on: bool);
}

/// Two legs with a motor between them.
pub struct Bridge<R> {
    registers: R,
}

impl<R: Registers> Bridge<R> {
    /// A bridge whose timer is set up and whose outputs are off.
    pub const fn new(registers: R) -> Self {
        Self { registers }
    }

    /// Sets the compare values and turns the outputs on.
    #[inline]
    pub fn drive(&mut self, [b, c]: [u16; 2]) {
        self.registers.compare(0, b);
        self.registers.compare(1, c);
        self.registers.output(true);
    }

    /// Turns the outputs off.
    #[inline]
    pub fn off(&mut self) {
        self.registers.output(false);
    }
}

#[cfg(test)]
mod tests {
    use super::{Bridge, Registers, dead_time, repetitions, top};

    /// What DTG means (17.4.18), in ticks.
    fn ticks(dtg: u8) -> u64 {
        let low = |bits: u8| u64::from(dtg & ((1 << bits) - 1));
        match dtg >> 5 {
            0..=3 => low(7),
            4..=5 => (64 + low(6)) * 2,
            6 => (32 + low(5)) * 8,
            _ => (32 + low(5)) * 16,
        }
    }

    #[test]
    fn the_dead_time_is_never_too_short_and_as_short_as_can_be() {
        for nanoseconds in 0..=6000 {
            let dtg = dead_time(168_000_000, nanoseconds);
            let wanted = u64::from(nanoseconds) * 168;
            assert!(ticks(dtg) * 1000 >= wanted, "{nanoseconds} ns");
            let shorter = (0..=u8::MAX).filter(|d| ticks(*d) < ticks(dtg));
            assert!(
                shorter.into_iter().all(|d| ticks(d) * 1000 < wanted),
                "{nanoseconds} ns"
            );
        }
        assert_eq!(dead_time(168_000_000, 119), 20);
    }

    #[test]
    fn the_counter_turns_where_the_frequencies_say() {
        assert_eq!(top(168_000_000, 24_000), 3500);
        // 24 kHz and an event every third period: six turns.
        assert_eq!(
            (repetitions(1), repetitions(3), repetitions(128)),
            (1, 5, 255)
        );
    }

    #[derive(Default)]
    struct Timer {
        compare: [Option<u16>; 2],
        on: bool,
    }

    impl Registers for Timer {
        fn compare(&mut self, leg: usize, value: u16) {
            self.compare[leg] = Some(value);
        }
        fn output(&mut self, on: bool) {
            assert!(
                !on || self.compare.iter().all(Option::is_some),
                "on without values"
            );
            self.on = on;
        }
    }

    #[test]
    fn the_outputs_come_on_with_the_values_in_place_and_go_off() {
        let mut bridge = Bridge::new(Timer::default());
        bridge.drive([1800, 1700]);
        let timer = &bridge.registers;
        assert_eq!((timer.compare, timer.on), ([Some(1800), Some(1700)], true));
        bridge.off();
        assert!(!bridge.registers.on);
    }
}
