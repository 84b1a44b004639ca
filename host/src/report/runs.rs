//! Measured against simulated: the worst stretch of the held-out part, and one part for each recording.

use std::ops::Range;

use super::page::{Band, Item, Plot, Role, Section, Style};
use super::subject::{Prediction, Subject};
use super::thin::thin;
use crate::error::Result;
use crate::fit::HORIZON;
use crate::format::scaled_unit;
use crate::weak::TRAIN_SHARE;

/// Recordings that get plots of their own.
pub(super) const MOST_RECORDINGS: usize = 6;
/// Points of all main plots together; two screens' width for one recording.
const POINTS: usize = 12_000;
/// Times the largest measured value at which a model that runs away is cut off.
const FAR: f64 = 1e3;
/// Most points of one plot.
const PLOT_POINTS: usize = 4000;

/// One plot's worth: a recording, what models make of it, and which samples are shown.
struct View<'a> {
    subject: &'a Subject<'a>,
    prediction: &'a Prediction,
    index: usize,
    samples: Range<usize>,
    points: usize,
}

/// The section with all runs.
pub(super) fn section(subject: &Subject, predictions: &[Prediction]) -> Result<Section> {
    let count = subject.recordings.len();
    let shown = count.min(MOST_RECORDINGS);
    let mut items = vec![Item::text(explanation(subject))];
    if count > shown {
        items.push(Item::text(format!(
            "The first {shown} of {count} recordings are shown; all of them count in every number of this report."
        )));
    }
    for (index, prediction) in predictions.iter().enumerate().take(shown) {
        if count > 1 {
            items.push(Item::heading(subject.recordings[index].file_name()));
        }
        let view = View {
            subject,
            prediction,
            index,
            samples: 0..prediction.measured.len(),
            points: (POINTS / shown).min(PLOT_POINTS),
        };
        items.push(one(view.over_time()));
        items.push(one(view.errors()));
        if !subject.inverse() {
            items.push(one(view.free_run()?));
        }
    }
    if let Some((index, samples)) = worst(predictions) {
        let view = View {
            subject,
            prediction: &predictions[index],
            index,
            samples,
            points: PLOT_POINTS,
        };
        items.push(one(view.worst()));
    }
    Ok(Section {
        title: "Measured against simulated".to_owned(),
        items,
    })
}

fn one(plot: Plot) -> Item {
    Item::Plots { plots: vec![plot] }
}

fn explanation(subject: &Subject) -> String {
    let how = if subject.inverse() {
        "The motion of this recording is imposed: the model says which u it takes, along the measured motion."
            .to_owned()
    } else {
        format!(
            "The model is driven by the recorded u alone and restarted from the measured state every {HORIZON:.0} s: what shows is how far it drifts off in that time."
        )
    };
    format!(
        "{how} The last {:.0} % of the recording (shaded) were held out from the fit.",
        100.0 * (1.0 - TRAIN_SHARE)
    )
}

/// The held-out window with the largest error, by the baseline if there is one, with a neighbour on either side.
fn worst(predictions: &[Prediction]) -> Option<(usize, Range<usize>)> {
    let mut worst: Option<(f64, usize, Range<usize>)> = None;
    for (index, prediction) in predictions.iter().enumerate() {
        let predicted = prediction.before.as_ref().unwrap_or(&prediction.after);
        let windows: Vec<_> = prediction
            .windows
            .iter()
            .filter(|w| w.start >= prediction.boundary)
            .collect();
        for (k, window) in windows.iter().enumerate() {
            let error = prediction.squared_error(predicted, window);
            if worst.as_ref().is_none_or(|(most, ..)| error > *most) {
                let last = windows[(k + 1).min(windows.len() - 1)];
                worst = Some((error, index, windows[k.max(1) - 1].start..last.end));
            }
        }
    }
    worst.map(|(_, index, samples)| (index, samples))
}

impl View<'_> {
    fn over_time(&self) -> Plot {
        let (name, si) = self.subject.compared();
        let title = if self.subject.inverse() {
            format!("{name} along the measured motion")
        } else {
            format!("{name}, restarted every {HORIZON:.0} s")
        };
        let (factor, unit) = scaled_unit(largest(self.measured()), si);
        Plot {
            title,
            y_label: format!("{} [{unit}]", name.to_lowercase()),
            height: 280,
            limit: Some(around(&self.prediction.measured, 0.5).map(|x| x * factor)),
            group: Some(format!("run-{}", self.index)),
            ..self.plot(true, self.models(), factor)
        }
    }

    fn errors(&self) -> Plot {
        let (name, si) = self.subject.compared();
        let models = self.models().map(|model| {
            let pairs = model?.into_iter().zip(self.measured());
            Some(pairs.map(|(p, x)| p - x).collect::<Vec<f64>>())
        });
        let [low, high] = around(self.measured(), 0.0);
        let greatest = models
            .iter()
            .flatten()
            .map(|e| largest(e))
            .fold(0.0, f64::max)
            .min(high - low);
        let (factor, unit) = scaled_unit(greatest, si);
        Plot {
            title: format!("Error of {}: simulated less measured", name.to_lowercase()),
            y_label: format!("error [{unit}]"),
            height: 200,
            limit: Some([-1.1, 1.1].map(|x| x * greatest * factor)),
            group: Some(format!("run-{}", self.index)),
            ..self.plot(false, models, factor)
        }
    }

    fn free_run(&self) -> Result<Plot> {
        let (name, si) = self.subject.compared();
        let run = |model| self.subject.free_run(model, self.index);
        let models = [
            self.subject.before.map(|b| run(b.model)).transpose()?,
            Some(run(self.subject.after.model)?),
        ];
        let (factor, unit) = scaled_unit(largest(self.measured()), si);
        Ok(Plot {
            title: format!("{name}, one free run over the whole recording"),
            caption: format!(
                "Never restarted, so that small errors of {} add up to large ones of {}: the harder test. A model that runs away is shown up to once the measured span beyond it.",
                self.subject.torque().0,
                name.to_lowercase(),
            ),
            y_label: format!("{} [{unit}]", name.to_lowercase()),
            height: 220,
            limit: Some(around(self.measured(), 1.0).map(|x| x * factor)),
            group: Some(format!("run-{}", self.index)),
            ..self.plot(true, models, factor)
        })
    }

    fn worst(&self) -> Plot {
        let t = &self.subject.recordings[self.index].t;
        let whose = if self.subject.before.is_some() {
            "baseline"
        } else {
            "model"
        };
        let of = if self.subject.recordings.len() > 1 {
            format!(" of {}", self.subject.recordings[self.index].file_name())
        } else {
            String::new()
        };
        let mut plot = self.over_time();
        plot.title = format!("Where the {whose} predicts the held-out part{of} worst");
        (plot.bands, plot.group) = (Vec::new(), None);
        if !self.subject.inverse() {
            let windows = self.prediction.windows.iter();
            plot.marks = windows
                .filter(|w| self.samples.contains(&w.start))
                .map(|w| t[w.start])
                .collect();
            plot.caption
                .push_str("Dotted: restarts from the measured state.");
        }
        plot
    }

    fn measured(&self) -> &[f64] {
        &self.prediction.measured[self.samples.clone()]
    }

    /// The baseline's prediction, if there is one, and the final model's.
    fn models(&self) -> [Option<Vec<f64>>; 2] {
        let shown = |y: &Vec<f64>| y[self.samples.clone()].to_vec();
        [
            self.prediction.before.as_ref().map(shown),
            Some(shown(&self.prediction.after)),
        ]
    }

    /// Series over time in the plot's unit, thinned, with the held-out part shaded.
    fn plot(&self, measured: bool, models: [Option<Vec<f64>>; 2], factor: f64) -> Plot {
        // A line to a point that is too far away is not drawn at all, so what runs away stops short of that.
        let far = FAR * largest(&self.prediction.measured).max(f64::MIN_POSITIVE);
        let t = &self.subject.recordings[self.index].t;
        let names = self.subject.names();
        let [before, after] = models;
        let (labels, series): (Vec<_>, Vec<Vec<f64>>) = [
            (
                "measured",
                Role::Measured,
                measured.then(|| self.measured().to_vec()),
            ),
            (names.0, Role::Before, before),
            (names.1, Role::After, after),
        ]
        .into_iter()
        .filter_map(|(name, role, y)| Some(((name, role), y?)))
        .map(|(label, y)| {
            (
                label,
                y.iter().map(|y| y.clamp(-far, far) * factor).collect(),
            )
        })
        .unzip();
        let (x, thinned) = thin(&t[self.samples.clone()], &series, self.points);
        let mut plot = Plot {
            x_label: "time [s]".to_owned(),
            x,
            bands: vec![Band {
                from: t[self.prediction.boundary],
                to: t[t.len() - 1],
                held_out: true,
                label: "held out".to_owned(),
            }],
            ..Plot::default()
        };
        for ((name, role), y) in labels.into_iter().zip(thinned) {
            plot.push(name, role, Style::Line, y);
        }
        plot
    }
}

fn largest(values: &[f64]) -> f64 {
    let finite = values.iter().filter(|x| x.is_finite());
    finite.fold(0.0, |a: f64, b| a.max(b.abs()))
}

/// The span of values, widened on both sides by a share of itself.
fn around(values: &[f64], share: f64) -> [f64; 2] {
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| {
            (a.min(x), b.max(x))
        });
    let margin = share * (high - low);
    [low - margin, high + margin]
}

#[cfg(test)]
mod tests {
    use super::{Prediction, worst};

    #[test]
    fn the_worst_stretch_is_held_out_and_has_its_neighbours() {
        let mut after = vec![0.0; 60];
        // The largest error of all lies in the training part; the largest held-out one in the fifth window.
        (after[5], after[42]) = (9.0, 1.0);
        let prediction = |after: Vec<f64>| Prediction {
            measured: vec![0.0; 60],
            boundary: 30,
            windows: (0..6).map(|k| 10 * k..10 * k + 10).collect(),
            before: None,
            after,
        };
        let calm = prediction(vec![0.0; 60]);
        assert_eq!(worst(&[calm, prediction(after)]), Some((1, 30..60)));
        assert_eq!(worst(&[]), None);
    }
}
