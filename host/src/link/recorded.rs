//! A recording out of the memory of a board.

use bristle_core::drive::recorder::Contents;
use bristle_core::drive::signal::Signal;

/// What a board has recorded by itself.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// What it says of it.
    pub contents: Contents,
    /// The words, row after row.
    pub words: Vec<u32>,
}

impl Recorded {
    /// The words of a signal, one for each row; none if it was not recorded.
    pub fn column(&self, signal: Signal) -> impl Iterator<Item = u32> + '_ {
        let selection = self.contents.selection;
        let at = selection.iter().position(|s| s == signal);
        let words = move |at| self.words[at..].iter().step_by(selection.len()).copied();
        at.filter(|_| !self.words.is_empty())
            .into_iter()
            .flat_map(words)
    }
}
