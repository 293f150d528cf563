// SPDX-License-Identifier: MIT OR Apache-2.0
//! Full-screen interface of `takt debug`: keys in, commands out; `takt_debug::view` draws.

use super::{execute, running};
use crate::terminal::history::CommandHistory;
use anyhow::{Context, Result};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::Rect;
use std::time::Duration;
use takt_debug::console::{Console, keys};
use takt_debug::session::Control;
use takt_debug::view::{self, Screen};
use tui_input::Input;
use tui_input::backend::crossterm::EventHandler;

/// Lines per Page Up and Page Down.
const PAGE: isize = 10;

/// The terminal in full-screen mode, restored on drop. (On a panic, ratatui's hook restores it before the message is printed.)
struct Terminal(DefaultTerminal);

impl Terminal {
    /// Clears the screen and ratatui's record of its contents, which are unknown after a resize. (ratatui's own `clear` queries the
    /// cursor position, which some terminals do not answer.)
    fn renew(&mut self) -> Result<()> {
        let size = self.0.size()?;
        self.0.resize(Rect::new(0, 0, size.width, size.height))?;
        Ok(())
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

/// A partial command line.
#[derive(Default)]
struct Typing {
    input: Input,
    /// Position in the history, counted backwards from 1; 0 is the new line.
    back: usize,
}

struct Front<'c> {
    console: &'c mut Console,
    control: &'c Control,
    terminal: Terminal,
    screen: Screen,
    typing: Option<Typing>,
    past: CommandHistory,
}

/// Shows the session and executes commands until the user quits.
pub(super) fn run(console: &mut Console, control: &Control) -> Result<()> {
    let screen = Screen::new(console.panes());
    let terminal = Terminal(ratatui::try_init().context("cannot use the terminal")?);
    let mut front =
        Front { console, control, terminal, screen, typing: None, past: CommandHistory::load("history") };
    while !front.console.quit {
        front.draw()?;
        match event::read().context("cannot read the terminal")? {
            Event::Key(key) if key.kind != KeyEventKind::Release => front.key(key)?,
            Event::Resize(..) => front.terminal.renew()?,
            _ => {}
        }
    }
    Ok(())
}

fn is_control(key: KeyEvent, letter: char) -> bool {
    key.modifiers.contains(KeyModifiers::CONTROL) && key.code == KeyCode::Char(letter)
}

impl Front<'_> {
    fn draw(&mut self) -> Result<()> {
        let typed = self.typing.as_ref();
        self.screen.typed = typed.map(|Typing { input, .. }| (input.value().to_owned(), input.cursor()));
        self.terminal
            .0
            .draw(|frame| view::draw(frame, &mut self.screen))
            .context("cannot write to the terminal")?;
        Ok(())
    }

    fn key(&mut self, key: KeyEvent) -> Result<()> {
        if is_control(key, 'd') {
            self.console.quit = true;
        } else if is_control(key, 'l') {
            self.terminal.renew()?;
        } else if is_control(key, 'c') {
            self.typing = None;
        } else if self.screen.help.is_some() {
            self.help_key(key);
        } else if self.typing.is_some() {
            self.typing_key(key)?;
        } else {
            self.command_key(key)?;
        }
        Ok(())
    }

    /// Handles a scroll key; returns false for any other key.
    fn scrolls(&mut self, key: KeyEvent) -> bool {
        let lines = match key.code {
            KeyCode::Up => -1,
            KeyCode::Down => 1,
            KeyCode::PageUp => -PAGE,
            KeyCode::PageDown => PAGE,
            _ => return false,
        };
        self.screen.scroll(lines);
        true
    }

    fn help_key(&mut self, key: KeyEvent) {
        if !self.scrolls(key) {
            self.screen.help = None;
        }
    }

    fn command_key(&mut self, key: KeyEvent) -> Result<()> {
        if self.scrolls(key) {
            return Ok(());
        }
        match key.code {
            KeyCode::Char(':') => self.typing = Some(Typing::default()),
            KeyCode::Char('?') => self.screen.help = Some(0),
            KeyCode::Tab => self.screen.turn(1),
            KeyCode::BackTab => self.screen.turn(-1),
            KeyCode::Enter => self.execute("")?,
            KeyCode::Char(letter) => match keys(self.screen.panes.target).find(|(key, _)| *key == letter) {
                Some((_, line)) if line.ends_with(' ') => {
                    self.typing = Some(Typing { input: Input::from(line), back: 0 });
                }
                Some((_, line)) => self.execute(line)?,
                None => {}
            },
            _ => {}
        }
        Ok(())
    }

    fn typing_key(&mut self, key: KeyEvent) -> Result<()> {
        let Some(typing) = &mut self.typing else { return Ok(()) };
        let step = match key.code {
            KeyCode::Enter => {
                let line =
                    self.typing.take().map(|typing| typing.input.value().to_owned()).unwrap_or_default();
                self.past.add(&line);
                return self.execute(&line);
            }
            KeyCode::Esc => {
                self.typing = None;
                return Ok(());
            }
            KeyCode::Tab => {
                self.complete();
                return Ok(());
            }
            KeyCode::Up => typing.back + 1,
            KeyCode::Down => typing.back.saturating_sub(1),
            _ => {
                typing.input.handle_event(&Event::Key(key));
                return Ok(());
            }
        };
        let line = if step == 0 { Some(String::new()) } else { self.past.back(step) };
        if let Some(line) = line {
            *typing = Typing { input: Input::from(line), back: step };
        }
        Ok(())
    }

    /// Completes the word before the cursor as far as it is unambiguous, and lists the candidates.
    fn complete(&mut self) {
        let Some(Typing { input, .. }) = &mut self.typing else { return };
        let before: String = input.value().chars().take(input.cursor()).collect();
        let after: String = input.value().chars().skip(input.cursor()).collect();
        let (start, found) = self.console.complete(&before);
        let Some(first) = found.first() else { return };
        let common = found.iter().fold(first.len(), |common, name| {
            first.bytes().zip(name.bytes()).take(common).take_while(|(a, b)| a == b).count()
        });
        let certain = format!("{}{}", &before[..start], &first[..common]);
        let cursor = certain.chars().count();
        *input = Input::from(certain + &after).with_cursor(cursor);
        if found.len() > 1 {
            let panes = self.console.panes();
            self.screen.log_command(&before, &Ok(found.join("  ")), panes);
        }
    }

    /// Executes a line; meanwhile the terminal stays responsive.
    fn execute(&mut self, line: &str) -> Result<()> {
        let Front { console, control, terminal, screen, .. } = self;
        screen.typed = None;
        let counts = console.counts();
        let answer = execute(console, line, control, || {
            while event::poll(Duration::ZERO)? {
                match event::read()? {
                    Event::Key(key) if is_control(key, 'c') || key.code == KeyCode::Esc => {
                        control.interrupt()
                    }
                    Event::Resize(..) => terminal.renew()?,
                    _ => {}
                }
            }
            screen.running = Some(running(counts, control));
            terminal.0.draw(|frame| view::draw(frame, screen))?;
            Ok(())
        });
        screen.running = None;
        let panes = console.panes();
        screen.log_command(line, &answer?, panes);
        Ok(())
    }
}
