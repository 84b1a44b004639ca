//! The way of the input to the axis: what an amplifier makes of the recorded `u`.

/// Static limits first, then what shifts and smooths in time: `w = limit(dead_zone(u))`, delayed, through a first-order
/// lag. Delay and lag commute with each other, and a delay with anything. Lags in series, those of a winding and of what
/// drives it, act as one of their sum, which is right to the first order in their time constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Inputs up to this size do nothing; larger ones act less by as much.
    pub dead_zone: f64,
    /// Inputs beyond this size act as this.
    pub limit: f64,
    /// How much later than recorded the input acts, s.
    pub delay: f64,
    /// Time constant, s.
    pub lag: f64,
}

impl Default for Path {
    /// The input acts as recorded.
    fn default() -> Self {
        Self {
            dead_zone: 0.0,
            limit: f64::INFINITY,
            delay: 0.0,
            lag: 0.0,
        }
    }
}

impl Path {
    /// What the static part of the path makes of an input.
    pub fn pass(&self, u: f64) -> f64 {
        (u.abs() - self.dead_zone)
            .max(0.0)
            .min(self.limit)
            .copysign(u)
    }

    /// What distinguishes two paths.
    pub fn bits(&self) -> [u64; 4] {
        [self.dead_zone, self.limit, self.delay, self.lag].map(f64::to_bits)
    }

    /// Mean over the next `h` seconds of a lagged input that stands at `y` while `w` is held, and where it ends.
    pub fn relax(&self, y: f64, w: f64, h: f64) -> (f64, f64) {
        if self.lag <= 0.0 {
            return (w, w);
        }
        let x = h / self.lag;
        let end = w + (y - w) * (-x).exp();
        // The mean of e^(−t/lag) over h is (1 − e^(−x))/x.
        (w + (y - w) * (-(-x).exp_m1() / x), end)
    }
}

#[cfg(test)]
mod tests {
    use super::Path;

    #[test]
    fn a_dead_zone_takes_off_and_a_limit_cuts() {
        let path = Path {
            dead_zone: 0.5,
            limit: 2.0,
            ..Path::default()
        };
        let passed = [-9.0, -1.0, 0.3, 1.5, 2.5, 3.0].map(|u| path.pass(u));
        assert_eq!(passed, [-2.0, -0.5, 0.0, 1.0, 2.0, 2.0]);
        assert_eq!(Path::default().pass(-7.0), -7.0);
    }

    #[test]
    fn a_lag_relaxes_exactly_and_in_pieces_alike() {
        let path = Path {
            lag: 2e-3,
            ..Path::default()
        };
        let (whole, end) = path.relax(1.0, 3.0, 4e-3);
        let (first, middle) = path.relax(1.0, 3.0, 1e-3);
        let (rest, last) = path.relax(middle, 3.0, 3e-3);
        assert!((last - end).abs() < 1e-14 && (end - (3.0 - 2.0 * (-2f64).exp())).abs() < 1e-14);
        assert!((0.25 * first + 0.75 * rest - whole).abs() < 1e-14);
        assert_eq!(Path::default().relax(1.0, 3.0, 1e-3), (3.0, 3.0));
    }
}
