// SPDX-License-Identifier: MIT OR Apache-2.0
//! Code emission: encodes the operations, with their allocated registers, as the program that the machine loads.

pub(crate) mod allocate;
pub(crate) mod spill;

use crate::capacity;
use crate::emit::allocate::Allocation;
use crate::ir::position::Position;
use crate::ir::{Constant, Ir, Operation, RegisterId, RegisterKind, numbered};
use crate::limits::NAME_BYTES;
use foldhash::{HashSet, HashSetExt as _};
use std::collections::BTreeMap;
use takt_diagnostics::diag::{Diagnostic, Sink};
use takt_diagnostics::source::Span;
use takt_isa::program::{Assumption, LoopBound, Port, Range, Section, Symbol};
use takt_isa::{BundleAddress, Instruction, Program, Register, SlotIndex, Type};

/// A program, with the words that a macro, a repetition or the assembler itself made (indices into its code, ascending).
pub(crate) struct EmittedProgram {
    pub(crate) program: Program,
    pub(crate) expanded: Vec<u32>,
    /// By word with a source line: its operation's order, and its expansion, which gives the scope.
    pub(crate) origins: Vec<Option<Position>>,
    /// Words that compute a part of an equation, and the place of the part.
    pub(crate) parts: Vec<(u32, Span)>,
}

/// Writes the program. The labels become its symbols.
pub(crate) fn emit(ir: &mut Ir, allocation: &Allocation, sink: &mut Sink) -> EmittedProgram {
    let slots = ir.machine.slots.len();
    let filler = Instruction::NOP.encode().unwrap_or(0);
    let mut code = vec![filler; ir.bundles.len() * slots];
    let mut lines = vec![None; ir.bundles.len() * slots];
    let (mut expanded, mut parts) = (Vec::new(), Vec::new());
    let (mut columns, mut assumptions) = (Vec::new(), Vec::new());
    let mut origins = vec![None; ir.bundles.len() * slots];
    for (address, bundle) in ir.bundles.iter().enumerate() {
        let words = address * slots..(address + 1) * slots;
        // An idle operation goes to the first slot that no other operation of the bundle claims.
        let claims = |slot: SlotIndex| bundle.operations.iter().any(|other| other.slot == Some(slot));
        let mut free = ir.machine.numbered_slots().map(|(slot, _)| slot).filter(|slot| !claims(*slot));
        for operation in &bundle.operations {
            let Some(slot) = operation.slot.or_else(|| free.next()) else { continue };
            let index = words.start + slot.index();
            code[index] = word(ir, operation, slot, allocation, sink);
            let (location, part) = (ir.location(operation), ir.columns(operation));
            lines[index] = location;
            origins[index] = location.map(|_| Position::new(operation.order, operation.expansion));
            assumptions.extend(ir.assumed(operation).map(|assumed| Assumption {
                word: index as u32,
                ty: assumed.ty,
                low: assumed.ends[0],
                high: assumed.ends[1],
            }));
            columns.extend(part.map(|part| (index as u32, part)));
            if operation.is_computed() && part.is_none() {
                parts.push((index as u32, operation.span));
            }
            if operation.expansion != 0 || operation.made || operation.is_computed() {
                expanded.push(index as u32);
            }
        }
    }
    limits(ir, sink);
    expanded.sort_unstable();
    parts.sort_unstable_by_key(|(word, _)| *word);
    assumptions.sort_unstable_by_key(|assumption: &Assumption| assumption.word);
    let mut program = Program {
        machine: ir.machine,
        code,
        data: ir.data.clone(),
        constants: constants(ir, allocation),
        inputs: ports(ir, allocation, |kind| kind == RegisterKind::Input),
        outputs: ports(ir, allocation, |kind| kind == RegisterKind::Output),
        parameters: ports(ir, allocation, |kind| kind == RegisterKind::Parameter),
        latched: ir.latched,
        registers: ports(ir, allocation, |kind| matches!(kind, RegisterKind::Plain | RegisterKind::State)),
        symbols: symbols(std::mem::take(&mut ir.labels)),
        sections: sections(ir),
        loop_bounds: loop_bounds(ir),
        ranges: ranges(ir, allocation),
        array_ranges: ir.array_ranges.clone(),
        results: ir.results.clone(),
        assumptions,
        files: ir.files.clone(),
        lines,
        // Columns of equations are added where the sources are at hand.
        parts: columns,
        origins: Vec::new(),
    };
    distinguish(&mut program);
    EmittedProgram { program, expanded, origins, parts }
}

fn word(ir: &Ir, operation: &Operation, slot: SlotIndex, allocation: &Allocation, sink: &mut Sink) -> u64 {
    // A missing address is reported by the allocation.
    let address = |id: crate::ir::RegisterId| allocation.addresses[id.index()].unwrap_or(Register::ZERO);
    let constant = match operation.constant {
        Constant::None => 0,
        Constant::Value(value) => value,
        Constant::Code(label) => ir.labels[label.0 as usize].position,
        Constant::Raw(index) => return ir.raw[index as usize],
    };
    let mut instruction = Instruction::bare(operation.op);
    if let Some(dest) = operation.dest {
        // A register without a place, or out of reach, has been reported.
        let Some(dest) = ir.machine.slot(slot).bank.index(address(dest)) else { return 0 };
        instruction.dest = dest;
    }
    for (source, id) in instruction.sources.iter_mut().zip(operation.reads()) {
        *source = address(*id);
    }
    instruction.constant = constant;
    match instruction.encode() {
        Ok(word) => word,
        Err(error) => {
            sink.push(Diagnostic::error("range", operation.span, error.to_string()));
            0
        }
    }
}

/// Reports a program that is longer than the machine's program memory.
pub(crate) fn limits(ir: &Ir, sink: &mut Sink) {
    let depth = ir.machine.most_bundles() as usize;
    let bundles = ir.bundles.len();
    if bundles > depth {
        let first = ir.bundles[depth].operations.first().map_or(Span::default(), |operation| operation.span);
        let message = format!(
            "the program memory is full: {bundles} bundles, and {} has {depth}, {} too few",
            ir.machine.name,
            bundles - depth
        );
        let error = Diagnostic::error("memory-full", first, message).here("the first that does not fit");
        sink.push(error.help(capacity::for_bundles(ir.machine, bundles)));
    }
}

fn constants(ir: &Ir, allocation: &Allocation) -> Vec<(Register, u32)> {
    let mut constants: Vec<(Register, u32)> = ir
        .registers
        .iter()
        .zip(&allocation.addresses)
        .filter_map(|(register, address)| {
            let bits = match register.kind {
                RegisterKind::Constant(bits) => Some(bits),
                _ => register.preset,
            };
            Some(((*address)?, bits?))
        })
        .collect();
    constants.sort_unstable();
    constants
}

fn ports(ir: &Ir, allocation: &Allocation, wanted: impl Fn(RegisterKind) -> bool) -> Vec<Port> {
    ir.registers
        .iter()
        .zip(allocation.addresses.iter().zip(&allocation.shared))
        // A register shared by several names has no name.
        .filter(|(register, (_, shared))| wanted(register.kind) && !register.name.is_empty() && !**shared)
        .filter_map(|(register, (address, _))| {
            Some(Port { name: register.name.clone(), register: (*address)?, ty: register.ty })
        })
        .collect()
}

fn symbols(labels: Vec<crate::ir::Label>) -> Vec<Symbol> {
    let symbol =
        |label: crate::ir::Label| Symbol { name: label.name, space: label.space, address: label.position };
    // Labels without a name are the assembler's own.
    let named = labels.into_iter().filter(|label| !label.name.is_empty());
    let mut symbols: Vec<Symbol> = named.map(symbol).collect();
    // Labels of one address stay in the order of the source.
    symbols.sort_by_key(|symbol| (symbol.space, symbol.address));
    symbols
}

/// The sections that hold bundles.
fn sections(ir: &Ir) -> Vec<Section> {
    let end = ir.bundles.len() as u32;
    [("once", 0, ir.period), ("period", ir.period, end)]
        .map(|(name, start, end)| (name, BundleAddress::new(start), BundleAddress::new(end)))
        .into_iter()
        .filter(|(_, start, end)| start < end)
        .map(|(name, start, end)| Section { name: name.to_owned(), start, end })
        .collect()
}

/// The bounds of loops. Two may share a place where the scheduler removed a block of idle bundles.
fn loop_bounds(ir: &Ir) -> Vec<LoopBound> {
    let mut bounds: BTreeMap<u32, (u32, Option<u32>)> = BTreeMap::new();
    for bound in ir.loop_bounds.iter().filter(|bound| (bound.position as usize) < ir.bundles.len()) {
        let this = (bound.most, bound.total);
        let both = |(most, total): &mut (u32, Option<u32>)| {
            *most = bound.most.max(*most);
            *total = total.zip(bound.total).map(|(one, other)| one.saturating_add(other));
        };
        bounds.entry(bound.position).and_modify(both).or_insert(this);
    }
    bounds
        .into_iter()
        .map(|(address, (most, total))| LoopBound { address: BundleAddress::new(address), most, total })
        .collect()
}

/// Ranges of registers that have an address; unused registers have none.
fn ranges(ir: &Ir, allocation: &Allocation) -> Vec<Range> {
    let range = |&(id, [low, high]): &(RegisterId, [u32; 2])| {
        let register = allocation.addresses[id.index()]?;
        let ty = if ir.register(id).ty == Type::I { Type::I } else { Type::F };
        Some(Range { register, ty, low, high })
    };
    let mut ranges: Vec<Range> = ir.ranges.iter().filter_map(range).collect();
    ranges.sort_by_key(|range| range.register);
    ranges.dedup_by_key(|range| range.register);
    ranges
}

/// Makes all names unique and short enough. Only names made by the assembler, of a macro's locals and of values split from a name,
/// can collide or be too long.
fn distinguish(program: &mut Program) {
    let count = program.named_registers().count() + program.symbols.len();
    let mut all: HashSet<&str> = HashSet::with_capacity(count);
    let listed = program
        .named_registers()
        .map(|port| &port.name)
        .chain(program.symbols.iter().map(|symbol| &symbol.name));
    all.extend(listed.filter(|name| name.len() <= NAME_BYTES).map(String::as_str));
    if all.len() == count {
        return;
    }
    // Names without a point come from the source and are kept; names with a point are changed.
    let mut taken: HashSet<String> =
        all.into_iter().filter(|name| !name.contains('.')).map(str::to_owned).collect();
    let Program { inputs, outputs, parameters, registers, symbols, .. } = program;
    let ports =
        inputs.iter_mut().chain(outputs).chain(parameters).chain(registers).map(|port| &mut port.name);
    for name in ports.chain(symbols.iter_mut().map(|symbol| &mut symbol.name)) {
        if !name.contains('.') || (name.len() <= NAME_BYTES && taken.insert(name.clone())) {
            continue;
        }
        // ASCII throughout: a name can be cut anywhere.
        let (head, indices) = name.split_at(name.find('[').unwrap_or(name.len()));
        let room = (NAME_BYTES - 12).saturating_sub(indices.len());
        let stem = format!("{}{indices}", &head[..head.len().min(room)]);
        let mut number = 2;
        *name = loop {
            let candidate = numbered(&stem, &format!("._{number}"));
            if taken.insert(candidate.clone()) {
                break candidate;
            }
            number += 1;
        };
    }
}
