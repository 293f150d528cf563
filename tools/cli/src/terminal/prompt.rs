// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interactive prompt: a line editor with completion and a history across sessions.

use crate::terminal::history::{self, CommandHistory};
use anyhow::{Context, Result};
use rustyline::completion::Completer;
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::history::FileHistory;
use rustyline::validate::Validator;
use rustyline::{Editor, Helper};
use std::path::PathBuf;

/// Completion by a function from the text before the cursor to the place where candidates begin, and the candidates.
struct Completion<F>(F);

impl<F: Fn(&str) -> (usize, Vec<String>)> Helper for Completion<F> {}
impl<F> Highlighter for Completion<F> {}
impl<F> Validator for Completion<F> {}
impl<F> Hinter for Completion<F> {
    type Hint = String;
}

impl<F: Fn(&str) -> (usize, Vec<String>)> Completer for Completion<F> {
    type Candidate = String;

    fn complete(
        &self,
        line: &str,
        at: usize,
        _: &rustyline::Context<'_>,
    ) -> rustyline::Result<(usize, Vec<String>)> {
        Ok((self.0)(&line[..at]))
    }
}

/// Input at a prompt.
pub(crate) enum Input {
    Line(String),
    /// Ctrl-C.
    Interrupted,
    End,
}

/// Line editor of a session.
pub(crate) struct Prompt<F: Fn(&str) -> (usize, Vec<String>)> {
    editor: Editor<Completion<F>, FileHistory>,
    file: Option<PathBuf>,
}

impl<F: Fn(&str) -> (usize, Vec<String>)> Prompt<F> {
    /// A prompt with the history of earlier sessions, from the file of this name, and a completion.
    ///
    /// # Errors
    /// If the terminal cannot be used.
    pub(crate) fn new(history: &str, complete: F) -> Result<Prompt<F>> {
        let CommandHistory { history, file } = CommandHistory::load(history);
        let mut editor =
            Editor::with_history(history::config(), history).context("cannot use the terminal")?;
        editor.set_helper(Some(Completion(complete)));
        Ok(Prompt { editor, file })
    }

    /// Reads a line, and keeps it in the history.
    ///
    /// # Errors
    /// If the terminal cannot be read.
    pub(crate) fn read(&mut self, prompt: &str) -> Result<Input> {
        match self.editor.readline(prompt) {
            Ok(line) => {
                history::append(self.editor.history_mut(), self.file.as_deref());
                Ok(Input::Line(line))
            }
            Err(ReadlineError::Interrupted) => Ok(Input::Interrupted),
            Err(ReadlineError::Eof) => Ok(Input::End),
            Err(error) => Err(error).context("cannot read the terminal"),
        }
    }
}
