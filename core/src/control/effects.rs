//! Torques that depend on where the axis is and which way it goes.

use serde::{Deserialize, Serialize};

use super::{Backlash, Position};
use crate::Scalar;

/// A wave over position: `sine·sin φ + cosine·cos φ` with `φ = 2π·periods·q`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Harmonic<T> {
    /// Periods per count, times 2³², to nearest: the phase of a position wraps as the counts do. For an encoder whose
    /// counts per turn are a power of two it is exact, else it errs by 2⁻³³ turns of phase a count.
    pub cycle: u32,
    /// N·m or N.
    pub sine: T,
    /// N·m or N.
    pub cosine: T,
}

impl<T: Scalar> Harmonic<T> {
    /// No wave.
    pub const NONE: Self = Self {
        cycle: 0,
        sine: T::ZERO,
        cosine: T::ZERO,
    };

    /// Whether it is other than zero anywhere.
    pub fn is_any(&self) -> bool {
        self.sine != T::ZERO || self.cosine != T::ZERO
    }

    /// The value at a position.
    // Not in the loop over the waves, which would keep its constants in registers that the rest of a sample needs.
    #[inline(never)]
    pub fn at(&self, position: Position<T>) -> T {
        let whole = (position.counts as u32).wrapping_mul(self.cycle);
        let part = position.fraction.share_of(self.cycle);
        let (sine, cosine) = T::wave(whole.wrapping_add(part));
        (self.cosine * cosine).plus_product(self.sine, sine)
    }
}

/// Physics beside dry and viscous friction that a diagnosis may find; all of it zero for none.
///
/// Signs as everywhere: what resists motion in the positive direction is positive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Effects<T> {
    /// `direction-asymmetry`: a constant, N·m or N.
    pub offset: T,
    /// `viscous-asymmetry`: a torque per speed, whichever way the axis goes; N·m·s/rad or N·s/m.
    pub viscous_difference: T,
    /// `spring`: torque per displacement from zero, N·m/rad or N/m.
    pub stiffness: T,
    /// `gravity` and `cogging`.
    pub waves: [Harmonic<T>; WAVES],
    /// `position-dependent-friction`: what the Coulomb level has at a position beyond its mean.
    pub friction: Harmonic<T>,
    /// `backlash`.
    pub backlash: Backlash<T>,
}

/// Waves over position that a controller can carry.
pub const WAVES: usize = 4;

impl<T: Scalar> Effects<T> {
    /// None of them.
    pub const NONE: Self = Self {
        offset: T::ZERO,
        viscous_difference: T::ZERO,
        stiffness: T::ZERO,
        waves: [Harmonic::NONE; WAVES],
        friction: Harmonic::NONE,
        backlash: Backlash::NONE,
    };

    /// Whether every number is finite, and the backlash one of an axis with this inertia.
    pub fn is_valid(&self, inertia: T) -> bool {
        let own = [self.offset, self.viscous_difference, self.stiffness];
        let waves = self.waves.iter().chain([&self.friction]);
        own.into_iter().all(Scalar::is_finite)
            && waves
                .flat_map(|w| [w.sine, w.cosine])
                .all(Scalar::is_finite)
            && self.backlash.is_valid(inertia)
    }

    /// How many of the waves matter: those from there on are zero.
    pub fn waves(&self) -> usize {
        let last = self.waves.iter().rposition(Harmonic::is_any);
        last.map_or(0, |last| last + 1)
    }

    /// What the first `count` waves resist at a position, whatever the motion, N·m or N.
    #[inline]
    pub fn waving(&self, position: Position<T>, count: usize) -> T {
        let mut sum = T::ZERO;
        for wave in self.waves.iter().take(count) {
            sum += wave.at(position);
        }
        sum
    }

    /// What the spring resists, likewise; `unit` is rad or m to a count of the encoder.
    #[inline]
    pub fn spring(&self, position: Position<T>, unit: T) -> T {
        self.stiffness * (position.minus(Position::at(0)) * unit)
    }
}

#[cfg(test)]
mod tests {
    use super::{Effects, Harmonic};
    use crate::control::Position;
    use crate::scalar::{Q16, Scalar};

    fn cogging<T: Scalar>() -> Effects<T> {
        let mut effects = Effects::NONE;
        effects.stiffness = T::from_f64(0.125);
        // 24 periods a turn of 4096 counts.
        effects.waves[2] = Harmonic {
            cycle: 24 << 20,
            sine: T::from_f64(0.3),
            cosine: T::from_f64(-0.4),
        };
        effects
    }

    fn worst<T: Scalar>() -> f64 {
        let effects = cogging::<T>();
        let errors = (-3000..3000).map(|k| {
            let counts = f64::from(k) * 3.37;
            let position = Position::from_f64(counts);
            let spring = effects.spring(position, T::from_f64(0.01));
            let found = effects.waving(position, effects.waves()) + spring;
            let phase = counts * 24.0 / 4096.0 * core::f64::consts::TAU;
            let wave = 0.3 * libm::sin(phase) - 0.4 * libm::cos(phase);
            (found.to_f64() - (0.125 * 0.01 * counts + wave)).abs()
        });
        errors.fold(0.0, f64::max)
    }

    #[test]
    fn waves_and_springs_are_what_their_equations_say() {
        // Cutting the phase to its last bit costs 0.5·2π/2³², and rounding the part of a count to 2⁻ⁿ costs
        // 0.5·24/4096·2π/2ⁿ; the spring has 10 000 counts of rounding.
        let cut = 0.5 * core::f64::consts::TAU * 2f64.powi(-32);
        let part = |bits: i32| 0.5 * 24.0 / 4096.0 * core::f64::consts::TAU * 2f64.powi(-bits);
        assert!(worst::<f64>() < cut + 1e-12);
        assert!(worst::<f32>() < cut + part(23) + 1e-5);
        // Two amplitudes, two waves of them, and the three operations that add them and the spring, to nearest.
        let rest = (2.0 + 0.7 * 1.1 + 3.0) * 2f64.powi(-17);
        let spring = 0.125 * 10_200.0 * 2f64.powi(-17);
        assert!(worst::<Q16>() < cut + part(16) + spring + rest);
    }

    #[test]
    fn numbers_that_are_none_are_refused() {
        let mut effects = cogging::<f32>();
        assert!(effects.is_valid(1.0));
        effects.friction.cosine = f32::NAN;
        assert!(!effects.is_valid(1.0));
    }
}
