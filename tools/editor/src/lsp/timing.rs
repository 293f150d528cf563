// SPDX-License-Identifier: MIT OR Apache-2.0
//! Timing hints: beside a line, issue cycles of its operations and causes of delays; above a section, its cycles.

use crate::lsp::program::CountedProgram;
use crate::lsp::{Settings, plural};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use takt_analysis::{SectionBounds, StaticIssue};
use takt_asm::schedule::BlockReport;
use takt_isa::program::Location;
use takt_isa::{BundleAddress, Instruction, Program, SlotIndex};

/// Maximum number of operations listed for a line; of more, the first and the last cycle are shown, so that the text beside stays in sight.
const LISTED: usize = 2;
/// Maximum number of operations explained for a line.
const EXPLAINED: usize = 12;

/// Inlay hint beside a line.
pub(crate) struct Hint {
    /// Line number, from 0.
    pub(crate) line: u32,
    /// Cycles, slots, and delay: `12 · mul, stalls 4`.
    pub(crate) text: String,
    /// Details, one line per operation.
    pub(crate) more: String,
}

/// A program word, given by bundle and slot.
type Word = (BundleAddress, SlotIndex);

/// Words of each line of a file, ordered by bundle.
fn words(program: &Program, file: &str) -> BTreeMap<u32, Vec<Word>> {
    let mut words: BTreeMap<u32, Vec<Word>> = BTreeMap::new();
    let Some(number) = program.files.iter().position(|name| name == file) else { return words };
    for address in program.addresses() {
        for (location, slot) in program.locations(address).iter().zip(SlotIndex::all()) {
            if let Some(Location { file, line }) = location
                && *file as usize == number
            {
                words.entry(*line).or_default().push((address, slot));
            }
        }
    }
    words
}

/// Inlay hints of a file.
pub(crate) fn hints(counted: &CountedProgram, file: &str) -> Vec<Hint> {
    let program = &counted.assembled.program;
    let words = words(program, file);
    words
        .into_iter()
        .map(|(line, words)| Hint {
            line: line - 1,
            text: short(counted, &words),
            more: explained(counted, &words),
        })
        .collect()
}

fn issue(counted: &CountedProgram, address: BundleAddress) -> Option<&StaticIssue> {
    counted.issues.get(address.index())
}

/// Text for an issue cycle; states the origin unless cycles are counted from the beginning of a section.
fn cycle(program: &Program, issue: &StaticIssue) -> String {
    if program.sections.iter().any(|section| section.start == issue.from) {
        return issue.cycle.to_string();
    }
    format!("{} {}", cycle_from(program, issue.from), issue.cycle)
}

/// Origin from which cycles are counted: name of a section or label, or a bundle as `@12`.
pub(crate) fn cycle_from(program: &Program, from: BundleAddress) -> String {
    if let Some(section) = program.sections.iter().find(|section| section.start == from) {
        return section.name.to_string();
    }
    match program.nearest_label(from) {
        Some((label, 0)) => label.to_owned(),
        _ => format!("@{from}"),
    }
}

fn short(counted: &CountedProgram, words: &[Word]) -> String {
    let program = &counted.assembled.program;
    let shown = |(address, slot): &Word| {
        let cycle = cycle(program, issue(counted, *address)?);
        Some(format!("{cycle} · {}", program.machine.slots[slot.index()].name))
    };
    let mut text = if words.len() <= LISTED {
        words.iter().filter_map(shown).collect::<Vec<_>>().join(", ")
    } else {
        let cycle = |(address, _): &Word| Some(cycle(program, issue(counted, *address)?));
        let ends = [words.first(), words.last()];
        let ends: Vec<String> = ends.into_iter().flatten().filter_map(cycle).collect();
        format!("{} ({} operations)", ends.join(" … "), words.len())
    };
    // A single operation shares the delay of its bundle, whose cause is among the details.
    if let [(address, _)] = words
        && let Some(issue) = issue(counted, *address)
        && let Some(cycles) = issue.stalls.iter().map(|(_, cycles)| *cycles).max()
    {
        let _ = write!(text, ", stalls {cycles}");
    }
    text
}

fn explained(counted: &CountedProgram, words: &[Word]) -> String {
    let program = &counted.assembled.program;
    let mut text = String::new();
    for &(address, slot) in words.iter().take(EXPLAINED) {
        let Some(issue) = issue(counted, address) else { continue };
        let word = program.words(address).and_then(|words| words.get(slot.index()).copied());
        let Some(instruction) = word.and_then(|word| Instruction::decode(word).ok()) else { continue };
        let name = |register| program.register_text(register);
        let operation = program.operation_text(slot, &instruction);
        let slot_name = program.machine.slots[slot.index()].name;
        let _ = write!(
            text,
            "- cycle {}, bundle {address}, slot {slot_name}: `{operation}`",
            cycle(program, issue)
        );
        if let Some((register, ready, producer)) = issue.awaits[slot.index()] {
            let from = program.bundle_text(producer);
            let _ = write!(text, "; `{}` is there from cycle {ready} on, from {from}", name(register));
        }
        for (cause, cycles) in &issue.stalls {
            let _ = write!(
                text,
                "; {} stalled: {}",
                plural(u64::from(*cycles), "cycle"),
                program.cause_text(*cause)
            );
        }
        text.push('\n');
    }
    if words.len() > EXPLAINED {
        let _ = writeln!(text, "- … and {}", plural((words.len() - EXPLAINED) as u64, "more operation"));
    }
    text
}

/// Cycles of all sections as text, periods first, for clients without a source view.
pub(crate) fn sections(counted: &CountedProgram, settings: &Settings) -> Vec<String> {
    let Ok(bounds) = &counted.bounds else { return Vec::new() };
    let (once, periods): (Vec<_>, Vec<_>) = bounds.sections.iter().partition(|section| section.once);
    let text = |section: &SectionBounds| section_text(section, &counted.assembled.blocks, settings).0;
    periods.into_iter().chain(once).map(text).collect()
}

/// Cycles of a section as text, with its block number if the section is a single block.
fn section_text(
    section: &SectionBounds,
    blocks: &[BlockReport],
    settings: &Settings,
) -> (String, Option<usize>) {
    let cycles = match section.cycles.best == section.cycles.worst {
        true => plural(section.cycles.worst, "cycle"),
        false => format!("{} to {}", section.cycles.best, plural(section.cycles.worst, "cycle")),
    };
    let mut text = format!("{}: {cycles}", section.name);
    if section.once {
        text.push_str(" from reset");
        return (text, None);
    }
    // Block that makes up the whole section.
    let whole = |block: &BlockReport| {
        block.address == section.address
            && section.ends.contains(&block.address.offset(block.bundles.saturating_sub(1)))
    };
    let block = blocks.iter().position(whole);
    if let Some(number) = block {
        let _ = write!(text, ", lower bound {}", blocks[number].bound.cycles());
    }
    // The same computation as in `takt bound --deadline`.
    let worst = section.in_time.worst + 1;
    if let Some(deadline) = settings.deadline {
        let (what, by) = match deadline.checked_sub(worst) {
            Some(spare) => ("kept", spare),
            None => ("missed", worst - deadline),
        };
        let _ = write!(text, ", deadline {what} by {}", grouped(by));
    }
    (text, block)
}

/// Code lenses above lines of a file, from 0. `head` gives the lines of labels and section directives.
pub(crate) fn lenses(
    counted: &CountedProgram,
    settings: &Settings,
    file: &str,
    head: &dyn Fn(&str) -> Option<u32>,
) -> Vec<(u32, String)> {
    let program = &counted.assembled.program;
    let line = |location: Option<Location>| {
        let location = location?;
        (program.files.get(location.file as usize)? == file).then_some(location.line - 1)
    };
    let mut lenses: BTreeMap<u32, Vec<String>> = BTreeMap::new();
    let blocks = &counted.assembled.blocks;
    let mut told = Vec::new();
    match &counted.bounds {
        Ok(bounds) => {
            for section in &bounds.sections {
                let Some(line) = head(&section.name).or_else(|| line(section.location)) else { continue };
                let (text, block) = section_text(section, blocks, settings);
                told.extend(block);
                lenses.entry(line).or_default().push(text);
            }
        }
        Err(error) => {
            let period = program.sections.iter().find(|section| section.name == "period");
            if let Some(line) =
                line(program.location(period.map_or(BundleAddress::RESET, |section| section.start)))
            {
                lenses.entry(line).or_default().push(format!("no bound: {error}"));
            }
        }
    }
    for (_, block) in blocks.iter().enumerate().filter(|(number, _)| !told.contains(number)) {
        if let Some(line) = line(block.location) {
            let text = format!(
                "block: {}, lower bound {}",
                plural(u64::from(block.cycles), "cycle"),
                block.bound.cycles()
            );
            lenses.entry(line).or_default().push(text);
        }
    }
    lenses.into_iter().map(|(line, texts)| (line, texts.join(" · "))).collect()
}

/// Decimal number with digits in groups of three.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let groups: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().filter_map(|group| std::str::from_utf8(group).ok()).collect();
    groups.join(",")
}

#[cfg(test)]
mod tests {
    #[test]
    fn digits_in_groups() {
        for (number, text) in [(0, "0"), (999, "999"), (12_376, "12,376"), (1_000_000, "1,000,000")] {
            assert_eq!(super::grouped(number), text);
        }
    }
}
