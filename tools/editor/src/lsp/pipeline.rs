// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pipeline diagram for a view beside the source: operations of each bundle with cycles and source lines. The cycles equal those of the
//! inlay hints.

use crate::lsp::program::CountedProgram;
use crate::lsp::timing::cycle_from;
use lsp_types::Uri;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use takt_analysis::picture::Picture;
use takt_analysis::{EdgeSlots, StaticIssue, Trace};
use takt_isa::program::Location;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Instruction, Program, SlotIndex};

/// Maximum number of bundles in a diagram.
const BUNDLES: usize = 4096;

/// Diagram of a program, sent to the client as JSON.
#[derive(Serialize)]
pub(crate) struct Pipeline {
    machine: &'static str,
    /// No source of the program, including included files, has changed since.
    #[serde(rename = "current")]
    is_current: bool,
    /// Cycles of each section as text, periods first.
    sections: Vec<String>,
    /// URIs of the operations' files; `None` for a file that editors cannot open.
    files: Vec<Option<Uri>>,
    bundles: Vec<Bundle>,
    /// Longest dependence chain of each straight-line block.
    chain: Vec<Link>,
    /// Number of bundles left out.
    more: usize,
}

#[derive(Serialize)]
struct Bundle {
    address: BundleAddress,
    /// Point from which the cycles are counted: a section, a label, or a bundle.
    from: String,
    cycle: Cycle,
    stalls: Vec<Stall>,
    operations: Vec<Operation>,
}

/// Reason why a bundle waited, as in `takt analyse`: indices of bundles, and slots if a single operation is the reason.
#[derive(Serialize)]
struct Link {
    from: usize,
    to: usize,
    from_slot: Option<&'static str>,
    to_slot: Option<&'static str>,
    cycles: Cycle,
    text: String,
}

#[derive(Serialize)]
struct Stall {
    /// Kind of delay, as named by `takt analyse`.
    cause: &'static str,
    cycles: u32,
    text: String,
}

#[derive(Serialize)]
struct Operation {
    slot: &'static str,
    unit: &'static str,
    text: String,
    /// Latency in cycles; `None` for an operation without a result.
    latency: Option<u32>,
    /// The operation is on the longest chain.
    critical: bool,
    /// Index of the operation's file, and the line number in it, from 0.
    file: Option<usize>,
    line: Option<u32>,
}

/// Facts about the whole program that the diagram needs.
pub(crate) struct ProgramFacts {
    pub(crate) is_current: bool,
    pub(crate) sections: Vec<String>,
}

/// Diagram of a program. `line` maps a line (from 0) of the scheduled text to its current place; `uri` maps files.
pub(crate) fn pipeline(
    counted: &CountedProgram,
    whole: ProgramFacts,
    uri: impl Fn(&str) -> Option<Uri>,
    line: impl Fn(&str, u32) -> Option<u32>,
) -> Pipeline {
    let program = &counted.assembled.program;
    let mut files = Vec::new();
    let mut numbers: BTreeMap<u32, usize> = BTreeMap::new();
    let mut place = |location: &Location| {
        let name = program.files.get(location.file as usize)?;
        let number = *numbers.entry(location.file).or_insert_with(|| {
            files.push(uri(name));
            files.len() - 1
        });
        Some((number, line(name, location.line.saturating_sub(1))?))
    };
    let shown = &counted.issues[..counted.issues.len().min(BUNDLES)];
    let (chain, critical) = chains(program, shown);
    let bundles = shown.iter().enumerate().map(|(index, issue)| {
        let locations = program.locations(issue.address);
        let words = program.words(issue.address).unwrap_or_default();
        let operation = |(slot, word): (SlotIndex, &u64)| {
            let instruction = Instruction::decode(*word).ok()?;
            let of = program.machine.slot(slot);
            let unit = of.unit(instruction.op.row().function)?;
            let place = locations.get(slot.index()).copied().flatten().and_then(|location| place(&location));
            Some(Operation {
                slot: of.name,
                unit: unit.name,
                text: program.operation_text(slot, &instruction),
                latency: instruction.writes(of).map(|_| unit.latency),
                critical: critical.contains(&(index, slot)),
                file: place.map(|place| place.0),
                line: place.map(|place| place.1),
            })
        };
        Bundle {
            address: issue.address,
            from: cycle_from(program, issue.from),
            cycle: issue.cycle,
            stalls: issue
                .stalls
                .iter()
                .map(|&(cause, cycles)| Stall {
                    cause: cause.name(),
                    cycles,
                    text: program.cause_text(cause),
                })
                .collect(),
            operations: SlotIndex::all().zip(words).filter_map(operation).collect(),
        }
    });
    let bundles: Vec<Bundle> = bundles.collect();
    let more = counted.issues.len() - bundles.len();
    let ProgramFacts { is_current, sections } = whole;
    Pipeline { machine: program.machine.name, is_current, sections, files, bundles, chain, more }
}

/// Longest chain of each straight-line block, and the operations on it as pairs of bundle index and slot.
fn chains(program: &Program, issues: &[StaticIssue]) -> (Vec<Link>, BTreeSet<(usize, SlotIndex)>) {
    let (mut chain, mut critical, mut first) = (Vec::new(), BTreeSet::new(), 0);
    for line in issues.chunk_by(|one, next| one.from == next.from) {
        let picture = Picture::new(program, "", 0, Trace::predicted(line));
        critical.extend(picture.critical().into_iter().map(|(issue, slot)| (first + issue, slot)));
        chain.extend(picture.chain.iter().map(|link| {
            let EdgeSlots { from, to } = link.ends(program, &picture.trace);
            let name = |slot: Option<SlotIndex>| slot.map(|slot| program.machine.slot(slot).name);
            Link {
                from: first + link.from,
                to: first + link.to,
                from_slot: name(from),
                to_slot: name(to),
                cycles: link.cycles,
                text: picture.link(link),
            }
        }));
        first += line.len();
    }
    (chain, critical)
}
