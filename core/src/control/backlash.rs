//! Lost motion between the measured side and the load.

use serde::{Deserialize, Serialize};

use crate::Scalar;

/// `backlash`, as a diagnosis finds it: part of the inertia is carried along with a play of `gap` in all.
///
/// Two things are done about it. While the measured side crosses the gap after a reversal it is lighter, and the
/// acceleration fed forward is that of what it carries. And if `speed` is not zero the set point changes flanks with its
/// direction, by half of the gap to either side and at that speed, so that the load follows what was asked for and not
/// the measured side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Backlash<T> {
    /// Counts of play in all; zero for none.
    pub gap: T,
    /// Inertia behind the gap, part of that of the axis; kg·m² or kg.
    pub inertia: T,
    /// Speed at which the set point changes flanks, rad/s or m/s; zero where the measured side is to follow.
    pub speed: T,
}

/// Where the measured side is within the gap, and the set point between its flanks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Play<T> {
    /// Counts from the middle of the gap, positive where the load is pushed in the positive direction.
    pub at: T,
    /// Counts by which the set point is ahead.
    pub ahead: T,
}

impl<T: Scalar> Backlash<T> {
    /// No play.
    pub const NONE: Self = Self {
        gap: T::ZERO,
        inertia: T::ZERO,
        speed: T::ZERO,
    };

    /// Whether the numbers are finite, not negative, and the load is less than all of the inertia.
    pub fn is_valid(&self, inertia: T) -> bool {
        let numbers = [self.gap, self.inertia, self.speed];
        numbers.into_iter().all(|x| x.is_finite() && x >= T::ZERO) && self.inertia < inertia
    }

    /// The inertia that an acceleration has to move, out of `inertia` in all, where the measured side is.
    #[inline]
    pub(super) fn carried(&self, inertia: T, acceleration: T, play: &Play<T>) -> T {
        let flank = self.gap.half();
        // Against the flank it pushes at, the load comes along; away from it, it stays behind until the gap is crossed.
        let pushes = if acceleration < T::ZERO {
            -play.at
        } else {
            play.at
        };
        if self.gap == T::ZERO || pushes >= flank {
            inertia
        } else {
            inertia - self.inertia
        }
    }

    /// The measured side moves by `moved` counts, and the set point at `velocity`; `most` is the counts that
    /// [`Backlash::speed`] makes in a sample. Returns the counts by which the set point has changed flanks.
    #[inline]
    pub(super) fn follow(&self, play: &mut Play<T>, moved: T, velocity: T, most: T) -> T {
        let flank = self.gap.half();
        play.at = (play.at + moved).clamp_symmetric(flank);
        let aim = if velocity == T::ZERO {
            play.ahead
        } else {
            flank * velocity.sign()
        };
        let step = (aim - play.ahead).clamp_symmetric(most);
        play.ahead += step;
        step
    }
}

#[cfg(test)]
mod tests {
    use super::{Backlash, Play};

    const GAP: Backlash<f64> = Backlash {
        gap: 10.0,
        inertia: 0.6,
        speed: 2.0,
    };

    #[test]
    fn the_load_comes_along_only_at_the_flank_that_pushes_it() {
        let mut play = Play {
            at: 0.0,
            ahead: 0.0,
        };
        assert_eq!(GAP.carried(1.0, 3.0, &play), 0.4);
        GAP.follow(&mut play, 7.0, 1.0, 0.0);
        assert_eq!((play.at, GAP.carried(1.0, 3.0, &play)), (5.0, 1.0));
        // Braking lets the load fly on.
        assert_eq!(GAP.carried(1.0, -3.0, &play), 0.4);
        GAP.follow(&mut play, -9.0, -1.0, 0.0);
        assert_eq!((play.at, GAP.carried(1.0, -3.0, &play)), (-4.0, 0.4));
        GAP.follow(&mut play, -2.0, -1.0, 0.0);
        assert_eq!(GAP.carried(1.0, -3.0, &play), 1.0);
        assert_eq!(Backlash::NONE.carried(1.0, -3.0, &play), 1.0);
    }

    #[test]
    fn the_set_point_changes_flanks_at_its_speed_and_stays_at_rest() {
        let mut play = Play {
            at: 0.0,
            ahead: 0.0,
        };
        let steps: f64 = (0..4).map(|_| GAP.follow(&mut play, 0.0, 0.1, 2.0)).sum();
        assert_eq!((steps, play.ahead), (5.0, 5.0));
        assert_eq!(GAP.follow(&mut play, 0.0, 0.0, 2.0), 0.0);
        assert_eq!(GAP.follow(&mut play, 0.0, -0.1, 2.0), -2.0);
    }

    #[test]
    fn a_load_larger_than_the_axis_is_refused() {
        assert!(GAP.is_valid(1.0) && !GAP.is_valid(0.6));
        assert!(
            !Backlash {
                gap: f64::NAN,
                ..GAP
            }
            .is_valid(1.0)
        );
    }
}
