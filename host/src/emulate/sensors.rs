//! From the plant's state to what a board's converters and counters show.

use bristle_core::drive::{Number, Sample, parameters::Limits};

/// Scales of the converters, and the supply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// rad or m to an encoder count.
    pub count: f64,
    /// A to a count of the converter.
    pub current_per_count: f64,
    /// V to a count of the converter.
    pub bus_per_count: f64,
    /// Voltage of the supply, V.
    pub bus: f64,
}

/// What the current's converter shows without current: the middle of its 12 bits.
pub const CURRENT_ZERO: u16 = 2048;

/// A set point is stale after this, s: ten times what `bristle monitor` takes from one to the next, as a host on an ordinary
/// operating system is late now and then.
const STALE: f64 = 0.05;
/// A host that is silent for so long is gone, s.
const GONE: f64 = 0.5;
/// An axis that does not move for so long under an input that must move it stalls, s.
const STALLED: f64 = 1.0;

/// The largest reading of 12 bits.
const FULL: f64 = 4095.0;

impl Sensors {
    /// The converters of the emulated board, for an encoder whose count is `count` rad or m.
    pub const fn emulated(count: f64) -> Self {
        Self {
            count,
            current_per_count: 0.02,
            bus_per_count: 0.015,
            bus: 24.0,
        }
    }

    /// The counts that an encoder has passed at a position.
    pub fn counts(&self, q: f64) -> i64 {
        (q / self.count).floor() as i64
    }

    /// The readings of a healthy board at a position and a motor current.
    pub fn sample(&self, q: f64, current: f64) -> Sample {
        let reading = |x: f64| x.round().clamp(0.0, FULL) as u16;
        Sample {
            // The counter wraps.
            count: self.counts(q).rem_euclid(1 << 16) as u16,
            current: reading(f64::from(CURRENT_ZERO) + current / self.current_per_count),
            bus: reading(self.bus / self.bus_per_count),
            gate_fault: false,
        }
    }

    /// The limits of a board with these sensors and so many control periods a second: generous, but for what a period can
    /// hold.
    pub fn limits<T: Number>(&self, rate: f64) -> Limits<T> {
        // As many periods as there are in a time, and one at least, as 0 turns a check off.
        let periods =
            |seconds: f64| (seconds * rate).round().clamp(1.0, f64::from(u16::MAX)) as u16;
        Limits {
            // A sixteenth of the counter's range: a lost encoder jumps further, an axis does not.
            jump: 1 << 12,
            current_per_count: T::from_f64(self.current_per_count),
            current_zero: CURRENT_ZERO,
            // A reading at the end of the range says only that there is more.
            current: T::from_f64(0.95 * 2047.0 * self.current_per_count),
            bus_per_count: T::from_f64(self.bus_per_count),
            bus_min: T::from_f64(0.5 * self.bus),
            bus_max: T::from_f64(1.5 * self.bus),
            stall: T::from_f64(1e4),
            stall_periods: periods(STALLED),
            command_timeout: periods(STALE),
            link_timeout: periods(GONE),
        }
    }
}

#[cfg(test)]
mod tests {
    use bristle_core::drive::Encoder;

    use super::{CURRENT_ZERO, Sensors};

    const SENSORS: Sensors = Sensors {
        count: 1e-3,
        current_per_count: 0.01,
        bus_per_count: 0.01,
        bus: 24.0,
    };

    #[test]
    fn readings_are_those_of_the_scales() {
        let sample = SENSORS.sample(0.0125, -1.0);
        assert_eq!(
            (sample.count, sample.current, sample.bus),
            (12, CURRENT_ZERO - 100, 2400)
        );
        assert_eq!(SENSORS.sample(-1e-4, 1e9).count, u16::MAX);
        assert_eq!(SENSORS.sample(0.0, 1e9).current, 4095);
    }

    #[test]
    fn timeouts_are_times_and_not_numbers_of_periods() {
        for rate in [1000.0, 8000.0] {
            let limits = SENSORS.limits::<f32>(rate);
            assert_eq!(f64::from(limits.command_timeout) / rate, 0.05);
            assert_eq!(f64::from(limits.link_timeout) / rate, 0.5);
        }
        let limits = SENSORS.limits::<f32>(1.0);
        assert_eq!((limits.command_timeout, limits.link_timeout), (1, 1));
        assert_eq!(SENSORS.limits::<f32>(1e6).link_timeout, u16::MAX);
    }

    #[test]
    fn the_board_follows_what_the_encoder_shows() {
        let mut encoder = Encoder::new();
        let start = SENSORS.counts(0.3);
        for k in 0..2000 {
            let q = 0.3 + 5.0 * f64::from(k) - f64::from(k) * f64::from(k) * 0.004;
            encoder.follow(SENSORS.sample(q, 0.0).count);
            assert_eq!(i64::from(encoder.total()), SENSORS.counts(q) - start);
        }
    }
}
