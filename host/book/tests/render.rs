//! The book as its readers get it, rendered by mdBook itself: every page is there, and nothing in them leads nowhere.
//!
//! `BRISTLE_BOOK=FOLDER` keeps what was rendered.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use mdbook_driver::MDBook;
use mdbook_driver::book::BookItem;
use tracing::field::Field;
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata};

fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Renders the book into a folder; its pages, and what mdBook complained of.
fn render(site: &Path) -> (Vec<PathBuf>, Vec<String>) {
    let complaints = Complaints::default();
    let pages = tracing::subscriber::with_default(complaints.clone(), || {
        let mut book = MDBook::load(folder()).expect("a book");
        book.config.build.build_dir = site.to_owned();
        book.build().expect("it is rendered");
        let page = |item: &BookItem| match item {
            BookItem::Chapter(chapter) => chapter.path.clone(),
            _ => None,
        };
        book.iter().filter_map(page).collect()
    });
    let complaints = complaints.0.lock().expect("no panic").clone();
    (pages, complaints)
}

/// Warnings and errors that are logged under it.
#[derive(Clone, Default)]
struct Complaints(Arc<Mutex<Vec<String>>>);

impl tracing::Subscriber for Complaints {
    fn enabled(&self, about: &Metadata<'_>) -> bool {
        *about.level() <= Level::WARN
    }
    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }
    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn event(&self, event: &Event<'_>) {
        let mut text = event.metadata().target().to_owned();
        event.record(&mut |_: &Field, value: &dyn std::fmt::Debug| {
            text += &format!(" {value:?}");
        });
        self.0.lock().expect("no panic").push(text);
    }
    fn enter(&self, _: &Id) {}
    fn exit(&self, _: &Id) {}
}

/// The values of an attribute in rendered HTML, whose attributes are all in double quotes.
fn attributes<'a>(html: &'a str, name: &str) -> Vec<&'a str> {
    let opening = format!(" {name}=\"");
    let after = html.split(&opening).skip(1);
    after.filter_map(|rest| rest.split('"').next()).collect()
}

/// All rendered pages.
fn rendered(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a readable folder");
    let paths = entries.map(|entry| entry.expect("a readable entry").path());
    paths
        .flat_map(|path| match path.extension() {
            _ if path.is_dir() => rendered(&path),
            Some(extension) if extension == "html" => vec![path],
            _ => Vec::new(),
        })
        .collect()
}

#[test]
fn mdbook_renders_every_page_and_nothing_in_them_leads_nowhere() {
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let kept = std::env::var_os("BRISTLE_BOOK").map(PathBuf::from);
    let site = kept.unwrap_or_else(|| temporary.path().to_owned());
    let (pages, complaints) = render(&site);
    assert!(complaints.is_empty(), "{complaints:#?}");
    assert!(pages.len() > 15, "{pages:?}");
    for page in pages {
        let page = site.join(page).with_extension("html");
        assert!(page.is_file(), "{}", page.display());
    }
    let (mut followed, mut seen) = (0, 0);
    for page in rendered(&site) {
        let html = read(&page);
        let folder = page.parent().expect("a folder");
        let pictures = attributes(&html, "src");
        seen += pictures
            .iter()
            .filter(|file| !file.ends_with(".js"))
            .count();
        for link in attributes(&html, "href").into_iter().chain(pictures) {
            if link.contains(':') {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => page.clone(),
                // The base of the page that a server shows in the place of one that is missing.
                "/" => continue,
                _ => folder.join(file),
            };
            assert!(target.is_file(), "{}: {link}", page.display());
            let is_there = anchor.is_empty() || attributes(&read(&target), "id").contains(&anchor);
            assert!(is_there, "{}: {link}", page.display());
            followed += 1;
        }
    }
    assert!(
        followed > 500 && seen > 2,
        "{followed} links, {seen} pictures"
    );
}

#[test]
fn what_mdbook_complains_of_and_attributes_are_seen() {
    let complaints = Complaints::default();
    tracing::subscriber::with_default(complaints.clone(), || {
        tracing::warn!("a page {} is missing", 7);
        tracing::info!("all is well");
    });
    let said = complaints.0.lock().expect("no panic").clone();
    assert_eq!(said, ["render a page 7 is missing"]);
    let html = r##"<a class="x" href="a.html#b">c</a> <img src="d.png">"##;
    assert_eq!(attributes(html, "href"), ["a.html#b"]);
    assert_eq!(attributes(html, "src"), ["d.png"]);
}
