//! What holds for every effect of the catalogue.

use std::f64::consts::TAU;

use super::swing::Swing;
use super::{
    ALL, CREEP, Effect, Motion, Point, Scale, Survey, find, periodicities, section, tell_apart,
};

const SCALE: Scale = Scale {
    coulomb: 0.3,
    gain: 1.7,
};

#[test]
fn the_catalogue_has_the_24_ids_once_each() {
    let mut ids: Vec<&str> = ALL.iter().map(|e| e.id()).collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), 24);
    assert!(find("stribeck").is_some() && find("unknown").is_none());
}

#[test]
fn sections_of_the_documentation_are_found() {
    assert_eq!(
        section("//! # A\n//! b\n//! c\n//! # D\n", "A").unwrap(),
        "b c"
    );
    assert!(section("//! # A\n", "B").is_none());
}

#[test]
fn any_two_effects_can_be_told_apart() {
    for one in ALL {
        for other in ALL.iter().filter(|o| o.id() != one.id()) {
            let text = tell_apart(*one, *other);
            assert!(text.len() > 30 && !text.contains("//!"), "{text}");
        }
    }
}

#[test]
fn every_doc_has_the_fixed_headings() {
    for effect in ALL {
        for heading in [
            "What it is",
            "What it looks like in a recording",
            "What excites it",
            "Confused with",
            "Example",
            "References",
        ] {
            assert!(
                effect.doc().contains(&format!("//! # {heading}\n")),
                "{}: {heading}",
                effect.id()
            );
        }
    }
}

/// Every effect, in each of its forms.
fn forms() -> impl Iterator<Item = &'static dyn Effect> {
    let all = |effect: &&'static dyn Effect| {
        let others = effect.other_forms().iter().copied();
        [*effect].into_iter().chain(others).collect::<Vec<_>>()
    };
    ALL.iter().flat_map(all)
}

/// A model file tells the other form of an effect by a parameter that only that has, and they mean the same by their id.
#[test]
fn the_other_form_of_an_effect_has_its_id_and_a_parameter_of_its_own() {
    let forms: Vec<_> = ALL
        .iter()
        .flat_map(|e| e.other_forms().iter().map(move |form| (e, form)))
        .collect();
    assert_eq!(forms.len(), 17);
    for (effect, form) in forms {
        assert_eq!(effect.id(), form.id());
        let known = |name: &str| effect.parameters().iter().any(|spec| spec.name == name);
        let mut names = form.parameters().iter().map(|spec| spec.name);
        let own = names
            .find(|name| !known(name))
            .expect("a parameter of its own");
        assert!(effect.doc().contains(&format!("`{own}`")), "{own}");
    }
}

#[test]
fn named_and_linear_parameters_are_inverse_to_each_other() {
    for effect in forms() {
        let named: Vec<f64> = (0..effect.parameters().len())
            .map(|k| 0.7 + 0.2 * k as f64)
            .collect();
        let (inner, coefficients) = effect.linear(&named, SCALE);
        assert_eq!(coefficients.len(), effect.width());
        let again = effect.named(inner, &coefficients, SCALE);
        assert!(
            named.iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-12),
            "{}: {named:?} {again:?}",
            effect.id()
        );
    }
}

#[test]
fn sentences_read_well_for_tiny_and_huge_numbers() {
    let exponent = |text: &str| {
        let bytes = text.as_bytes();
        bytes.windows(3).any(|w| {
            w[0].is_ascii_digit() && w[1] == b'e' && (w[2] == b'-' || w[2].is_ascii_digit())
        })
    };
    assert!(exponent("3.644e-1 N*m") && !exponent("0.364 N·m"));
    for effect in forms() {
        for size in [1.234_567e-9, 0.364_4, -0.364_4, 8.043_21e7] {
            for motion in [Motion::Rotary, Motion::Linear] {
                let text = effect.sentence(&vec![size; effect.parameters().len()], motion);
                let digits = text.split(|c: char| !c.is_ascii_digit() && c != '.');
                assert!(
                    !exponent(&text)
                        && !text.contains('*')
                        && text.ends_with('.')
                        && digits.clone().all(|d| d.len() <= 8),
                    "{}: {text}",
                    effect.id()
                );
            }
        }
    }
}

#[test]
fn a_sentence_has_three_digits_and_a_printed_unit() {
    let text = find("stribeck")
        .unwrap()
        .sentence(&[0.364_4, 0.481_6, 1.39], Motion::Rotary);
    assert!(
        text.starts_with(
            "Friction rises to 0.364 N·m towards zero speed, below about 0.482 rad/s:"
        ),
        "{text}"
    );
    let text = find("gravity")
        .unwrap()
        .sentence(&[0.2, 0.01], Motion::Rotary);
    assert!(text.contains("towards q = −0.0100 rad"), "{text}");
}

#[test]
fn confusions_name_effects_of_the_catalogue() {
    for effect in ALL {
        for confusion in effect.confusions() {
            let known = find(confusion.id).is_some();
            assert!(
                known && confusion.id != effect.id(),
                "{} and {}",
                effect.id(),
                confusion.id
            );
        }
    }
}

#[test]
fn dissipative_effects_oppose_motion() {
    for id in ["stribeck", "quadratic-drag", "power-law-viscous"] {
        let effect = find(id).unwrap();
        for v in [-2.0, -0.1, 0.1, 2.0_f64] {
            let mut b = [0.0];
            effect.basis(
                [0.5, 2.0],
                Point::new(Motion::Linear, 0.3, v, v.signum()),
                &mut b,
            );
            assert!(b[0] * v > 0.0, "{id} at {v}");
        }
    }
}

#[test]
fn periods_that_pass_by_between_samples_are_not_tried() {
    let survey = |top_speed: f64, motion| Survey {
        motion,
        period: 5e-3,
        duration: 10.0,
        half_width: 0.07,
        top_speed,
        usual_speed: 0.5 * top_speed,
        slow: 0.01,
        travel: (-1.0, 1.0),
        position_noise: 1e-4,
        level: 0.1,
        deceleration: 10.0,
        input: (1.0, 2.0),
    };
    let most = |survey: &Survey| periodicities(survey, 1).last().copied().unwrap_or(0.0);
    // At one turn a second and 200 samples a second, half of 200 periods a turn; of fewer turns all that are ever tried.
    assert_eq!(most(&survey(TAU, Motion::Rotary)), 99.0);
    assert_eq!(most(&survey(0.5 * TAU, Motion::Rotary)), 120.0);
    // At 2 m/s up to 50 periods a metre, of at most 60 over 2 m.
    let linear = most(&survey(2.0, Motion::Linear));
    assert!(linear < 50.0 && linear > 49.0, "{linear}");
}

/// `ΔJ·q̈ + ½·ΔJ'·q̇²` along `q = sin t`, its second derivative by differences.
#[test]
fn an_inertia_over_the_turn_is_a_second_derivative_and_a_torque() {
    let [sine, cosine] = [0.7, -0.4];
    let of = |two: [f64; 2]| sine * two[0] + cosine * two[1];
    let momentum = |t: f64| {
        let mut out = [(0.0, 0.0); 2];
        Swing.error(t.sin(), &mut out);
        of(out.map(|(value, _)| value))
    };
    for t in [0.3, 1.1, 2.6] {
        let (q, v, a) = (f64::sin(t), f64::cos(t), -f64::sin(t));
        let mut out = [0.0; 2];
        Swing.basis([0.0; 2], Point::new(Motion::Rotary, q, v, 1.0), &mut out);
        let h = 1e-3;
        let second = (momentum(t + h) - 2.0 * momentum(t) + momentum(t - h)) / (h * h);
        let [change, slope] = [of([q.cos(), -q.sin()]), of([-q.sin(), -q.cos()])];
        let torque = change * a + 0.5 * slope * v * v;
        assert!((second + of(out) - torque).abs() < 1e-5, "{t}");
    }
}

#[test]
fn what_is_no_effect_of_the_catalogue_has_no_id_of_it() {
    assert!(CREEP.nuisance() && find(CREEP.id()).is_none());
    assert!(ALL.iter().all(|effect| !effect.nuisance()));
    for (effect, impostor) in ALL.iter().filter_map(|e| Some((e, e.impostor()?.effect))) {
        assert!(find(impostor.id()).is_none());
        assert_eq!(impostor.parameters().len(), effect.parameters().len());
    }
    // Friction without its jump: nothing at standstill, nothing missing at speed.
    let missing = |v: f64| {
        let mut out = [0.0];
        let at = Point::new(Motion::Rotary, 0.0, v, v.signum());
        CREEP.basis([0.1, 0.0], at, &mut out);
        out[0]
    };
    assert!((missing(1e-9) + 1.0).abs() < 1e-7 && (missing(-1e-9) - 1.0).abs() < 1e-7);
    assert!(missing(1.0).abs() < 1e-8 && missing(0.1) < -0.2);
}
