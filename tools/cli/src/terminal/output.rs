// SPDX-License-Identifier: MIT OR Apache-2.0
//! Messages on standard error, and errors that are presented in special ways.

use crate::terminal::interrupt;
use crate::terminal::page::Page;
use anyhow::Result;
use std::io::{self, IsTerminal, Write};
use takt_isa::text::visible;

/// Prints text to standard error, without terminal control sequences except colours. Write errors are ignored.
pub(crate) fn message(text: &str) {
    let text = text.trim_end();
    if !text.is_empty() {
        let _ = interrupt::beside_bars(|| writeln!(io::stderr(), "{}", coloured(text)));
    }
}

/// Escapes all terminal control sequences in a text except colours.
pub(crate) fn coloured(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find("\x1b[") {
        let (before, command) = rest.split_at(at);
        let length = command[2..]
            .find(|c: char| !(c.is_ascii_digit() || c == ';'))
            .map_or(command.len(), |end| end + 2);
        let is_colour = command[length..].starts_with('m');
        shown.push_str(&visible(before));
        let end = if is_colour { length + 1 } else { 2 };
        shown.push_str(&if is_colour { command[..end].into() } else { visible(&command[..end]) });
        rest = &command[end..];
    }
    shown + &visible(rest)
}

/// Folds a text to the width of the terminal on standard error.
pub(crate) fn folded(text: &str) -> String {
    let page = Page::of_stderr();
    text.lines().map(|line| page.folded(line)).collect::<Vec<_>>().join("\n")
}

/// Prints an error to standard error.
pub(crate) fn error(text: &str, color: bool) {
    let (on, off) = if color { ("\x1b[1;31m", "\x1b[0m") } else { ("", "") };
    message(&folded(&format!("{on}error{off}: {}", visible(text))));
}

/// Prints a warning to standard error.
pub(crate) fn warning(text: &str, color: bool) {
    let (on, off) = if color { ("\x1b[1;33m", "\x1b[0m") } else { ("", "") };
    message(&folded(&format!("{on}warning{off}: {}", visible(text))));
}

/// Prints a note about an assumption that the user may not expect.
pub(crate) fn note(text: &str) {
    message(&folded(&format!("note: {}", visible(text))));
}

/// The error is a closed pipe: nothing reads standard output any more.
pub(crate) fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let is_pipe = |cause: &io::Error| cause.kind() == io::ErrorKind::BrokenPipe;
    error.chain().any(|cause| cause.downcast_ref().is_some_and(is_pipe))
}

/// Converts a closed pipe to `true`: it ends the work, but is not an error.
pub(crate) fn unless_closed(result: Result<()>) -> Result<bool> {
    match result {
        Err(error) if is_closed_pipe(&error) => Ok(true),
        result => result.map(|()| false),
    }
}

/// Failures that are presented in special ways.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Rendered diagnostics of the assembler, which include the word `error`.
    Diagnostics(String),
    /// Conflicting options: an error in the command line.
    Usage(String),
    /// Events denied by --deny, one message each.
    Denied(Vec<String>),
    /// Ctrl-C ended the work before all of it was done; the message says how much was.
    Interrupted(String),
    /// Failure that the results already report.
    Reported,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Failure::Diagnostics(text) | Failure::Usage(text) | Failure::Interrupted(text) => {
                f.write_str(text)
            }
            Failure::Denied(messages) => f.write_str(&messages.join("\n")),
            Failure::Reported => Ok(()),
        }
    }
}

impl std::error::Error for Failure {}

/// When to colour.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Color {
    /// On a terminal, unless NO_COLOR is set.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

impl Color {
    /// Explicit choice of the user; `None` if the terminal decides.
    pub(crate) fn explicit_choice(self) -> Option<bool> {
        match self {
            Color::Always => Some(true),
            Color::Never => Some(false),
            Color::Auto => None,
        }
    }

    /// Messages on standard error are coloured.
    pub(crate) fn on_stderr(self) -> bool {
        match self {
            Color::Always => true,
            Color::Never => false,
            Color::Auto => {
                let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
                io::stderr().is_terminal() && !refused
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_have_colours_and_no_other_commands() {
        let text = "\x1b[1;31merror\x1b[0m: a\x1b]0;title\x07\x1b[2J\x1b[\u{9b}31m\n";
        let shown = "\x1b[1;31merror\x1b[0m: a\\u001b]0;title\\u0007\\u001b[2J\\u001b[\\u009b31m\n";
        assert_eq!(coloured(text), shown);
    }
}
