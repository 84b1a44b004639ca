//! What the drive asks of a number beyond [`Scalar`].

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::Scalar;
use crate::scalar::Q16;

/// A number of the control path, which travels over the link and into the flash as it is.
pub trait Number: Scalar + Serialize + DeserializeOwned + 'static {
    /// Whether the resolution is the same everywhere, so that units have to be chosen in which the numbers lie around 1.
    const FIXED: bool;
    /// What a computation leaves that has failed.
    const UNSOUND: Self;
    /// Whether it is finite and, in fixed point, not at the end of its range.
    fn is_sound(self) -> bool;
    /// The number as a word of a recording; `f64` is rounded to `f32`.
    fn to_word(self) -> u32;
    /// The number that a word stands for.
    fn from_word(word: u32) -> Self;
}

impl Number for f32 {
    const FIXED: bool = false;
    const UNSOUND: Self = f32::NAN;

    #[inline]
    fn is_sound(self) -> bool {
        self.is_finite()
    }
    #[inline]
    fn to_word(self) -> u32 {
        self.to_bits()
    }
    #[inline]
    fn from_word(word: u32) -> Self {
        Self::from_bits(word)
    }
}

impl Number for f64 {
    const FIXED: bool = false;
    const UNSOUND: Self = f64::NAN;

    fn is_sound(self) -> bool {
        self.is_finite()
    }
    fn to_word(self) -> u32 {
        (self as f32).to_bits()
    }
    fn from_word(word: u32) -> Self {
        f32::from_bits(word).into()
    }
}

impl Number for Q16 {
    const FIXED: bool = true;
    const UNSOUND: Self = Self::MAX;

    #[inline]
    fn is_sound(self) -> bool {
        self > Self::MIN && self < Self::MAX
    }
    #[inline]
    fn to_word(self) -> u32 {
        self.to_bits() as u32
    }
    #[inline]
    fn from_word(word: u32) -> Self {
        Self::from_bits(word as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::Number;
    use crate::Scalar;
    use crate::scalar::Q16;

    #[test]
    fn words_keep_the_number() {
        for value in [-30_000.25, -1.0, 0.0, 0.5, 32_767.0] {
            assert_eq!(
                f32::from_word(f32::from_f64(value).to_word()).to_f64(),
                value
            );
            assert_eq!(f64::from_word(value.to_word()), value);
            assert_eq!(
                Q16::from_word(Q16::from_f64(value).to_word()).to_f64(),
                value
            );
        }
    }

    #[test]
    fn what_is_lost_is_unsound() {
        assert!(!f32::NAN.is_sound() && !f32::INFINITY.is_sound() && 0.0_f32.is_sound());
        let large = Q16::from_f64(20_000.0);
        assert!(large.is_sound() && !(large + large).is_sound() && !(-large - large).is_sound());
    }
}
