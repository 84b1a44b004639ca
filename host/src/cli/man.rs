//! `bristle man`

use std::path::PathBuf;

use clap::{Args, CommandFactory};

use super::output::{self, Outputs};
use super::{Cli, DONE, Outcome, reference, terminal};
use crate::error::{Error, Result};

/// Write the man pages: one of bristle, one of each command
///
/// `bristle man ~/.local/share/man/man1` puts them where `man bristle-diagnose` finds them.
#[derive(Args, Debug)]
pub(super) struct Command {
    /// Folder to write to
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Write the reference chapters of the book, commands.md, effects.md and faults.md, instead
    #[arg(long)]
    markdown: bool,
}

impl Command {
    pub fn run(&self) -> Outcome {
        let pages = if self.markdown {
            vec![
                ("commands.md".to_owned(), reference::commands()),
                ("effects.md".to_owned(), reference::effects()),
                ("faults.md".to_owned(), reference::faults()),
            ]
        } else {
            pages()?
        };
        if !self.folder.is_dir() {
            return Err(Error::Usage(format!(
                "{}: there is no such folder; make it first, or name another",
                self.folder.display()
            )));
        }
        let files: Vec<(PathBuf, String)> = pages
            .into_iter()
            .map(|(name, text)| (self.folder.join(name), text))
            .collect();
        let places: Vec<Option<&PathBuf>> = files.iter().map(|(path, _)| Some(path)).collect();
        output::check(&[], &places)?;
        let mut outputs = Outputs::default();
        for (path, text) in &files {
            outputs.add(Some(path), || Ok(text.clone()))?;
        }
        terminal::written(&outputs.write()?);
        Ok(DONE)
    }
}

/// Name and text of every man page.
fn pages() -> Result<Vec<(String, String)>> {
    let mut whole = Cli::command();
    // Gives every command the name of its page, such as bristle-diagnose.
    whole.build();
    let verbs = whole.get_subcommands().cloned();
    let verbs: Vec<clap::Command> = verbs.filter(|verb| verb.get_name() != "help").collect();
    std::iter::once(whole).chain(verbs).map(page).collect()
}

fn page(command: clap::Command) -> Result<(String, String)> {
    let release = concat!("bristle ", env!("CARGO_PKG_VERSION"));
    let page = clap_mangen::Man::new(command)
        .source(release)
        .manual("Bristle");
    let mut text = Vec::new();
    page.render(&mut text)
        .map_err(|e| Error::Internal(format!("a man page cannot be made: {e}")))?;
    let text = String::from_utf8(text)
        .map_err(|e| Error::Internal(format!("a man page is no text: {e}")))?;
    Ok((page.get_filename(), text))
}
