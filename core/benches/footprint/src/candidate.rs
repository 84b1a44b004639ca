//! `I16F16` of the crate `fixed`, with saturating arithmetic. It has no exponential, so ours serves both.

use bristle_core::Scalar;
use bristle_core::scalar::Q16;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use fixed::types::I16F16;

#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
#[repr(transparent)]
pub struct Number(I16F16);

macro_rules! operators {
    ($($trait:ident $method:ident $saturating:ident),*) => {$(
        impl $trait for Number {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0.$saturating(other.0))
            }
        }
    )*};
}

operators!(Add add saturating_add, Sub sub saturating_sub, Mul mul saturating_mul);

impl Div for Number {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        if other.0 == I16F16::ZERO {
            return if self.0 < I16F16::ZERO {
                Self(I16F16::MIN)
            } else {
                Self(I16F16::MAX)
            };
        }
        Self(self.0.saturating_div(other.0))
    }
}

impl Neg for Number {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.saturating_neg())
    }
}

impl AddAssign for Number {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Number {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Scalar for Number {
    const ZERO: Self = Self(I16F16::ZERO);
    const ONE: Self = Self(I16F16::ONE);
    const EPSILON: Self = Self(I16F16::DELTA);

    fn from_f64(value: f64) -> Self {
        Self(I16F16::saturating_from_num(value))
    }
    fn to_f64(self) -> f64 {
        self.0.to_num()
    }
    fn from_i32(value: i32) -> Self {
        Self(I16F16::saturating_from_num(value))
    }
    fn floor(self) -> i32 {
        self.0.to_bits() >> 16
    }
    fn half(self) -> Self {
        Self(I16F16::from_bits(self.0.to_bits() >> 1))
    }
    fn share_of(self, whole: u32) -> u32 {
        Q16::from_bits(self.0.to_bits()).share_of(whole)
    }
    fn wave(phase: u32) -> (Self, Self) {
        let (sine, cosine) = Q16::wave(phase);
        (number(sine.to_bits()), number(cosine.to_bits()))
    }
    fn sqrt(self) -> Self {
        Self(I16F16::from_bits(
            Q16::from_bits(self.0.to_bits()).sqrt().to_bits(),
        ))
    }
    fn exp(self) -> Self {
        Self(I16F16::from_bits(
            Q16::from_bits(self.0.to_bits()).exp().to_bits(),
        ))
    }
    fn relax(self) -> (Self, Self) {
        let (relaxed, mean) = Q16::from_bits(self.0.to_bits()).relax();
        (
            Self(I16F16::from_bits(relaxed.to_bits())),
            Self(I16F16::from_bits(mean.to_bits())),
        )
    }
}

pub fn number(bits: i32) -> Number {
    Number(I16F16::from_bits(bits))
}
