//! # What it is
//! An external torque that switches on at one instant and, perhaps, off at a later one: `τ = torque` for `on ≤ t < off`,
//! resisting motion in the positive direction. Instants count from the first sample of the recording; one that never
//! switches off again has `off` far beyond its end, and so has one whose `off` the file leaves out beside given numbers.
//!
//! # What it looks like in a recording
//! The axis behaves as before up to some instant and then as if it leaned to one side, at rest as well as in motion.
//!
//! # What excites it
//! Any motion in both directions before and after the instant.
//!
//! # Confused with
//! direction-asymmetry when it lasts the whole recording; thermal-drift and periodic-disturbance when it is slow or
//! returns: repeat the recording.
//!
//! # Example
//! A workpiece clamped or lost, a brake that drags, a cable that catches, a cutting force.
//!
//! # References
//! E. S. Page, Continuous inspection schemes, Biometrika 41, 1954 (cumulative sums); P. Perron, Dealing with structural
//! breaks, Palgrave Handbook of Econometrics 1, 2006 (search over the instants).

use super::{Confusion, Effect, Inner, Motion, Point, Quantity, Search, Spec};
use crate::format::quantity;

/// An instant that never comes, s: thirty years.
const NEVER: f64 = 1e9;

pub(super) struct LoadStep;

impl Effect for LoadStep {
    fn id(&self) -> &'static str {
        "load-step"
    }
    fn name(&self) -> &'static str {
        "Load step"
    }
    fn doc(&self) -> &'static str {
        include_str!("load_step.rs")
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::new("torque", Quantity::Torque),
                Spec::within("on", Quantity::Time, (0.0, f64::INFINITY)),
                Spec::within("off", Quantity::Time, (0.0, f64::INFINITY)),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        const {
            &[
                Confusion {
                    id: "direction-asymmetry",
                    tell_apart_by: "record for longer, or again: an offset is there from the first sample to the last, a load step begins at an instant",
                },
                Confusion {
                    id: "thermal-drift",
                    tell_apart_by: "repeat the recording cold and warm: drift changes friction in both directions alike and gradually, a load step leans to one side at once",
                },
                Confusion {
                    id: "periodic-disturbance",
                    tell_apart_by: "record three times as long: a periodic disturbance returns at equal intervals, a load step does not",
                },
            ]
        }
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        let side = if p[0] > 0.0 { "positive" } else { "negative" };
        let until = if p[2] >= NEVER {
            "and stays".to_owned()
        } else {
            format!("until {}", quantity(p[2], "s"))
        };
        format!(
            "A load of {} comes on {} after the start {until}, against motion in the {side} direction: look for what touched the axis then, or let the controller estimate the load.",
            quantity(p[0].abs(), Quantity::Torque.unit(motion)),
            quantity(p[1], "s")
        )
    }
    fn timed(&self) -> bool {
        true
    }
    fn search(&self) -> Search {
        Search::Interval
    }
    fn inner(&self) -> Option<usize> {
        Some(1)
    }
    fn shape(&self) -> Option<usize> {
        Some(2)
    }
    fn textbook(&self) -> Option<f64> {
        Some(NEVER)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        // The share of the interval around this instant that lies within: smooth in `on` and `off`.
        let (t, half) = (at.moment.t, 0.5 * at.moment.dt);
        let overlap = (t + half).min(inner[1]) - (t - half).max(inner[0]);
        out[0] = if half > 0.0 {
            (overlap / at.moment.dt).max(0.0)
        } else {
            f64::from(t >= inner[0] && t < inner[1])
        };
    }
}

#[cfg(test)]
mod tests {
    use super::{Effect, LoadStep};
    use crate::effects::{Moment, Motion, Point};

    #[test]
    fn it_acts_for_as_long_as_it_is_on() {
        let (dt, inner) = (0.1, [1.234, 2.87]);
        let impulse: f64 = (0..50)
            .map(|k| {
                let t = (f64::from(k) + 0.5) * dt;
                let at = Point::new(Motion::Linear, 0.0, 1.0, 1.0).at(Moment { t, dt, u: 0.0 });
                let mut b = [0.0];
                LoadStep.basis(inner, at, &mut b);
                b[0] * dt
            })
            .sum();
        assert!((impulse - (2.87 - 1.234)).abs() < 1e-12);
    }
}
