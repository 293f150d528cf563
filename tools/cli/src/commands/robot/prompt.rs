// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interactive prompt of `takt robot`.

use super::RobotConsole;
use anyhow::{Context, Result};
use rustyline::completion::Completer;
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::history::DefaultHistory;
use rustyline::validate::Validator;
use rustyline::{Config, Editor, Helper};
use std::io::Write;
use std::sync::atomic::Ordering;
use takt_robot::language::table;
use takt_robot::level::Answer;

/// Completion of commands at the beginning of a line.
struct Prompt;

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
        let begin = line[..at].trim_start();
        if begin.contains(char::is_whitespace) {
            return Ok((at, Vec::new()));
        }
        Ok((at - begin.len(), table::complete(begin)))
    }
}

/// Reads and executes commands until the end of input.
pub(super) fn run(desk: &mut RobotConsole<'_>) -> Result<()> {
    let config = Config::builder().auto_add_history(true).build();
    let mut editor: Editor<Prompt, DefaultHistory> =
        Editor::with_config(config).context("cannot use the terminal")?;
    editor.set_helper(Some(Prompt));
    writeln!(
        desk.out,
        "The robot is ready. `help` lists the commands; time passes only while one is executed."
    )?;
    let mut text = String::new();
    while !desk.session.quit {
        desk.out.flush()?;
        let line = match editor.readline(if text.is_empty() { "(robot) " } else { "   ...  " }) {
            Ok(line) => line,
            Err(ReadlineError::Interrupted) => {
                text.clear();
                continue;
            }
            Err(ReadlineError::Eof) => return Ok(()),
            Err(error) => return Err(error).context("cannot read the terminal"),
        };
        text.push_str(&line);
        text.push('\n');
        desk.interrupt.store(false, Ordering::Relaxed);
        let answer = desk.session.enter("prompt", &text, !line.is_empty());
        if desk.print_messages(answer)? != Some(Answer::More) {
            text.clear();
        }
    }
    Ok(())
}
