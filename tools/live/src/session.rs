// SPDX-License-Identifier: MIT OR Apache-2.0
//! Owner of the board: reads its state, carries out requests of pages, and knows which of them may set and control.

use crate::control::{set, setting};
use crate::message::{FromPage, ToPage, Wish};
use crate::parameters::{self, Parameters};
use crate::recorder::Recorder;
use crate::report::Report;
use crate::shown::Values;
use anyhow::{Error, Result, anyhow, bail};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;
use takt_board::protocol::{Line, LinkError};
use takt_board::scope::ScopeError;
use takt_board::{Application, Host, Wiring};
use takt_debug::parameters::parse;
use takt_diagnostics::describe;

/// Time between two readings of the board's state.
pub const EVERY: Duration = Duration::from_millis(100);
/// Time between two attempts to find a board that has gone.
const RETRY: Duration = Duration::from_secs(1);

/// The program that runs on the board, and the names of its place.
pub struct Target {
    /// Name of the program's file.
    pub program: String,
    /// Name of the port.
    pub port: String,
    /// Baud rate.
    pub baud: u32,
    /// The program, or the system.
    pub application: Application<'static>,
    /// Source texts of each core, by file name; they state units.
    pub sources: Vec<Vec<(String, String)>>,
    /// The wiring that the board was built with, if it is known.
    pub wiring: Option<Wiring>,
}

/// Way to the pages, which the session knows by number.
pub trait Pages {
    /// Sends a message to a page; false if the page is gone, or reads too slowly.
    fn send(&mut self, page: u64, text: &Arc<str>) -> bool;

    /// A page has asked for something that waits for its answer.
    fn is_asked(&mut self) -> bool;
}

/// The board and its pages.
pub struct Session<L, P> {
    /// The board; the reason if it has gone.
    board: Result<Host<L>, String>,
    target: Target,
    parameters: Parameters,
    values: Values,
    recorder: Recorder,
    /// Cycles from tick to tick.
    cycles: u32,
    /// Numbers of the pages.
    pages: Vec<u64>,
    /// Number of the page that may set and control.
    writer: Option<u64>,
    way: P,
}

/// The error means that there is no board at the port any more. Other errors are the board's answers.
fn is_gone(error: &Error) -> bool {
    let link = error.chain().find_map(|cause| match cause.downcast_ref::<ScopeError>() {
        Some(ScopeError::Link(error)) => Some(error),
        _ => cause.downcast_ref::<LinkError>(),
    });
    !matches!(link, None | Some(LinkError::ReadOnly { .. } | LinkError::Busy | LinkError::Stopped))
}

impl<L: Line, P: Pages> Session<L, P> {
    /// A session without pages, for a board that has the application's circuit.
    ///
    /// # Errors
    /// If the board has another circuit, or is gone.
    pub fn new(mut host: Host<L>, target: Target, way: P) -> Result<Session<L, P>> {
        let mut recorder = Recorder::default();
        host.fits(target.application.clone())?;
        recorder.attach(&mut host)?;
        Ok(Session {
            cycles: host.register("period")?,
            board: Ok(host),
            parameters: Parameters::of(&target.application)?,
            values: Values::of(&target)?,
            target,
            recorder,
            pages: Vec::new(),
            writer: None,
            way,
        })
    }

    /// Way to the pages.
    pub fn pages(&mut self) -> &mut P {
        &mut self.way
    }

    /// Nobody looks at the board.
    pub fn is_alone(&self) -> bool {
        self.pages.is_empty()
    }

    fn tell(&mut self, number: u64, text: &Arc<str>) {
        if !self.way.send(number, text) {
            self.pages.retain(|page| *page != number);
        }
    }

    fn tell_all(&mut self, text: &Arc<str>) {
        let Session { pages, way, .. } = self;
        pages.retain(|page| way.send(*page, text));
    }

    fn tell_roles(&mut self) {
        let (free, pages) = (self.writer.is_none(), self.pages.len());
        for number in self.pages.clone() {
            let writer = self.writer == Some(number);
            self.tell(number, &ToPage::Role { writer, free, pages }.text());
        }
    }

    fn link(&self) -> Arc<str> {
        let text = self.board.as_ref().err().map_or("", String::as_str);
        let scope = self.recorder.size();
        ToPage::Link { connected: self.board.is_ok(), text, cycles: self.cycles, scope }.text()
    }

    /// A page begins to look. The first one has control.
    pub fn join(&mut self, number: u64) {
        self.pages.push(number);
        self.writer.get_or_insert(number);
        let Target { program, port, baud, application, .. } = &self.target;
        let hello = ToPage::Hello {
            version: env!("CARGO_PKG_VERSION"),
            program,
            machine: &application.cores(),
            port,
            baud: *baud,
            parameters: &self.values.parameters,
            inputs: &self.values.inputs,
            outputs: &self.values.outputs,
            channels: &self.values.channels,
        };
        let hello = hello.text();
        self.tell(number, &hello);
        self.tell(number, &self.link());
        self.tell(number, &self.recorder.phase(0, 0));
        if let Some(recording) = self.recorder.recording().cloned() {
            self.tell(number, &recording);
        }
        self.tell_roles();
    }

    /// A page has gone. If it had control, that is free.
    pub fn leave(&mut self, number: u64) {
        self.pages.retain(|page| *page != number);
        self.writer = self.writer.filter(|writer| *writer != number);
        self.tell_roles();
    }

    /// Carries out a page's message, and answers it.
    pub fn answer(&mut self, number: u64, text: &str) {
        let parsed: Result<FromPage, _> = serde_json::from_str(text);
        let (id, result) = match parsed {
            Ok(FromPage { id, wish }) => (id, self.fulfil(number, wish)),
            Err(error) => (0, Err(anyhow!("a message that is none: {error}"))),
        };
        let (error, file) = match result {
            Ok(file) => (None, file),
            Err(error) => (Some(self.failed(&error)), None),
        };
        self.tell(number, &ToPage::Answer { id, error: error.as_deref(), file: file.as_deref() }.text());
    }

    /// The text of an error; if the board has gone, all pages are told.
    fn failed(&mut self, error: &Error) -> String {
        let text = describe(error.as_ref());
        if is_gone(error) && self.board.is_ok() {
            self.board = Err(text.clone());
            self.tell_all(&self.link());
        }
        text
    }

    /// Does what a page asks for; returns a file if it asks for one.
    fn fulfil(&mut self, number: u64, wish: Wish) -> Result<Option<String>> {
        let Target { application, wiring, .. } = &self.target;
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
                let values = parse("the file", &text).map_err(|text| anyhow!("{text}"))?;
                let settings = self.parameters.check(application, values)?;
                parameters::set(host, &settings)?;
            }
            Wish::Save => return self.parameters.file(host).map(Some),
            Wish::Input { name, value } => {
                let (address, bits) = setting(application, wiring.as_ref(), &name, &value)?;
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

    /// Reads the state of the board, or looks for one that has gone with `open`; returns the time until the next look.
    pub fn poll(&mut self, open: impl FnOnce() -> Result<Host<L>>) -> Duration {
        let result = if self.board.is_ok() { self.report() } else { self.reconnect(open()) };
        match result {
            Ok(()) => EVERY,
            Err(error) => {
                self.failed(&error);
                RETRY
            }
        }
    }

    fn reconnect(&mut self, opened: Result<Host<L>>) -> Result<()> {
        let found = opened.and_then(|mut host| {
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
                let text = describe(error.as_ref());
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
        let Target { application, wiring, .. } = &self.target;
        let report = Report::read(host, Some(application), wiring.as_ref())?;
        let (values, busy) = match self.values.read(host) {
            Ok(values) => (values, None),
            Err(error @ LinkError::Busy) => (Vec::new(), Some(error.to_string())),
            Err(error) => return Err(error.into()),
        };
        let state = ToPage::State { report: &report, values: &values, busy: busy.as_deref() };
        self.tell_all(&state.text());
        let cycles = f64::from(self.cycles);
        // Requests of pages come before the rest of a long recording.
        let Session { board: Ok(host), recorder, target, way, pages, .. } = self else {
            return Ok(());
        };
        let seconds = target.wiring.as_ref().map(|wiring| cycles / (wiring.clock * 1e6));
        let told = recorder.watch(host, &target.application, seconds, |progress| {
            pages.retain(|page| way.send(*page, &progress));
            if way.is_asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        for text in told {
            self.tell_all(&text);
        }
        Ok(())
    }
}
