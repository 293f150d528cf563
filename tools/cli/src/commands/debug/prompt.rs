// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interactive prompt of `takt debug`.

use super::history::{self, CommandHistory};
use super::{execute, leave, running};
use crate::terminal::files::Out;
use crate::terminal::output;
use anyhow::{Context, Result};
use rustyline::completion::Completer;
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::history::FileHistory;
use rustyline::validate::Validator;
use rustyline::{Editor, Helper};
use std::cell::RefCell;
use std::io::{IsTerminal, Write};
use std::rc::Rc;
use std::sync::Arc;
use takt_debug::console::Console;
use takt_debug::session::Control;

/// Terminal sequence that clears the rest of the line.
const CLEAR: &str = "\x1b[K";

/// Completion of the prompt's input, from its session.
struct Prompt(Rc<RefCell<Console>>);

impl Helper for Prompt {}
impl Highlighter for Prompt {}
impl Validator for Prompt {}
impl Hinter for Prompt {
    type Hint = String;
}

impl Completer for Prompt {
    type Candidate = String;

    fn complete(
        &self,
        line: &str,
        at: usize,
        _: &rustyline::Context<'_>,
    ) -> rustyline::Result<(usize, Vec<String>)> {
        Ok(self.0.borrow().complete(&line[..at]))
    }
}

/// Reads and executes commands until the end of input.
pub(super) fn run(console: Console, control: &Arc<Control>, color: bool, out: &mut Out) -> Result<()> {
    let console = Rc::new(RefCell::new(console));
    let CommandHistory { history, file } = CommandHistory::load();
    let mut editor: Editor<Prompt, FileHistory> =
        Editor::with_history(history::config(), history).context("cannot use the terminal")?;
    editor.set_helper(Some(Prompt(Rc::clone(&console))));
    while !console.borrow().quit {
        out.flush()?;
        let line = match editor.readline("(takt) ") {
            Ok(line) => line,
            Err(ReadlineError::Interrupted) => continue,
            Err(ReadlineError::Eof) => break,
            Err(error) => return Err(error).context("cannot read the terminal"),
        };
        history::append(editor.history_mut(), file.as_deref());
        let mut console = console.borrow_mut();
        let (mut shown, counts) = (false, console.counts());
        let answer = execute(&mut console, &line, control, || {
            shown = std::io::stderr().is_terminal();
            if shown {
                // The terminal's `^C` would wrap a full-width bar.
                write!(std::io::stderr(), "\r{}{CLEAR}", running(counts, control))?;
            }
            Ok(())
        });
        if shown {
            write!(std::io::stderr(), "\r{CLEAR}")?;
        }
        match answer? {
            Ok(text) => out.write_all(text.as_bytes())?,
            Err(error) => output::error(&error, color),
        }
    }
    leave(&mut console.borrow_mut(), out)
}
