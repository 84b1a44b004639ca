//! Floating point.

use super::Scalar;

impl Scalar for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const EPSILON: Self = f64::EPSILON;

    fn from_f64(value: f64) -> Self {
        value
    }
    fn to_f64(self) -> f64 {
        self
    }
    fn sqrt(self) -> Self {
        if self > 0.0 { libm::sqrt(self) } else { 0.0 }
    }
    fn exp(self) -> Self {
        libm::exp(self)
    }
    fn relax(self) -> (Self, Self) {
        let relaxed = -libm::expm1(-self);
        (relaxed, if self > 0.0 { relaxed / self } else { 1.0 })
    }
}

impl Scalar for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const EPSILON: Self = f32::EPSILON;

    fn from_f64(value: f64) -> Self {
        value as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    fn sqrt(self) -> Self {
        if self > 0.0 { libm::sqrtf(self) } else { 0.0 }
    }
    fn exp(self) -> Self {
        libm::expf(self)
    }
    fn relax(self) -> (Self, Self) {
        let relaxed = -libm::expm1f(-self);
        (relaxed, if self > 0.0 { relaxed / self } else { 1.0 })
    }
}
