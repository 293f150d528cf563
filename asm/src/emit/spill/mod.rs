// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reduction of register pressure: other schedules, and spilling to data memory.
//!
//! If a block of equations has more live values than a bank has registers, two remedies are tried: schedules nearer to the
//! source's order, which have lower pressure ([`Order`]), and spilling: values whose next use is farthest are stored in words that
//! nothing else touches, and reloaded before that use ([`block`]). The shorter program is taken. Registers written by hand-written
//! operations are never spilled.

mod block;

use super::allocate::{self, Pressure};
use crate::capacity;
use crate::ir::runs::{self, Run};
use crate::ir::{Bundle, Ir};
use crate::schedule::{self, BlockReport, Budget, Order, PlainLoop, Report};
use takt_diagnostics::diag::Sink;
use takt_isa::BundleAddress;
use takt_isa::program::Location;

/// A value of a block that is kept in data memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SpilledValue {
    /// Name of the value; empty for a part of an equation.
    pub name: String,
    /// Bank that had no room for the value.
    pub bank: &'static str,
    /// Source line that computes the value.
    pub location: Option<Location>,
    /// Data word that keeps the value.
    pub word: u32,
    /// Number of loads from the word.
    pub loads: u32,
}

/// The cost of high register pressure in a block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spills {
    /// Index of the block among the assembled program's blocks.
    pub block: usize,
    /// Spilled values; empty if another order was enough.
    pub values: Vec<SpilledValue>,
    /// Additional cycles, compared with the block's schedule for unlimited registers.
    pub cycles: u32,
}

impl Spills {
    /// Number of loads and stores added.
    pub fn operations(&self) -> u32 {
        self.values.iter().map(|value| 1 + value.loads).sum()
    }
}

impl std::fmt::Display for Spills {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let cycles = self.cycles;
        if self.values.is_empty() {
            return write!(f, "order nearer to the source's, for want of registers: {cycles} cycles");
        }
        let (count, operations) = (self.values.len(), self.operations());
        write!(f, "{count} values kept in data memory: {operations} loads and stores, {cycles} cycles")
    }
}

impl std::fmt::Display for SpilledValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let SpilledValue { name, bank, word, loads, .. } = self;
        let name = if name.is_empty() { "a part of the equation" } else { name };
        let times = if *loads == 1 { "once".to_owned() } else { format!("{loads} times") };
        write!(f, "{name}: from bank {bank} to word {word}, loaded {times}")
    }
}

/// Number of schedules to try. Each halves the window in which operations may leave source order, beginning at half of the
/// block's operations. Used if not even source order is known to suffice.
const REACHES: u32 = 5;

/// A program in which all live values have a register.
struct AllocatableProgram {
    ir: Ir,
    report: Report,
    spills: Vec<Spills>,
}

impl AllocatableProgram {
    fn cycles(&self) -> u64 {
        self.report.blocks.iter().map(|block| u64::from(block.cycles)).sum()
    }

    fn fits(&self) -> bool {
        self.ir.bundles.len() <= self.ir.machine.most_bundles() as usize
    }
}

/// Number of programs to try, each with one pipelined loop fewer, before leaving all loops as written.
const LOOPS_LESS: usize = 5;

/// Leaves pipelined loops as they are written, beginning with the loop that saves the fewest cycles per bundle, until the program
/// fits the program memory and all values have a register, or no pipelined loop is left.
pub(crate) fn reduce_loops(ir: &mut Ir, report: &mut Report, source: Option<&Ir>, budget: &mut Budget) {
    let Some(source) = source else { return };
    let (mut without, mut plain) = (Vec::new(), Vec::new());
    while let Some(last) = report.loops.iter().reduce(|a, b| if b.is_of_less_use(a) { b } else { a }) {
        let most = ir.machine.most_bundles();
        let pressure = allocate::pressure(ir, &runs::runs(ir), &mut Sink::default());
        let reason = match ir.bundles.len() > most as usize {
            true => {
                let bundles = ir.bundles.len();
                let room = capacity::for_bundles(ir.machine, bundles);
                format!("the program would take {bundles} bundles of {most}; {room}")
            }
            false if pressure.has_all() => break,
            false => pressure.shortage_text(ir.machine),
        };
        let rest = plain.len() >= LOOPS_LESS;
        for one in report.loops.iter().filter(|one| rest || one.number == last.number) {
            without.push(one.number);
            plain.push(PlainLoop { location: one.location, reason: reason.clone() });
        }
        *ir = source.clone();
        *report = schedule::schedule_without(ir, budget, Order::Free, &without, &mut Sink::default());
    }
    report.plain_loops.extend(plain);
}

/// Reduces the register pressure of a scheduled program to the available registers. `source` is the program before scheduling.
///
/// # Errors
/// If some values get no register, with the reason. The program is then in its current order or in source order, whichever lacks
/// fewer registers.
pub(crate) fn reduce_pressure(
    ir: &mut Ir,
    report: &mut Report,
    source: Option<&Ir>,
    budget: &mut Budget,
) -> Result<Vec<Spills>, Option<String>> {
    let runs = runs::runs(ir);
    let pressure = allocate::pressure(ir, &runs, &mut Sink::default());
    if report.blocks.is_empty() || pressure.has_all() || ir.bundles.len() > ir.machine.most_bundles() as usize
    {
        return Ok(Vec::new());
    }
    // With the source's order as the last resort, no program that fits without the scheduler fails to fit with it.
    let as_written = source.map(|source| by_order(source, report, budget, Order::Written));
    let (written, unfit) = match as_written {
        Some(Ok(written)) => (Some(written), None),
        Some(Err(unfit)) => (None, unfit),
        None => (None, None),
    };
    let (mut spilled, mut why, mut near) = (None, None, None);
    if pressure.is_short() || written.is_some() {
        let longest = report.blocks.iter().map(|block| block.operations).max().unwrap_or(1);
        // Reduce the reach step by step, as long as some order fits.
        let last = if written.is_some() { longest.ilog2() } else { REACHES };
        near = source.and_then(|source| {
            (1..=last).find_map(|shift| {
                let reach = (longest >> shift).max(1) as usize;
                by_order(source, report, budget, Order::Near(reach)).ok()
            })
        });
    }
    if pressure.is_short() {
        match by_memory(ir, &runs, &pressure, report) {
            Ok(reduced) => spilled = Some(reduced),
            Err(reason) => why = Some(reason),
        }
    }
    let best = near.into_iter().chain(spilled).chain(written).min_by_key(AllocatableProgram::cycles);
    let Some(best) = best else {
        // The error is about the order that lacks the fewest registers.
        if let Some(unfit) = unfit.filter(|unfit| unfit.missing < pressure.shortage()) {
            *ir = *unfit.program;
        }
        return Err(why);
    };
    *ir = best.ir;
    *report = best.report;
    Ok(best.spills)
}

/// A program in an order in which some values lack registers.
struct UnallocatableProgram {
    program: Box<Ir>,
    /// Number of missing registers.
    missing: usize,
}

/// Reduces the pressure by an order near to the source's.
///
/// # Errors
/// If some values lack registers in this order: the program, and the number of missing registers. `None` if the order breaks a demand.
fn by_order(
    source: &Ir,
    before: &Report,
    budget: &mut Budget,
    order: Order,
) -> Result<AllocatableProgram, Option<UnallocatableProgram>> {
    let mut ir = source.clone();
    let mut sink = Sink::default();
    let mut report = schedule::schedule(&mut ir, budget, order, &mut sink);
    let pressure = allocate::pressure(&ir, &runs::runs(&ir), &mut Sink::default());
    if sink.errors > 0 || ir.bundles.len() > ir.machine.most_bundles() as usize {
        return Err(None);
    }
    if !pressure.has_all() {
        return Err(Some(UnallocatableProgram { missing: pressure.shortage(), program: Box::new(ir) }));
    }
    // This order pipelines no loops, so its blocks may differ.
    let same = |after: &BlockReport| {
        let same = |free: &&BlockReport| (free.location, &free.label) == (after.location, &after.label);
        before.blocks.iter().find(same)
    };
    let mut spills = Vec::new();
    for (block, after) in report.blocks.iter_mut().enumerate() {
        let Some(free) = same(after) else { continue };
        after.bound = free.bound.clone();
        if after.cycles > free.cycles {
            spills.push(Spills { block, values: Vec::new(), cycles: after.cycles - free.cycles });
        }
    }
    Ok(AllocatableProgram { ir, report, spills })
}

/// Reduces the pressure by spilling to data memory.
fn by_memory(
    ir: &Ir,
    runs: &[Run],
    pressure: &Pressure,
    before: &Report,
) -> Result<AllocatableProgram, String> {
    let name = ir.machine.name;
    let touched = schedule::touched(ir)
        .ok_or("values are not kept in data memory: a load or store may touch any word of it")?;
    let declared = ir.data.len() as u32;
    let mut words = (declared..ir.machine.data_depth).filter(|word| !touched.contains(word));
    let mut reduced = AllocatableProgram { ir: ir.clone(), report: before.clone(), spills: Vec::new() };
    let mut bundles: Vec<Bundle> = Vec::with_capacity(ir.bundles.len());
    let mut moved = std::collections::BTreeMap::new();
    for run in runs {
        let address = BundleAddress::new(run.start as u32);
        moved.insert(run.start as u32, bundles.len() as u32);
        let index = before.blocks.iter().position(|block| block.address == address);
        let Some(index) = index.filter(|_| run.scheduled) else {
            bundles.extend_from_slice(&ir.bundles[run.start..run.end]);
            continue;
        };
        let spilled = block::spill(&mut reduced.ir, *run, pressure, &mut words);
        let (new, values) = spilled.map_err(|short| match short {
            block::SpillError::Words(needed) => {
                let free = ir.machine.data_depth - declared.min(ir.machine.data_depth);
                // Ask for more than the current memory: words beyond the declared ones hold spilled values, too.
                let words = u64::from(declared.max(ir.machine.data_depth)) + needed as u64;
                let mend = capacity::for_words(ir.machine, words);
                format!("{needed} data words are needed for values that find no register, and {free} of {name} are free ({mend})")
            }
            block::SpillError::Values => {
                "values are not kept in data memory: too few of those that find no register are computed by equations"
                    .to_owned()
            }
        })?;
        let block = &mut reduced.report.blocks[index];
        if !values.is_empty() {
            let start = schedule::as_written(&reduced.ir, &new);
            let cycles = start.last().map_or(0, |last| last + 1);
            let spills = Spills { block: index, values, cycles: cycles.saturating_sub(block.cycles) };
            block.operations += spills.operations();
            block.cycles = cycles;
            reduced.spills.push(spills);
        }
        block.address = BundleAddress::new(bundles.len() as u32);
        block.bundles = new.len() as u32;
        bundles.extend(new);
    }
    let end = bundles.len() as u32;
    reduced.ir.replace_bundles(bundles, |position| moved.get(&position).copied().unwrap_or(end));
    if !reduced.fits() {
        let (bundles, depth) = (reduced.ir.bundles.len(), ir.machine.most_bundles());
        return Err(format!(
            "with loads and stores of values that find no register there are {bundles} bundles, and {name}'s program memory \
             holds {depth} ({})",
            capacity::for_bundles(ir.machine, bundles)
        ));
    }
    // The demands on ports must be met with the spill code, too.
    if !ir.demands.is_empty() {
        let mut stands = reduced.ir.clone();
        stands.bundles.iter_mut().for_each(|bundle| bundle.scheduled = false);
        let mut sink = Sink::default();
        reduced.report.timing =
            schedule::schedule(&mut stands, &mut Budget::new(0), Order::Free, &mut sink).timing;
        if sink.errors > 0 {
            return Err("with values kept in data memory, the demands on ports are not met".to_owned());
        }
    }
    Ok(reduced)
}
