//! How estimates move with the width of the windows: what a method that is right must pass.
//!
//! Every half-width gives an estimate of the same parameters from the same data. Such estimates are strongly correlated,
//! so their errors say little about their difference `d`; what matters is how much the same stretch of data moves the
//! one and the other. A block of time `c` adds `ψ_c = (JᵀJ)⁻¹·(Jᵀr)_c` to an estimate, and for estimates 1 and 2
//!
//! `var d = G/(G − 1)·Σ_c (ψ1_c − ψ2_c)²`
//!
//! over the `G` blocks, which are the same for all widths: the sandwich variance (Liang and Zeger 1986) of the difference.
//! `d/√(var d)` is compared with Student's t of `G − 1` degrees of freedom. With `m` widths compared to the chosen one, a
//! two-sided level of `0.05/m` each keeps a false alarm below 5 % over all of them (Bonferroni). A parameter that fails
//! depends on the width: the model lacks something in the band that the widths differ in, or noise biases it. In the
//! spirit of J. A. Hausman, Econometrica 46, 1978. A significant difference may still be small: the sentence gives its
//! size in standard errors of the estimate as well.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::linear::{self, Form, NoiseDraws, Shift};
use crate::diagnose::{Estimate, estimate};
use crate::error::Result;
use crate::format::{quantity, significant, with_unit};
use crate::identify::Workbench;
use crate::model::Model;
use crate::refine;
use crate::weak::Part;

/// Narrowest half-width, s.
const NARROWEST: f64 = 0.015;
/// Widest half-width, s.
const WIDEST: f64 = 0.3;
/// Samples under half a test function at least.
const FEWEST_SAMPLES: f64 = 8.0;
/// Half-widths that are tried.
const COUNT: usize = 10;
/// Widths within this factor of the chosen one are compared with it: half to double, an octave of frequency either way.
const AROUND: f64 = 2.0;
/// Chance of a false alarm over all widths compared.
const FALSE_ALARM: f64 = 0.05;

/// Estimates of all parameters under windows of one half-width.
#[derive(Clone, Debug, Serialize)]
pub struct AtWidth {
    /// Half-width, s.
    pub half_width: f64,
    /// Windows in the training part.
    pub rows: usize,
    /// Whether this is the width that was chosen.
    pub chosen: bool,
    /// By the order of the parameters; empty where the width allows no fit.
    pub estimates: Vec<Named>,
    /// By the linear forms.
    pub linear: Vec<Found>,
    /// Why there is no fit, if there is none.
    pub failure: Option<String>,
    /// What each block of time adds to each estimate; empty for those that were not estimated.
    #[serde(skip)]
    influences: Vec<Vec<f64>>,
}

/// A parameter and its estimate.
#[derive(Clone, Debug, Serialize)]
pub struct Named {
    /// Its name.
    pub name: String,
    /// What was found.
    #[serde(flatten)]
    pub estimate: Estimate,
}

/// What a linear form finds under windows of one half-width.
#[derive(Clone, Debug, Serialize)]
pub struct Found {
    /// The form.
    pub form: &'static str,
    /// Physical parameters; empty where the products are not determined.
    pub parameters: Vec<LinearEstimate>,
    /// The products that were solved for, in SI units.
    pub products: Vec<Product>,
}

/// A physical parameter as a linear form finds it.
#[derive(Clone, Debug, Serialize)]
pub struct LinearEstimate {
    /// Its name.
    pub name: &'static str,
    /// The value; `None` where the products stand for none, as where a square would be negative.
    pub value: Option<f64>,
    /// Standard error by the delta method.
    pub se: Option<f64>,
    /// SI unit.
    pub unit: &'static str,
    /// How much it moves when encoder noise doubles in variance: about the bias that is in it already.
    pub bias: Option<Shift>,
}

/// A product of parameters that a linear form solves for.
#[derive(Clone, Debug, Serialize)]
pub struct Product {
    /// As a formula.
    pub name: &'static str,
    /// Its value, SI units.
    pub value: f64,
    /// Its standard error.
    pub se: f64,
    /// Distance from what the physical parameters make of it, in standard errors; none where they were made of it.
    pub redundancy: Option<f64>,
}

/// Whether a parameter's estimates agree over the widths around the chosen one.
#[derive(Clone, Debug, Serialize)]
pub struct Agreement {
    /// The parameter.
    pub name: String,
    /// Widths compared with the chosen one.
    pub compared: usize,
    /// Largest difference, in its own standard errors.
    pub farthest: f64,
    /// The same difference in standard errors of the estimate at the chosen width.
    pub size: f64,
    /// What chance allows.
    pub allowed: f64,
    /// Whether they agree.
    pub agree: bool,
    /// In a sentence.
    pub text: String,
}

/// Half-widths for tracks of a period: geometric, with the chosen one in the place of its neighbour.
fn half_widths(period: f64, chosen: f64) -> Vec<f64> {
    let narrowest = NARROWEST.max(FEWEST_SAMPLES * period);
    let widest = WIDEST.max(2.0 * narrowest);
    let step = (widest / narrowest).powf(1.0 / (COUNT - 1) as f64);
    let mut widths: Vec<f64> = (0..COUNT)
        .map(|k| narrowest * step.powi(k as i32))
        .collect();
    widths.retain(|w| (w / chosen).ln().abs() > 0.5 * step.ln());
    widths.push(chosen);
    widths.sort_by(f64::total_cmp);
    widths
}

/// Fits a model under windows of several half-widths; `start` is the model as the user gave it, `fitted` the one found.
pub fn over(
    bench: &Workbench,
    start: &Model,
    fitted: &Model,
    draws: &NoiseDraws,
    progress: &dyn Fn(&str),
) -> Vec<AtWidth> {
    let tracks = bench.problem.tracks.iter();
    let period = tracks.map(|t| t.period).fold(0.0, f64::max);
    let chosen = bench.problem.half_width();
    let forms = linear::forms(start);
    let mut all: Vec<AtWidth> = Vec::new();
    for half_width in half_widths(period, chosen) {
        progress(&format!("half-width {}", quantity(1e3 * half_width, "ms")));
        let own = half_width == chosen;
        let fit = || -> Result<(Workbench, Model)> {
            let bench = bench.with_half_width(start, half_width)?;
            let (model, _) = bench.estimate(start)?;
            Ok((bench, model))
        };
        let at = if own {
            at_width(bench, fitted, &forms, draws)
        } else {
            match fit() {
                Ok((bench, model)) => at_width(&bench, &model, &forms, draws),
                Err(error) => failed(half_width, &error.to_string()),
            }
        };
        // A short recording caps the width: the same windows once are enough.
        if own || all.iter().all(|a| a.half_width != at.half_width) {
            all.push(AtWidth { chosen: own, ..at });
        }
    }
    all
}

fn failed(half_width: f64, why: &str) -> AtWidth {
    AtWidth {
        half_width,
        rows: 0,
        chosen: false,
        estimates: Vec::new(),
        linear: Vec::new(),
        failure: Some(why.to_owned()),
        influences: Vec::new(),
    }
}

fn at_width(
    bench: &Workbench,
    model: &Model,
    forms: &[Box<dyn Form>],
    draws: &NoiseDraws,
) -> AtWidth {
    let labels = model.labels().into_iter().zip(model.parameters());
    AtWidth {
        half_width: bench.problem.half_width(),
        rows: bench.problem.count(Part::Train),
        chosen: false,
        estimates: labels
            .map(|(label, p)| Named {
                name: label.to_string(),
                estimate: estimate(p, label.unit),
            })
            .collect(),
        linear: forms
            .iter()
            .map(|form| found(form.as_ref(), bench, model, draws))
            .collect(),
        failure: None,
        influences: influences(bench, model),
    }
}

fn influences(bench: &Workbench, model: &Model) -> Vec<Vec<f64>> {
    let mut all = vec![Vec::new(); model.parameters().len()];
    // Numbered alike whatever the width.
    let blocks = &bench.blocks;
    if let Some(shares) = refine::influences(&bench.problem, model, &bench.noise, blocks) {
        for (row, k) in refine::free_parameters(model).into_iter().enumerate() {
            all[k] = shares.row(row).iter().copied().collect();
        }
    }
    all
}

fn found(form: &dyn Form, bench: &Workbench, model: &Model, draws: &NoiseDraws) -> Found {
    let Some(solution) = linear::solve(form, &bench.problem, &bench.blocks, model) else {
        return Found {
            form: form.name(),
            parameters: Vec::new(),
            products: Vec::new(),
        };
    };
    let shifts = draws.shifts(form, bench, model);
    let finite = |x: f64| x.is_finite().then_some(x);
    let parameters = form.physical().iter().enumerate();
    let products = form.products().iter().enumerate();
    Found {
        form: form.name(),
        parameters: parameters
            .map(|(k, (name, quantity))| LinearEstimate {
                name,
                value: finite(solution.physical[k]),
                // Where there is no value there is no error either.
                se: finite(solution.physical[k]).and(finite(solution.se[k])),
                unit: model.unit(*quantity),
                bias: shifts
                    .as_ref()
                    .map(|s| s[k])
                    .filter(|s| s.mean.is_finite() && s.se.is_finite()),
            })
            .collect(),
        products: products
            .map(|(k, name)| Product {
                name,
                value: solution.products[k],
                se: solution.covariance[(k, k)].sqrt(),
                redundancy: solution.redundancy[k],
            })
            .collect(),
    }
}

/// Judges every estimated parameter.
pub fn agreement(widths: &[AtWidth]) -> Vec<Agreement> {
    let Some(chosen) = widths.iter().find(|w| w.chosen) else {
        return Vec::new();
    };
    let near = |w: &&AtWidth| {
        let factor = w.half_width / chosen.half_width;
        let inside = factor.ln().abs() <= AROUND.ln() + 1e-9;
        inside && !w.chosen && !w.estimates.is_empty()
    };
    let near: Vec<&AtWidth> = widths.iter().filter(near).collect();
    let estimated = chosen.estimates.iter().enumerate();
    let estimated = estimated.filter(|(_, e)| e.estimate.se.is_some_and(|se| se > 0.0));
    estimated
        .map(|(k, own)| judged(k, own, chosen, &near))
        .collect()
}

/// A difference from the chosen width.
struct Difference {
    /// Half-width of the other one, s.
    at: f64,
    /// The difference, in its own standard errors over what chance allows.
    excess: f64,
    /// In its own standard errors.
    distance: f64,
    allowed: f64,
    /// In the unit of the parameter.
    value: f64,
}

fn judged(k: usize, own: &Named, chosen: &AtWidth, near: &[&AtWidth]) -> Agreement {
    let compared: Vec<(&AtWidth, f64, f64)> = near
        .iter()
        .filter_map(|other| {
            let (error, freedom) = error(&chosen.influences[k], &other.influences[k])?;
            Some((*other, error, freedom))
        })
        .collect();
    let differences = compared.iter().map(|(other, error, freedom)| {
        let value = other.estimates[k].estimate.value - own.estimate.value;
        let (distance, allowed) = (value.abs() / error, allowed(compared.len(), *freedom));
        Difference {
            at: other.half_width,
            excess: distance / allowed,
            distance,
            allowed,
            value,
        }
    });
    let worst = differences.max_by(|a, b| a.excess.total_cmp(&b.excess));
    let se = own.estimate.se.unwrap_or(f64::INFINITY);
    let text = match &worst {
        None => format!(
            "{}: no other width has an estimate to compare with.",
            own.name
        ),
        Some(worst) => format!(
            "{}: the estimates at the {} other widths from half to double the chosen one {} ({}). The most telling difference, at {}, is {} of its own standard errors, where chance allows {}, and {} of those of the estimate.",
            own.name,
            compared.len(),
            if worst.excess <= 1.0 {
                "agree within errors"
            } else {
                "do not agree: the value depends on the width"
            },
            values(k, near, own),
            quantity(1e3 * worst.at, "ms"),
            significant(worst.distance, 2),
            significant(worst.allowed, 2),
            significant(worst.value.abs() / se, 2),
        ),
    };
    Agreement {
        name: own.name.clone(),
        compared: compared.len(),
        farthest: worst.as_ref().map_or(0.0, |w| w.distance),
        size: worst.as_ref().map_or(0.0, |w| w.value.abs() / se),
        allowed: worst.as_ref().map_or(f64::INFINITY, |w| w.allowed),
        agree: worst.is_some_and(|w| w.excess <= 1.0),
        text,
    }
}

/// Standard error of the difference of two estimates, and its degrees of freedom; `None` where one was not estimated.
fn error(a: &[f64], b: &[f64]) -> Option<(f64, f64)> {
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let share = |x: &[f64], c: usize| x.get(c).copied().unwrap_or_default();
    let apart = (0..a.len().max(b.len())).map(|c| share(a, c) - share(b, c));
    let apart: Vec<f64> = apart.filter(|d| *d != 0.0).collect();
    let groups = apart.len() as f64;
    let variance = apart.iter().map(|d| d * d).sum::<f64>() * groups / (groups - 1.0);
    (groups > 1.0 && variance.is_finite()).then(|| (variance.sqrt(), groups - 1.0))
}

/// Range of a parameter over the widths compared, the chosen one included.
fn values(k: usize, near: &[&AtWidth], own: &Named) -> String {
    let all = near.iter().map(|w| w.estimates[k].estimate.value);
    let (low, high) = all.fold(
        (own.estimate.value, own.estimate.value),
        |(low, high), x| (low.min(x), high.max(x)),
    );
    let text = format!("{} to {}", significant(low, 4), significant(high, 4));
    with_unit(&text, own.estimate.unit)
}

/// Quantile of Student's t that leaves `0.05/m` outside on both sides together.
fn allowed(compared: usize, freedom: f64) -> f64 {
    let tail = FALSE_ALARM / (2 * compared.max(1)) as f64;
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - tail))
}

#[cfg(test)]
mod tests {
    use super::{AtWidth, Named, agreement, half_widths};
    use crate::diagnose::Estimate;

    fn at(half_width: f64, value: f64, share: f64, chosen: bool) -> AtWidth {
        AtWidth {
            half_width,
            rows: 100,
            chosen,
            estimates: vec![Named {
                name: "inertia".to_owned(),
                estimate: Estimate {
                    value,
                    se: Some(0.1),
                    unit: "kg*m^2",
                    status: "identified".to_owned(),
                },
            }],
            linear: Vec::new(),
            failure: None,
            influences: vec![vec![share; 4]],
        }
    }

    #[test]
    fn widths_hold_the_chosen_one_and_no_double_of_it() {
        let widths = half_widths(1e-3, 0.07);
        assert!(widths.is_sorted() && widths.contains(&0.07) && widths.len() == 10);
        assert!((widths[0] - 0.015).abs() < 1e-12 && (widths[9] - 0.3).abs() < 1e-12);
        assert!(half_widths(5e-3, 0.1)[0] >= 0.04 - 1e-12);
    }

    #[test]
    fn only_what_chance_does_not_allow_disagrees() {
        // Four blocks that add √3/8 each to one estimate and nothing to the other: √(4/3·4·3/64) = 0.5. Two widths
        // compared: Student's t of 3 degrees of freedom at 1 − 0.0125 is 4.177. Far widths do not count.
        let share = 3f64.sqrt() / 8.0;
        let widths = |x: f64| {
            vec![
                at(0.05, x, share, false),
                at(0.07, 1.0, 0.0, true),
                at(0.1, 1.1, share, false),
                at(0.3, 9.0, share, false),
            ]
        };
        let close = &agreement(&widths(1.0 + 4.1 * 0.5))[0];
        assert!(close.agree && close.compared == 2, "{close:?}");
        assert!((close.allowed - 4.1765).abs() < 1e-3 && (close.farthest - 4.1).abs() < 1e-9);
        assert!((close.size - 20.5).abs() < 1e-9, "{close:?}");
        let apart = &agreement(&widths(1.0 - 4.3 * 0.5))[0];
        assert!(
            !apart.agree && apart.text.contains("do not agree"),
            "{apart:?}"
        );
    }
}
