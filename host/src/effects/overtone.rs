//! A wave with overtones: others of twice and three times its periods, each with an amplitude and a phase of its own. Poles, slots and
//! teeth are seldom shaped like a sine, and what switches on and off is none.

use super::{
    Confusion, Effect, Impostor, Inner, Motion, Point, Quantity, Scale, Search, Seat, Spec, Survey,
    Wave,
};

/// An effect that is one wave, of an amplitude, a phase and what is scanned, with multiples of that beside.
pub(super) struct Overtone {
    /// The effect that is one wave.
    pub plain: &'static dyn Effect,
    /// Its parameters, then [`SECOND_AMPLITUDE`] and [`SECOND_PHASE`], then those of the third wave if there is one.
    pub parameters: &'static [Spec],
}

/// Torque or force of the octave.
pub(super) const SECOND_AMPLITUDE: Spec = Spec::new("second_amplitude", Quantity::Torque);
/// Its phase.
pub(super) const SECOND_PHASE: Spec = Spec::new("second_phase", Quantity::Phase);
/// Torque or force of the wave of three times the periods.
pub(super) const THIRD_AMPLITUDE: Spec = Spec::new("third_amplitude", Quantity::Torque);
/// Its phase.
pub(super) const THIRD_PHASE: Spec = Spec::new("third_phase", Quantity::Phase);

impl Effect for Overtone {
    fn id(&self) -> &'static str {
        self.plain.id()
    }
    fn name(&self) -> &'static str {
        self.plain.name()
    }
    fn doc(&self) -> &'static str {
        self.plain.doc()
    }
    fn parameters(&self) -> &'static [Spec] {
        self.parameters
    }
    fn confusions(&self) -> &'static [Confusion] {
        self.plain.confusions()
    }
    fn sentence(&self, p: &[f64], motion: Motion) -> String {
        self.plain.sentence(p, motion)
    }
    fn impostor(&self) -> Option<Impostor> {
        self.plain.impostor()
    }
    fn seat(&self) -> Seat {
        self.plain.seat()
    }
    fn driven(&self) -> bool {
        self.plain.driven()
    }
    fn timed(&self) -> bool {
        self.plain.timed()
    }
    fn fast(&self) -> bool {
        self.plain.fast()
    }
    fn search(&self) -> Search {
        self.plain.search()
    }
    fn found_as(&self) -> Option<&'static dyn Effect> {
        Some(self.plain)
    }
    fn refines(&self) -> bool {
        true
    }
    /// Over less than two periods nothing shows to come again, and several waves bend to any force along the travel.
    fn shows(&self, [periods, _]: Inner, survey: &Survey) -> bool {
        let (low, high) = survey.travel;
        self.timed() || periods * (high - low) >= 2.0 * survey.motion.turn()
    }
    fn width(&self) -> usize {
        self.parameters.len() - 1
    }
    fn inner(&self) -> Option<usize> {
        self.plain.inner()
    }
    fn grid(&self, survey: &Survey) -> Vec<f64> {
        self.plain.grid(survey)
    }
    fn basis(&self, inner: Inner, at: Point, out: &mut [f64]) {
        let Some(Wave {
            number,
            coordinate,
            carrier,
        }) = self.plain.wave(inner)
        else {
            return;
        };
        let (sin, cos) = (number * coordinate(&at)).sin_cos();
        let carrier = carrier(&at);
        // Each wave is the one before, turned by the first.
        let mut wave = [sin, cos];
        for pair in out.chunks_exact_mut(2) {
            pair.copy_from_slice(&wave.map(|wave| carrier * wave));
            wave = [wave[0] * cos + wave[1] * sin, wave[1] * cos - wave[0] * sin];
        }
    }
    fn named(&self, inner: Inner, c: &[f64], scale: Scale) -> Vec<f64> {
        let (first, others) = c.split_at(2);
        let mut named = self.plain.named(inner, first, scale);
        for other in others.chunks_exact(2) {
            named.extend_from_slice(&self.plain.named(inner, other, scale)[..2]);
        }
        named
    }
    fn linear(&self, p: &[f64], scale: Scale) -> (Inner, Vec<f64>) {
        let (first, others) = p.split_at(3);
        let (inner, mut c) = self.plain.linear(first, scale);
        for other in others.chunks_exact(2) {
            c.extend(self.plain.linear(&[other[0], other[1], first[2]], scale).1);
        }
        (inner, c)
    }
}

#[cfg(test)]
mod tests {
    use super::Effect;
    use crate::effects::cogging::THREE_WAVES;
    use crate::effects::{Motion, Point, Scale};

    #[test]
    fn the_other_waves_have_twice_and_three_times_the_periods() {
        let scale = Scale {
            coulomb: 0.0,
            gain: 1.0,
        };
        let (inner, c) = THREE_WAVES.linear(&[0.2, 0.4, 7.0, 0.1, -0.3, 0.05, 1.2], scale);
        let q = 0.83;
        let mut b = [0.0; 6];
        THREE_WAVES.basis(inner, Point::new(Motion::Rotary, q, 1.0, 1.0), &mut b);
        let torque: f64 = c.iter().zip(b).map(|(c, b)| c * b).sum();
        let exact = 0.2 * (7.0 * q + 0.4).sin()
            + 0.1 * (14.0 * q - 0.3).sin()
            + 0.05 * (21.0 * q + 1.2).sin();
        assert!((torque - exact).abs() < 1e-14);
    }
}
