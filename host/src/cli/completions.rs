//! `bristle completions`

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::output::print;
use super::{Cli, DONE, Outcome};

/// Print what a shell needs to complete the commands, options and values of bristle
///
/// A shell reads it from a file:
///
///   bash        bristle completions bash > ~/.local/share/bash-completion/completions/bristle
///
///   zsh         bristle completions zsh > ~/.zfunc/_bristle, with `fpath+=~/.zfunc` before `compinit` in ~/.zshrc
///
///   fish        bristle completions fish > ~/.config/fish/completions/bristle.fish
///
///   powershell  bristle completions powershell >> $PROFILE
#[derive(Args, Debug)]
pub(super) struct Command {
    /// The shell
    shell: Shell,
}

impl Command {
    pub fn run(&self) -> Outcome {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "bristle", &mut script);
        print(&script)?;
        Ok(DONE)
    }
}
