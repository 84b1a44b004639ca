//! The sliding and the sticking component of a scalar reaction (the source's fig. 3a and 3b).
//!
//! ```text
//! cargo run --release --example reaction
//! ```

mod plot;

use bristle_core::friction::{Friction, Static};
use plot::{BLUE, Curve, GREY, ORANGE, Panel};

const LAW: Static<f64> = Static {
    coulomb: 1.0,
    viscous: 0.4,
    static_level: 1.6,
    stribeck_velocity: 0.15,
};

fn main() -> std::io::Result<()> {
    let line = |f: &dyn Fn(f64) -> f64, from: f64, to: f64| -> Vec<(f64, f64)> {
        let at = |k: i32| from + (to - from) * f64::from(k) / 400.0;
        (0..=400).map(|k| (at(k), f(at(k)))).collect()
    };
    let sliding = |v: f64| -LAW.sliding(v);
    let sticking = |a: f64| -LAW.reaction(0.0, a);
    plot::write(
        "host/book/src/reaction.svg",
        2,
        &[
            Panel {
                title: "Sliding: the reaction opposes velocity".to_owned(),
                x: "velocity [m/s]",
                y: "reaction [N]",
                curves: vec![
                    Curve::new("", BLUE, line(&sliding, -2.0, -1e-9)),
                    Curve::new("", BLUE, line(&sliding, 1e-9, 2.0)),
                    Curve::new(
                        "what sticking spans",
                        GREY,
                        vec![(0.0, -LAW.static_level), (0.0, LAW.static_level)],
                    )
                    .dashed(),
                ],
            },
            Panel {
                title: "Sticking, v = 0: it balances the active force".to_owned(),
                x: "active component of the other forces [N]",
                y: "reaction [N]",
                curves: vec![
                    Curve::new(
                        "held",
                        BLUE,
                        line(&sticking, -LAW.static_level, LAW.static_level),
                    ),
                    Curve::new(
                        "breaks away",
                        ORANGE,
                        line(&sticking, LAW.static_level, 2.5),
                    ),
                    Curve::new("", ORANGE, line(&sticking, -2.5, -LAW.static_level)),
                ],
            },
        ],
    )
}
