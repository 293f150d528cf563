// SPDX-License-Identifier: MIT OR Apache-2.0
//! Report of a period as text, for a terminal.

use crate::WhatIf;
use crate::picture::{Picture, Speedup, gained};
use std::cmp::Reverse;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fmt::Write;
use takt_isa::timing::Cycle;

/// Limit on the lines of each list; the JSON has all.
const SHOWN: usize = 12;

/// Cause of stalls: the first issue that it delayed, the number of times, and the total cycles.
struct StallGroup {
    first: usize,
    times: u32,
    cycles: Cycle,
    /// Every delay took the same number of cycles.
    is_even: bool,
    text: String,
}

impl StallGroup {
    /// Text with the number of times: in a loop, once for each iteration.
    fn render(&self) -> String {
        match self.times {
            1 => self.text.clone(),
            times if self.is_even => {
                format!("{} ({times} times {})", self.text, self.cycles / Cycle::from(times))
            }
            times => format!("{} ({times} times)", self.text),
        }
    }
}

/// Longest groups, equal texts merged.
fn longest(lines: Vec<StallGroup>) -> Vec<StallGroup> {
    let mut groups: Vec<StallGroup> = Vec::new();
    let mut known: HashMap<String, usize> = HashMap::new();
    for line in lines {
        match known.entry(line.text.clone()) {
            Entry::Occupied(group) => {
                let group = &mut groups[*group.get()];
                group.is_even &= group.cycles == line.cycles * Cycle::from(group.times);
                group.times += line.times;
                group.cycles += line.cycles;
            }
            Entry::Vacant(new) => {
                new.insert(groups.len());
                groups.push(line);
            }
        }
    }
    groups.sort_by_key(|line| (Reverse(line.cycles), line.first));
    groups.truncate(SHOWN);
    groups
}

impl Picture<'_> {
    /// Complete report as text.
    pub fn text(&self) -> String {
        self.account() + &self.faster_units()
    }

    /// First part of the text, where the cycles went; it needs no other machine.
    pub fn account(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut text);
        text
    }

    /// Last part of the text: the effect of faster units.
    pub fn faster_units(&self) -> String {
        let mut text = String::new();
        let _ = self.write_faster(&mut text);
        text
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let Picture { program, trace, .. } = self;
        let issues = &trace.issues;
        let what =
            if self.period == 0 { "what runs once".to_owned() } else { format!("period {}", self.period) };
        let (machine, cycles) = (program.machine.name, trace.cycles);
        writeln!(out, "{what} on {machine}: {cycles} cycles, {} bundles", issues.len())?;
        let share = |count: u64| 100.0 * count as f64 / cycles.max(1) as f64;
        let slots = self.slots().into_iter();
        let slots: Vec<String> =
            slots.map(|(name, count)| format!("{name} {count} ({:.0} %)", share(count))).collect();
        writeln!(out, "operations by slot, and their share of the cycles: {}", slots.join(", "))?;

        let stalls = issues.iter().enumerate().flat_map(|(i, issue)| {
            issue.stalls.iter().map(move |&(cause, cycles)| {
                let (at, what) = (program.bundle_text(issue.address), program.cause_text(cause));
                StallGroup {
                    first: i,
                    times: 1,
                    cycles: Cycle::from(cycles),
                    is_even: true,
                    text: format!("{at}: {what}"),
                }
            })
        });
        let stalls: Vec<StallGroup> = stalls.collect();
        let stalled: Cycle = stalls.iter().map(|line| line.cycles).sum();
        writeln!(out, "\nstalls: {}, {stalled} cycles; the longest:", stalls.len())?;
        for line in longest(stalls) {
            writeln!(
                out,
                "  {:>5}  before cycle {:<5} {}",
                line.cycles,
                self.cycle(line.first),
                line.render()
            )?;
        }

        let chain: Cycle = self.chain.iter().map(|link| link.cycles).sum();
        writeln!(out, "\nthe chain that sets the time: {} links, {chain} cycles, through", self.chain.len())?;
        for (kind, cycles) in self.chain_by_kind() {
            writeln!(out, "  {cycles:>5}  {kind}")?;
        }
        let links = self.chain.iter().filter(|link| link.cycles > 1).map(|link| {
            let (to, how) = (program.bundle_text(issues[link.to].address), self.link(link));
            StallGroup {
                first: link.to,
                times: 1,
                cycles: link.cycles,
                is_even: true,
                text: format!("{to}: {how}"),
            }
        });
        let mut links = longest(links.collect());
        links.sort_by_key(|line| line.first);
        writeln!(out, "its longest links:")?;
        for line in links {
            writeln!(out, "  {:>5}  to cycle {:<5} {}", line.cycles, self.cycle(line.first), line.render())?;
        }
        Ok(())
    }

    /// Writes the effect of each faster unit, with the reason if the unit costs cycles.
    fn write_faster(&self, out: &mut String) -> std::fmt::Result {
        let today = self.trace.cycles;
        let has_again = self.faster.iter().any(|faster| faster.reassembled.is_some());
        let again = if has_again { "      reassembled" } else { "" };
        writeln!(out, "\none cycle less in      as it is{again}")?;
        let gain = |new: Cycle| format!("{new} ({:+})", new.cast_signed() - today.cast_signed());
        for Speedup { what, reassembled } in &self.faster {
            write!(out, "  {:<16} {:>12}", self.unit(what.unit), gain(what.cycles))?;
            let reassembled =
                reassembled.as_ref().map_or_else(|| "-".to_owned(), |reassembled| gain(reassembled.cycles));
            writeln!(out, "{}", if has_again { format!(" {reassembled:>16}") } else { String::new() })?;
        }
        let worse: Vec<&WhatIf> =
            self.faster.iter().map(|faster| &faster.what).filter(|what| what.cycles > today).collect();
        if !worse.is_empty() {
            writeln!(
                out,
                "more as it is: in bundles packed for today's latencies, sooner results meet others"
            )?;
        }
        for what in worse {
            let stalls: Vec<String> = gained(what).map(|(kind, more)| format!("{kind} {more:+}")).collect();
            writeln!(out, "  {:<16} stalled cycles: {}", self.unit(what.unit), stalls.join(", "))?;
        }
        let worse = || self.faster.iter().filter_map(|faster| Some((faster, faster.reassembled.as_ref()?)));
        let worse = || worse().filter(|(_, reassembled)| reassembled.cycles > today);
        if worse().next().is_some() {
            writeln!(
                out,
                "more when reassembled: the search ended with a longer schedule, which proves nothing"
            )?;
        }
        for (faster, reassembled) in worse() {
            writeln!(
                out,
                "  {:<16} none takes fewer than {}",
                self.unit(faster.what.unit),
                reassembled.least
            )?;
        }
        Ok(())
    }
}
