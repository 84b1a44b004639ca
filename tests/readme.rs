//! What the README says is so.

mod cli;

use std::path::Path;

use bristle::effects;
use bristle::model::Model;
use cli::{Folder, PLAIN, csv, record};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the host package lies in the workspace")
}

fn readme() -> String {
    std::fs::read_to_string(root().join("README.md")).expect("there is a README")
}

/// The text between the first occurrence of `from` and the next one of `to`.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let after = text.split_once(from).unwrap_or_else(|| panic!("no {from}"));
    let inside = after.1.split_once(to).unwrap_or_else(|| panic!("no {to}"));
    inside.0
}

/// The words in back quotes.
fn quoted(text: &str) -> Vec<&str> {
    text.split('`').skip(1).step_by(2).collect()
}

#[test]
fn the_lists_of_effects_are_those_of_the_catalogue() {
    let readme = readme();
    let built_in: Vec<&str> = effects::ALL.iter().map(|e| e.id()).collect();
    let listed = between(&readme, "## What it looks for\n", ", on top of");
    assert_eq!(quoted(listed), built_in);
}

#[test]
fn the_model_file_is_a_model() {
    let readme = readme();
    let model = Model::parse(between(&readme, "```toml\n", "```")).expect("the example parses");
    assert_eq!(model.columns["u"], "torque_cmd");
}

#[test]
fn the_commands_run_on_a_recording_of_that_form() {
    let readme = readme();
    let folder = Folder::new();
    folder.write("axis.toml", between(&readme, "```toml\n", "```"));
    for (name, seed) in [("run.csv", 1), ("other.csv", 2)] {
        let recording = csv(&record(PLAIN, 8.0, seed));
        folder.write(name, recording.replacen("u[N*m]", "torque_cmd[N*m]", 1));
    }
    let block = between(&readme, "```sh\nbristle ", "```");
    let lines: Vec<&str> = block.split("\nbristle ").collect();
    assert_eq!(lines.len(), 5);
    for line in lines {
        folder.done(line.split('#').next().unwrap_or_default());
    }
}

#[test]
fn the_files_it_names_are_there() {
    let readme = readme();
    let links = readme
        .split("](")
        .skip(1)
        .filter_map(|l| l.split(')').next());
    let mut files: Vec<&str> = links.filter(|link| !link.contains("://")).collect();
    files.extend([".ci/test", ".ci/run", "host/examples/picture.rs"]);
    assert!(files.len() >= 6, "{files:?}");
    for file in files {
        assert!(root().join(file).is_file(), "{file}");
    }
}

#[test]
fn the_two_commands_come_first() {
    let readme = readme();
    let block = between(&readme, "```sh\n", "```");
    let commands: Vec<&str> = block
        .lines()
        .filter_map(|line| line.split('#').next())
        .map(str::trim)
        .collect();
    assert_eq!(commands, ["cargo run --release -- demo", "sh .ci/test"]);
}
