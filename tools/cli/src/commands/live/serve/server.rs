// SPDX-License-Identifier: MIT OR Apache-2.0
//! Owner of the board: reads its state, carries out what pages ask for, and knows which of them may.

use super::Target;
use super::connection::Event;
use super::message::{FromPage, ToPage, Wish};
use super::recorder::Recorder;
use super::shown::Values;
use crate::commands::live::parameters::{self, Parameters};
use crate::commands::live::status::Report;
use crate::commands::live::{set, setting};
use crate::run::parameters::parse;
use crate::terminal::output::describe;
use anyhow::{Error, Result, anyhow, bail};
use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::time::{Duration, Instant};
use takt_board::Host;
use takt_board::protocol::LinkError;
use takt_board::scope::ScopeError;
use takt_board::serial::Serial;

/// Time between two readings of the board's state.
const EVERY: Duration = Duration::from_millis(100);
/// Time between two attempts to find a board that has gone.
const RETRY: Duration = Duration::from_secs(1);

/// Browser page that is connected.
struct Page {
    number: u64,
    sender: SyncSender<Arc<str>>,
}

/// The board, the pages, and the names that both know.
pub(super) struct Server<'a> {
    /// The board; the reason if it has gone.
    board: Result<Host<Serial>, String>,
    target: &'a Target<'a>,
    parameters: Parameters,
    values: Values,
    recorder: Recorder,
    /// Cycles from tick to tick.
    cycles: u32,
    events: Receiver<Event>,
    /// Events that came while a recording was read.
    pending: VecDeque<Event>,
    pages: Vec<Page>,
    /// Number of the page that may set and control.
    writer: Option<u64>,
}

/// The error means that there is no board at the port any more. Other errors are the board's answers.
fn is_gone(error: &Error) -> bool {
    let link = error.chain().find_map(|cause| match cause.downcast_ref::<ScopeError>() {
        Some(ScopeError::Link(error)) => Some(error),
        _ => cause.downcast_ref::<LinkError>(),
    });
    !matches!(link, None | Some(LinkError::ReadOnly { .. } | LinkError::Busy | LinkError::Stopped))
}

impl<'a> Server<'a> {
    pub(super) fn new(
        mut host: Host<Serial>,
        target: &'a Target<'a>,
        events: Receiver<Event>,
    ) -> Result<Server<'a>> {
        let mut recorder = Recorder::default();
        recorder.attach(&mut host)?;
        Ok(Server {
            cycles: host.register("period")?,
            board: Ok(host),
            target,
            parameters: Parameters::of(target.application)?,
            values: Values::of(target)?,
            recorder,
            events,
            pending: VecDeque::new(),
            pages: Vec::new(),
            writer: None,
        })
    }

    /// Serves pages as long as connections may come.
    pub(super) fn run(&mut self) {
        let mut due = Instant::now();
        loop {
            // A board that expects a host hears none while nobody looks.
            if !self.pages.is_empty() && Instant::now() >= due {
                let pause = self.poll();
                due = Instant::now() + pause;
            }
            match self.next(due) {
                Ok(Event::Joined(number, sender)) => {
                    self.join(number, sender);
                    due = Instant::now();
                }
                Ok(Event::Left(number)) => self.leave(number),
                Ok(Event::Sent(number, text)) => {
                    self.answer(number, &text);
                    due = due.min(Instant::now() + EVERY / 5);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// Next event, or a time-out when the state is due.
    fn next(&mut self, due: Instant) -> Result<Event, RecvTimeoutError> {
        if let Some(event) = self.pending.pop_front() {
            return Ok(event);
        }
        if self.pages.is_empty() {
            return self.events.recv().map_err(|_| RecvTimeoutError::Disconnected);
        }
        self.events.recv_timeout(due.saturating_duration_since(Instant::now()))
    }

    fn tell(&mut self, number: u64, text: Arc<str>) {
        // The thread of a page without a sender closes its connection. It then reports that the page has left.
        self.pages.retain(|page| page.number != number || page.sender.try_send(text.clone()).is_ok());
    }

    fn tell_all(&mut self, text: &Arc<str>) {
        self.pages.retain(|page| page.sender.try_send(text.clone()).is_ok());
    }

    fn tell_roles(&mut self) {
        let (free, pages) = (self.writer.is_none(), self.pages.len());
        for number in self.pages.iter().map(|page| page.number).collect::<Vec<_>>() {
            let writer = self.writer == Some(number);
            self.tell(number, ToPage::Role { writer, free, pages }.text());
        }
    }

    fn link(&self) -> Arc<str> {
        let text = self.board.as_ref().err().map_or("", String::as_str);
        let scope = self.recorder.size();
        ToPage::Link { connected: self.board.is_ok(), text, cycles: self.cycles, scope }.text()
    }

    fn join(&mut self, number: u64, sender: SyncSender<Arc<str>>) {
        self.pages.push(Page { number, sender });
        self.writer.get_or_insert(number);
        let Target { port, file, application, .. } = self.target;
        let program = file.file_name().unwrap_or_default().to_string_lossy();
        let hello = ToPage::Hello {
            version: env!("CARGO_PKG_VERSION"),
            program: &program,
            machine: &application.cores(),
            port: &port.port.display().to_string(),
            baud: port.baud,
            parameters: &self.values.parameters,
            inputs: &self.values.inputs,
            outputs: &self.values.outputs,
            channels: &self.values.channels,
        };
        self.tell(number, hello.text());
        self.tell(number, self.link());
        self.tell(number, self.recorder.phase(0, 0));
        if let Some(recording) = self.recorder.recording() {
            self.tell(number, recording.clone());
        }
        self.tell_roles();
    }

    fn leave(&mut self, number: u64) {
        self.pages.retain(|page| page.number != number);
        self.writer = self.writer.filter(|writer| *writer != number);
        self.tell_roles();
    }

    fn answer(&mut self, number: u64, text: &str) {
        let parsed: Result<FromPage, _> = serde_json::from_str(text);
        let (id, result) = match parsed {
            Ok(FromPage { id, wish }) => (id, self.fulfil(number, wish)),
            Err(error) => (0, Err(anyhow!("a message that is none: {error}"))),
        };
        let (error, file) = match result {
            Ok(file) => (None, file),
            Err(error) => (Some(self.failed(&error)), None),
        };
        self.tell(number, ToPage::Answer { id, error: error.as_deref(), file: file.as_deref() }.text());
    }

    /// The text of an error; if the board has gone, all pages are told.
    fn failed(&mut self, error: &Error) -> String {
        let text = describe(error);
        if is_gone(error) && self.board.is_ok() {
            self.board = Err(text.clone());
            self.tell_all(&self.link());
        }
        text
    }

    /// Does what a page asks for; returns a file if it asks for one.
    fn fulfil(&mut self, number: u64, wish: Wish) -> Result<Option<String>> {
        let Target { application, wiring, .. } = *self.target;
        if self.writer != Some(number) && !wish.is_harmless() {
            let other = if self.writer.is_some() { "another page" } else { "no page" };
            bail!("{other} has control: this one only shows");
        }
        match wish {
            Wish::Claim | Wish::Release => {
                let free = self.writer.is_none_or(|writer| writer == number);
                if !free {
                    bail!("another page has control");
                }
                self.writer = matches!(wish, Wish::Claim).then_some(number);
                self.tell_roles();
                return Ok(None);
            }
            Wish::Csv => return self.recorder.csv().map(Some),
            _ => {}
        }
        let host = self.board.as_mut().map_err(|text| anyhow!("the board is not there: {text}"))?;
        match wish {
            Wish::Parameters { values } => {
                let settings = self.parameters.check(application, values.into_iter().collect())?;
                parameters::set(host, &settings)?;
            }
            Wish::Load { text } => {
                let settings = self.parameters.check(application, parse("the file", &text)?)?;
                parameters::set(host, &settings)?;
            }
            Wish::Save => return self.parameters.file(host).map(Some),
            Wish::Input { name, value } => {
                let (address, bits) = setting(application, wiring, &name, &value)?;
                set(host, &[(address, bits)], &[(address, name)])?;
            }
            Wish::Control { command } => command.send(host)?,
            Wish::Arm { request } => {
                self.recorder.arm(host, application, request)?;
                self.tell_all(&self.recorder.phase(0, 0));
            }
            Wish::End => self.recorder.end(host)?,
            Wish::Claim | Wish::Release | Wish::Csv => {}
        }
        Ok(None)
    }

    /// Reads the state of the board, or looks for one that has gone; returns the time until the next look.
    fn poll(&mut self) -> Duration {
        let result = if self.board.is_ok() { self.report() } else { self.reconnect() };
        match result {
            Ok(()) => EVERY,
            Err(error) => {
                self.failed(&error);
                RETRY
            }
        }
    }

    fn reconnect(&mut self) -> Result<()> {
        let found = self.target.port.open().and_then(|mut host| {
            host.fits(self.target.application.clone())?;
            self.recorder.attach(&mut host)?;
            self.cycles = host.register("period")?;
            Ok(host)
        });
        match found {
            Ok(host) => {
                self.board = Ok(host);
                self.tell_all(&self.link());
                self.tell_all(&self.recorder.phase(0, 0));
            }
            Err(error) => {
                let text = describe(&error);
                let is_new = self.board.as_ref().err() != Some(&text);
                self.board = Err(text);
                if is_new {
                    self.tell_all(&self.link());
                }
                return Err(error);
            }
        }
        Ok(())
    }

    fn report(&mut self) -> Result<()> {
        let Ok(host) = &mut self.board else { return Ok(()) };
        let report = Report::read(host, Some(self.target.application), self.target.wiring)?;
        let (values, busy) = match self.values.read(host) {
            Ok(values) => (values, None),
            Err(error @ LinkError::Busy) => (Vec::new(), Some(error.to_string())),
            Err(error) => return Err(error.into()),
        };
        let state = ToPage::State { report: &report, values: &values, busy: busy.as_deref() };
        self.tell_all(&state.text());
        let cycles = f64::from(self.cycles);
        let seconds = self.target.wiring.map(|wiring| cycles / (wiring.clock * 1e6));
        // Requests of pages come before the rest of a long recording.
        let Server { board: Ok(host), recorder, target, events, pending, pages, .. } = self else {
            return Ok(());
        };
        let told = recorder.watch(host, target.application, seconds, |progress| {
            pending.extend(events.try_iter());
            pages.retain(|page| page.sender.try_send(progress.clone()).is_ok());
            if pending.is_empty() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        })?;
        for text in told {
            self.tell_all(&text);
        }
        Ok(())
    }
}
