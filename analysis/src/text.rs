//! The picture in words, for a terminal.

use crate::picture::{Faster, Picture, gained};
use crate::{Link, WhatIf};
use std::cmp::Reverse;
use std::fmt::Write;
use takt_isa::timing::{Cause, Cycle};

/// Lines of each list of the text; the JSON has all.
const SHOWN: usize = 12;

impl Picture<'_> {
    /// The text.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // A string takes all.
        let _ = self.write(&mut text);
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

        let mut stalls: Vec<(usize, Cause, u32)> = Vec::new();
        for (i, issue) in issues.iter().enumerate() {
            stalls.extend(issue.stalls.iter().map(|&(cause, cycles)| (i, cause, cycles)));
        }
        stalls.sort_by_key(|&(i, _, cycles)| (Reverse(cycles), i));
        let stalled: u32 = stalls.iter().map(|(_, _, cycles)| cycles).sum();
        writeln!(out, "\nstalls: {}, {stalled} cycles; the longest:", stalls.len())?;
        for &(i, cause, cycles) in stalls.iter().take(SHOWN) {
            let (at, what) = (program.bundle_text(issues[i].address), program.cause_text(cause));
            writeln!(out, "  {cycles:>5}  before cycle {:<5} {at}: {what}", self.cycle(i))?;
        }

        let chain: Cycle = self.chain.iter().map(|link| link.cycles).sum();
        writeln!(out, "\nthe chain that sets the time: {} links, {chain} cycles, through", self.chain.len())?;
        for (kind, cycles) in self.chain_by_kind() {
            writeln!(out, "  {cycles:>5}  {kind}")?;
        }
        let mut links: Vec<&Link> = self.chain.iter().filter(|link| link.cycles > 1).collect();
        links.sort_by_key(|link| (Reverse(link.cycles), link.to));
        links.truncate(SHOWN);
        links.sort_by_key(|link| link.to);
        writeln!(out, "its longest links:")?;
        for link in links {
            let (to, how) = (program.bundle_text(issues[link.to].address), self.link(link));
            writeln!(out, "  {:>5}  to cycle {:<5} {to}: {how}", link.cycles, self.cycle(link.to))?;
        }

        self.write_faster(out)
    }

    /// What a faster unit would bring; where that is more cycles than today, why.
    fn write_faster(&self, out: &mut String) -> std::fmt::Result {
        let today = self.trace.cycles;
        writeln!(out, "\none cycle less in      as it is      reassembled")?;
        let gain = |new: Cycle| format!("{new} ({:+})", new.cast_signed() - today.cast_signed());
        for Faster { what, reassembled } in &self.faster {
            let reassembled =
                reassembled.as_ref().map_or_else(|| "-".to_owned(), |reassembled| gain(reassembled.cycles));
            writeln!(out, "  {:<16} {:>12} {reassembled:>16}", self.unit(what.unit), gain(what.cycles))?;
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
