//! Tests of whole pages.

use super::page::Page;
use super::{diagnosis, escape_json, fill, identification, render};
use crate::diagnose::diagnose;
use crate::identify::{Options, identify};
use crate::model::{Causality, Model};
use crate::recording::Recording;

/// A rotary axis under two sines of torque, integrated here in small steps; 1 kHz, 24 s, 16384 counts.
fn recording() -> Recording {
    recording_under(|_| 0.0)
}

/// The same against a torque that depends on the position.
fn recording_under(load: impl Fn(f64) -> f64) -> Recording {
    let (inertia, coulomb, viscous, h) = (0.01, 0.15, 0.02, 1e-4);
    let drive = |t: f64| 0.5 * (1.3 * t).sin() + 0.3 * (4.1 * t + 0.4).sin();
    let (mut q, mut v) = (0.0_f64, 0.0_f64);
    let (mut t, mut u, mut position) = (Vec::new(), Vec::new(), Vec::new());
    let count = std::f64::consts::TAU / 16384.0;
    for k in 0..24_000 {
        let now = f64::from(k) * 1e-3;
        t.push(now);
        u.push(drive(now));
        position.push((q / count).floor() * count);
        for _ in 0..10 {
            // Implicit Coulomb step (Moreau): the axis rests exactly where friction can hold it.
            let free = v + h / inertia * (drive(now) - viscous * v - load(q));
            let held = h / inertia * coulomb;
            v = free.signum() * (free.abs() - held).max(0.0);
            q += h * v;
        }
    }
    Recording {
        path: "a <b>{{script}}.csv".into(),
        t,
        u,
        q: Some(position),
        ..Recording::default()
    }
}

fn model(friction: &str) -> Model {
    Model::parse(&format!(
        "name = \"A & B</script>\"\n[plant]\nmotion = \"rotary\"\ninput = \"torque\"\ninertia = \"?\"\n[friction]\n{friction}"
    ))
    .unwrap()
}

/// What a page must not hold outside the comment of the licence's banner: any way to ask the network.
fn assert_self_contained(page: &str) {
    let banner = "/*! https://github.com/leeoniya/uPlot (v1.6.32) */";
    assert!(page.contains(banner) && page.contains("The MIT License"));
    let rest = page.replacen(banner, "", 1);
    for forbidden in [
        "http://",
        "https://",
        "src=",
        "href=",
        "fetch(",
        "XMLHttpRequest",
        "import(",
        "@import",
        "url(",
        "WebSocket",
        "sendBeacon",
        "<link",
        "<img",
        "<iframe",
    ] {
        assert!(!rest.contains(forbidden), "{forbidden}");
    }
    assert!(page.contains("default-src 'none'"));
}

/// The page's own script writes texts only as texts, and nothing put into the page opens or closes an element.
#[test]
fn hostile_texts_stay_texts() {
    let script = include_str!("page.js");
    for way in [
        "innerHTML",
        "outerHTML",
        "insertAdjacentHTML",
        "document.write",
        "eval(",
    ] {
        assert!(!script.contains(way), "{way}");
    }
    let name = "</title></script><script>alert(1)</script><img onerror=x>";
    let page = render(&Page {
        title: name.to_owned(),
        facts: vec![[name.to_owned(), name.to_owned()]],
        verdict: None,
        warnings: Vec::new(),
        figures: Vec::new(),
        figures_note: name.to_owned(),
        sections: Vec::new(),
    })
    .unwrap();
    let template = include_str!("page.html");
    for tag in ["<script", "</script", "</title", "<img"] {
        assert_eq!(
            page.matches(tag).count(),
            template.matches(tag).count(),
            "{tag}"
        );
    }
    assert_eq!(data(&page)["title"], name);
}

/// Every plot of a page has axes with units, ascending abscissas and series that show something.
fn assert_sound(page: &serde_json::Value) -> Vec<&serde_json::Value> {
    let array = |v: &'_ serde_json::Value| v.as_array().unwrap().len();
    let sections = page["sections"].as_array().unwrap().iter();
    let items = sections.flat_map(|s| s["items"].as_array().unwrap());
    let plots: Vec<_> = items
        .filter_map(|i| i["plots"].as_array())
        .flatten()
        .collect();
    for plot in &plots {
        let title = plot["title"].as_str().unwrap();
        for label in ["x_label", "y_label"] {
            let text = plot[label].as_str().unwrap();
            assert!(
                text.contains(" [") && text.ends_with(']'),
                "{title}: {text}"
            );
        }
        let x: Vec<f64> = plot["x"]
            .as_array()
            .unwrap()
            .iter()
            .map(|x| x.as_f64().unwrap())
            .collect();
        assert!(x.len() > 1 && x.is_sorted(), "{title}");
        assert!(plot["height"].as_u64().unwrap() > 100, "{title}");
        for series in plot["series"].as_array().unwrap() {
            let y = series["y"].as_array().unwrap();
            assert!(
                y.len() == x.len() && y.iter().any(serde_json::Value::is_number),
                "{title}"
            );
            if series["style"] == "bars" {
                assert_eq!(array(&series["bar"]), x.len(), "{title}");
            }
        }
    }
    plots
}

fn plot_titles<'a>(plots: &[&'a serde_json::Value]) -> Vec<&'a str> {
    plots.iter().filter_map(|p| p["title"].as_str()).collect()
}

fn data(page: &str) -> serde_json::Value {
    let (_, rest) = page.split_once("id=\"data\">").unwrap();
    let (json, _) = rest.split_once("</script>").unwrap();
    serde_json::from_str(json).unwrap()
}

#[test]
fn a_diagnosis_is_self_contained_and_complete() {
    let recordings = [recording_under(|q| 0.1 * q.sin())];
    let model = model("coulomb = 0.15\nviscous = \"?\"\n");
    let (bench, baseline) = identify(&recordings, &model, Options::default()).unwrap();
    let outcome = diagnose(&bench, &baseline, &recordings, &|_| {}).unwrap();
    let page = diagnosis(&outcome, None, &bench, &recordings).unwrap();
    assert_self_contained(&page);
    assert!(page.contains("<title>Diagnosis of A &amp; B&lt;/script&gt;</title>"));
    let data = data(&page);
    let titles: Vec<&str> = data["sections"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|s| s["title"].as_str())
        .collect();
    for title in [
        "Measured against simulated",
        "Residual torque",
        "Friction curve",
        "Findings",
        "Next experiment",
        "Parameters",
        "Method",
    ] {
        assert!(titles.contains(&title), "{title} is not among {titles:?}");
    }
    let plots = assert_sound(&data);
    let titles = plot_titles(&plots);
    for title in [
        "Position, restarted every 1 s",
        "Where the baseline predicts the held-out part worst",
        "Against time",
        "Against velocity",
        "Against position",
        "Resisting torque against velocity",
    ] {
        assert!(titles.contains(&title), "{title} is not among {titles:?}");
    }
    // The held-out part is shaded, and so is the located region against each coordinate.
    assert_eq!(plots[0]["bands"][0]["label"], "held out");
    for plot in plots.iter().filter(|p| {
        let title = p["title"].as_str().unwrap();
        title.starts_with("Against")
    }) {
        assert!(
            plot["bands"][0]["label"]
                .as_str()
                .unwrap()
                .ends_with("of the mismatch"),
            "{}",
            plot["title"]
        );
    }
    let points = data["verdict"]["points"].as_array().unwrap();
    assert_eq!(points.len(), outcome.diagnosis.findings.len());
    assert!(!points.is_empty());
    assert!(
        data["facts"][1][1]
            .as_str()
            .unwrap()
            .starts_with("a <b>{{script}}.csv: 24000 samples")
    );
    assert!(page.len() < 2_000_000, "{}", page.len());
}

#[test]
fn an_identification_shows_its_parameters_with_errors() {
    let recordings = [recording()];
    let (bench, identified) = identify(
        &recordings,
        &model("coulomb = \"?\"\nviscous = \"?\"\n"),
        Options::default(),
    )
    .unwrap();
    let page = identification(&identified, None, &[], &bench, &recordings).unwrap();
    assert_self_contained(&page);
    let data = data(&page);
    let rows = &data["sections"][0]["items"][0]["rows"];
    assert_eq!(rows[0][0], "inertia");
    let inertia = rows[0][1].as_str().unwrap();
    assert!(
        inertia.contains(" ± ") && inertia.ends_with("kg·m²"),
        "{inertia}"
    );
    assert!(data["verdict"].is_null());
    assert_sound(&data);
    // The friction curve runs through the truth at the highest speed within a few per cent.
    let plot = &data["sections"]
        .as_array()
        .unwrap()
        .iter()
        .find(|s| s["title"] == "Friction curve")
        .unwrap()["items"][0]["plots"][0];
    let series = plot["series"].as_array().unwrap();
    let curve = series.iter().find(|s| s["role"] == "after").unwrap()["y"]
        .as_array()
        .unwrap();
    let at = curve
        .iter()
        .rposition(serde_json::Value::is_number)
        .unwrap();
    let (v, torque) = (plot["x"][at].as_f64().unwrap(), curve[at].as_f64().unwrap());
    let factor = if plot["y_label"].as_str().unwrap().contains("[mN") {
        1e3
    } else {
        1.0
    };
    assert!(
        (torque / factor / (0.15 + 0.02 * v) - 1.0).abs() < 0.05,
        "{torque} at {v}"
    );
}

#[test]
fn values_from_the_whole_recordings_stand_beside_those_that_were_judged() {
    let recordings = [recording()];
    let asked = model("coulomb = \"?\"\nviscous = \"?\"\n");
    let (bench, identified) = identify(&recordings, &asked, Options::default()).unwrap();
    let all = bench.on_whole(&asked, Options::default()).unwrap();
    let all = all.fit(&asked, &recordings).unwrap().model;
    let page = identification(&identified, Some(&all), &[], &bench, &recordings).unwrap();
    let table = &data(&page)["sections"][0]["items"][1];
    let columns = ["Parameter", "Value", "From the whole recordings"];
    assert_eq!(table["columns"], serde_json::json!(columns));
    for row in table["rows"].as_array().unwrap() {
        assert_eq!(row.as_array().unwrap().len(), columns.len(), "{row}");
        assert_eq!(row[1] == row[2], row[0] == "gain", "{row}");
    }
}

#[test]
fn a_recording_of_velocity_alone_is_shown_as_velocity() {
    let mut recording = recording();
    let q = recording.q.take().unwrap();
    let slope = |k: usize| {
        let (a, b) = (k.saturating_sub(5), (k + 5).min(q.len() - 1));
        (q[b] - q[a]) / ((b - a) as f64 * 1e-3)
    };
    recording.v = Some((0..q.len()).map(slope).collect());
    let recordings = [recording];
    let (bench, identified) = identify(
        &recordings,
        &model("coulomb = \"?\"\nviscous = \"?\"\n"),
        Options::default(),
    )
    .unwrap();
    let data = data(&identification(&identified, None, &[], &bench, &recordings).unwrap());
    let plots = assert_sound(&data);
    assert_eq!(plot_titles(&plots)[0], "Velocity, restarted every 1 s");
    assert!(plots[0]["y_label"].as_str().unwrap().ends_with("rad/s]"));
}

#[test]
fn an_inverse_recording_is_shown_by_its_force() {
    let recordings = [recording()];
    let mut model = model("coulomb = \"?\"\nviscous = \"?\"\n");
    model.causality = Causality::Inverse;
    let (bench, identified) = identify(&recordings, &model, Options::default()).unwrap();
    let data = data(&identification(&identified, None, &[], &bench, &recordings).unwrap());
    let plots = assert_sound(&data);
    let titles = plot_titles(&plots);
    assert_eq!(titles[0], "Torque u along the measured motion");
    assert!(!titles.iter().any(|t| t.contains("free run")), "{titles:?}");
}

#[test]
fn two_recordings_have_plots_of_their_own() {
    let recordings = [recording(), recording()];
    let (bench, identified) = identify(
        &recordings,
        &model("coulomb = \"?\"\nviscous = \"?\"\n"),
        Options::default(),
    )
    .unwrap();
    let data = data(&identification(&identified, None, &[], &bench, &recordings).unwrap());
    let plots = assert_sound(&data);
    let runs = plot_titles(&plots).into_iter();
    assert_eq!(
        runs.filter(|t| t.starts_with("Position, restarted"))
            .count(),
        2
    );
}

#[test]
fn what_is_put_in_is_not_searched_for_names() {
    let text = fill("a {{x}} b {{y}} {{", |name| format!("<{name}:{{{{y}}}}>"));
    assert_eq!(text, "a <x:{{y}}> b <y:{{y}}> {{");
}

#[test]
fn json_cannot_end_its_script_element() {
    assert_eq!(
        escape_json("{\"a\":\"</script><!--\"}"),
        "{\"a\":\"\\u003c/script>\\u003c!--\"}"
    );
}
