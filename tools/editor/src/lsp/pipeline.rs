// SPDX-License-Identifier: MIT OR Apache-2.0
//! The picture of the pipeline, for a view beside the source: what each bundle issues and when, and the lines that it comes
//! from. The same cycles as in the inlay hints.

use crate::lsp::program::Counted;
use crate::lsp::timing::cycle_from;
use lsp_types::Uri;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use takt_analysis::picture::Picture;
use takt_analysis::{Ends, StaticIssue, Trace};
use takt_isa::program::Location;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Instruction, Program, SlotIndex};

/// Bundles of a picture at most.
const BUNDLES: usize = 4096;

/// The picture.
#[derive(Serialize)]
pub(crate) struct Pipeline {
    machine: &'static str,
    /// False if a source of the program has changed since, included files too.
    #[serde(rename = "current")]
    is_current: bool,
    /// The cycles of each section in words, those of periods first.
    sections: Vec<String>,
    /// The files that operations come from; `None` for one that no editor can open.
    files: Vec<Option<Uri>>,
    bundles: Vec<Bundle>,
    /// The longest chain of each straight line of code.
    chain: Vec<Link>,
    /// Bundles that are not shown.
    more: usize,
}

#[derive(Serialize)]
struct Bundle {
    address: BundleAddress,
    /// The place from which its cycles count: a section, a label, or a bundle.
    from: String,
    cycle: Cycle,
    stalls: Vec<Stall>,
    operations: Vec<Operation>,
}

/// What a bundle waited for, as `takt analyse` writes it: indices of bundles, and slots where one operation is the reason.
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
    /// Its kind, as `takt analyse` names it.
    cause: &'static str,
    cycles: u32,
    text: String,
}

#[derive(Serialize)]
struct Operation {
    slot: &'static str,
    unit: &'static str,
    text: String,
    /// Cycles to its result; `None` if it has none.
    latency: Option<u32>,
    /// It is on the longest chain.
    critical: bool,
    /// Index of its file, and its line there, from 0.
    file: Option<usize>,
    line: Option<u32>,
}

/// What the picture says of the program as a whole.
pub(crate) struct Whole {
    pub(crate) is_current: bool,
    pub(crate) sections: Vec<String>,
}

/// The picture of a program. `line` is where a line of the counted text, from 0, stands in the file now; `uri` is the file.
pub(crate) fn pipeline(
    counted: &Counted,
    whole: Whole,
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
    let Whole { is_current, sections } = whole;
    Pipeline { machine: program.machine.name, is_current, sections, files, bundles, chain, more }
}

/// The longest chain of each straight line of code, and the operations on them: index of the bundle, and slot.
fn chains(program: &Program, issues: &[StaticIssue]) -> (Vec<Link>, BTreeSet<(usize, SlotIndex)>) {
    let (mut chain, mut critical, mut first) = (Vec::new(), BTreeSet::new(), 0);
    for line in issues.chunk_by(|one, next| one.from == next.from) {
        let picture = Picture::new(program, "", 0, Trace::predicted(line));
        critical.extend(picture.critical().into_iter().map(|(issue, slot)| (first + issue, slot)));
        chain.extend(picture.chain.iter().map(|link| {
            let Ends { from, to } = link.ends(program, &picture.trace);
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
