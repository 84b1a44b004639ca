//! What the page shows: texts with their numbers already formatted, and the series of the plots.
//!
//! The script in `page.js` draws these as they are; it computes nothing.

use serde::{Serialize, Serializer};

/// A whole report.
#[derive(Debug, Serialize)]
pub struct Page {
    /// Heading and window title.
    pub title: String,
    /// Name and text of the model, recordings and other facts: what, and its value.
    pub facts: Vec<[String; 2]>,
    /// Verdict of a diagnosis.
    pub verdict: Option<Verdict>,
    /// What there is to know about the recordings before the rest is trusted, a sentence or two each.
    pub warnings: Vec<String>,
    /// The headline numbers.
    pub figures: Vec<Figure>,
    /// What the headline numbers' errors mean.
    pub figures_note: String,
    /// The parts of the report in order.
    pub sections: Vec<Section>,
}

/// The verdict in a word and in a sentence.
#[derive(Debug, Serialize)]
pub struct Verdict {
    /// `adequate`, `explained` or `unknown`.
    pub word: String,
    /// The sentence.
    pub text: String,
    /// What was found, a sentence each, and what to be wary of.
    pub points: Vec<String>,
}

/// One headline number, before and after.
#[derive(Debug, Serialize)]
pub struct Figure {
    /// What it is.
    pub label: String,
    /// Its value with the baseline, if something was added since.
    pub before: Option<String>,
    /// Its value with the final model.
    pub after: String,
    /// What it means, in a line.
    pub note: String,
}

/// One part of the report.
#[derive(Debug, Serialize)]
pub struct Section {
    /// Its heading.
    pub title: String,
    /// Its content from top to bottom.
    pub items: Vec<Item>,
}

/// One piece of a section.
#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Item {
    /// A heading below the section's.
    Heading {
        /// Its text.
        text: String,
    },
    /// A paragraph.
    Text {
        /// Its text.
        text: String,
    },
    /// Short points.
    List {
        /// One text each.
        points: Vec<String>,
    },
    /// A table.
    Table(Table),
    /// Plots side by side, or one over the full width.
    Plots {
        /// From left to right.
        plots: Vec<Plot>,
    },
}

/// A table of texts.
#[derive(Debug, Serialize)]
pub struct Table {
    /// Heading of each column.
    pub columns: Vec<String>,
    /// Texts row by row.
    pub rows: Vec<Vec<String>>,
}

/// A plot: series over one common, ascending abscissa.
#[derive(Debug, Default, Serialize)]
pub struct Plot {
    /// Heading.
    pub title: String,
    /// What the plot shows and how to read it.
    pub caption: String,
    /// Label of the abscissa with its unit.
    pub x_label: String,
    /// Label of the ordinate with its unit.
    pub y_label: String,
    /// Height, CSS pixels.
    pub height: u32,
    /// The abscissa.
    #[serde(serialize_with = "even")]
    pub x: Vec<f64>,
    /// The series, drawn in this order.
    pub series: Vec<Series>,
    /// Shaded parts of the abscissa.
    pub bands: Vec<Band>,
    /// Instants at which the models were restarted.
    pub marks: Vec<f64>,
    /// The ordinate never shows more than this, so that a model that runs away leaves the rest readable.
    pub limit: Option<[f64; 2]>,
    /// Plots of one group share cursor and zoom.
    pub group: Option<String>,
}

/// One series of a plot; values that are not finite are left out of the drawing.
#[derive(Debug, Serialize)]
pub struct Series {
    /// Name in the legend.
    pub label: String,
    /// What it stands for, which decides its colour and dash.
    pub role: Role,
    /// Line, dots, or dots with bars.
    pub style: Style,
    /// One value for each abscissa.
    #[serde(serialize_with = "short")]
    pub y: Vec<f64>,
    /// Half-length of the bars.
    #[serde(serialize_with = "short")]
    pub bar: Vec<f64>,
}

/// What a series stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// What was recorded.
    Measured,
    /// The baseline.
    Before,
    /// The final model.
    After,
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// A line.
    Line,
    /// Small dots.
    Dots,
    /// Large dots with bars.
    Bars,
}

/// A shaded part of the abscissa.
#[derive(Debug, Serialize)]
pub struct Band {
    /// Its two ends.
    pub from: f64,
    /// Its two ends.
    pub to: f64,
    /// Whether it marks held-out data (otherwise the located region).
    pub held_out: bool,
    /// What it marks, for the key.
    pub label: String,
}

impl Plot {
    /// Adds a series without bars.
    pub fn push(&mut self, label: &str, role: Role, style: Style, y: Vec<f64>) {
        self.series.push(Series {
            label: label.to_owned(),
            role,
            style,
            y,
            bar: Vec::new(),
        });
    }
}

impl Item {
    /// A paragraph.
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text { text: text.into() }
    }

    /// A heading below the section's.
    pub fn heading(text: impl Into<String>) -> Self {
        Self::Heading { text: text.into() }
    }
}

/// Six significant digits are more than a screen shows, and half the size.
fn short<S: Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|&x| shortened(x)))
}

/// An abscissa in steps of a millionth of its span: its origin may be far away.
fn even<S: Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    let span = values
        .last()
        .zip(values.first())
        .map_or(1.0, |(b, a)| (b - a).abs());
    let decimals = (6.0 - span.max(1e-12).log10().floor()).clamp(0.0, 17.0) as usize;
    let rounded = |x: f64| format!("{x:.decimals$}").parse().unwrap_or(x);
    serializer.collect_seq(values.iter().map(|&x| rounded(x)))
}

fn shortened(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::{Plot, Role, Series, Style, shortened};

    #[test]
    fn series_are_written_short_and_gaps_as_null() {
        assert_eq!(shortened(1.234_567_89), 1.23457);
        assert_eq!(shortened(-1.234_567_89e-7), -1.23457e-7);
        let plot = Plot {
            x: vec![1e9 + 0.125, 1e9 + 0.25, 1e9 + 1.0],
            series: vec![Series {
                label: "model".to_owned(),
                role: Role::After,
                style: Style::Line,
                y: vec![0.1 + 0.2, f64::NAN, f64::INFINITY],
                bar: Vec::new(),
            }],
            ..Plot::default()
        };
        let text = serde_json::to_string(&plot).unwrap();
        assert!(text.contains("\"y\":[0.3,null,null]"), "{text}");
        assert!(
            text.contains("\"x\":[1000000000.125,1000000000.25,1000000001.0]"),
            "{text}"
        );
    }
}
