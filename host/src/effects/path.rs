//! The way of the input to the axis: what an amplifier makes of the recorded `u`.

use super::MOTOR;

/// Static limits first, then what shifts and smooths in time: `w = soft_limit(limit(dead_zone(threshold(u))))`, delayed,
/// through a first-order lag, and through a spring that swings. Delay, lag and spring commute with each other, and a delay
/// with anything. Lags in series, those of a winding and of what drives it, act as one of their sum, which is right to the
/// first order in their time constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Inputs up to this size do nothing; larger ones act in full.
    pub threshold: f64,
    /// Inputs up to this size do nothing; larger ones act less by as much.
    pub dead_zone: f64,
    /// Inputs beyond this size act as this.
    pub limit: f64,
    /// What the input never quite comes to, by `soft_limit·tanh(u/soft_limit)`; infinite where it acts in full.
    pub soft_limit: f64,
    /// How much later than recorded the input acts, s.
    pub delay: f64,
    /// Time constant, s.
    pub lag: f64,
    /// Angular frequency at which a spring on the way swings, rad/s; infinite where there is none.
    pub resonance: f64,
    /// Its damping ratio.
    pub damping: f64,
    /// Gap between the drive and the measured side.
    pub gap: Gap,
}

/// A gap on the way of the input, and what of the axis is before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Its width, rad or m; zero where there is none.
    pub width: f64,
    /// Share of the friction that acts before it.
    pub friction: f64,
    /// Share of the inertia that is before it.
    pub inertia: f64,
}

impl Default for Gap {
    /// There is none.
    fn default() -> Self {
        Self {
            width: 0.0,
            friction: 1.0,
            inertia: MOTOR,
        }
    }
}

/// Where a spring on the way of the input stands: `a` follows the input `w`, with `ȧ = ω·b` and `ḃ = ω·(w − a) − 2ζω·b`. The
/// spring passes `a + 2ζ·b`, which is `(2ζω·s + ω²)/(s² + 2ζω·s + ω²)` of `w`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Swing {
    /// What follows the input.
    pub a: f64,
    /// Its rate over `ω`.
    pub b: f64,
}

impl Swing {
    /// At ease under an input that has long stood at `w`.
    pub fn at_ease(w: f64) -> Self {
        Self { a: w, b: 0.0 }
    }
}

impl Default for Path {
    /// The input acts as recorded.
    fn default() -> Self {
        Self {
            threshold: 0.0,
            dead_zone: 0.0,
            limit: f64::INFINITY,
            soft_limit: f64::INFINITY,
            delay: 0.0,
            lag: 0.0,
            resonance: f64::INFINITY,
            damping: 0.0,
            gap: Gap::default(),
        }
    }
}

impl Path {
    /// What the static part of the path makes of an input.
    pub fn pass(&self, u: f64) -> f64 {
        let size = u.abs();
        let through = if self.threshold > 0.0 {
            let beyond = (size / self.threshold - 1.0) / EDGE;
            (0.5 + beyond).clamp(0.0, 1.0)
        } else {
            1.0
        };
        let size = (through * size - self.dead_zone).max(0.0).min(self.limit);
        let size = if self.soft_limit.is_finite() {
            self.soft_limit * (size / self.soft_limit).tanh()
        } else {
            size
        };
        size.copysign(u)
    }

    /// What distinguishes two paths.
    pub fn bits(&self) -> [u64; 11] {
        let Self {
            threshold,
            dead_zone,
            limit,
            soft_limit,
            delay,
            lag,
            resonance,
            damping,
            gap:
                Gap {
                    width,
                    friction,
                    inertia,
                },
        } = *self;
        [
            threshold, dead_zone, limit, soft_limit, delay, lag, resonance, damping, width,
            friction, inertia,
        ]
        .map(f64::to_bits)
    }

    /// Whether there is a spring on the way.
    pub fn swings(&self) -> bool {
        self.resonance.is_finite()
    }

    /// Whether it ends at another side of the axis than the drive's.
    pub fn divides(&self) -> bool {
        self.swings() || self.gap.width > 0.0
    }

    /// The spring of the way alone.
    #[must_use]
    pub fn spring(&self) -> Self {
        Self {
            resonance: self.resonance,
            damping: self.damping,
            ..Self::default()
        }
    }

    /// What acts on the input alone, before any spring or gap.
    #[must_use]
    pub fn of_input(&self) -> Self {
        let Self {
            threshold,
            dead_zone,
            limit,
            soft_limit,
            delay,
            lag,
            ..
        } = *self;
        Self {
            threshold,
            dead_zone,
            limit,
            soft_limit,
            delay,
            lag,
            ..Self::default()
        }
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

    /// What a spring passes of a signal that is held in cells of `h` seconds: means over the cells, and where it stands at
    /// their ends. The signal has stood at the first value since ever.
    pub fn swung(&self, cells: &[f64], h: f64) -> impl Iterator<Item = (f64, Swing)> {
        let (spring, mut swing) = (
            self.swinging(h),
            Swing::at_ease(cells.first().copied().unwrap_or_default()),
        );
        cells.iter().map(move |&w| {
            let mean;
            (mean, swing) = spring.pass(swing, w);
            (mean, swing)
        })
    }

    /// The spring over steps of `h` seconds.
    fn swinging(&self, h: f64) -> Swinging {
        let zeta = self.damping.clamp(0.0, MOST_DAMPED);
        let root = (1.0 - zeta * zeta).sqrt();
        let (sin, cos) = (self.resonance * root * h).sin_cos();
        let decay = (-zeta * self.resonance * h).exp();
        let (cos, sin) = (decay * cos, decay * sin / root);
        Swinging {
            left: [cos + zeta * sin, cos - zeta * sin],
            turned: sin,
            angle: self.resonance * h,
        }
    }
}

/// A spring over steps of equal length.
struct Swinging {
    /// What is left of a deflection, and of a rate.
    left: [f64; 2],
    /// What a rate adds to a deflection, and a deflection takes off a rate.
    turned: f64,
    /// `ω·h`.
    angle: f64,
}

impl Swinging {
    /// Mean of what the spring passes over a step while `w` is held, and where it ends. In steps one after the other each
    /// waits for the one before, so what of it does not is kept apart.
    ///
    /// Its damping cancels in the integral: `∫(a + 2ζ·b) = w·h − (b_h − b_0)/ω`.
    fn pass(&self, Swing { a, b }: Swing, w: f64) -> (f64, Swing) {
        let ([of_a, of_b], turned) = (self.left, self.turned);
        let end = Swing {
            a: of_a * a + (turned * b + (1.0 - of_a) * w),
            b: (of_b * b + turned * w) - turned * a,
        };
        (w - (end.b - b) / self.angle, end)
    }
}

/// Width of the edge of a threshold, as a share of it: what is sharp has no derivative, which errors are told by.
const EDGE: f64 = 0.02;
/// Damping ratio up to which a spring is taken to swing.
const MOST_DAMPED: f64 = 0.999;

#[cfg(test)]
mod tests {
    use super::{Path, Swing};

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

    /// Under a sine the spring passes what its transfer function says, and in pieces as in one.
    #[test]
    fn a_spring_swings_as_its_transfer_function_says() {
        let path = Path {
            resonance: 50.0,
            damping: 0.1,
            ..Path::default()
        };
        let (h, drive) = (1e-4, 35.0);
        let pass = |from, w, h| path.swinging(h).pass(from, w);
        let mut swing = Swing::default();
        let mut peak = 0.0_f64;
        for k in 0..40_000 {
            let mean;
            (mean, swing) = pass(swing, (drive * h * (f64::from(k) + 0.5)).sin(), h);
            peak = if k < 30_000 { 0.0 } else { peak.max(mean) };
        }
        let (x, damped) = (drive / 50.0, 2.0 * 0.1 * drive / 50.0);
        let gain = (1.0 + damped * damped).sqrt() / (1.0 - x * x).hypot(damped);
        assert!((peak / gain - 1.0).abs() < 1e-4, "{peak} {gain}");
        let from = Swing::at_ease(1.0);
        let (whole, end) = pass(from, 3.0, 4e-2);
        let (first, middle) = pass(from, 3.0, 1e-2);
        let (rest, last) = pass(middle, 3.0, 3e-2);
        assert!((0.25 * first + 0.75 * rest - whole).abs() < 1e-13);
        assert!((last.a - end.a).hypot(last.b - end.b) < 1e-13);
    }
}
