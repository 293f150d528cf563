// SPDX-License-Identifier: MIT OR Apache-2.0
//! Events of connections, in order, for the session that owns the board.

use super::connection::Event;
use super::{Served, target};
use anyhow::Result;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::time::Instant;
use takt_board::Host;
use takt_board::serial::Serial;
use takt_live::{EVERY, Pages, Session};

/// Connections of the pages, and what they have sent.
struct Connections {
    events: Receiver<Event>,
    /// Events that came while a recording was read.
    pending: VecDeque<Event>,
    pages: Vec<(u64, SyncSender<Arc<str>>)>,
}

impl Pages for Connections {
    fn send(&mut self, number: u64, text: &Arc<str>) -> bool {
        let page = self.pages.iter().position(|(page, _)| *page == number);
        let sent = page.is_some_and(|at| self.pages[at].1.try_send(text.clone()).is_ok());
        if !sent {
            // The thread of a page without a sender closes its connection. It then reports that the page has left.
            self.pages.retain(|(page, _)| *page != number);
        }
        sent
    }

    fn is_asked(&mut self) -> bool {
        self.pending.extend(self.events.try_iter());
        !self.pending.is_empty()
    }
}

/// The session, and the port at which it finds the board again.
pub(super) struct Server<'a> {
    session: Session<Serial, Connections>,
    served: &'a Served<'a>,
}

impl<'a> Server<'a> {
    pub(super) fn new(
        host: Host<Serial>,
        served: &'a Served<'a>,
        events: Receiver<Event>,
    ) -> Result<Server<'a>> {
        let connections = Connections { events, pending: VecDeque::new(), pages: Vec::new() };
        Ok(Server { session: Session::new(host, target(served), connections)?, served })
    }

    /// Serves pages as long as connections may come.
    pub(super) fn run(&mut self) {
        let mut due = Instant::now();
        loop {
            // A board that expects a host hears none while nobody looks.
            if !self.session.is_alone() && Instant::now() >= due {
                let port = self.served.port;
                let pause = self.session.poll(|| port.open());
                due = Instant::now() + pause;
            }
            match self.next(due) {
                Ok(Event::Joined(number, sender)) => {
                    self.session.pages().pages.push((number, sender));
                    self.session.join(number);
                    due = Instant::now();
                }
                Ok(Event::Left(number)) => {
                    self.session.pages().pages.retain(|(page, _)| *page != number);
                    self.session.leave(number);
                }
                Ok(Event::Sent(number, text)) => {
                    self.session.answer(number, &text);
                    due = due.min(Instant::now() + EVERY / 5);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// Next event, or a time-out when the state is due.
    fn next(&mut self, due: Instant) -> Result<Event, RecvTimeoutError> {
        let is_alone = self.session.is_alone();
        let Connections { events, pending, .. } = self.session.pages();
        if let Some(event) = pending.pop_front() {
            return Ok(event);
        }
        if is_alone {
            return events.recv().map_err(|_| RecvTimeoutError::Disconnected);
        }
        events.recv_timeout(due.saturating_duration_since(Instant::now()))
    }
}
