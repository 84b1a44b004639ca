//! The shape of the project: data goes one way through the modules, and the top level stays short.

use std::fs;
use std::path::{Path, PathBuf};

/// What may lie at the top level, beside names that begin with a dot.
const TOP_LEVEL: [&str; 14] = [
    "CHANGELOG.md",
    "Cargo.lock",
    "Cargo.toml",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "README.md",
    "core",
    "firmware",
    "host",
    "memory.x",
    "rust-toolchain.toml",
    "tests",
    // Made by cargo and by `bristle demo`, and ignored by git.
    "target",
    "bristle-demo",
];

/// What separates modules on the line of a crate's documentation that lists them.
const ARROW: &str = " → ";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the host package lies in the workspace")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// All Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a readable folder");
    let paths = entries.map(|entry| entry.expect("a readable entry").path());
    paths
        .flat_map(|path| match path.extension() {
            _ if path.is_dir() => sources(&path),
            Some(extension) if extension == "rs" => vec![path],
            _ => Vec::new(),
        })
        .collect()
}

/// The modules of a crate in the order that its documentation gives, which must be those it declares.
fn order(lib: &str) -> Vec<&str> {
    let line = lib
        .lines()
        .filter_map(|line| line.strip_prefix("//! "))
        .find(|line| line.contains(ARROW))
        .expect("lib.rs lists the order of its modules");
    let order: Vec<&str> = line.split(ARROW).map(str::trim).collect();
    let mut declared: Vec<&str> = lib
        .lines()
        .filter_map(|line| line.strip_prefix("pub mod ").or(line.strip_prefix("mod ")))
        .map(|rest| rest.trim_end_matches(';'))
        .collect();
    let mut listed = order.clone();
    listed.sort_unstable();
    declared.sort_unstable();
    assert_eq!(listed, declared, "modules listed and modules declared");
    order
}

/// The modules at the root of the crate that a source text names as `crate::…`, alone or in braces.
fn uses(source: &str) -> Vec<String> {
    let code: String = source
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| [line, "\n"])
        .collect();
    code.split("crate::")
        .skip(1)
        .flat_map(|after| match after.strip_prefix('{') {
            None => vec![first_word(after)],
            Some(group) => heads(group),
        })
        .filter(|name| name.starts_with(|c: char| c.is_lowercase()))
        .collect()
}

fn first_word(text: &str) -> String {
    let word = |c: &char| c.is_alphanumeric() || *c == '_';
    text.trim_start().chars().take_while(word).collect()
}

/// The first word of each entry of a group, up to the brace that closes it.
fn heads(group: &str) -> Vec<String> {
    let mut heads = vec![first_word(group)];
    let mut depth = 0;
    for (k, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => heads.push(first_word(&group[k + 1..])),
            _ => {}
        }
    }
    heads
}

/// Uses that go against the order, as `user uses later`.
fn backward_uses(source_folder: &Path) -> Vec<String> {
    let lib = read(&source_folder.join("lib.rs"));
    let order = order(&lib);
    let place = |name: &str| order.iter().position(|module| *module == name);
    let mut found = Vec::new();
    for path in sources(source_folder) {
        let inside = path.strip_prefix(source_folder).expect("a file below");
        let first = inside.iter().next().and_then(|p| p.to_str());
        let module = first.unwrap_or_default().trim_end_matches(".rs");
        let Some(own) = place(module) else {
            assert!(["lib", "main"].contains(&module), "{module} is not listed");
            continue;
        };
        let text = read(&path);
        assert!(
            !text.contains("super::super"),
            "{}: write crate::",
            inside.display()
        );
        for used in uses(&text) {
            if place(&used).is_none_or(|place| place > own) {
                found.push(format!("{} uses {used}", inside.display()));
            }
        }
    }
    found
}

#[test]
fn modules_use_only_those_before_them() {
    for package in ["core", "host"] {
        let backward = backward_uses(&root().join(package).join("src"));
        assert!(backward.is_empty(), "{package}: {backward:#?}");
    }
}

#[test]
fn every_way_to_name_a_module_is_seen() {
    let text = "use crate::fit;\n// crate::report\nuse crate::{model::{Law, Model}, weak, Scalar};\nlet x = crate::cli::run();";
    assert_eq!(uses(text), ["fit", "model", "weak", "cli"]);
}

#[test]
fn a_use_against_the_order_is_found() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text);
    write("lib.rs", "//! early → late\nmod early;\nmod late;\n").expect("writes");
    write("early.rs", "use crate::late::Thing;\n").expect("writes");
    write("late.rs", "use crate::early::Other;\n").expect("writes");
    assert_eq!(backward_uses(folder.path()), ["early.rs uses late"]);
}

#[test]
fn the_top_level_holds_only_what_belongs_there() {
    let entries = fs::read_dir(root()).expect("a readable folder");
    for entry in entries {
        let name = entry.expect("a readable entry").file_name();
        let name = name.to_string_lossy();
        assert!(
            name.starts_with('.') || TOP_LEVEL.contains(&&*name),
            "{name} does not belong at the top level"
        );
    }
}
