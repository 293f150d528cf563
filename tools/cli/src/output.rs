// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results as JSON, messages on standard error, and how failures are told.

use crate::files::Out;
use crate::page::Page;
use anyhow::Result;
use std::io::{self, IsTerminal, Write};
use takt_isa::text::visible;

/// Writes a value as JSON, for people to read too; its lines stay whole.
pub(crate) fn json(value: &impl serde::Serialize, out: &mut Out) -> Result<()> {
    out.set_page(Page::default());
    // Via a string: an error of writing stays an `io::Error`.
    let text = serde_json::to_string_pretty(value)?;
    Ok(writeln!(out, "{text}")?)
}

/// Shows a text on standard error, which may be coloured and has no other command to a terminal. If nobody can read it, there is
/// nobody to tell.
pub(crate) fn message(text: &str) {
    let text = text.trim_end();
    if !text.is_empty() {
        let _ = writeln!(io::stderr(), "{}", coloured(text));
    }
}

/// A text with all that a terminal would obey escaped, but for colours.
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

/// A text whose lines fit the terminal of standard error.
fn folded(text: &str) -> String {
    let page = Page::of_stderr();
    text.lines().map(|line| page.folded(line)).collect::<Vec<_>>().join("\n")
}

/// Shows an error.
pub(crate) fn error(text: &str, color: bool) {
    let (on, off) = if color { ("\x1b[1;31m", "\x1b[0m") } else { ("", "") };
    message(&folded(&format!("{on}error{off}: {}", visible(text))));
}

/// Shows a warning.
pub(crate) fn warning(text: &str, color: bool) {
    let (on, off) = if color { ("\x1b[1;33m", "\x1b[0m") } else { ("", "") };
    message(&folded(&format!("{on}warning{off}: {}", visible(text))));
}

/// An error and its causes in one line. Some errors repeat their cause in their own text; it is said once. The system's number of an
/// error tells nobody anything.
pub(crate) fn describe(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !text.contains(&cause) {
            let colon = if text.is_empty() { "" } else { ": " };
            text.push_str(colon);
            text.push_str(&cause);
        }
    }
    while let Some((before, after)) =
        text.split_once(" (os error ").map(|(a, b)| (a.to_owned(), b.to_owned()))
    {
        let rest = after.split_once(')').map_or("", |(_, rest)| rest);
        text = before + rest;
    }
    text
}

/// True if the error is that nobody reads standard output any more.
pub(crate) fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let is_pipe = |cause: &io::Error| cause.kind() == io::ErrorKind::BrokenPipe;
    error.chain().any(|cause| cause.downcast_ref().is_some_and(is_pipe))
}

/// True if writing failed because nobody reads any more, which ends the work and is no error.
pub(crate) fn unless_closed(result: Result<()>) -> Result<bool> {
    match result {
        Err(error) if is_closed_pipe(&error) => Ok(true),
        result => result.map(|()| false),
    }
}

/// Failures that are not told like the others.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The assembler's diagnostics, rendered; they say themselves that they are errors.
    Diagnostics(String),
    /// Options that cannot be together: an error in the command line.
    Usage(String),
    /// Things that --deny names happened: a message for each.
    Denied(Vec<String>),
    /// The result has told already.
    Reported,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Failure::Diagnostics(text) | Failure::Usage(text) => f.write_str(text),
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
    /// The user's word; `None` if it depends on the terminal.
    pub(crate) fn asked(self) -> Option<bool> {
        match self {
            Color::Always => Some(true),
            Color::Never => Some(false),
            Color::Auto => None,
        }
    }

    /// True if messages on standard error are coloured.
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
