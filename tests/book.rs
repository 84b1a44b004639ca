//! The book as it is written: its links lead somewhere, its commands run, and its reference is what the program says.
// Elsewhere the program has no emulator, and its reference is shorter.
#![cfg(unix)]

mod cli;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use cli::Folder;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the host package lies in the workspace")
}

fn book() -> PathBuf {
    root().join("host/book/src")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// All Markdown files below a folder.
fn pages(folder: &Path) -> BTreeSet<PathBuf> {
    let entries = fs::read_dir(folder).expect("a readable folder");
    let paths = entries.map(|entry| entry.expect("a readable entry").path());
    paths
        .flat_map(|path| match path.extension() {
            _ if path.is_dir() => pages(&path),
            Some(extension) if extension == "md" => BTreeSet::from([path]),
            _ => BTreeSet::new(),
        })
        .collect()
}

/// A block of code: its language, its text, and the file that it is to be saved as, if the page says so.
#[derive(Debug, PartialEq)]
struct Block {
    language: String,
    text: String,
    file: Option<String>,
}

fn blocks(page: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut file = None;
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        if let Some(name) = line.strip_prefix("<!-- file: ") {
            file = name.strip_suffix(" -->").map(str::to_owned);
        } else if let Some(language) = line.strip_prefix("```") {
            let body = lines.by_ref().take_while(|line| *line != "```");
            blocks.push(Block {
                language: language.to_owned(),
                text: body.flat_map(|line| [line, "\n"]).collect(),
                file: file.take(),
            });
        }
    }
    blocks
}

/// What links of a page lead to, without code blocks, which hold brackets of their own.
fn links(page: &str) -> Vec<String> {
    let mut inside = false;
    let prose: String = page
        .lines()
        .filter(|line| {
            inside ^= line.starts_with("```");
            !inside
        })
        .flat_map(|line| [line, "\n"])
        .collect();
    let targets = prose.split("](").skip(1);
    let targets = targets.filter_map(|rest| rest.split(')').next());
    targets.map(str::to_owned).collect()
}

/// A line with every number replaced, as values move a little when the estimation gets better.
fn shape(line: &str) -> String {
    let mut shape = String::new();
    for c in line.chars() {
        let in_number = c.is_ascii_digit() || c == '.';
        if !in_number {
            shape.push(c);
        } else if !shape.ends_with('#') {
            shape.push('#');
        }
    }
    shape
}

#[test]
fn the_summary_lists_every_page_once() {
    let listed = links(&read(&book().join("SUMMARY.md")));
    let mut files: Vec<PathBuf> = listed.iter().map(|link| book().join(link)).collect();
    files.push(book().join("SUMMARY.md"));
    files.sort();
    let pages: Vec<PathBuf> = pages(&book()).into_iter().collect();
    assert!(pages.len() > 15, "{pages:?}");
    assert_eq!(files, pages);
}

#[test]
fn links_lead_to_files() {
    let mut all = pages(&book());
    all.insert(root().join(".github/CONTRIBUTING.md"));
    let mut followed = 0;
    for page in all {
        for link in links(&read(&page)) {
            if link.contains("://") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = match file {
                "" => page.clone(),
                _ => page.parent().expect("a folder").join(file),
            };
            assert!(target.is_file(), "{}: {link}", page.display());
            let heading = format!("\n## {anchor}\n");
            let is_there = anchor.is_empty() || read(&target).contains(&heading);
            assert!(is_there, "{}: {link}", page.display());
            followed += 1;
        }
    }
    assert!(followed > 60, "only {followed} links were found");
}

#[test]
fn the_reference_is_what_the_program_says() {
    let folder = Folder::new();
    folder.done("man --markdown .");
    for name in ["commands.md", "effects.md", "faults.md"] {
        let kept = read(&book().join("reference").join(name));
        assert!(
            kept == folder.read(name),
            "{name} is out of date: cargo run --release -- man --markdown host/book/src/reference"
        );
    }
}

#[test]
fn commands_run_in_the_order_of_their_page() {
    let mut ran = 0;
    for page in pages(&book()) {
        let folder = Folder::new();
        let mut said = BTreeSet::new();
        for block in blocks(&read(&page)) {
            let text = block.text.as_str();
            if let Some(file) = block.file {
                folder.write(&file, text);
            } else if block.language == "sh" {
                for line in text.lines() {
                    let rest = line.strip_prefix("bristle ");
                    let rest = rest.unwrap_or_else(|| panic!("{}: {line}", page.display()));
                    // The page says that this gives the same bytes, and it needs no emulator.
                    let on_host = if rest.starts_with("emulate ") {
                        " --on-host"
                    } else {
                        ""
                    };
                    let output = folder.done(&format!("{rest}{on_host}"));
                    said.extend(output.lines().map(shape));
                    ran += 1;
                }
            } else if block.language == "text" && !page.ends_with("reference/commands.md") {
                for line in text.lines() {
                    assert!(said.contains(&shape(line)), "nothing printed: {line}");
                }
            }
        }
        if page.ends_with("tutorial.md") {
            let error = |file| {
                folder.json(file)["tracking"]["rms"]
                    .as_f64()
                    .expect("a number")
            };
            let (plain, compensated) = (error("plain.json"), error("compensated.json"));
            assert!(compensated < 0.1 * plain, "{plain} and {compensated}");
        }
    }
    assert!(ran >= 8, "only {ran} commands were run");
}

/// Options on a command line.
fn options(line: &str) -> Vec<&str> {
    let words = line.split_whitespace();
    words.filter(|word| word.starts_with("--")).collect()
}

#[test]
fn commands_that_are_not_run_have_the_options_they_show() {
    let folder = Folder::new();
    let mut seen = 0;
    for page in pages(&book()) {
        let shown = blocks(&read(&page));
        let lines = shown.iter().filter(|b| b.language == "console");
        for line in lines.flat_map(|block| block.text.lines()) {
            if let Some((_, rest)) = line
                .split_once("bristle ")
                .filter(|_| !line.contains("cargo"))
            {
                let verb = rest.split_whitespace().next().expect("a verb");
                let help = folder.done(&format!("{verb} --help"));
                for option in options(rest) {
                    assert!(help.contains(option), "{line}");
                }
                seen += 1;
            }
            if let Some((_, rest)) = line.split_once("--example ") {
                let name = rest.split_whitespace().next().expect("a name");
                let manifest = read(&root().join("host/Cargo.toml"));
                let file = root().join("host/examples").join(format!("{name}.rs"));
                let declared = manifest.contains(&format!("name = \"{name}\""));
                assert!(declared || file.is_file(), "{line}");
                seen += 1;
            }
        }
    }
    assert!(seen >= 8, "only {seen} lines were looked at");
}

#[test]
fn there_is_a_man_page_for_every_command() {
    let folder = Folder::new();
    let before = folder.run("man nowhere");
    assert_eq!(before.status, 2);
    assert!(before.stderr.contains("nowhere: there is no such folder"));
    folder.done("man .");
    let help = folder.done("--help");
    let (_, verbs) = help.split_once("Commands:\n").expect("commands");
    let (verbs, _) = verbs.split_once("\n\n").expect("options behind them");
    let verbs: BTreeSet<String> = verbs
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|verb| *verb != "help")
        .map(|verb| format!("bristle-{verb}.1"))
        .collect();
    assert!(verbs.contains("bristle-diagnose.1"), "{verbs:?}");
    for page in &verbs {
        let text = folder.read(page);
        let name = page.trim_end_matches(".1").replace('-', "\\-");
        assert!(
            text.contains(".SH NAME") && text.contains(&name),
            "{page}: {text}"
        );
        let usage = page.trim_end_matches(".1").replacen('-', " ", 1);
        assert!(
            text.contains(&usage.replace('-', "\\-")),
            "{page}: no {usage}"
        );
    }
    assert_eq!(folder.files().len(), verbs.len() + 1);
    assert!(folder.read("bristle.1").contains("diagnose"));
}

#[test]
fn every_shell_gets_completions() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = folder.done(&format!("completions {shell}"));
        for word in ["diagnose", "next-experiment", "half-width"] {
            assert!(script.contains(word), "{shell} does not complete {word}");
        }
    }
    folder.write("bristle.bash", folder.done("completions bash"));
    let check = "source ./bristle.bash; COMP_WORDS=(bristle diag); COMP_CWORD=1; _bristle bristle diag bristle; echo \"${COMPREPLY[*]}\"";
    let Ok(output) = Command::new("bash")
        .args(["--norc", "-c", check])
        .current_dir(folder.path(""))
        .output()
    else {
        eprintln!("skipped: bash is not installed");
        return;
    };
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(said.trim(), "diagnose", "{output:?}");
}

#[test]
fn blocks_and_links_of_a_page_are_found() {
    let page = "See [a](b.md#c) and ![d](e.svg).\n<!-- file: x.toml -->\n```toml\n[y](z)\n```\n";
    assert_eq!(links(page), ["b.md#c", "e.svg"]);
    let block = Block {
        language: "toml".to_owned(),
        text: "[y](z)\n".to_owned(),
        file: Some("x.toml".to_owned()),
    };
    assert_eq!(blocks(page), [block]);
    assert_eq!(shape("off by 4.56 % (3 of 10)"), "off by # % (# of #)");
}
