//! From a voltage to the compare values of two legs.

use crate::Scalar;

/// The largest mean voltage between two legs of a bridge on a bus of `bus`: 15/16 of it.
pub(super) fn most<T: Scalar>(bus: T) -> T {
    bus - bus.half().half().half().half()
}

/// The compare values of two legs, between which a motor is to see the mean voltage `input` from a bus of `bus`.
///
/// Both legs stand at half of the period plus and minus half of the ratio, so that the voltage changes twice a period and
/// is exact whatever its sign. A share of 1/32 is kept from both ends, for the low sides must conduct long enough
/// for the current to be measured and for the high sides' supplies to be charged.
pub(super) fn compare<T: Scalar>(input: T, bus: T, top: u16) -> [u16; 2] {
    let ratio = if bus > T::ZERO {
        (input / bus).clamp_symmetric(most(T::ONE))
    } else {
        T::ZERO
    };
    let half = T::from_i32(i32::from(top)).half();
    let offset = (half * ratio).floor();
    let middle = i32::from(top / 2);
    [middle + offset, middle - offset].map(|leg| leg.clamp(0, i32::from(top)) as u16)
}

#[cfg(test)]
mod tests {
    use super::compare;
    use crate::scalar::{Q16, Scalar};

    fn voltage<T: Scalar>(input: f64, bus: f64) -> f64 {
        let [b, c] = compare(T::from_f64(input), T::from_f64(bus), 3500);
        assert!(b <= 3500 && c <= 3500);
        (f64::from(b) - f64::from(c)) / 3500.0 * bus
    }

    #[test]
    fn the_mean_voltage_is_right_to_a_step_and_limited() {
        for input in [-20.0, -3.3, -0.01, 0.0, 0.01, 5.0, 21.0] {
            // Both legs move a whole step at a time.
            let step = 2.0 / 3500.0 * 24.0;
            assert!((voltage::<f32>(input, 24.0) - input).abs() <= step);
            assert!((voltage::<Q16>(input, 24.0) - input).abs() <= 1.1 * step);
        }
        let most = 24.0 * 15.0 / 16.0;
        assert!((voltage::<f32>(100.0, 24.0) - most).abs() < 0.02);
        assert!((voltage::<f32>(-100.0, 24.0) + most).abs() < 0.02);
        assert_eq!(voltage::<f32>(1.0, 0.0), 0.0);
    }
}
