//! Lost motion before a load with friction of its own: see [`super::backlash`] for the equation.

use super::backlash::{Backlash, carried};
use super::{
    Carried, Confusion, Coupling, Effect, Given, Inner, Motion, Quantity, Seat, Spec, Survey,
};

pub(super) struct BacklashBraked;

impl Effect for BacklashBraked {
    fn id(&self) -> &'static str {
        Backlash.id()
    }
    fn name(&self) -> &'static str {
        Backlash.name()
    }
    fn doc(&self) -> &'static str {
        Backlash.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        const {
            &[
                Spec::within("load_inertia", Quantity::Inertia, (0.0, f64::INFINITY)),
                Spec::within("gap", Quantity::Position, (0.0, f64::INFINITY)),
                Spec::within(
                    "load_deceleration",
                    Quantity::Acceleration,
                    (0.0, f64::INFINITY),
                ),
            ]
        }
    }
    fn confusions(&self) -> &'static [Confusion] {
        Backlash.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        Backlash.sentence(p, motion)
    }
    fn unsuited(&self, axis: Given) -> Option<&'static str> {
        Backlash.unsuited(axis)
    }
    fn seat(&self) -> Seat {
        Backlash.seat()
    }
    fn inner(&self) -> Option<usize> {
        Backlash.inner()
    }
    fn shape(&self) -> Option<usize> {
        Some(2)
    }
    fn textbook(&self) -> Option<f64> {
        Some(0.0)
    }
    fn shapes(&self, survey: &Survey) -> Vec<f64> {
        // As the axis, if friction is divided as inertia is; half and twice as fast, and many times, where it is mostly the load's.
        let shares = [0.2, 0.5, 1.0, 2.0, 5.0];
        shares.map(|share| share * survey.deceleration).to_vec()
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        Backlash.grid(survey)
    }
    fn load(&self, inner: Inner, _q: &[f64], v: &[f64], period: f64) -> Carried {
        carried(inner[0], inner[1], v, period)
    }
    fn admissible(&self, c: &[f64]) -> bool {
        Backlash.admissible(c)
    }
    fn coupling(&self, p: &[f64], inertia: f64, friction: [f64; 2]) -> Option<Coupling> {
        let free = Backlash.coupling(p, inertia, friction)?;
        Some(Coupling {
            friction: (p[0] * p[2]).min(friction[0]),
            ..free
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{BacklashBraked, Effect};

    #[test]
    fn friction_of_its_own_stops_the_load_within_the_gap() {
        // Thrown at 1 rad/s by a side that stops at once, at 10 rad/s² it comes to rest after v²/2d = 0.05 rad and 0.1 s. Until then
        // its friction is what the side that rests has not, and none is left when both rest.
        let v: Vec<f64> = (0..1000)
            .map(|k| f64::from((100..500).contains(&k)))
            .collect();
        let found = BacklashBraked.load([0.2, 10.0], &[], &v, 1e-3);
        let rest = found.ahead[700];
        assert!((rest - (-0.1 + 0.05)).abs() < 1e-3, "{rest}");
        assert_eq!(found.ahead[999], rest);
        assert!((found.resisting[550] - 10.0).abs() < 1e-9);
        assert_eq!(found.resisting[700], 0.0);
        // A side that moves on alone, from rest, lacks all of the load's friction.
        assert!((found.resisting[150] + 10.0).abs() < 1e-9);
        assert_eq!(found.resisting[400], 0.0);
    }
}
