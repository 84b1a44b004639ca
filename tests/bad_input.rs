//! Unusable input gets one clear message and status 2, and leaves every file as it was; usable input of every
//! promised form is read.

mod cli;

use std::fmt::Write;

use cli::{Folder, PLAIN, Sample, csv, record};

/// Long enough for every command to succeed, if nothing were wrong.
const SECONDS: f64 = 8.0;

/// The three verbs that read recordings, each asked for all it can write.
fn verbs(recording: &str, model: &str) -> [String; 3] {
    [
        format!(
            "identify {recording} --model {model} --model-out out.toml --json out.json --report out.html"
        ),
        format!(
            "diagnose {recording} --model {model} --model-out out.toml --json out.json --report out.html"
        ),
        format!("simulate --input {recording} --model {model} --out out.csv"),
    ]
}

/// Asserts that a command line is refused with one message that contains all of `parts`, and touches no file.
fn refused(folder: &Folder, line: &str, parts: &[&str]) {
    let before = folder.files();
    let ran = folder.run(line);
    assert_eq!(ran.status, 2, "bristle {line}: {ran:?}");
    assert_eq!(ran.stdout, "", "bristle {line}");
    assert_eq!(ran.stderr.matches("error:").count(), 1, "{}", ran.stderr);
    assert_eq!(ran.stderr.trim_end().lines().count(), 1, "{}", ran.stderr);
    for part in parts {
        assert!(
            ran.stderr.contains(part),
            "{part:?} is not in: {}",
            ran.stderr
        );
    }
    assert!(folder.files() == before, "bristle {line} changed a file");
}

/// Asserts that all verbs refuse a recording, with output files there and without.
fn bad_recording(content: impl AsRef<[u8]>, parts: &[&str]) {
    let folder = Folder::new();
    folder.write("axis.toml", complete());
    folder.write("bad.csv", content);
    let parts: Vec<&str> = [&["bad.csv"], parts].concat();
    for line in verbs("bad.csv", "axis.toml") {
        refused(&folder, &line, &parts);
    }
    for name in ["out.toml", "out.json", "out.html", "out.csv"] {
        folder.write(name, "what was here before");
    }
    for line in verbs("bad.csv", "axis.toml") {
        refused(&folder, &line, &parts);
    }
}

/// A model that every verb takes: it has values, some of them estimates.
fn complete() -> String {
    PLAIN.replace("inertia = 0.012", "inertia = { value = 0.012, se = 0.001 }")
}

fn samples() -> Vec<Sample> {
    record(PLAIN, SECONDS, 1)
}

/// A good recording with the text of one row replaced; rows count from 1, as lines do, the header being 1.
fn with_row(line: usize, row: &str) -> String {
    let text = csv(&samples());
    let rows = text
        .lines()
        .enumerate()
        .map(|(k, old)| if k + 1 == line { row } else { old });
    rows.flat_map(|row| [row, "\n"]).collect()
}

#[test]
fn a_good_recording_is_taken_by_every_verb() {
    // The refusals of the other tests mean nothing if this fails.
    let folder = Folder::with(PLAIN, SECONDS);
    folder.write("axis.toml", complete());
    for line in verbs("run.csv", "axis.toml") {
        folder.done(&line);
    }
}

#[test]
fn missing_columns() {
    bad_recording(
        csv(&samples()).replacen("u[N*m]", "torque", 1),
        &["line 1", "column u", "torque", "[columns]"],
    );
    bad_recording(
        csv(&samples()).replacen("t[s]", "clock", 1),
        &["line 1", "column t"],
    );
    bad_recording(
        csv(&samples()).replacen("q[rad]", "angle", 1),
        &["line 1", "column q", "(or v)"],
    );
    let headless = csv(&samples());
    let headless = headless.split_once('\n').expect("a header").1;
    bad_recording(
        headless,
        &["line 1", "the first line must name the columns"],
    );
}

#[test]
fn columns_named_twice() {
    bad_recording(
        csv(&samples()).replacen("q[rad]", "u[N]", 1),
        &["line 1", "column u", "2 columns"],
    );
}

#[test]
fn cells_that_are_no_numbers() {
    for (cell, said) in [
        ("NaN", "NaN is not a finite number"),
        ("nan", "nan is not a finite number"),
        ("inf", "inf is not a finite number"),
        ("-Infinity", "-Infinity is not a finite number"),
        ("1e999", "1e999 is not a finite number"),
        ("abc", "\"abc\" is not a number"),
        ("9.9e37", "9.9e37 is beyond anything an axis does"),
        ("1.2.3", "\"1.2.3\" is not a number"),
        ("0x10", "\"0x10\" is not a number"),
        ("", "the cell is empty"),
    ] {
        bad_recording(
            with_row(1234, &format!("2.464,{cell},0.1")),
            &["line 1234, column u[N*m]", said],
        );
    }
    bad_recording(with_row(77, "x,0,0"), &["line 77, column t[s]"]);
    bad_recording(with_row(78, "0.152,0,?"), &["line 78, column q[rad]"]);
}

#[test]
fn the_line_is_right_behind_comments_and_empty_lines() {
    let text = with_row(300, "\n# a remark\n\n0.596,wrong,0.1");
    bad_recording(text, &["line 303, column u[N*m]"]);
    let text = format!("# made by a logger\n\n{}", with_row(300, "0.596,wrong,0.1"));
    bad_recording(text, &["line 302, column u[N*m]"]);
}

#[test]
fn time_that_does_not_increase() {
    let backwards = with_row(900, "0.5,0.1,0.1");
    bad_recording(backwards, &["line 900, column t[s]", "does not increase"]);
    let t = samples()[898].t;
    let repeated = with_row(901, &format!("{t:?},0.1,0.1"));
    bad_recording(repeated, &["line 901, column t[s]", "does not increase"]);
}

#[test]
fn clocks_that_were_set() {
    let mut samples = samples();
    samples[1000..].iter_mut().for_each(|s| s.t += 1.7e9);
    bad_recording(csv(&samples), &["line 1002, column t", "time jumps"]);
}

#[test]
fn constant_columns() {
    let mut constant = samples();
    constant.iter_mut().for_each(|s| s.u = 0.25);
    bad_recording(csv(&constant), &["lines 2 to 4001, column u", "0.25"]);
    let mut still = samples();
    still.iter_mut().for_each(|s| s.q = 0.25);
    bad_recording(csv(&still), &["lines 2 to 4001, column q", "did not move"]);
}

#[test]
fn too_few_samples() {
    bad_recording(csv(&samples()[..199]), &["line 200", "199 samples", "200"]);
    bad_recording(csv(&[]), &["line 1", "0 samples"]);
    // 200 samples may still hold too little motion, but they are no longer too few.
    let folder = Folder::new();
    folder.write("axis.toml", complete());
    folder.write("run.csv", csv(&samples()[..200]));
    folder.done("simulate --input run.csv --model axis.toml --out out.csv");
}

#[test]
fn ragged_rows() {
    bad_recording(
        with_row(50, "0.096,0.1"),
        &["line 50, column q[rad]", "2 cells"],
    );
    bad_recording(
        with_row(50, "0.096,0.1,0.2,9"),
        &["line 50", "4 cells", "3 columns"],
    );
    // Decimal commas between commas shift every value by a column.
    bad_recording(
        with_row(50, "0,096,0,1,0,2"),
        &["line 50", "6 cells", "decimal points"],
    );
}

#[test]
fn unknown_units() {
    bad_recording(
        csv(&samples()).replacen("q[rad]", "q[furlong]", 1),
        &["line 1, column q[furlong]", "rad", "deg"],
    );
    bad_recording(
        csv(&samples()).replacen("q[rad]", "q[mm]", 1),
        &["line 1, column q[mm]", "rotary"],
    );
}

#[test]
fn files_that_are_no_recordings() {
    bad_recording("", &["line 1", "the file is empty"]);
    bad_recording("\n\n", &["line 1", "the file is empty"]);
    bad_recording(
        [0x7F, b'E', b'L', b'F', 2, 1, 1, 0, 0xFF],
        &["line 1", "not text"],
    );
    bad_recording([b't', b'\n', 0xFF, 0xFE, b'\n'], &["line 2", "not text"]);
    let utf_16: Vec<u8> = csv(&samples())
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    bad_recording(utf_16, &["line 1", "not text"]);
    bad_recording("{\"t\": [1, 2, 3]}\n", &["line 1", "column t"]);
}

#[test]
fn files_that_cannot_be_read() {
    let folder = Folder::with(PLAIN, SECONDS);
    folder.write("axis.toml", complete());
    std::fs::create_dir(folder.path("folder")).expect("a folder");
    for line in verbs("absent.csv", "axis.toml") {
        refused(&folder, &line, &["absent.csv", "cannot be read"]);
    }
    for line in verbs("folder", "axis.toml") {
        refused(&folder, &line, &["folder", "cannot be read"]);
    }
    for line in verbs("run.csv", "absent.toml") {
        refused(&folder, &line, &["absent.toml", "cannot be read"]);
    }
    for line in verbs("run.csv", "folder") {
        refused(&folder, &line, &["folder", "cannot be read"]);
    }
    for name in ["run.mat", "run.parquet"] {
        for line in verbs(name, "axis.toml") {
            refused(&folder, &line, &[name, "cannot be read"]);
        }
    }
    // One bad recording among good ones stops everything.
    folder.write("bad.csv", with_row(9, "0.014,x,0"));
    for line in verbs("run.csv bad.csv", "axis.toml").iter().take(2) {
        refused(&folder, line, &["bad.csv", "line 9"]);
    }
}

/// Asserts that the verbs that fit refuse a model, and name file and line.
fn bad_model(model: &str, parts: &[&str]) {
    let folder = Folder::with(PLAIN, SECONDS);
    folder.write("axis.toml", model);
    let parts: Vec<&str> = [&["axis.toml"], parts].concat();
    for line in verbs("run.csv", "axis.toml") {
        refused(&folder, &line, &parts);
    }
}

#[test]
fn model_files() {
    let good = complete();
    bad_model("[plant\nmotion = 1", &["line 1, column", "not valid TOML"]);
    bad_model(
        &format!("{good}\nx = = 1"),
        &["line 8, column 5", "not valid TOML"],
    );
    bad_model(
        &format!("{good}mass = 1"),
        &["line 7", "\"mass\"", "[friction]"],
    );
    bad_model(&format!("{good}[plan]"), &["line 7", "\"plan\""]);
    bad_model(
        &format!("{good}[effects.strybeck]"),
        &["line 7", "strybeck", "is not an effect", "stribeck"],
    );
    bad_model(
        &format!("{good}[effects.gremlins]"),
        &["line 7", "gremlins", "is not an effect"],
    );
    bad_model(
        &format!("{good}[effects.gravity]\nmass = 1"),
        &["line 8", "\"mass\"", "amplitude"],
    );
    bad_model(
        &good.replace("coulomb = 0.12", "coulomb = \"big\""),
        &["line 5", "friction.coulomb", "\"?\""],
    );
    bad_model(
        &good.replace("coulomb = 0.12", "coulomb = nan"),
        &["line 5", "friction.coulomb"],
    );
    bad_model(
        &good.replace(
            "inertia = { value = 0.012, se = 0.001 }",
            "inertia = -0.012",
        ),
        &["line 3", "plant.inertia", "positive"],
    );
    bad_model(
        &good.replace("se = 0.001", "max = -0.001"),
        &["line 3", "plant.inertia", "positive"],
    );
    bad_model(
        &good.replace("coulomb = 0.12", "coulomb = -0.12"),
        &["line 5", "friction.coulomb", "negative"],
    );
    bad_model(&format!("name = 5\n{good}"), &["line 1", "name", "quotes"]);
    bad_model(
        &good.replace("rotary", "round"),
        &["line 2", "plant.motion", "linear"],
    );
    bad_model(
        &good.replace("motion = \"rotary\"\n", ""),
        &["line 1", "plant.motion"],
    );
    bad_model("", &["[plant]", "missing"]);
    bad_model(
        &good.replace("[friction]", "[friction]\nmodel = \"lugree\""),
        &["line 5", "friction.model", "stribeck"],
    );
}

#[test]
fn a_recording_in_the_place_of_a_model() {
    let folder = Folder::with(PLAIN, SECONDS);
    for line in verbs("run.csv", "run.csv") {
        refused(
            &folder,
            &line,
            &["run.csv", "by its name this is a recording"],
        );
    }
}

#[test]
fn mapped_columns_that_are_not_there() {
    let folder = Folder::with(PLAIN, SECONDS);
    folder.write("axis.toml", complete() + "[columns]\nu = \"vir\"\n");
    for line in verbs("run.csv", "axis.toml") {
        refused(
            &folder,
            &line,
            &["run.csv", "line 1, column vir", "maps u", "u[N*m]"],
        );
    }
}

#[test]
fn models_that_no_recording_can_determine() {
    let folder = Folder::with(PLAIN, SECONDS);
    let both = cli::BASELINE.replace("gain    = 1.0", "gain    = \"?\"");
    folder.write("both.toml", both);
    for line in verbs("run.csv", "both.toml").iter().take(2) {
        refused(
            &folder,
            line,
            &[
                "run.csv",
                "both.toml",
                "plant.gain and plant.inertia are both unknown",
            ],
        );
    }
    // `simulate` wants every value.
    let line = "simulate --input run.csv --model axis.toml --out out.csv";
    refused(&folder, line, &["axis.toml", "plant.inertia", "identify"]);
    // What no fit estimates has to be written.
    for (key, part) in [
        ("back_emf", "viscous friction holds both"),
        ("electrical_time_constant", "names the lag"),
    ] {
        let driven = format!("input = \"voltage\"\n{key} = \"?\"\n[friction]");
        folder.write("motor.toml", PLAIN.replace("[friction]", &driven));
        let parts = ["motor.toml", &format!("plant.{key}"), part];
        for verb in ["identify", "diagnose", "dbi"] {
            refused(
                &folder,
                &format!("{verb} run.csv --model motor.toml"),
                &parts,
            );
        }
    }
    let spring = "[plant]\nmotion = \"linear\"\nkind = \"mass-spring\"\ninertia = 1\n[friction]\ncoulomb = 1\nviscous = 0\n";
    folder.write("spring.toml", spring);
    let line = "simulate --excite chirp --amplitude 1 --model spring.toml --out out.csv";
    let parts = ["spring.toml", "plant.stiffness; write a number"];
    refused(&folder, line, &parts);
}

#[test]
fn outputs_that_cannot_be_written() {
    let folder = Folder::with(PLAIN, SECONDS);
    folder.write("axis.toml", complete());
    folder.write("a_file", "x");
    std::fs::create_dir(folder.path("a_folder")).expect("a folder");
    for bad in ["absent/out", "a_folder", "a_file/out"] {
        for verb in ["identify", "diagnose"] {
            for option in ["--model-out", "--json", "--report"] {
                // The other outputs are fine, and must not be written either.
                let mut line = format!("{verb} run.csv --model axis.toml {option} {bad}");
                for other in ["--model-out", "--json", "--report"] {
                    if other != option {
                        let _ = write!(line, " {other} fine{other}");
                    }
                }
                refused(&folder, &line, &[bad, "cannot be written"]);
            }
        }
        let line = format!("simulate --input run.csv --model axis.toml --out {bad}");
        refused(&folder, &line, &[bad, "cannot be written"]);
    }
    refused(
        &folder,
        "identify run.csv --model axis.toml --json absent/out",
        &["there is no folder absent"],
    );
    refused(
        &folder,
        "identify run.csv --model axis.toml --json run.csv",
        &["run.csv", "is an input"],
    );
    refused(
        &folder,
        "diagnose run.csv --model axis.toml --json out --report ./out",
        &["out", "two outputs"],
    );
}

#[test]
#[cfg(unix)]
fn outputs_keep_what_they_are() {
    use std::os::unix::fs::{FileTypeExt, PermissionsExt};
    let folder = Folder::with(PLAIN, SECONDS);
    folder.write("target.json", "before");
    let path = folder.path("target.json");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).expect("permissions");
    std::os::unix::fs::symlink("target.json", folder.path("link.json")).expect("a link");
    folder.done("identify run.csv --model axis.toml --json link.json --model-out /dev/null");
    assert!(folder.path("link.json").is_symlink());
    assert!(
        folder
            .read("target.json")
            .contains("bristle.identification/1")
    );
    let mode = path.metadata().expect("a file").permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    let null = std::fs::metadata("/dev/null").expect("a device");
    assert!(null.file_type().is_char_device());
}

#[test]
fn arguments() {
    let folder = Folder::with(PLAIN, SECONDS);
    for line in [
        "",
        "diagnoze",
        "diagnose",
        "diagnose run.csv",
        "diagnose run.csv --model axis.toml --jsn x",
        "identify --model axis.toml",
        "simulate --model axis.toml --input run.csv",
        "simulate --model axis.toml --input run.csv --out o.csv --horizon soon",
        "simulate --model axis.toml --input run.csv --out o.csv --horizon 0",
        "simulate --model axis.toml --input run.csv --out o.csv --horizon -1",
        "simulate --model axis.toml --input run.csv --out o.csv --horizon nan",
        "explain no-such-effect",
        "explain stribeck gravity",
    ] {
        let before = folder.files();
        let ran = folder.run(line);
        assert_eq!((ran.status, ran.stdout.as_str()), (2, ""), "bristle {line}");
        assert!(!ran.stderr.is_empty(), "bristle {line}");
        assert!(folder.files() == before, "bristle {line} changed a file");
    }
}

/// Parameters that `identify` finds in a recording, with a model that ends in `columns`.
fn identified(recording: impl AsRef<[u8]>, columns: &str) -> [f64; 3] {
    let folder = Folder::new();
    folder.write("run.csv", recording);
    folder.write("axis.toml", format!("{}{columns}", cli::BASELINE));
    folder.done("identify run.csv --model axis.toml --json out.json");
    let json = folder.json("out.json");
    ["inertia", "coulomb", "viscous"].map(|name| {
        json["parameters"][name]["value"]
            .as_f64()
            .unwrap_or_else(|| panic!("no {name} in {json}"))
    })
}

/// A recording with its own header, one row for each sample.
fn table(header: &str, row: impl Fn(&Sample) -> String) -> String {
    let rows: String = samples().iter().map(|s| row(s) + "\n").collect();
    format!("{header}\n{rows}")
}

#[test]
fn every_promised_form_reads_the_same() {
    let expected = identified(csv(&samples()), "");
    let same = |recording: &[u8], columns: &str, what: &str| {
        let found = identified(recording, columns);
        for (found, expected) in found.iter().zip(expected) {
            // Conversion of units rounds in the last place; nothing else may differ.
            assert!(
                (found / expected - 1.0).abs() < 1e-6,
                "{what}: {found} and {expected}"
            );
        }
    };
    let plain = csv(&samples());
    same(plain.replace(',', ";").as_bytes(), "", "semicolons");
    same(plain.replace(',', "\t").as_bytes(), "", "tabs");
    same(
        plain.replace(',', " , ").as_bytes(),
        "",
        "spaces around cells",
    );
    same(
        plain.replace('\n', "\r\n").as_bytes(),
        "",
        "Windows line ends",
    );
    same(format!("\u{feff}{plain}").as_bytes(), "", "byte order mark");
    same(plain.trim_end().as_bytes(), "", "no line end at the end");
    same(
        plain.replace('\n', ",\n").as_bytes(),
        "",
        "delimiter at the line end",
    );
    same(
        format!("# logger; v2\n{plain}\n# end\n").as_bytes(),
        "",
        "comments",
    );
    same(
        plain.replace(',', ";").replace('.', ",").as_bytes(),
        "",
        "decimal commas",
    );
    same(
        table("t[ms],u[mN*m],q[deg]", |s| {
            format!("{:?},{:?},{:?}", 1e3 * s.t, 1e3 * s.u, s.q.to_degrees())
        })
        .as_bytes(),
        "",
        "other units",
    );
    same(
        table("note,q[rev],temp,u,t,i", |s| {
            format!(
                "\"warm, \"\"up\"\"\",{:?},,{:?},{:?},n/a",
                s.q / std::f64::consts::TAU,
                s.u,
                s.t
            )
        })
        .as_bytes(),
        "",
        "unused columns with text, in another order",
    );
    same(
        table("clock,vir,qm,u", |s| {
            format!("{:?},{:?},{:?},7", s.t, s.u, s.q)
        })
        .as_bytes(),
        "[columns]\nt = \"clock\"\nu = \"vir\"\nq = \"qm\"\n",
        "mapped columns",
    );
    same(
        table("t,u[N*m],u[N],q", |s| {
            format!("{:?},{:?},1,{:?}", s.t, s.u, s.q)
        })
        .as_bytes(),
        "[columns]\nu = \"u[N*m]\"\n",
        "a name with its unit picks the column",
    );
}

/// Time only enters through differences; its offset costs some digits of them.
#[test]
fn time_need_not_start_at_zero() {
    let expected = identified(csv(&samples()), "");
    let shifted = table("t,u,q", |s| format!("{:?},{:?},{:?}", s.t + 1e4, s.u, s.q));
    for (found, expected) in identified(shifted, "").iter().zip(expected) {
        assert!(
            (found / expected - 1.0).abs() < 1e-3,
            "{found} and {expected}"
        );
    }
}

/// 5 % of the sampling interval, as a loaded logger would have it. The parameters are those of the axis within
/// 5 %, about five times what the noise of the recording does to them.
#[test]
fn jittered_time_is_taken() {
    let jittered = table("t,u,q", |s| {
        let jitter = 1e-4 * (1234.5 * s.t).sin();
        format!("{:?},{:?},{:?}", s.t + jitter, s.u, s.q)
    });
    for (found, truth) in identified(jittered, "").iter().zip([0.012, 0.12, 0.02]) {
        assert!((found / truth - 1.0).abs() < 0.05, "{found} and {truth}");
    }
}

/// Velocity alone is enough, in any of its units.
#[test]
fn velocity_alone_is_taken() {
    let samples = samples();
    let mut text = String::from("t,u,v[rpm]\n");
    for [before, now, after] in samples.array_windows() {
        let v = (after.q - before.q) / (after.t - before.t);
        let rpm = v * 60.0 / std::f64::consts::TAU;
        let _ = writeln!(text, "{:?},{:?},{rpm:?}", now.t, now.u);
    }
    for (found, truth) in identified(text, "").iter().zip([0.012, 0.12, 0.02]) {
        assert!((found / truth - 1.0).abs() < 0.05, "{found} and {truth}");
    }
}
