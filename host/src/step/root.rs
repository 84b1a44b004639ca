//! Zeros of functions of one variable.

/// Steps that take any bracket down to rounding: every third halves it.
const STEPS: usize = 300;

/// Narrows a bracket of a sign change of `f`, by secants, until it is `narrow` with the values of `f` at its ends; the end that
/// was found last comes last. Zero counts as positive.
pub(super) fn bracket(
    mut ends: [f64; 2],
    mut values: [f64; 2],
    narrow: impl Fn([f64; 2], [f64; 2]) -> bool,
    f: impl Fn(f64) -> f64,
) -> [f64; 2] {
    for k in 0..STEPS {
        if narrow(ends, values) {
            break;
        }
        let [a, b] = ends;
        // Secants, with a halving now and then: it bounds the steps where the function changes all at once.
        let share = values[0] / (values[0] - values[1]);
        let next = if k % 3 == 2 {
            0.5 * (a + b)
        } else {
            a + share * (b - a)
        };
        if !next.is_finite() {
            break;
        }
        let value = f(next);
        if (value >= 0.0) == (values[1] >= 0.0) {
            // The other end stays: its value counts half, or it would stay for ever (Illinois).
            values[0] *= 0.5;
        } else {
            (ends[0], values[0]) = (ends[1], values[1]);
        }
        (ends[1], values[1]) = (next, value);
    }
    ends
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::bracket;

    #[test]
    fn brackets_close_around_smooth_and_sudden_sign_changes() {
        let closes = |f: &dyn Fn(f64) -> f64, zero: f64| {
            let narrow = |[a, b]: [f64; 2], _| (b - a).abs() <= 1e-12;
            let mut ends = bracket([0.0, 1.0], [f(0.0), f(1.0)], narrow, f);
            ends.sort_by(f64::total_cmp);
            assert!(ends[1] - ends[0] <= 1e-12, "{ends:?}");
            assert!(ends[0] <= zero && zero <= ends[1], "{ends:?}");
        };
        closes(&|x| 0.3 - x * x, 0.3_f64.sqrt());
        closes(&|x| if x <= 0.7 { 1.0 } else { -1e-9 }, 0.7);
        closes(&|x| (0.2 - x).powi(9), 0.2);
    }

    #[test]
    fn a_smooth_function_takes_fewer_steps_than_halving() {
        let steps = Cell::new(0);
        let f = |x: f64| {
            steps.set(steps.get() + 1);
            0.3 - x - x.powi(3)
        };
        let narrow = |_, values: [f64; 2]| values[1].abs() <= 1e-13;
        let [_, zero] = bracket([0.0, 1.0], [0.3, -1.7], narrow, f);
        assert!((0.3 - zero - zero.powi(3)).abs() <= 1e-13);
        assert!(steps.get() <= 20, "{}", steps.get());
    }
}
