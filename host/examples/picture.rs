//! Draws the picture of the README from the files of `bristle demo`:
//!
//! ```text
//! cargo run --release -- demo
//! cargo run --release --example picture
//! ```
//!
//! It is the residual torque against velocity, as the report shows it, before and after the diagnosis.

use std::fmt::Write;
use std::path::Path;

use bristle::diagnose::diagnose;
use bristle::effects;
use bristle::identify::{Options, identify};
use bristle::model::Model;
use bristle::recording::Recording;
use bristle::system;

const FROM: &str = "bristle-demo";
const TO: &str = "host/book/src/residual.svg";

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 320.0;
/// Left, right, top and bottom of the frame.
const FRAME: [f64; 4] = [64.0, 700.0, 44.0, 268.0];
/// Dots of one colour.
const DOTS: usize = 900;

/// Dots of one colour: velocity and residual torque, rad/s and mN·m.
struct Cloud {
    name: String,
    colour: &'static str,
    dots: Vec<(f64, f64)>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(FROM);
    let model = Model::read(&folder.join("baseline.toml"))?;
    let path = folder.join("recording.csv");
    let recordings = [Recording::read(&path, &model.columns, model.motion)?];
    let (bench, baseline) = identify(&recordings, &model, Options::default())?;
    let outcome = diagnose(&bench, &baseline, &recordings, &|_| {})?;
    let fit = &outcome.diagnosis.fit;
    let cloud = |what: &str, colour, model: &Model, error: f64| {
        let scale = 1e3 * system::torque_scale(&bench.problem, model);
        let residual = system::residual(&bench.problem, model);
        let velocity = bench.problem.velocity(&effects::Path::default());
        let step = residual.len().div_ceil(DOTS);
        Cloud {
            name: format!("{what}: held-out error {:.1} %", 100.0 * error),
            colour,
            dots: velocity
                .iter()
                .zip(&residual)
                .step_by(step)
                .map(|(&v, r)| (v, r * scale))
                .collect(),
        }
    };
    let found: Vec<&str> = outcome.diagnosis.findings.iter().map(|f| f.id).collect();
    let svg = draw(&[
        cloud(
            "Coulomb and viscous friction",
            "#d9722e",
            &outcome.before,
            fit.before.held_out.nrmse,
        ),
        cloud(
            &format!("with {}", found.join(", ")),
            "#2563a8",
            &outcome.after,
            fit.after.held_out.nrmse,
        ),
    ]);
    std::fs::write(TO, svg)?;
    println!("wrote {TO}");
    Ok(())
}

fn draw(clouds: &[Cloud]) -> String {
    let all = || clouds.iter().flat_map(|cloud| &cloud.dots);
    let most = |f: &dyn Fn(&(f64, f64)) -> f64| all().map(f).fold(0.0, f64::max);
    let (right, top) = (most(&|d| d.0.abs()), most(&|d| d.1.abs()));
    let [x0, x1, y0, y1] = FRAME;
    let place = |v: f64, r: f64| {
        (
            0.5 * (x0 + x1) + 0.48 * (x1 - x0) * v / right,
            0.5 * (y0 + y1) - 0.48 * (y1 - y0) * r / top,
        )
    };
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n"
    );
    for v in ticks(right) {
        let (x, _) = place(v, 0.0);
        let _ = writeln!(
            svg,
            "<path d=\"M{x:.1} {y0}V{y1}\" stroke=\"#e3e3e3\"/><text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{v}</text>",
            y1 + 17.0
        );
    }
    for r in ticks(top) {
        let (_, y) = place(0.0, r);
        let _ = writeln!(
            svg,
            "<path d=\"M{x0} {y:.1}H{x1}\" stroke=\"#e3e3e3\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{r}</text>",
            x0 - 7.0,
            y + 4.0
        );
    }
    for (k, cloud) in clouds.iter().enumerate() {
        let x = x0 + 330.0 * k as f64;
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"20\" r=\"5\" fill=\"{0}\"/><text x=\"{1:.1}\" y=\"25\">{2}</text>\n<g fill=\"{0}\" fill-opacity=\"0.6\">",
            cloud.colour,
            x + 12.0,
            cloud.name
        );
        for &(v, r) in &cloud.dots {
            let (x, y) = place(v, r);
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.8\"/>");
        }
        svg.push_str("</g>\n");
    }
    let (x, y) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
    let _ = writeln!(
        svg,
        "<text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">velocity [rad/s]</text>\n\
         <text transform=\"translate(18 {y}) rotate(-90)\" text-anchor=\"middle\">residual torque [mN·m]</text>\n</svg>",
        HEIGHT - 14.0
    );
    svg
}

/// Round numbers from minus to plus `most`.
fn ticks(most: f64) -> Vec<f64> {
    let power = 10f64.powf(most.log10().floor());
    let step = [0.2, 0.5, 1.0]
        .map(|s| s * power)
        .into_iter()
        .find(|step| most / step < 5.0)
        .unwrap_or(2.0 * power);
    let count = (most / step).floor() as i32;
    (-count..=count)
        .map(|k| (f64::from(k) * step * 1e6).round() / 1e6)
        .collect()
}
