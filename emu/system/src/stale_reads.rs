// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stale reads of FIFOs: a program that reads a field of an entry after the pop that removed the entry may get the next entry's field.
//! docs/system.md defines exactly which reads are reported.

use std::collections::BTreeSet;
use takt_analysis::{StaticIssue, static_issue};
use takt_isa::program::Location;
use takt_isa::system::{Description, End, LinkKind, MIN_LATENCY, Mailbox, Source};
use takt_isa::timing::{Bundle, Cycle};
use takt_isa::{BundleAddress, Program, Register};

/// Cycles from a pop's writeback to the first bundle that may read the next head: one until it arrives, then the delay of any value that
/// arrives from a link.
const NEXT: Cycle = 1 + MIN_LATENCY;

/// Reason why a read is doubtful.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doubt {
    /// The source reads before the pop, but the scheduler has moved the read after it: the read gets the next head, if there is one.
    Moved,
    /// Too soon after the pop: the read may get the old head or the next one.
    Between,
}

/// Doubtful read of a field of a FIFO's head, after the pop in the same straight line of bundles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StaleRead {
    /// Index of the reading core.
    pub core: usize,
    /// Index of the FIFO among the links.
    pub link: usize,
    /// Input port with the field.
    pub field: Register,
    /// Output port whose writes pop.
    pub pop: Register,
    /// Bundle that reads the field.
    pub read_at: BundleAddress,
    /// Source line of the read, if known.
    pub read: Option<Location>,
    /// Source line of the pop, if known.
    pub popped: Option<Location>,
    /// Cycles from the pop's writeback to the read.
    pub after: Cycle,
    /// Cycles from the pop's writeback until all fields of the next head have arrived.
    pub complete: Cycle,
    /// Reason for the doubt.
    pub doubt: Doubt,
}

/// Operation that reads a field or pops, in its place along a straight line.
struct Access {
    register: Register,
    at: BundleAddress,
    line: Option<Location>,
    /// Issue of a read, writeback of a pop; in cycles of the straight line.
    cycle: Cycle,
}

/// Stale reads in a system's programs, each source line and field once.
pub fn stale_reads(description: &Description) -> Vec<StaleRead> {
    let mut found = Vec::new();
    for (number, core) in description.cores.iter().enumerate() {
        // Latched inputs do not change before the next tick.
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

/// Search for stale reads of one FIFO in its receiver's program.
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

    /// Searches a straight line of bundles.
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

    /// Last source line of the bundle above a stretch.
    fn line_above(&self, first: BundleAddress) -> Option<Location> {
        let slots = self.program.machine.slots.len();
        let end = first.index() * slots;
        let lines = self.program.lines.get(end.checked_sub(slots)?..end)?;
        lines.iter().flatten().max_by_key(|line| line.line).copied()
    }

    /// The source reads before the pop. Lines of a macro defined above the stretch say nothing about the order, so reads on such lines
    /// do not count.
    fn stands_before(&self, read: &Access, pop: &Access, above: Option<Location>) -> bool {
        let (Some(read), Some(pop)) = (read.line, pop.line) else { return false };
        let below = above.is_none_or(|above| above.file != read.file || above.line < read.line);
        read.file == pop.file && read.line < pop.line && below
    }
}

/// Code repeated for each entry (`.rep`): the same line also reads the field before the pop, so the read is not stale.
fn repeated(read: &Access, pop: &Access, reads: &[Access]) -> bool {
    reads.iter().any(|other| {
        other.register == read.register && other.line == read.line && other.cycle < pop.cycle + NEXT
    })
}
