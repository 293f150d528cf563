// SPDX-License-Identifier: MIT OR Apache-2.0
//! Register allocation: an address for each virtual register.
//!
//! A virtual register lies in the bank of the slot whose operations write it; a register that nothing writes, such as a constant,
//! lies in the bank with the most free registers. Within a bank addresses follow the order of declaration, around those that the
//! source gives. Inputs lie in the input bank. An output has a number, given by the source or else the first free one, and lies
//! at that place of the output window of the bank of the slot that writes it.
//!
//! A virtual register that only one straight run of bundles uses, and writes before it reads, has a live range from its first write
//! to its last use. Live ranges are allocated by linear scan (Poletto, Sarkar, TOPLAS 1999), which reuses a register only after all
//! others of the bank. Too many live values at a time are spilled ([`spill`](super::spill)).

use crate::ir::runs::Run;
use crate::ir::{Ir, Operation, RegisterId, RegisterKind, VirtualRegister};
use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};
use takt_diagnostics::diag::{Diagnostic, Sink};
use takt_diagnostics::source::Span;
use takt_isa::{Bank, Machine, Register, SlotIndex};

/// Addresses of all virtual registers.
#[derive(Clone, Debug)]
pub(crate) struct Allocation {
    /// Address of each virtual register, by index; `None` for unused ones.
    pub addresses: Vec<Option<Register>>,
    /// Another virtual register has the same address, at another time.
    pub shared: Vec<bool>,
}

/// The part of a bank that registers of a kind may take, as addresses.
#[derive(Clone, Copy)]
struct Window {
    first: u16,
    end: u16,
}

impl Window {
    fn of(bank: &Bank, kind: RegisterKind, outputs: u16) -> Window {
        let split = bank.base + bank.depth - outputs.min(bank.depth);
        match kind {
            RegisterKind::Input | RegisterKind::Parameter => {
                Window { first: bank.base, end: (bank.base + bank.depth).min(Register::ZERO.get()) }
            }
            _ => Window { first: bank.base, end: split },
        }
    }
}

/// Addresses that are taken.
struct Space {
    taken: [bool; Register::COUNT],
}

impl Space {
    fn room(&self, window: Window) -> usize {
        self.taken[window.first as usize..window.end as usize].iter().filter(|taken| !**taken).count()
    }

    fn take(&mut self, window: Window) -> Option<Register> {
        let free = self.taken[window.first as usize..window.end as usize].iter().position(|taken| !taken)?;
        let address = Register::new(window.first as usize + free)?;
        self.taken[address.index()] = true;
        Some(address)
    }
}

/// Register pressure: the allocation of all virtual registers except the live ranges within one run ([`Pressure::ranges`]).
pub(crate) struct Pressure {
    /// The slot that writes each register.
    pub(crate) writer: Vec<Option<SlotIndex>>,
    /// Live ranges within one run, still without an address: the bundles of the first write and the last use.
    pub(crate) ranges: Vec<Option<(u32, u32)>>,
    /// By slot: registers of its bank that are left for these live ranges.
    pub(crate) free: Vec<usize>,
    space: Space,
    addresses: Vec<Option<Register>>,
    missing: Vec<(usize, Option<SlotIndex>)>,
    unplaced: Vec<usize>,
}

/// Peak register pressure of a bank: the most live values at a time, and the first bundle that reaches it.
#[derive(Clone, Copy, Default)]
struct Peak {
    values: usize,
    bundle: u32,
}

impl Pressure {
    /// By slot: the peak of live values in its bank.
    fn peaks(&self) -> Vec<Peak> {
        peaks(&self.ranges, &self.writer, self.free.len())
    }

    fn holds_values(&self) -> bool {
        self.peaks().iter().zip(&self.free).all(|(peak, free)| peak.values <= *free)
    }

    /// Only values that are live at the same time lack registers.
    pub(crate) fn is_short(&self) -> bool {
        !self.holds_values() && self.missing.is_empty() && self.unplaced.is_empty()
    }

    /// Number of missing registers.
    pub(crate) fn shortage(&self) -> usize {
        let peaks = self.peaks();
        let values = peaks.iter().zip(&self.free).map(|(peak, free)| peak.values.saturating_sub(*free));
        values.sum::<usize>() + self.missing.len() + self.unplaced.len()
    }

    /// The first bank that lacks registers, in words.
    pub(crate) fn shortage_text(&self, machine: &Machine) -> String {
        let short = machine.numbered_slots().zip(self.peaks()).find_map(|((slot, row), peak)| {
            let missing = self.missing.iter().filter(|(_, of)| *of == Some(slot)).count();
            let lacks = missing + peak.values.saturating_sub(self.free[slot.index()]);
            (lacks > 0).then(|| format!("bank {} would lack {lacks} registers", row.bank.name))
        });
        short.unwrap_or_else(|| "there would not be registers for all constants".to_owned())
    }

    /// Every value and register has an address, or room for one.
    pub(crate) fn has_all(&self) -> bool {
        self.missing.is_empty() && self.unplaced.is_empty() && self.holds_values()
    }
}

fn peaks(ranges: &[Option<(u32, u32)>], writer: &[Option<SlotIndex>], slots: usize) -> Vec<Peak> {
    let mut changes: Vec<BTreeMap<u32, i64>> = vec![BTreeMap::new(); slots];
    for (range, writer) in ranges.iter().zip(writer) {
        if let (Some((first, last)), Some(slot)) = (*range, *writer) {
            // A value that is never read is live for one cycle.
            let last = last.max(first + 1);
            *changes[slot.index()].entry(first).or_default() += 1;
            *changes[slot.index()].entry(last).or_default() -= 1;
        }
    }
    let most = |changes: &BTreeMap<u32, i64>| {
        let mut peak = Peak::default();
        let mut count = 0;
        for (&bundle, change) in changes {
            count += change;
            if count as usize > peak.values {
                peak = Peak { values: count as usize, bundle };
            }
        }
        peak
    };
    changes.iter().map(most).collect()
}

/// Allocates every virtual register that is used. `why` explains why values without a register could not be spilled.
pub(crate) fn allocate(ir: &Ir, runs: &[Run], why: Option<&str>, sink: &mut Sink) -> Allocation {
    let mut pressure = pressure(ir, runs, sink);
    let peaks = pressure.peaks();
    let shared = linear_scan(ir, &mut pressure);
    report(ir, &pressure, &peaks, why, sink);
    Allocation { addresses: pressure.addresses, shared }
}

/// Allocates all virtual registers except live ranges within one run. Constants leave a register for each of these ranges if
/// there are enough, else as many as are live at a time.
pub(crate) fn pressure(ir: &Ir, runs: &[Run], sink: &mut Sink) -> Pressure {
    let pressure = pressure_with(ir, runs, false, sink);
    if pressure.has_all() {
        return pressure;
    }
    let closer = pressure_with(ir, runs, true, &mut Sink::default());
    if closer.shortage() < pressure.shortage() { closer } else { pressure }
}

/// [`pressure`] with one policy for constants; if `close`, they leave only as many registers as are live at a time.
fn pressure_with(ir: &Ir, runs: &[Run], close: bool, sink: &mut Sink) -> Pressure {
    let machine = ir.machine;
    // The slot that writes each register, and whether an operation uses the register at all.
    let mut writer: Vec<Option<SlotIndex>> = vec![None; ir.registers.len()];
    let mut used = vec![false; ir.registers.len()];
    for operation in ir.operations() {
        for source in operation.reads() {
            used[source.index()] = true;
        }
        if let (Some(dest), Some(slot)) = (operation.dest, operation.slot) {
            writer[dest.index()] = Some(slot);
            used[dest.index()] = true;
        }
    }
    let mut space = Space { taken: [false; Register::COUNT] };
    let mut addresses: Vec<Option<Register>> = ir.registers.iter().map(|register| register.pinned).collect();
    for address in addresses.iter().flatten() {
        space.taken[address.index()] = true;
    }
    outputs(ir, &writer, &mut space, &mut addresses, sink);
    let mut ranges = ranges(ir, runs);
    let is_local = |index: usize| ranges[index].is_some() && addresses[index].is_none();
    // Registers that live ranges within one run need in each bank: constants leave these if they can.
    let mut wanted_by_locals = vec![0; machine.slots.len()];
    if close {
        let local =
            |(index, range): (usize, &Option<(u32, u32)>)| range.filter(|_| addresses[index].is_none());
        let local: Vec<Option<(u32, u32)>> = ranges.iter().enumerate().map(local).collect();
        let needed = peaks(&local, &writer, machine.slots.len());
        wanted_by_locals = needed.iter().map(|peak| peak.values as i64).collect();
    } else {
        for index in (0..ir.registers.len()).filter(|index| is_local(*index)) {
            wanted_by_locals[writer[index].unwrap_or(SlotIndex::FIRST).index()] += 1;
        }
    }
    // Constants come last: they go wherever there is room.
    let is_constant = |index: &usize| {
        let register: &VirtualRegister = &ir.registers[*index];
        matches!(register.kind, RegisterKind::Constant(_))
            || (!register.kind.is_from_outside() && writer[*index].is_none())
    };
    let wanted = (0..ir.registers.len()).filter(|index| {
        let register = &ir.registers[*index];
        addresses[*index].is_none()
            && ranges[*index].is_none()
            && register.kind != RegisterKind::Output
            && (used[*index] || register.kind.is_from_outside() || register.preset.is_some())
    });
    let (constants, mut registers): (Vec<usize>, Vec<usize>) = wanted.partition(is_constant);
    // Parameters come behind the inputs: a new one leaves the inputs' numbers alone.
    registers.sort_by_key(|index| ir.registers[*index].kind == RegisterKind::Parameter);
    let mut missing: Vec<(usize, Option<SlotIndex>)> = Vec::new();
    for index in registers {
        let kind = ir.registers[index].kind;
        let (bank, slot) = match (kind, writer[index]) {
            (RegisterKind::Input | RegisterKind::Parameter, _) => (&machine.inputs, None),
            (_, slot) => (&machine.slot(slot.unwrap_or(SlotIndex::FIRST)).bank, slot),
        };
        match space.take(Window::of(bank, kind, machine.outputs_per_bank)) {
            Some(address) => addresses[index] = Some(address),
            None => missing.push((index, slot)),
        }
    }
    let mut unplaced = Vec::new();
    for index in constants {
        let kind = ir.registers[index].kind;
        let windows = machine.slots.iter().enumerate();
        let windows = windows.map(|(s, slot)| (s, Window::of(&slot.bank, kind, machine.outputs_per_bank)));
        // Ties go to the first bank. A full bank is never chosen, however little its values need.
        let open = windows.rev().filter(|(_, window)| space.room(*window) > 0);
        let roomiest = open.max_by_key(|(s, window)| space.room(*window) as i64 - wanted_by_locals[*s]);
        match roomiest.and_then(|(_, window)| space.take(window)) {
            Some(address) => addresses[index] = Some(address),
            None => unplaced.push(index),
        }
    }
    let windows = machine.slots.iter();
    let windows = windows.map(|slot| Window::of(&slot.bank, RegisterKind::Plain, machine.outputs_per_bank));
    let free = windows.map(|window| space.room(window)).collect();
    for (index, range) in ranges.iter_mut().enumerate() {
        *range = range.filter(|_| addresses[index].is_none());
    }
    Pressure { writer, ranges, free, space, addresses, missing, unplaced }
}

/// Allocates the output ports, by their numbers.
fn outputs(
    ir: &Ir,
    writer: &[Option<SlotIndex>],
    space: &mut Space,
    addresses: &mut [Option<Register>],
    sink: &mut Sink,
) {
    let machine = ir.machine;
    let count = machine.outputs_per_bank;
    let given: HashMap<RegisterId, u16> = ir.numbers.iter().map(|(number, id)| (*id, *number)).collect();
    // An unnamed register that the source writes at an output's address takes that output's number.
    let unnamed = |number| {
        let mut places =
            machine.slots.iter().filter_map(|slot| machine.output_registers(slot).nth(usize::from(number)));
        places.any(|place| space.taken[place.index()])
    };
    let mut free: VecDeque<u16> =
        (0..count).filter(|number| !ir.numbers.contains_key(number) && !unnamed(*number)).collect();
    let all = || (0..ir.registers.len()).filter(|index| ir.registers[*index].kind == RegisterKind::Output);
    let mut missing = Vec::new();
    for index in all() {
        if addresses[index].is_some() {
            continue;
        }
        let register = &ir.registers[index];
        let Some(number) = given.get(&RegisterId::new(index)).copied().or_else(|| free.pop_front()) else {
            missing.push(index);
            continue;
        };
        let slot = machine.slot(writer[index].unwrap_or(SlotIndex::FIRST));
        let Some(place) = machine.output_registers(slot).nth(number.into()) else {
            missing.push(index);
            continue;
        };
        if space.taken[place.index()] {
            let name = machine.register_name(place).unwrap_or_default();
            let message = format!("output {number}, `{}`, lies at `{name}`, which is taken", register.name);
            let error = Diagnostic::error("place", register.span, message)
                .note(format!("the source names `@{name}` elsewhere"))
                .help("give it another number, or say its name there");
            sink.push(error);
            continue;
        }
        space.taken[place.index()] = true;
        addresses[index] = Some(place);
    }
    if let Some(first) = missing.first() {
        let names: Vec<&str> = missing.iter().map(|index| ir.registers[*index].name.as_str()).collect();
        let message = format!("{} output ports are needed, and {} has {count}", all().count(), machine.name);
        let error = Diagnostic::error("bank-full", ir.registers[*first].span, message)
            .here("no number is left for this one")
            .note(format!("no number for: {}", few(&names)));
        sink.push(error);
    }
}

/// Live range of each virtual register that one run of bundles writes before it reads, and no other run uses: the bundles of the
/// first write and the last use.
fn ranges(ir: &Ir, runs: &[Run]) -> Vec<Option<(u32, u32)>> {
    /// The uses of a register so far.
    #[derive(Clone, Copy)]
    enum RegisterUses {
        Nowhere,
        In { run: u32, first: u32, last: u32 },
        Wide,
    }
    if ir.is_opaque() {
        // A raw word may use any register.
        return vec![None; ir.registers.len()];
    }
    let is_candidate = |register: &VirtualRegister| {
        register.kind == RegisterKind::Plain && register.pinned.is_none() && register.preset.is_none()
    };
    let wide = |register| if is_candidate(register) { RegisterUses::Nowhere } else { RegisterUses::Wide };
    let mut seen: Vec<RegisterUses> = ir.registers.iter().map(wide).collect();
    // Registers that may still turn out to be short-lived: a program whose names are used throughout soon has none.
    let mut left = ir.registers.iter().filter(|register| is_candidate(register)).count();
    for (run, bounds) in (0..).zip(runs) {
        if left == 0 {
            break;
        }
        for (at, bundle) in (bounds.start as u32..).zip(&ir.bundles[bounds.start..bounds.end]) {
            for source in bundle.operations.iter().flat_map(|operation| operation.reads()) {
                match &mut seen[source.index()] {
                    RegisterUses::Wide => {}
                    RegisterUses::In { run: same, last, .. } if *same == run => *last = at,
                    seen => {
                        *seen = RegisterUses::Wide;
                        left -= 1;
                    }
                }
            }
            for dest in bundle.operations.iter().filter_map(|operation| operation.dest) {
                match &mut seen[dest.index()] {
                    RegisterUses::Wide => {}
                    RegisterUses::In { run: same, last, .. } if *same == run => *last = at,
                    seen @ RegisterUses::Nowhere => *seen = RegisterUses::In { run, first: at, last: at },
                    seen => {
                        *seen = RegisterUses::Wide;
                        left -= 1;
                    }
                }
            }
        }
    }
    let range = |seen: &RegisterUses| match *seen {
        RegisterUses::In { first, last, .. } => Some((first, last)),
        _ => None,
    };
    seen.iter().map(range).collect()
}

/// Linear scan over the live ranges, in the order of their first writes. A register is reused only after all others of its bank;
/// the bundle of a value's last read may write the next value, because it reads first.
fn linear_scan(ir: &Ir, pressure: &mut Pressure) -> Vec<bool> {
    let Pressure { writer, ranges, space, addresses, missing, .. } = pressure;
    let mut shared = vec![false; ir.registers.len()];
    let ranges = ranges.iter().enumerate();
    let mut starting: Vec<(u32, u32, usize)> =
        ranges.filter_map(|(index, range)| range.map(|(first, last)| (first, last, index))).collect();
    starting.sort_unstable_by_key(|&(first, _, index)| (first, index));
    for (number, slot) in ir.machine.numbered_slots() {
        let window = Window::of(&slot.bank, RegisterKind::Plain, ir.machine.outputs_per_bank);
        // Free registers, the longest free first, each with its previous owner; live values, soonest end first.
        let mut free: VecDeque<(Register, Option<usize>)> = VecDeque::new();
        while let Some(address) = space.take(window) {
            free.push_back((address, None));
        }
        let mut ending: BTreeSet<(u32, usize)> = BTreeSet::new();
        for &(first, last, index) in starting.iter().filter(|(_, _, index)| writer[*index] == Some(number)) {
            while let Some(&(end, old)) = ending.first().filter(|(end, _)| *end <= first) {
                ending.remove(&(end, old));
                free.extend(addresses[old].map(|address| (address, Some(old))));
            }
            match free.pop_front() {
                Some((address, before)) => {
                    addresses[index] = Some(address);
                    if let Some(before) = before {
                        (shared[before], shared[index]) = (true, true);
                    }
                    ending.insert((last, index));
                }
                None => missing.push((index, Some(number))),
            }
        }
    }
    shared
}

/// The demand on a bank's registers, by purpose.
struct Fill {
    constants: usize,
    /// States, and names that more than one block uses.
    lasting: usize,
    /// Values that only one block uses, at their peak.
    values: usize,
    /// Use of one of the constants, to point at.
    constant: Option<Span>,
}

impl Fill {
    fn total(&self) -> usize {
        self.constants + self.lasting + self.values
    }
}

impl std::fmt::Display for Fill {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let of = |count: usize, one: &str, many: &str| match count {
            0 => None,
            1 => Some(format!("1 {one}")),
            count => Some(format!("{count} {many}")),
        };
        let parts = [
            of(self.constants, "for a constant", "for constants"),
            of(
                self.lasting,
                "for a name that keeps its value from block to block",
                "for names that keep their values from block to block",
            ),
            of(
                self.values,
                "for a value of a block",
                "for values of one block that are needed at the same time",
            ),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        f.write_str(&parts.join(", "))
    }
}

/// Reports an error for each full bank.
fn report(ir: &Ir, pressure: &Pressure, peaks: &[Peak], why: Option<&str>, sink: &mut Sink) {
    let machine = ir.machine;
    let Pressure { missing, unplaced, .. } = pressure;
    let mut rest: Vec<&(usize, Option<SlotIndex>)> = missing.iter().collect();
    while let Some(&&(first, slot)) = rest.first() {
        let kind = ir.registers[first].kind;
        let same = |(_, other): &(usize, Option<SlotIndex>)| *other == slot;
        let bank = slot.map_or(&machine.inputs, |slot| &machine.slot(slot).bank);
        let window = Window::of(bank, kind, machine.outputs_per_bank);
        let available = usize::from(window.end - window.first);
        // Short-lived values count at their peak.
        let lasts = |index: usize| pressure.ranges[index].is_none();
        let inside = |address: &Option<Register>| {
            address.is_some_and(|address| (window.first..window.end).contains(&address.get()))
        };
        let placed =
            (0..).zip(&pressure.addresses).filter(|(index, address)| lasts(*index) && inside(address));
        let (constants, others): (Vec<usize>, Vec<usize>) = placed
            .map(|(index, _)| index)
            .partition(|index| matches!(ir.registers[*index].kind, RegisterKind::Constant(_)));
        let peak = slot.map_or(Peak::default(), |slot| peaks[slot.index()]);
        let fill = Fill {
            constants: constants.len(),
            lasting: others.len() + rest.iter().filter(|entry| same(entry) && lasts(entry.0)).count(),
            values: peak.values,
            constant: constants.last().map(|index| ir.registers[*index].span),
        };
        // If constants find no room, values find none for the same reason: report only once.
        if lasts(first) || unplaced.is_empty() {
            sink.push(full(ir, pressure, (first, slot), &fill, peak, available, why));
        }
        rest.retain(|entry| !same(entry));
    }
    if let Some(first) = unplaced.first() {
        let available: usize = machine
            .slots
            .iter()
            .map(|slot| usize::from(slot.bank.depth - machine.outputs_per_bank.min(slot.bank.depth)))
            .sum();
        let kind = |wanted: fn(RegisterKind) -> bool| {
            ir.registers.iter().filter(move |register| wanted(register.kind)).count()
        };
        let fill = Fill {
            constants: kind(|kind| matches!(kind, RegisterKind::Constant(_))),
            lasting: lasting(ir, pressure),
            values: peaks.iter().map(|peak| peak.values).sum(),
            constant: None,
        };
        let plural = if unplaced.len() == 1 { "" } else { "s" };
        let message = format!("no register is left for {} constant{plural}", unplaced.len());
        let error = Diagnostic::error("bank-full", ir.registers[*first].span, message)
            .note(format!("{} has {available} registers; needed are {fill}", machine.name))
            .help(CONSTANTS_ELSEWHERE);
        sink.push(error);
    }
}

/// Number of registers that keep their values from block to block.
fn lasting(ir: &Ir, pressure: &Pressure) -> usize {
    let is_one = |index: &usize| {
        let kind = ir.registers[*index].kind;
        matches!(kind, RegisterKind::Plain | RegisterKind::State) && pressure.ranges[*index].is_none()
    };
    let placed =
        (0..pressure.addresses.len()).filter(|index| pressure.addresses[*index].is_some()).filter(is_one);
    placed.count() + pressure.missing.iter().filter(|(index, _)| is_one(index)).count()
}

/// The error of a full bank, or of too many inputs: `first` is the first register that finds no room.
fn full(
    ir: &Ir,
    pressure: &Pressure,
    (first, slot): (usize, Option<SlotIndex>),
    fill: &Fill,
    peak: Peak,
    available: usize,
    why: Option<&str>,
) -> Diagnostic {
    let (machine, register) = (ir.machine, &ir.registers[first]);
    let needed = fill.total();
    let missing = pressure.missing.iter().filter(|(_, other)| *other == slot);
    let names: Vec<&str> = missing
        .map(|(index, _)| ir.registers[*index].name.as_str())
        .filter(|name| !name.is_empty())
        .collect();
    let Some(slot) = slot else {
        let message = format!("{needed} input ports are needed, and {} has {available}", machine.name);
        return Diagnostic::error("bank-full", register.span, message)
            .here("no room for this one")
            .note(format!("no room for: {}", few(&names)));
    };
    let slot_row = machine.slot(slot);
    let bank = slot_row.bank.name;
    let message =
        format!("{needed} registers in bank {bank} are needed, and {} has {available}", machine.name);
    // Point at the bundle where the most values of a block are live, not at a declaration.
    let writes = |operation: &&Operation| operation.slot == Some(slot) && operation.dest.is_some();
    let crowded = pressure.ranges[first].and_then(|_| {
        let operations = &ir.bundles.get(peak.bundle as usize)?.operations;
        operations.iter().find(writes).or(operations.first())
    });
    let mut error = match crowded {
        Some(operation) => Diagnostic::error("bank-full", operation.span, message)
            .here(format!("here the block needs {} values at a time", peak.values)),
        None => Diagnostic::error("bank-full", register.span, message).here("no room for this one"),
    };
    let mostly_constants = fill.constants > fill.lasting + fill.values;
    if let Some(span) = fill.constant.filter(|_| mostly_constants) {
        error =
            error.also(span, format!("one of {} constants, each of which has a register", fill.constants));
    }
    error = error.note(format!("bank {bank}, which slot `{}` writes: {fill}", slot_row.name));
    if !names.is_empty() {
        error = error.note(format!("no room for: {}", few(&names)));
    }
    if let Some(why) = why {
        error = error.note(why);
    }
    if mostly_constants {
        error.help(CONSTANTS_ELSEWHERE)
    } else if crowded.is_some() {
        error.help("compute late values closer to their use, or use fewer values at a time")
    } else {
        error.help("use a register again once its value is no longer needed")
    }
}

/// The advice for constants that fill a bank.
const CONSTANTS_ELSEWHERE: &str = "load rarely used constants with `li`, or keep them in data memory";

/// The first names of a list.
fn few(names: &[&str]) -> String {
    const SHOWN: usize = 8;
    let shown = names.iter().take(SHOWN).copied().collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}
