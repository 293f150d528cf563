// SPDX-License-Identifier: MIT OR Apache-2.0
//! Actions of the host between runs.

use super::{HostAction, HostError, LinkEventKind, LinkState, System};
use std::sync::Arc;
use takt_emu::Number;
use takt_isa::system::{End, LinkKind};

impl System {
    fn acted(&mut self, action: impl FnOnce() -> HostAction) {
        if let Some(actions) = &mut self.actions {
            actions.push((self.now, action()));
        }
    }

    /// Writes an input of the system. A wire carries the value at once; a field of a snapshot or of a FIFO waits for [`System::publish`]
    /// or [`System::push`].
    ///
    /// # Errors
    /// If there is no such input.
    pub fn set_input(&mut self, name: &str, bits: u32) -> Result<(), HostError> {
        let description = Arc::clone(&self.description);
        let mut found = false;
        for (number, link) in description.links.iter().enumerate().filter(|(_, link)| link.from == End::Host)
        {
            match &mut self.links[number] {
                LinkState::Wire { .. } => {
                    if link.fields.first().is_some_and(|field| field.from == name) {
                        self.deliver(number, self.now + link.transit(), 0, bits);
                        found = true;
                    }
                }
                LinkState::Snapshot { working, .. } | LinkState::Fifo { working, .. } => {
                    let Some(name) = name.strip_prefix(&link.name).and_then(|rest| rest.strip_prefix('.'))
                    else {
                        continue;
                    };
                    if let Some(field) = link.fields.iter().position(|field| field.from == name) {
                        working[field] = bits;
                        found = true;
                    }
                }
            }
        }
        if !found {
            return Err(HostError::Unknown { what: "input", name: name.to_owned() });
        }
        self.acted(|| HostAction::Input { name: name.to_owned(), bits });
        Ok(())
    }

    /// Publishes the values of a snapshot that the host has set.
    ///
    /// # Errors
    /// If the link is not a snapshot from the host.
    pub fn publish(&mut self, link: usize) -> Result<(), HostError> {
        let description = Arc::clone(&self.description);
        let now = self.now;
        match (description.links.get(link), self.links.get_mut(link)) {
            (Some(known), Some(LinkState::Snapshot { working, published, .. }))
                if known.from == End::Host =>
            {
                let first = now + known.transit() + 1;
                published.push_back((first, working.clone()));
                self.event(first, link, LinkEventKind::Published);
                self.acted(|| HostAction::Publish(link));
                Ok(())
            }
            (known, _) => {
                let name = known.map_or_else(|| link.to_string(), |link| link.name.clone());
                Err(HostError::Unknown { what: "snapshot from the host", name })
            }
        }
    }

    /// Pushes the host's values into a FIFO. Returns false if the FIFO overflows, as far as the host can know: entries under way count as
    /// present, and pops before the entry arrives are not foreseen.
    ///
    /// # Errors
    /// If the link is not a FIFO from the host.
    pub fn push(&mut self, link: usize) -> Result<bool, HostError> {
        let description = Arc::clone(&self.description);
        let now = self.now;
        match (description.links.get(link), self.links.get_mut(link)) {
            (Some(known), Some(LinkState::Fifo { working, fifo })) if known.from == End::Host => {
                let LinkKind::Fifo { depth, .. } = known.kind else { return Ok(false) };
                let room = fifo.store.entries.len() + fifo.pushing() < depth as usize;
                let cycle = (now + known.transit()).max(fifo.free().0);
                fifo.push(cycle, working.clone());
                self.acted(|| HostAction::Push(link));
                Ok(room)
            }
            (known, _) => {
                let name = known.map_or_else(|| link.to_string(), |link| link.name.clone());
                Err(HostError::Unknown { what: "FIFO from the host", name })
            }
        }
    }

    /// Pops the head of a FIFO to the host; `None` if the FIFO is empty.
    ///
    /// # Errors
    /// If the link is not a FIFO to the host.
    pub fn pop(&mut self, link: usize) -> Result<Option<Vec<u32>>, HostError> {
        let description = Arc::clone(&self.description);
        let now = self.now;
        match (description.links.get(link), self.links.get_mut(link)) {
            (Some(known), Some(LinkState::Fifo { fifo, .. })) if known.to == End::Host => {
                let entry = fifo.store.entries.get(fifo.popping()).cloned();
                if entry.is_some() {
                    fifo.pop(now.max(fifo.free().1));
                    self.acted(|| HostAction::Pop(link));
                }
                Ok(entry)
            }
            (known, _) => {
                let name = known.map_or_else(|| link.to_string(), |link| link.name.clone());
                Err(HostError::Unknown { what: "FIFO to the host", name })
            }
        }
    }

    /// Repeats a recorded action ([`System::host_actions`]). Returns false if a FIFO was full, or empty.
    ///
    /// # Errors
    /// If the system has no such input or link.
    pub fn act(&mut self, action: &HostAction) -> Result<bool, HostError> {
        match action {
            HostAction::Input { name, bits } => self.set_input(name, *bits).map(|()| true),
            HostAction::Publish(link) => self.publish(*link).map(|()| true),
            HostAction::Push(link) => self.push(*link),
            HostAction::Pop(link) => self.pop(*link).map(|entry| entry.is_some()),
        }
    }

    /// Bits that the host sees on an output of the system; for a FIFO, its head's, 0 while it is empty.
    ///
    /// # Errors
    /// If there is no such output.
    pub fn output(&self, name: &str) -> Result<u32, HostError> {
        let ports = self.description.outputs();
        let port = ports.iter().find(|port| port.name == name);
        let port = port.ok_or_else(|| HostError::Unknown { what: "output", name: name.to_owned() })?;
        Ok(match &self.links[port.link] {
            LinkState::Wire { shown, .. } => *shown,
            LinkState::Snapshot { shown, .. } => shown[port.field],
            LinkState::Fifo { fifo, .. } => fifo.store.entries.front().map_or(0, |entry| entry[port.field]),
        })
    }

    /// Value of an output like [`System::output`], as a number of the port's type.
    ///
    /// # Errors
    /// If there is no such output.
    pub fn output_number(&self, name: &str) -> Result<Number, HostError> {
        let bits = self.output(name)?;
        let ty = self.description.outputs().iter().find(|port| port.name == name).map(|port| port.ty);
        Ok(ty.map_or(Number::Bits(bits), |ty| Number::of(ty, bits)))
    }

    /// Bits of an output by link and field, like [`Description::outputs`](crate::Description::outputs), for callers that poll in every
    /// tick. `None` if there is no such field.
    pub fn field_bits(&self, link: usize, field: usize) -> Option<u32> {
        match self.links.get(link)? {
            LinkState::Wire { shown, .. } => (field == 0).then_some(*shown),
            LinkState::Snapshot { shown, .. } => shown.get(field).copied(),
            LinkState::Fifo { fifo, .. } => match fifo.store.entries.front() {
                Some(entry) => entry.get(field).copied(),
                None => Some(0),
            },
        }
    }
}
