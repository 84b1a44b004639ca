//! Recordings as other programs write them: Parquet by pyarrow, MATLAB level 5 by `SciPy`, and a published `.mat` file.

mod cli;

use std::path::{Path, PathBuf};

use bristle::model::Columns;
use bristle::motion::Motion;
use bristle::recording::Recording;
use cli::real;

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../tests/formats")
        .join(name)
}

fn read(name: &str) -> Recording {
    Recording::read(&sample(name), &Columns::new(), Motion::Rotary).expect(name)
}

fn message(path: &Path) -> String {
    Recording::read(path, &Columns::new(), Motion::Rotary)
        .expect_err("not a recording")
        .to_string()
}

#[test]
fn every_format_gives_the_same_recording() {
    let text = read("table.csv");
    assert_eq!(text.len(), 400);
    for name in ["pyarrow.parquet", "scipy.mat"] {
        let other = read(name);
        assert_eq!(text.t, other.t, "{name}");
        assert_eq!(text.u, other.u, "{name}");
        assert_eq!(text.q, other.q, "{name}");
    }
}

#[test]
fn a_missing_value_is_named_by_line_and_column() {
    let text = message(&sample("gap.parquet"));
    assert!(
        text.contains("gap.parquet: line 101, column u[N*m]: the value is missing"),
        "{text}"
    );
}

#[test]
fn a_file_that_is_not_what_its_name_says_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, says) in [
        ("run.parquet", "not a readable Parquet file"),
        ("run.mat", "not a readable MATLAB level-5 file"),
    ] {
        let path = folder.path().join(name);
        std::fs::copy(sample("table.csv"), &path).expect("copies");
        let text = message(&path);
        assert!(text.contains(says) && text.lines().count() == 1, "{text}");
        assert!(message(&folder.path().join("none").join(name)).contains("none"));
    }
}

/// The published recording in its own format and as CSV hold the same signals.
#[test]
fn the_published_mat_file_is_read() {
    let published = real("emps/DATA_EMPS.mat").zip(real("emps/emps_est.csv"));
    let Some((mat, csv)) = published else {
        return;
    };
    let columns = Columns::from([
        ("u".to_owned(), "vir".to_owned()),
        ("q".to_owned(), "qm".to_owned()),
    ]);
    let mat = Recording::read(&mat, &columns, Motion::Linear).unwrap();
    let csv = Recording::read(&csv, &Columns::new(), Motion::Linear).unwrap();
    assert_eq!(mat.len(), 24841);
    // The CSV was rounded to twelve digits.
    let close = |a: &[f64], b: &[f64]| {
        a.iter()
            .zip(b)
            .all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + a.abs()))
    };
    assert!(close(&mat.u, &csv.u) && close(&mat.t, &csv.t));
    assert!(close(mat.measured(), csv.measured()));
}
