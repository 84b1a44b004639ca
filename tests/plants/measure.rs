//! What a simulated motion looks like, and how large an effect is in it.

/// One sample of the true motion, in the middle of its hold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub t: f64,
    pub q: f64,
    pub v: f64,
    /// Acceleration.
    pub a: f64,
    /// Sign of motion, 0 at rest.
    pub side: f64,
    /// Commanded torque, after any delay.
    pub u: f64,
    /// What a delay adds to the torque, mean over the hold.
    pub late: f64,
    /// Bristle torque.
    pub bristle: f64,
    /// What a load behind the measured side adds to the torque, mean over the hold.
    pub hung: f64,
}

/// Root mean square.
pub(super) fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|a| a * a).sum::<f64>() / x.len() as f64).sqrt()
}

/// Least and greatest.
pub(super) fn range(x: impl Iterator<Item = f64>) -> (f64, f64) {
    x.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
        (a.min(x), b.max(x))
    })
}

/// Mean over `2·half + 1` neighbours, fewer at the ends.
pub(super) fn moving_average(x: &[f64], half: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(x.len() + 1);
    sums.push(0.0);
    let mut sum = 0.0;
    for a in x {
        sum += a;
        sums.push(sum);
    }
    (0..x.len())
        .map(|k| {
            let (a, b) = (k.saturating_sub(half), (k + half + 1).min(x.len()));
            (sums[b] - sums[a]) / (b - a) as f64
        })
        .collect()
}

/// RMS over the recording of what is left of `torque` after its best fit by `[sgn v, v, a]`. Samples at
/// rest count as explained: friction takes any torque there.
pub(super) fn remainder(trace: &[Point], torque: &[f64], average: usize) -> f64 {
    let column = |f: fn(&Point) -> f64| {
        let raw: Vec<f64> = trace.iter().map(f).collect();
        moving_average(&raw, average)
    };
    let mut columns = [column(|p| p.side), column(|p| p.v), column(|p| p.a)];
    let mut left = moving_average(torque, average);
    for (k, p) in trace.iter().enumerate() {
        if p.side == 0.0 {
            left[k] = 0.0;
            columns.iter_mut().for_each(|c| c[k] = 0.0);
        }
    }
    // Gram-Schmidt, twice as near-parallel columns lose digits the first time.
    for _ in 0..2 {
        for k in 0..3 {
            let (done, rest) = columns.split_at_mut(k);
            for other in done {
                take_out(&mut rest[0], other);
            }
        }
    }
    for c in &columns {
        take_out(&mut left, c);
    }
    rms(&left)
}

/// Takes from `x` its part along `c`.
fn take_out(x: &mut [f64], c: &[f64]) {
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let gain = dot(x, c) / dot(c, c).max(f64::MIN_POSITIVE);
    x.iter_mut().zip(c).for_each(|(x, c)| *x -= gain * c);
}

/// Top speed, travel, reversals, share of the samples in motion.
pub(super) struct Look {
    pub top_speed: f64,
    pub lo: f64,
    pub hi: f64,
    pub reversals: usize,
    pub moving: f64,
}

/// Looks at a motion.
pub(super) fn look(trace: &[Point]) -> Look {
    let top_speed = trace.iter().map(|p| p.v.abs()).fold(0.0, f64::max);
    let (lo, hi) = range(trace.iter().map(|p| p.q));
    let mut last = 0.0;
    let mut reversals = 0;
    for p in trace.iter().filter(|p| p.v.abs() > 0.01 * top_speed) {
        if p.side * last < 0.0 {
            reversals += 1;
        }
        last = p.side;
    }
    let moving = trace.iter().filter(|p| p.v.abs() > 1e-3 * top_speed);
    Look {
        top_speed,
        lo,
        hi,
        reversals,
        moving: moving.count() as f64 / trace.len() as f64,
    }
}
