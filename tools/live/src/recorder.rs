// SPDX-License-Identifier: MIT OR Apache-2.0
//! The scope of the board, as pages use it: armed once or again and again, watched without waiting, read in parts.

use crate::message::{self, Phase, Request, ScopeSize, ToPage};
use crate::recording::{summary, table};
use anyhow::{Result, anyhow, bail};
use std::ops::ControlFlow;
use std::sync::Arc;
use takt_board::protocol::Line;
use takt_board::scope::{MOST_EVERY, Recording, Scope, ScopeError, ScopeState, Setup};
use takt_board::{Application, Host};

/// Recording that is under way.
struct Armed {
    request: Request,
    setup: Setup,
    phase: Phase,
}

/// The scope and its last recording.
#[derive(Default)]
pub(crate) struct Recorder {
    /// The scope of the board; `None` if its circuit has none.
    scope: Option<Scope>,
    armed: Option<Armed>,
    /// The last request of a page.
    request: Option<Request>,
    recording: Option<Recording>,
    /// Message with the last recording.
    message: Option<Arc<str>>,
    /// Reason for which the last recording failed.
    failure: Option<String>,
}

impl Recorder {
    /// Looks at a board that has just been connected. One that was under power before may still be armed.
    pub(crate) fn attach<L: Line>(&mut self, host: &mut Host<L>) -> Result<(), ScopeError> {
        self.scope = match host.scope() {
            Ok(scope) => Some(scope),
            Err(ScopeError::None) => None,
            Err(error) => return Err(error),
        };
        if self.armed.is_some() && (self.scope.is_none() || host.scope_state()? == ScopeState::Rest) {
            self.armed = None;
            self.failure = Some("the board was switched off, and has lost its recording".to_owned());
        }
        Ok(())
    }

    pub(crate) fn size(&self) -> Option<ScopeSize> {
        self.scope.map(|Scope { channels, depth, .. }| ScopeSize { channels, depth })
    }

    pub(crate) fn recording(&self) -> Option<&Arc<str>> {
        self.message.as_ref()
    }

    /// Message about the phase, for all pages.
    pub(crate) fn phase(&self, passed: usize, all: usize) -> Arc<str> {
        let (phase, text) = match &self.armed {
            Some(Armed { phase, setup, .. }) => (*phase, setup.triggers()),
            None => (Phase::Rest, self.failure.clone().unwrap_or_default()),
        };
        ToPage::Scope { phase, text: &text, passed, all, request: self.request.as_ref() }.text()
    }

    pub(crate) fn arm<L: Line>(
        &mut self,
        host: &mut Host<L>,
        application: &Application<'_>,
        request: Request,
    ) -> Result<()> {
        let setup = Setup::new(application, &request.channels, &request.triggers);
        let mut setup = setup.map_err(|text| anyhow!("{text}"))?;
        if !(1..=MOST_EVERY).contains(&request.every) {
            bail!("a sample every {} periods: expected 1 to {MOST_EVERY}", request.every);
        }
        if request.samples == Some(0) {
            bail!("a recording has 1 sample at least");
        }
        (setup.every, setup.samples, setup.before) = (request.every, request.samples, request.before);
        let scope = self.scope.ok_or(ScopeError::None)?;
        host.arm(application, &scope, &setup)?;
        self.request = Some(request.clone());
        self.armed = Some(Armed { request, setup, phase: Phase::Armed });
        self.failure = None;
        Ok(())
    }

    /// Ends the recording: what there is will be read.
    pub(crate) fn end<L: Line>(&mut self, host: &mut Host<L>) -> Result<()> {
        let Some(armed) = &mut self.armed else { bail!("no recording is under way") };
        armed.request.repeat = false;
        Ok(host.end_scope()?)
    }

    /// Looks after the recording; `passed` gets the words that have come, and of all, and says whether to go on reading. Returns what pages
    /// are to be told.
    pub(crate) fn watch<L: Line>(
        &mut self,
        host: &mut Host<L>,
        application: &Application<'_>,
        seconds: Option<f64>,
        mut passed: impl FnMut(Arc<str>) -> ControlFlow<()>,
    ) -> Result<Vec<Arc<str>>, ScopeError> {
        let (Some(scope), Some(armed)) = (self.scope, &mut self.armed) else { return Ok(Vec::new()) };
        let phase = match host.scope_state()? {
            ScopeState::Triggered => Phase::Triggered,
            ScopeState::Done => Phase::Reading,
            ScopeState::Armed | ScopeState::Rest => Phase::Armed,
        };
        let is_new = std::mem::replace(&mut armed.phase, phase) != phase;
        if phase != Phase::Reading {
            return Ok(if is_new { vec![self.phase(0, 0)] } else { Vec::new() });
        }
        let (setup, request) = (armed.setup.clone(), armed.request.clone());
        let read = host.recording(&scope, &setup, |words, all| passed(self.phase(words, all)));
        let recording = match read {
            Ok(recording) => recording,
            // A page has done something; the board keeps the recording.
            Err(ScopeError::Interrupted) => return Ok(Vec::new()),
            Err(ScopeError::Link(error)) => return Err(error.into()),
            Err(error) => {
                // Another host has armed the scope with other channels.
                (self.armed, self.failure) = (None, Some(error.to_string()));
                return Ok(vec![self.phase(0, 0)]);
            }
        };
        self.armed = None;
        if recording.periods.is_empty() {
            self.failure = Some("no period has ended since the scope was armed".to_owned());
            return Ok(vec![self.phase(0, 0)]);
        }
        let message = message::recording(&recording, &summary(&recording), seconds);
        (self.recording, self.message) = (Some(recording), Some(message.clone()));
        if request.repeat {
            host.arm(application, &scope, &setup)?;
            self.armed = Some(Armed { request, setup, phase: Phase::Armed });
        }
        Ok(vec![message, self.phase(0, 0)])
    }

    /// The last recording as CSV.
    pub(crate) fn csv(&self) -> Result<String> {
        self.recording.as_ref().map(table).ok_or_else(|| anyhow!("there is no recording yet"))
    }
}
