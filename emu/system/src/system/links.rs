// SPDX-License-Identifier: MIT OR Apache-2.0
//! Transport of values over links, from one core's output ports to another's input ports.

use super::{LinkEvent, LinkEventKind, LinkState, System, latched};
use crate::fifo::Change;
use std::sync::Arc;
use takt_emu::{PortWrite, Status};
use takt_isa::Register;
use takt_isa::system::{End, Link, LinkKind, Side, Source, Status as FifoStatus};
use takt_isa::timing::{Cycle, ENDED_DELAY};

impl System {
    /// Performs a FIFO's pending actions up to the cycle known of both sides. Returns the number of cycles done.
    pub(super) fn carry_out(&mut self, number: usize) -> Cycle {
        let link = &self.description.links[number];
        let end =
            (self.known_until(link.from) + link.transit()).min(self.known_until(link.to)).min(self.until);
        let LinkState::Fifo { fifo, .. } = &mut self.links[number] else { return 0 };
        if fifo.next_cycle().is_none_or(|cycle| cycle >= end) {
            // Fast path: no action is pending in these cycles.
            fifo.done = fifo.done.max(end);
            return fifo.done;
        }
        let description = Arc::clone(&self.description);
        let link = &description.links[number];
        let LinkKind::Fifo { sender, receiver, .. } = &link.kind else { return 0 };
        loop {
            let LinkState::Fifo { fifo, .. } = &mut self.links[number] else { return 0 };
            let Some((cycle, change)) = fifo.next(end) else { return fifo.done };
            let head = fifo.store.entries.front().filter(|_| change.head).cloned();
            let status = |list: &[(FifoStatus, Register)]| -> Vec<u32> {
                list.iter().map(|(status, _)| fifo.store.status(*status)).collect()
            };
            let (to_sender, to_receiver) = (status(sender), status(receiver));
            self.fifo_events(cycle, number, change);
            let core = |end| if let End::Core(core) = end { Some(core) } else { None };
            if let Some(core) = core(link.to) {
                for (field, value) in head.into_iter().flatten().enumerate() {
                    self.arrive(core, cycle + 1, Source::Field { link: number, field }, value);
                }
            }
            let sides = [
                (link.from, Side::Sender, sender, to_sender, cycle + 1 + link.transit()),
                (link.to, Side::Receiver, receiver, to_receiver, cycle + 1),
            ];
            for (end, side, list, values, cycle) in sides {
                for (&(status, _), value) in list.iter().zip(values) {
                    if let Some(core) = core(end) {
                        self.arrive(core, cycle, Source::Status { link: number, side, status }, value);
                    }
                }
            }
        }
    }

    pub(super) fn fifo_events(&mut self, cycle: Cycle, link: usize, change: Change) {
        for (happened, kind) in [
            (change.popped, LinkEventKind::Popped),
            (change.pushed, LinkEventKind::Pushed),
            (change.overflow, LinkEventKind::Overflow),
            (change.underflow, LinkEventKind::Underflow),
        ] {
            if happened {
                self.event(cycle, link, kind);
            }
        }
    }

    pub(super) fn event(&mut self, cycle: Cycle, link: usize, kind: LinkEventKind) {
        if let Some(events) = &mut self.events {
            events.push(LinkEvent { cycle, link, kind });
        }
    }

    /// Delivers a value to a core's gate.
    pub(super) fn arrive(&mut self, core: usize, cycle: Cycle, source: Source, value: u32) {
        let state = &mut self.cores[core];
        if let Some(mailbox) = state.mailboxes.iter().position(|mailbox| mailbox.source == source) {
            state.gate.arrive(cycle, mailbox, value);
        }
    }

    /// Delivers a field of a wire to its receiver.
    pub(super) fn deliver(&mut self, number: usize, cycle: Cycle, field: usize, value: u32) {
        self.event(cycle, number, LinkEventKind::Value(value));
        match self.description.links[number].to {
            End::Core(core) => self.arrive(core, cycle, Source::Field { link: number, field }, value),
            End::Host => {
                if let LinkState::Wire { host, .. } = &mut self.links[number] {
                    host.push_back((cycle, value));
                }
            }
        }
    }

    /// Takes the snapshots for a core's next tick and schedules the tick. Returns false if a sender has not run far enough.
    pub(super) fn take(&mut self, core: usize, cycle: Cycle) -> bool {
        let description = Arc::clone(&self.description);
        let here = |link: &&Link| link.is_snapshot() && link.to == End::Core(core);
        let far = |link: &Link| self.known_until(link.from) + ENDED_DELAY + link.transit() >= cycle;
        if !description.links.iter().filter(here).all(far) {
            return false;
        }
        let waits = match self.cores[core].emulator.status() {
            Status::Waiting { since, .. } => since + ENDED_DELAY <= cycle,
            _ => false,
        };
        let numbered = description.links.iter().enumerate().filter(|(_, link)| here(link));
        let mut any = false;
        for (number, _) in numbered {
            any = true;
            self.see(number, cycle);
            if waits {
                let LinkState::Snapshot { shown, taken, .. } = &mut self.links[number] else { continue };
                *taken += 1;
                for (field, value) in shown.clone().into_iter().enumerate() {
                    self.arrive(core, cycle, Source::Field { link: number, field }, value);
                }
            }
            self.event(cycle, number, if waits { LinkEventKind::Taken } else { LinkEventKind::Skipped });
        }
        let state = &mut self.cores[core];
        state.periods.skipped += u64::from(any && !waits);
        state.emulator.tick_at(state.tick);
        state.taken = true;
        true
    }

    /// Shows the receiver of a snapshot the newest published values that are visible in a cycle.
    pub(super) fn see(&mut self, number: usize, cycle: Cycle) {
        if let LinkState::Snapshot { published, shown, .. } = &mut self.links[number] {
            while let Some((_, values)) = published.pop_front_if(|(first, _)| *first <= cycle) {
                *shown = values;
            }
        }
    }

    /// Delivers arrived values to the host.
    pub(super) fn show(&mut self) {
        for number in 0..self.links.len() {
            if matches!(self.links[number], LinkState::Fifo { .. }) {
                self.carry_out(number);
            }
            if self.description.links[number].to == End::Host {
                self.see(number, self.now);
            }
            if let LinkState::Wire { host, shown, .. } = &mut self.links[number] {
                while let Some((_, value)) = host.pop_front_if(|(cycle, _)| *cycle < self.now) {
                    *shown = value;
                }
            }
        }
    }

    /// Puts a core's writes onto the links, and what it publishes in these cycles, both ascending.
    pub(super) fn send(&mut self, core: usize, writes: &[PortWrite], publications: &[Cycle]) {
        if writes.is_empty() && publications.is_empty() {
            return;
        }
        // The core's own writes may change the FIFOs that it sees.
        self.cores[core].known = 0;
        let description = Arc::clone(&self.description);
        let here = End::Core(core);
        for (number, link) in description.links.iter().enumerate() {
            if link.from == here {
                match &link.kind {
                    LinkKind::Wire => self.send_wire(number, link, writes, publications),
                    LinkKind::Snapshot { strobe } => {
                        let strobed = strobe.map(|strobe| cycles_of(writes, strobe));
                        self.send_snapshot(number, link, writes, strobed.as_deref().unwrap_or(publications));
                    }
                    LinkKind::Fifo { push: Some(push), .. } => {
                        let LinkState::Fifo { working, fifo } = &mut self.links[number] else { continue };
                        follow(link, writes, &cycles_of(writes, *push), working, |cycle, entry| {
                            fifo.push(cycle + link.transit(), entry);
                        });
                    }
                    LinkKind::Fifo { .. } => {}
                }
            }
            if let (LinkKind::Fifo { pop: Some(pop), .. }, true) = (&link.kind, link.to == here)
                && let LinkState::Fifo { fifo, .. } = &mut self.links[number]
            {
                let pops = writes.iter().filter(|write| write.register == *pop);
                pops.for_each(|write| fifo.pop(write.cycle));
            }
        }
    }

    fn send_wire(&mut self, number: usize, link: &Link, writes: &[PortWrite], publications: &[Cycle]) {
        let output = link.fields.first().and_then(|field| field.output);
        let mut written = writes.iter().filter(|write| Some(write.register) == output).peekable();
        if !latched(&self.description, link.from) {
            for write in written {
                self.deliver(number, write.cycle + link.transit(), 0, write.value);
            }
            return;
        }
        for &cycle in publications {
            let LinkState::Wire { changed, .. } = &mut self.links[number] else { return };
            while let Some(write) = written.next_if(|write| write.cycle <= cycle) {
                *changed = Some(write.value);
            }
            if let Some(value) = changed.take() {
                self.deliver(number, cycle + ENDED_DELAY + link.transit(), 0, value);
            }
        }
        if let (Some(write), LinkState::Wire { changed, .. }) = (written.last(), &mut self.links[number]) {
            *changed = Some(write.value);
        }
    }

    fn send_snapshot(&mut self, number: usize, link: &Link, writes: &[PortWrite], actions: &[Cycle]) {
        let LinkState::Snapshot { working, published, .. } = &mut self.links[number] else { return };
        let first = |cycle| cycle + ENDED_DELAY + link.transit() + 1;
        follow(link, writes, actions, working, |cycle, values| published.push_back((first(cycle), values)));
        for &cycle in actions {
            self.event(first(cycle), number, LinkEventKind::Published);
        }
    }
}

/// Cycles in which a port is written, each once.
fn cycles_of(writes: &[PortWrite], register: Register) -> Vec<Cycle> {
    let written = writes.iter().filter(|write| write.register == register);
    let mut cycles: Vec<Cycle> = written.map(|write| write.cycle).collect();
    cycles.dedup();
    cycles
}

/// Applies a core's writes to the fields of a link, and calls `tell` with all fields in the cycle of each action. Fields written in that
/// cycle are included. Writes and actions ascend.
fn follow(
    link: &Link,
    writes: &[PortWrite],
    actions: &[Cycle],
    working: &mut [u32],
    mut tell: impl FnMut(Cycle, Vec<u32>),
) {
    let apply = |working: &mut [u32], writes: &[PortWrite]| {
        for write in writes {
            for (field, value) in link.fields.iter().zip(&mut *working) {
                if field.output == Some(write.register) {
                    *value = write.value;
                }
            }
        }
    };
    let mut left = writes;
    for &cycle in actions {
        let (before, after) = left.split_at(left.partition_point(|write| write.cycle <= cycle));
        apply(working, before);
        left = after;
        tell(cycle, working.to_vec());
    }
    apply(working, left);
}
