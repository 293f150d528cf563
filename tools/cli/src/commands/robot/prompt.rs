// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interactive prompt of `takt robot`.

use super::RobotConsole;
use crate::terminal::prompt::{Input, Prompt};
use anyhow::Result;
use std::io::Write;
use std::sync::atomic::Ordering;
use takt_robot::language::table;
use takt_robot::level::Answer;

/// Completion of commands at the beginning of a line.
fn complete(text: &str) -> (usize, Vec<String>) {
    let begin = text.trim_start();
    if begin.contains(char::is_whitespace) {
        return (text.len(), Vec::new());
    }
    (text.len() - begin.len(), table::complete(begin))
}

/// Reads and executes commands until the end of input.
pub(super) fn run(desk: &mut RobotConsole<'_>) -> Result<()> {
    let mut prompt = Prompt::new("robot-history", complete)?;
    writeln!(
        desk.out,
        "The robot is ready. `help` lists the commands; time passes only while one is executed."
    )?;
    let mut text = String::new();
    while !desk.session.quit {
        desk.out.flush()?;
        let line = match prompt.read(if text.is_empty() { "(robot) " } else { "   ...  " })? {
            Input::Line(line) => line,
            Input::Interrupted => {
                text.clear();
                continue;
            }
            Input::End => return Ok(()),
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
