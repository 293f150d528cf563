// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stale reads of FIFOs: a program that reads a field of an entry after the pop that took the entry out may get the next entry's.
//! docs/system.md says exactly which reads are told.

use std::collections::BTreeSet;
use takt_analysis::{StaticIssue, static_issue};
use takt_isa::program::Location;
use takt_isa::system::{Description, End, LinkKind, MIN_LATENCY, Mailbox, Source};
use takt_isa::timing::{Bundle, Cycle};
use takt_isa::{BundleAddress, Program, Register};

/// Cycles from a pop's writeback to the first bundle that may read the next head: one until it arrives, then as a value that
/// arrives from a link.
const NEXT: Cycle = 1 + MIN_LATENCY;

/// The kind of doubt about a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doubt {
    /// The source has it before the pop, and the scheduler has put it behind: it is the next head's if there is one.
    Moved,
    /// It is so soon after the pop that it may be this head's or the next one's.
    Between,
}

/// A read of a field of a FIFO's head after the pop in the same straight line of bundles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StaleRead {
    /// The core that reads.
    pub core: usize,
    /// The FIFO.
    pub link: usize,
    /// The input port with the field.
    pub field: Register,
    /// The output port whose writes pop.
    pub pop: Register,
    /// The bundle that reads.
    pub read_at: BundleAddress,
    /// The source line of the read, if it is known.
    pub read: Option<Location>,
    /// The source line of the pop.
    pub popped: Option<Location>,
    /// Cycles from the pop's writeback to the read.
    pub after: Cycle,
    /// So many cycles after the writeback the next head is complete.
    pub complete: Cycle,
    /// The kind of doubt.
    pub doubt: Doubt,
}

/// An operation that reads a field or pops, in its place along a straight line.
struct Access {
    register: Register,
    at: BundleAddress,
    line: Option<Location>,
    /// Of a read, its issue; of a pop, its writeback.
    cycle: Cycle,
}

/// The stale reads in a system's programs, each source line and field once.
pub fn stale_reads(description: &Description) -> Vec<StaleRead> {
    let mut found = Vec::new();
    for (number, core) in description.cores.iter().enumerate() {
        // A latched input stays as it is until the next tick.
        if core.program.latched {
            continue;
        }
        let mailboxes = description.mailboxes(number);
        let issues = static_issue(&core.program);
        for (link, known) in description.links.iter().enumerate() {
            let LinkKind::Fifo { pop: Some(pop), .. } = known.kind else { continue };
            if known.to == End::Core(number) {
                let seek = Seek { core: number, link, pop, program: &core.program, mailboxes: &mailboxes };
                for stretch in issues.chunk_by(|one, next| one.from == next.from) {
                    seek.stretch(stretch, &mut found);
                }
            }
        }
    }
    let mut told = BTreeSet::new();
    found.retain(|read: &StaleRead| {
        let place = read.read.map_or((u32::MAX, read.read_at.index() as u32), |line| (line.file, line.line));
        told.insert((read.core, read.link, read.field, place))
    });
    found
}

/// One FIFO at its receiver.
struct Seek<'d> {
    core: usize,
    link: usize,
    pop: Register,
    program: &'d Program,
    mailboxes: &'d [Mailbox],
}

impl Seek<'_> {
    fn is_field(&self, register: Register) -> bool {
        self.mailboxes.iter().any(|mailbox| {
            mailbox.register == register
                && matches!(mailbox.source, Source::Field { link, .. } if link == self.link)
        })
    }

    /// A straight line of bundles.
    fn stretch(&self, issues: &[StaticIssue], found: &mut Vec<StaleRead>) {
        let (mut reads, mut pops) = (Vec::new(), Vec::new());
        let machine = self.program.machine;
        for issue in issues {
            let Some(Ok(bundle)) = self.program.bundle(issue.address) else { return };
            let timing = Bundle::new(machine, &bundle);
            for (slot, instruction) in bundle.iter().enumerate() {
                let line = self.line(issue.address, slot);
                let access = |register, cycle| Access { register, at: issue.address, line, cycle };
                if instruction.writes(&machine.slots[slot]) == Some(self.pop) {
                    let latency = timing.writebacks().find(|(register, _)| *register == self.pop);
                    pops.push(access(
                        self.pop,
                        issue.cycle + latency.map_or(0, |(_, cycles)| cycles as Cycle),
                    ));
                }
                let fields = instruction.reads().iter().filter(|register| self.is_field(**register));
                reads.extend(fields.map(|register| access(*register, issue.cycle)));
            }
        }
        let above = issues.first().and_then(|issue| self.line_above(issue.address));
        let complete = NEXT + self.mailboxes.len() as Cycle;
        for read in &reads {
            for pop in pops.iter().filter(|pop| read.cycle >= pop.cycle + NEXT) {
                let after = read.cycle - pop.cycle;
                let doubt = match () {
                    () if self.stands_before(read, pop, above) && !repeated(read, pop, &reads) => {
                        Doubt::Moved
                    }
                    () if after < complete => Doubt::Between,
                    () => continue,
                };
                found.push(StaleRead {
                    core: self.core,
                    link: self.link,
                    field: read.register,
                    pop: self.pop,
                    read_at: read.at,
                    read: read.line,
                    popped: pop.line,
                    after,
                    complete,
                    doubt,
                });
                break;
            }
        }
    }

    fn line(&self, address: BundleAddress, slot: usize) -> Option<Location> {
        *self.program.lines.get(address.index() * self.program.machine.slots.len() + slot)?
    }

    /// The last source line of the bundle above a stretch.
    fn line_above(&self, first: BundleAddress) -> Option<Location> {
        let slots = self.program.machine.slots.len();
        let end = first.index() * slots;
        let lines = self.program.lines.get(end.checked_sub(slots)?..end)?;
        lines.iter().flatten().max_by_key(|line| line.line).copied()
    }

    /// True if the source has a read before a pop. Lines of a macro that is defined elsewhere say nothing of the order: a line
    /// above the stretch is none of it.
    fn stands_before(&self, read: &Access, pop: &Access, above: Option<Location>) -> bool {
        let (Some(read), Some(pop)) = (read.line, pop.line) else { return false };
        let below = above.is_none_or(|above| above.file != read.file || above.line < read.line);
        read.file == pop.file && read.line < pop.line && below
    }
}

/// True if the same line reads the field before the pop too, as one that is repeated (`.rep`) does, for each entry.
fn repeated(read: &Access, pop: &Access, reads: &[Access]) -> bool {
    reads.iter().any(|other| {
        other.register == read.register && other.line == read.line && other.cycle < pop.cycle + NEXT
    })
}
