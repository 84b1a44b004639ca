//! Whether the parameters of an effect, with their errors, are told from none.
//!
//! Evidence is counted where noise is that of the rows; standard errors know besides what smoothing does, and what other
//! parameters can stand in for. An effect whose size may be zero, or whose place on its scale may be anywhere, is not named.

use crate::effects::{Quantity, Search};
use crate::model::Term;

/// Standard errors from which on an estimate is told from zero. By chance 0.3 % of estimates lie beyond, and so does the
/// largest of one from each effect of the catalogue in 6 % of the cases.
pub(super) const TOLD: f64 = 3.0;

/// Standard errors from which on a scanned parameter has a place: with fewer it may lie anywhere on its scale. Whether there
/// is anything to scan is not asked of it, so that chance has no choice among effects here.
const PLACED: f64 = 2.0;

/// How far a term is told from none, as a share of what suffices, if it does not.
///
/// Counted are its scanned parameter, and the largest of those that say how much of it there is, or the one that makes it what it
/// is. The part of the inertia behind a spring or a gap is not: it stands in for the other part, and the spring or the gap itself
/// shows the load. Nor are the coefficient of a power, whose very unit follows the exponent, instants, which may lie anywhere, and
/// phases. Bristles are none where they are stiff and do not damp: what they do grows with the distance over which they yield, whose
/// relative error is that of their stiffness, as long as it is `short`, and with what they damp meanwhile. Soft ones trade off
/// against the level that they yield at, for which such errors say nothing.
pub(super) fn doubt(term: &Term, short: bool) -> Option<f64> {
    let effect = term.effect;
    let errors = |k: usize| {
        let parameter = &term.parameters[k];
        let estimated = parameter.se.filter(|se| *se > 0.0 && !parameter.known);
        estimated.map_or(f64::INFINITY, |se| {
            (parameter.value.unwrap_or_default() / se).abs()
        })
    };
    let inner = [effect.inner(), effect.shape()];
    let specs = effect.parameters().iter().enumerate();
    let sizes = specs
        .filter(|(k, spec)| {
            let other = matches!(spec.quantity, Quantity::Phase | Quantity::PowerLaw);
            let counts = effect.essential().is_none_or(|essential| essential == *k);
            counts && !inner.contains(&Some(*k)) && !other
        })
        .map(|(k, _)| errors(k))
        .reduce(f64::max)
        .filter(|_| !effect.hangs() && !term.bends());
    // Among places of either sign, as where a spring rests, zero is one like any other.
    let signed = |k: usize| {
        let spec = &effect.parameters()[k];
        spec.quantity == Quantity::Position && spec.bounds.0 < 0.0
    };
    let scanned = effect
        .inner()
        .filter(|&k| effect.search() != Search::Interval && !term.bends() && !signed(k));
    // Of a lag or a dead zone the scanned parameter is the size as well.
    let enough = if effect.width() == 0 { TOLD } else { PLACED };
    let all = 0..term.parameters.len();
    let bristles = (term.bends() && short).then(|| all.map(errors).fold(0.0, f64::max));
    let shares = [
        sizes.or(bristles).map(|errors| errors / TOLD),
        scanned.map(|k| errors(k) / enough),
    ];
    let least = shares.into_iter().flatten().reduce(f64::min);
    least.filter(|share| *share < 1.0)
}

#[cfg(test)]
mod tests {
    use super::doubt;
    use crate::effects::{self, Effect};
    use crate::model::Parameter;
    use crate::scan;

    /// Whether an effect with parameters of these values in standard errors is in doubt.
    fn doubtful(id: &str, errors: &[f64]) -> bool {
        doubtful_as(effects::find(id).expect("an effect"), errors, false)
    }

    fn doubtful_as(effect: &'static dyn Effect, errors: &[f64], short: bool) -> bool {
        let mut term = scan::open(effect);
        for (parameter, value) in term.parameters.iter_mut().zip(errors) {
            *parameter = Parameter {
                value: Some(*value),
                se: Some(1.0),
                ..Parameter::unknown()
            };
        }
        doubt(&term, short).is_some()
    }

    #[test]
    fn sizes_are_told_from_none_and_places_from_anywhere() {
        // Amplitude, phase, periods.
        assert!(doubtful("cogging", &[2.9, 0.0, 99.0]) && !doubtful("cogging", &[3.1, 0.0, 99.0]));
        // Either change of friction, and the time constant.
        assert!(!doubtful("thermal-drift", &[9.0, 0.1, 2.1]));
        assert!(doubtful("thermal-drift", &[9.0, 9.0, 1.9]));
        assert!(doubtful("thermal-drift", &[2.9, 2.9, 9.0]));
        assert!(doubtful("delay", &[2.9]) && !doubtful("delay", &[3.1]));
        assert!(!doubtful("presliding", &[0.1]));
        let bristles =
            |errors: &[f64], short| doubtful_as(&effects::law::DAMPED_BRISTLES, errors, short);
        assert!(!bristles(&[0.1, 0.1], false));
        assert!(bristles(&[2.9, 2.9], true));
        assert!(!bristles(&[3.1, 0.1], true) && !bristles(&[0.1, 3.1], true));
        // The stiffness of any spring, and what hardens.
        assert!(
            doubtful("hardening-spring", &[99.0, 2.9])
                && !doubtful("hardening-spring", &[0.1, 3.1])
        );
        // The inertia behind a spring, its resonance and damping.
        assert!(
            !doubtful("compliance", &[0.1, 2.1, 0.1]) && doubtful("compliance", &[9.0, 1.9, 9.0])
        );
        // The instants of a step may be anywhere.
        assert!(
            !doubtful("load-step", &[3.1, 0.1, 0.0]) && doubtful("load-step", &[2.9, 9.0, 9.0])
        );
        assert!(
            !doubtful("power-law-viscous", &[0.1, 2.1])
                && doubtful("power-law-viscous", &[9.0, 1.9])
        );
    }
}
