//! Presliding loops of Dahl's law: friction against position under a motion imposed to and fro.
//!
//! ```text
//! cargo run --release --example dahl_loop
//! ```
//!
//! Along one direction `dF/dx = σ0·(1 − F·sgn v/Fc)`, whatever the speed, so that a loop of amplitude `A` with
//! `a = 2·A·σ0/Fc` encloses `∮F dx = 4·Fc·A − 4·(Fc²/σ0)·tanh(a/2)`: a loop within which bristles only bend is thin,
//! and one far beyond it loses `4·Fc·A` less what the bristles give back.

mod plot;

use bristle_core::friction::{Dahl, Dynamic};
use plot::{BLUE, Curve, GREEN, ORANGE, Panel};

const LAW: Dahl<f64> = Dahl {
    coulomb: 2.0,
    viscous: 0.0,
    bristle_stiffness: 2e5,
};
/// Steps from one turning point to the next.
const STEPS: usize = 2000;

/// Position and friction along the eleventh period, when the loop has closed, of a triangle of this amplitude.
fn closed_loop(amplitude: f64) -> Vec<(f64, f64)> {
    let (speed, mut x, mut z) = (1e-3, 0.0, 0.0);
    let dt = 2.0 * amplitude / speed / STEPS as f64;
    let mut loops = Vec::new();
    // A quarter first, then whole halves.
    for k in 0..STEPS / 2 + 22 * STEPS {
        let half = (k + STEPS / 2) / STEPS;
        let v = if half.is_multiple_of(2) {
            speed
        } else {
            -speed
        };
        if k >= STEPS / 2 + 20 * STEPS {
            loops.push((1e6 * x, LAW.force(z, 0.0)));
        }
        z = LAW.advance(z, v, dt);
        x += v * dt;
    }
    loops.push((1e6 * x, LAW.force(z, 0.0)));
    loops
}

fn main() -> std::io::Result<()> {
    let mut curves = Vec::new();
    for (amplitude, colour) in [(60e-6, BLUE), (20e-6, ORANGE), (5e-6, GREEN)] {
        let points = closed_loop(amplitude);
        let area: f64 = points
            .windows(2)
            .map(|p| 0.5 * (p[0].1 + p[1].1) * (p[1].0 - p[0].0))
            .sum();
        let (fc, bend) = (LAW.coulomb, LAW.coulomb / LAW.bristle_stiffness);
        let theory = 4.0 * fc * (amplitude - bend * (amplitude / bend).tanh());
        println!(
            "±{:.0} µm: {:.4} µJ a loop, by theory {:.4} µJ",
            1e6 * amplitude,
            area,
            1e6 * theory
        );
        curves.push(Curve::new(
            &format!("±{:.0} µm", 1e6 * amplitude),
            colour,
            points,
        ));
    }
    let panel = Panel {
        title: "Presliding loops of Dahl's law, Fc/σ0 = 10 µm".to_owned(),
        x: "position [µm]",
        y: "friction [N]",
        curves,
    };
    plot::write("host/book/src/dahl_loop.svg", 1, &[panel])
}
