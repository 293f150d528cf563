// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bindings of a source's names in the assembled program, for debuggers: the assembler may give the values of one name registers
//! of their own, the scheduler moves the operations that compute them, and a macro's names differ in each use.
//!
//! Source order decides which value a name means: a line reads the value that the line before it in the source wrote,
//! wherever the two were scheduled. So each word has the [`Position`] of its line, and each value the range of that order in
//! which the name means it.

use crate::context::{Context, ScopeId};
use crate::emit::EmittedProgram;
use crate::emit::allocate::Allocation;
use crate::ir::arrays::Array;
pub use crate::ir::position::Position;
use crate::ir::{Ir, RegisterId};
use std::collections::{BTreeMap, HashMap, HashSet};
use takt_diagnostics::source::{Lines, Sources, Span};
use takt_isa::program::Columns;
use takt_isa::{BundleAddress, Register, Type};
use takt_syntax::expr::Value;

/// Debugging information of a program, part of its image unless stripped.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DebugInfo {
    /// Sources: names as in the program, and texts.
    pub sources: Vec<(String, String)>,
    /// Named constants in source order.
    pub constants: Vec<(String, Value)>,
    /// Bindings of names to registers and data words.
    pub names: Names,
}

/// The bindings of names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Position of each word of the code that has a source line. Empty if nothing is known.
    pub positions: Vec<Option<Position>>,
    /// Uses of macros. The first stands for the code outside of macros.
    pub scopes: Vec<Scope>,
    /// Values of names whose register differs from place to place.
    pub values: Vec<NamedValue>,
    /// Arrays in data memory.
    pub arrays: Vec<NamedArray>,
}

impl Names {
    /// The position of the line that a bundle shows: taken from its first operation with a position, or else from a bundle
    /// before.
    pub fn at_hand(&self, slots: usize, address: BundleAddress) -> Position {
        let end = (address.index() + 1).saturating_mul(slots).min(self.positions.len());
        let bundles = self.positions[..end].rchunks(slots.max(1));
        bundles.flat_map(|words| words.iter().flatten()).next().copied().unwrap_or_default()
    }
}

/// An array in data memory. Its words follow one another, the last index counting fastest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedArray {
    /// Name of the array.
    pub name: String,
    /// First word in data memory.
    pub base: u32,
    /// Number of elements in each dimension; indices count from 1.
    pub sizes: Vec<u32>,
    /// Type of the elements.
    pub ty: Type,
}

/// A use of a macro.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scope {
    /// Prefix of the names declared in the use: the macro and the number of the use, `limit.2`. A point follows.
    pub name: String,
    /// Parameters that stand for registers, and the registers' names.
    pub parameters: Vec<(String, String)>,
}

/// A value of a name, and its register.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedValue {
    /// Name in the source.
    pub name: String,
    /// Name of the value: `t.1`, or the source's name for the last value of a straight run, which later runs may read.
    pub label: String,
    /// Register that holds the value.
    pub register: Register,
    /// Type by which debuggers read the bits.
    pub ty: Type,
    /// Range of source order in which the name means this value: above the first, up to the second. `None`: wherever the name means
    /// no other value.
    pub orders: Option<(u32, u32)>,
    /// Bundles of the first write and the last use, if the register may hold other values elsewhere.
    pub bundles: Option<(BundleAddress, BundleAddress)>,
}

/// Columns of the parts of lines that words compute, for words attributed to the lines where these parts stand.
pub(crate) fn parts(sources: &Sources, emitted: &EmittedProgram) -> Vec<(u32, Columns)> {
    let mut lines: HashMap<usize, Lines> = HashMap::new();
    let part = |&(word, span): &(u32, Span)| {
        let number = sources.file_of(span.start);
        let file = sources.files().get(number)?;
        let lines = lines.entry(number).or_insert_with(|| Lines::of(&file.text));
        let (start, end) = ((span.start - file.base) as usize, (span.end - file.base) as usize);
        let index = lines.index(start as u32);
        let location = emitted.program.lines.get(word as usize).copied().flatten()?;
        let is_there = location.line as usize == index + 1
            && emitted.program.files.get(location.file as usize).is_some_and(|name| **name == *file.name);
        let before = file.text.get(lines.range(index)?.start..start)?.chars().count() as u32;
        let within = file.text.get(start..end)?.chars().count() as u32;
        (is_there && within > 0).then_some((word, Columns { first: before + 1, last: before + within }))
    };
    let mut parts: Vec<(u32, Columns)> = emitted.program.parts.clone();
    parts.extend(emitted.parts.iter().filter_map(part));
    parts.sort_unstable_by_key(|(word, _)| *word);
    parts
}

/// The bindings of a program's names.
pub(crate) fn names(
    context: &mut Context,
    ir: &Ir,
    allocation: &Allocation,
    emitted: &mut EmittedProgram,
) -> Names {
    let (positions, scopes) = positions(context, ir, emitted);
    let array = |array: &Array| {
        let Array { name, base, sizes, ty, .. } = array;
        NamedArray { name: name.clone(), base: *base, sizes: sizes.to_vec(), ty: *ty }
    };
    let arrays = ir.arrays.iter().map(array).collect();
    Names { positions, scopes, values: values(ir, allocation, emitted), arrays }
}

fn positions(
    context: &mut Context,
    ir: &Ir,
    emitted: &mut EmittedProgram,
) -> (Vec<Option<Position>>, Vec<Scope>) {
    let mut given = std::mem::take(&mut context.declared.parameters);
    given.sort_unstable();
    given.dedup_by_key(|(scope, name, _)| (*scope, *name));
    let parameters = |owner: ScopeId| {
        let of_owner = &given[given.partition_point(|(scope, ..)| *scope < owner)..];
        let of_owner = of_owner.iter().take_while(|(scope, ..)| *scope == owner);
        let named = of_owner.filter(|(.., register)| !ir.register(*register).name.is_empty());
        let names = named.map(|(_, name, register)| {
            (context.scopes.text(*name).to_owned(), ir.register(*register).name.clone())
        });
        let mut names: Vec<(String, String)> = names.collect();
        names.sort_unstable();
        names
    };
    // Reserve room for each scope to be a macro's use: memory that is not written to costs nothing.
    let mut scopes = Vec::with_capacity(context.scopes.count());
    scopes.push(Scope::default());
    // Numbers of scopes by owner; 0 for owners without one yet, as for the code outside of macros.
    let mut numbers = vec![0; context.scopes.count()];
    let mut position = |position: Position| {
        let expansion = position.scope();
        if expansion == 0 {
            return position;
        }
        let owner = context.scopes.scope(ScopeId(expansion)).owner;
        let number = &mut numbers[owner.0 as usize];
        if *number == 0
            && let Some(name) = context.scopes.scope_name(owner)
        {
            *number = scopes.len() as u32;
            scopes.push(Scope { name, parameters: parameters(owner) });
        }
        Position::new(position.order, *number)
    };
    // Reuses the memory of the origins.
    let origins = std::mem::take(&mut emitted.origins);
    let positions = origins.into_iter().map(|origin| origin.map(&mut position)).collect();
    (positions, scopes)
}

fn values(ir: &Ir, allocation: &Allocation, emitted: &EmittedProgram) -> Vec<NamedValue> {
    // Values with registers of their own, by the register that the source names.
    type Values = Vec<(RegisterId, Option<(u32, u32)>)>;
    let mut split: BTreeMap<RegisterId, Values> = BTreeMap::new();
    for version in &ir.versions {
        split
            .entry(version.name)
            .or_default()
            .push((version.register, Some((version.after, version.through))));
    }
    let made: HashSet<RegisterId> = ir.versions.iter().map(|version| version.register).collect();
    let shared = (0..ir.registers.len()).filter(|index| allocation.shared[*index]).map(RegisterId::new);
    for id in shared.filter(|id| !made.contains(id)) {
        split.entry(id).or_default();
    }
    if split.is_empty() {
        return Vec::new();
    }
    let ranges = ranges(ir);
    let own_names: HashMap<Register, &str> =
        emitted.program.registers.iter().map(|port| (port.register, port.name.as_str())).collect();
    let mut values = Vec::new();
    for (original, mut versions) in split {
        versions.push((original, None));
        let name = &ir.register(original).name;
        // Intermediate values of equations have no name.
        if name.is_empty() {
            continue;
        }
        for (id, orders) in versions {
            let Some(register) = allocation.addresses[id.index()] else { continue };
            let shared = allocation.shared[id.index()];
            let own = own_names.get(&register).filter(|_| !shared);
            let label = own.map_or_else(|| ir.register(id).name.clone(), |own| (*own).to_owned());
            let lives = orders.is_some() || shared;
            values.push(NamedValue {
                name: name.clone(),
                label,
                register,
                ty: ir.register(id).ty,
                orders,
                bundles: ranges[id.index()].filter(|_| lives),
            });
        }
    }
    values
}

/// By register: the first bundle that writes it, and the last bundle that uses it.
fn ranges(ir: &Ir) -> Vec<Option<(BundleAddress, BundleAddress)>> {
    let mut ranges: Vec<Option<(BundleAddress, BundleAddress)>> = vec![None; ir.registers.len()];
    for (address, bundle) in (0..).map(BundleAddress::new).zip(&ir.bundles) {
        for operation in &bundle.operations {
            for source in operation.reads() {
                if let Some((_, last)) = &mut ranges[source.index()] {
                    *last = address;
                }
            }
        }
        for dest in bundle.operations.iter().filter_map(|operation| operation.dest) {
            ranges[dest.index()].get_or_insert((address, address)).1 = address;
        }
    }
    ranges
}
