//! Tests of whole pages.

use super::{diagnosis, escape_json, fill, identification};
use crate::diagnose::diagnose;
use crate::identify::identify;
use crate::model::Model;
use crate::recording::Recording;

/// A rotary axis under two sines of torque, integrated here in small steps; 1 kHz, 24 s, 16384 counts.
fn recording() -> Recording {
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
            let free = v + h / inertia * (drive(now) - viscous * v);
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
        v: None,
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

fn data(page: &str) -> serde_json::Value {
    let (_, rest) = page.split_once("id=\"data\">").unwrap();
    let (json, _) = rest.split_once("</script>").unwrap();
    serde_json::from_str(json).unwrap()
}

#[test]
fn a_diagnosis_is_self_contained_and_complete() {
    let recordings = [recording()];
    let model = model("coulomb = 0.15\nviscous = 0.0\n");
    let (bench, baseline) = identify(&recordings, &model).unwrap();
    let outcome = diagnose(&bench, &baseline, &recordings, &|_| {}).unwrap();
    let page = diagnosis(&outcome, &bench, &recordings).unwrap();
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
    let (bench, identified) =
        identify(&recordings, &model("coulomb = \"?\"\nviscous = \"?\"\n")).unwrap();
    let page = identification(&identified, &bench, &recordings).unwrap();
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
