// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interactive prompt of `takt debug`.

use super::{execute, leave, running};
use crate::terminal::files::Out;
use crate::terminal::output;
use crate::terminal::prompt::{Input, Prompt};
use anyhow::Result;
use std::cell::RefCell;
use std::io::{IsTerminal, Write};
use std::rc::Rc;
use std::sync::Arc;
use takt_debug::console::Console;
use takt_debug::session::Control;

/// Terminal sequence that clears the rest of the line.
const CLEAR: &str = "\x1b[K";

/// Reads and executes commands until the end of input.
pub(super) fn run(console: Console, control: &Arc<Control>, color: bool, out: &mut Out) -> Result<()> {
    let console = Rc::new(RefCell::new(console));
    let completed = Rc::clone(&console);
    let mut prompt = Prompt::new("history", move |text: &str| completed.borrow().complete(text))?;
    while !console.borrow().quit {
        out.flush()?;
        let line = match prompt.read("(takt) ")? {
            Input::Line(line) => line,
            Input::Interrupted => continue,
            Input::End => break,
        };
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
