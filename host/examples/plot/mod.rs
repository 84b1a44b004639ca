//! Line plots as SVG, for the examples.

use std::fmt::Write;

/// A line in a panel.
pub struct Curve {
    /// Name in the legend; none if empty.
    pub name: String,
    pub colour: &'static str,
    /// Dash pattern of SVG, empty for a solid line.
    pub dash: &'static str,
    pub points: Vec<(f64, f64)>,
}

/// One pair of axes.
pub struct Panel {
    pub title: String,
    pub x: &'static str,
    pub y: &'static str,
    pub curves: Vec<Curve>,
}

#[allow(dead_code, reason = "each example uses its own colours")]
mod colours {
    pub const BLUE: &str = "#2563a8";
    pub const ORANGE: &str = "#d9722e";
    pub const GREEN: &str = "#2f8f5b";
    pub const GREY: &str = "#8a8a8a";
}
pub use colours::*;

/// Width and height of a panel with all that belongs to it.
const SIZE: (f64, f64) = (460.0, 330.0);
/// Space left of, right of, above and below the axes.
const MARGIN: [f64; 4] = [64.0, 18.0, 58.0, 46.0];
/// Points of a curve that lie closer on the page are left out.
const APART: f64 = 0.8;

impl Curve {
    pub fn new(name: &str, colour: &'static str, points: Vec<(f64, f64)>) -> Self {
        Self {
            name: name.to_owned(),
            colour,
            dash: "",
            points,
        }
    }

    #[allow(dead_code, reason = "each example uses its own part of this module")]
    pub fn dashed(self) -> Self {
        Self {
            dash: "6 4",
            ..self
        }
    }
}

/// Draws panels in rows of `columns` and writes them to `path`.
pub fn write(path: &str, columns: usize, panels: &[Panel]) -> std::io::Result<()> {
    let rows = panels.len().div_ceil(columns);
    let (width, height) = (SIZE.0 * columns as f64, SIZE.1 * rows as f64);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
    );
    for (k, panel) in panels.iter().enumerate() {
        let (x, y) = (SIZE.0 * (k % columns) as f64, SIZE.1 * (k / columns) as f64);
        let _ = writeln!(svg, "<g transform=\"translate({x} {y})\">");
        panel.draw(&mut svg);
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    std::fs::write(path, svg)?;
    println!("wrote {path}");
    Ok(())
}

impl Panel {
    fn draw(&self, svg: &mut String) {
        let [left, right, top, bottom] = MARGIN;
        let (x1, y1) = (SIZE.0 - right, SIZE.1 - bottom);
        let across = Scale::new(self.range(|p| p.0), (left, x1));
        let up = Scale::new(self.range(|p| p.1), (y1, top));
        for tick in across.ticks() {
            let x = across.at(tick);
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {top}V{y1}\" stroke=\"#e6e6e6\"/><text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                y1 + 16.0,
                plain(tick)
            );
        }
        for tick in up.ticks() {
            let y = up.at(tick);
            let _ = writeln!(
                svg,
                "<path d=\"M{left} {y:.1}H{x1}\" stroke=\"#e6e6e6\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left - 6.0,
                y + 4.0,
                plain(tick)
            );
        }
        for curve in &self.curves {
            let mut line: Vec<(f64, f64)> = Vec::new();
            for (k, p) in curve.points.iter().enumerate() {
                let (x, y) = (across.at(p.0), up.at(p.1));
                let apart = line.last().is_none_or(|l| (x - l.0).hypot(y - l.1) > APART);
                if apart || k + 1 == curve.points.len() {
                    line.push((x, y));
                }
            }
            let line: Vec<String> = line.iter().map(|(x, y)| format!("{x:.1} {y:.1}")).collect();
            let _ = writeln!(
                svg,
                "<path d=\"M{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\" stroke-linejoin=\"round\" stroke-dasharray=\"{}\"/>",
                line.join("L"),
                curve.colour,
                curve.dash
            );
        }
        let mut x = left;
        for curve in self.curves.iter().filter(|c| !c.name.is_empty()) {
            let _ = writeln!(
                svg,
                "<path d=\"M{x} 44h20\" stroke=\"{}\" stroke-width=\"2\" stroke-dasharray=\"{}\"/><text x=\"{}\" y=\"48\">{}</text>",
                curve.colour,
                curve.dash,
                x + 25.0,
                curve.name
            );
            x += 42.0 + 6.4 * curve.name.chars().count() as f64;
        }
        let _ = writeln!(
            svg,
            "<text x=\"{left}\" y=\"24\" font-size=\"14\">{}</text>\n\
             <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(15 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            self.title,
            0.5 * (left + x1),
            SIZE.1 - 10.0,
            self.x,
            0.5 * (top + y1),
            self.y
        );
    }

    fn range(&self, of: impl Fn(&(f64, f64)) -> f64) -> (f64, f64) {
        let values = self.curves.iter().flat_map(|c| &c.points).map(of);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        })
    }
}

/// A straight map from values to the page.
struct Scale {
    low: f64,
    high: f64,
    page: (f64, f64),
}

impl Scale {
    fn new((low, high): (f64, f64), page: (f64, f64)) -> Self {
        let room = 0.04 * (high - low).max(1e-12);
        Self {
            low: low - room,
            high: high + room,
            page,
        }
    }

    fn at(&self, value: f64) -> f64 {
        self.page.0 + (value - self.low) / (self.high - self.low) * (self.page.1 - self.page.0)
    }

    fn ticks(&self) -> Vec<f64> {
        let span = self.high - self.low;
        let power = 10f64.powf((span / 6.0).log10().floor());
        let wide = |step: &f64| span / step <= 7.0;
        let step = [1.0, 2.0, 5.0]
            .map(|s| s * power)
            .into_iter()
            .find(wide)
            .unwrap_or(10.0 * power);
        let (first, last) = (
            (self.low / step).ceil() as i64,
            (self.high / step).floor() as i64,
        );
        (first..=last).map(|k| k as f64 * step).collect()
    }
}

/// A tick without the dust of its arithmetic.
fn plain(tick: f64) -> String {
    let text = format!("{:.6}", tick + 0.0);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
