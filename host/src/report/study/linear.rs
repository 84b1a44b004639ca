//! Forms of DBI that are linear in products of the parameters, beside the default estimates.

use super::basis::milliseconds;
use super::widths::limit;
use crate::dbi::{AtWidth, Found, LinearEstimate, LinearForm, Study};
use crate::diagnose::Estimate;
use crate::format::{parameter, significant, unit, value, with_unit};
use crate::report::page::{Item, Plot, Role, Section, Style, Table};
use crate::report::points::Points;

/// A section if the model's law has such a form.
pub(super) fn section(study: &Study) -> Option<Section> {
    let forms = study.linear_forms.iter().enumerate();
    let items: Vec<Item> = forms.flat_map(|(k, form)| items(study, k, form)).collect();
    (!items.is_empty()).then(|| Section {
        title: "Linear forms".to_owned(),
        items,
    })
}

fn items(study: &Study, k: usize, form: &LinearForm) -> Vec<Item> {
    let chosen = study.widths.iter().find(|w| w.chosen);
    let mut items = vec![
        Item::heading(form.name),
        Item::text(format!(
            "One linear problem in products of the parameters: no scan, no start values. {}",
            form.equation
        )),
        Item::text(form.remark),
    ];
    let Some((chosen, found)) = chosen.and_then(|w| Some((w, w.linear.get(k)?))) else {
        return items;
    };
    if found.parameters.is_empty() {
        items.push(Item::text(
            "At the chosen width the rows do not determine the products.",
        ));
    } else {
        items.push(Item::text("At the chosen width. Noise moves it by: what the estimate moves by when noise of the encoder's size is added once more, to first order the bias that is in it already (simulation and extrapolation, Cook and Stefanski 1994)."));
        items.push(Item::Table(beside(chosen, found)));
        items.push(Item::text("The products that were solved for. Redundant ones must agree with what the others make of them; the last column says how far they are apart, in standard errors of the difference."));
        items.push(Item::Table(products(found)));
    }
    items.push(Item::text("Over the widths, the default estimates beside those of the linear form. Where the bias by noise is small against the error and the redundant products agree, the width suits the form."));
    let count = found.parameters.len();
    let plots = (0..count).map(|p| plot(&study.widths, k, p));
    items.push(Item::Plots {
        plots: plots.collect(),
    });
    items.push(Item::Table(over_widths(&study.widths, k)));
    items
}

fn default<'a>(at: &'a AtWidth, name: &str) -> Option<&'a Estimate> {
    at.estimates
        .iter()
        .find(|e| e.name == name)
        .map(|e| &e.estimate)
}

fn beside(chosen: &AtWidth, found: &Found) -> Table {
    let rows = found.parameters.iter().map(|p| {
        let usual = default(chosen, p.name);
        let bias = p.bias.map_or_else(
            || "not determined".to_owned(),
            |b| with_unit(&value(b.mean, Some(b.se)), p.unit),
        );
        vec![
            p.name.to_owned(),
            usual.map_or_else(|| "–".to_owned(), |e| parameter(e.value, e.se, e.unit)),
            text(p),
            bias,
        ]
    });
    Table {
        columns: [
            "Parameter",
            "Default estimate",
            "Linear form",
            "Noise moves it by",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: rows.collect(),
    }
}

fn text(p: &LinearEstimate) -> String {
    p.value.map_or_else(
        || "none (a square came out negative)".to_owned(),
        |v| parameter(v, p.se, p.unit),
    )
}

fn products(found: &Found) -> Table {
    let rows = found.products.iter().map(|p| {
        let apart = p
            .redundancy
            .map_or_else(|| "used".to_owned(), |z| significant(z, 2));
        vec![p.name.to_owned(), value(p.value, Some(p.se)), apart]
    });
    Table {
        columns: ["Product", "Value (SI)", "Apart"]
            .map(str::to_owned)
            .to_vec(),
        rows: rows.collect(),
    }
}

fn parameter_at(at: &AtWidth, form: usize, index: usize) -> Option<&LinearEstimate> {
    at.linear.get(form)?.parameters.get(index)
}

fn plot(widths: &[AtWidth], form: usize, index: usize) -> Plot {
    let all = || {
        widths
            .iter()
            .filter_map(|w| Some((w, parameter_at(w, form, index)?)))
    };
    let linear: Vec<[f64; 3]> = all()
        .filter_map(|(w, p)| Some([1e3 * w.half_width, p.value?, p.se?]))
        .collect();
    let usual: Vec<[f64; 3]> = all()
        .filter_map(|(w, p)| {
            let e = default(w, p.name)?;
            let se = e.se.filter(|se| se.is_finite())?;
            Some([1e3 * w.half_width, e.value, se])
        })
        .collect();
    let (name, si) = all().next().map_or(("", ""), |(_, p)| (p.name, p.unit));
    let both = [limit(&linear), limit(&usual)].into_iter().flatten();
    let limit = both.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    let mut points = Points::default();
    points.add("default ± se", Role::After, Style::Bars, usual);
    points.add("linear form ± se", Role::Before, Style::Bars, linear);
    let mut plot = points.plot();
    plot.series.retain(|s| s.y.iter().any(|y| y.is_finite()));
    Plot {
        title: name.to_owned(),
        x_label: "half-width [ms]".to_owned(),
        y_label: format!("{name} [{}]", unit(si)),
        height: 220,
        limit,
        ..plot
    }
}

fn over_widths(widths: &[AtWidth], form: usize) -> Table {
    let found = || widths.iter().filter_map(|w| Some((w, w.linear.get(form)?)));
    let names: Vec<String> = found()
        .map(|(_, f)| f.parameters.iter().map(|p| p.name.to_owned()).collect())
        .max_by_key(Vec::len)
        .unwrap_or_default();
    let rows = found().map(|(w, f)| {
        let mark = if w.chosen { " (chosen)" } else { "" };
        let worst = f
            .products
            .iter()
            .filter_map(|p| p.redundancy)
            .map(f64::abs)
            .fold(0.0, f64::max);
        let cells = f.parameters.iter().map(|p| {
            let bias = p.bias.map_or(String::new(), |b| {
                format!(", noise {}", significant(b.mean, 2))
            });
            text(p) + &bias
        });
        std::iter::once(format!("{}{mark}", milliseconds(w.half_width)))
            .chain(cells)
            .chain([significant(worst, 2)])
            .collect()
    });
    Table {
        columns: std::iter::once("Half-width [ms]".to_owned())
            .chain(names)
            .chain(["Products apart, at most".to_owned()])
            .collect(),
        rows: rows.collect(),
    }
}
