// SPDX-License-Identifier: MIT OR Apache-2.0
//! The plain program: the source's operations in source order, on registers of its own, before any is fused, given a bank,
//! moved or given an address. A checker of the later stages starts from it (`takt-verify`).

use crate::context::Context;
use crate::expand::Expander;
use crate::ir::{Constant, Ir, Label, Operation, RegisterKind};
use crate::{Contract, Loader, Options, resolve};
use std::collections::HashMap;
use std::sync::Arc;
use takt_diagnostics::diag::Diagnostics;
use takt_diagnostics::source::Sources;
use takt_isa::program::{ArrayRange, ArrayResult, Location, Space};
use takt_isa::{Machine, Op, Register, Type};

/// A program in source order, before any transformation.
#[derive(Clone, Debug)]
pub struct PlainProgram {
    /// Machine that the program is for.
    pub machine: &'static Machine,
    /// Registers; the first always reads as zero.
    pub registers: Vec<PlainRegister>,
    /// Bundles of `once`, then of `period`. All operations of a bundle read before any writes.
    pub bundles: Vec<PlainBundle>,
    /// Index of the first bundle of `period`.
    pub period: u32,
    /// Arrays of data memory: name, first word, number of words. An access of an array's element never leaves the array.
    pub arrays: Vec<(String, u32, u32)>,
    /// Initial words of data memory.
    pub data: Vec<u32>,
    /// Inputs are latched together at the tick.
    pub latched: bool,
    /// Bounds of loops: the bundle that heads each, and the maximum number of iterations per entry of the loop and in a section.
    pub loop_bounds: Vec<(u32, u32, Option<u32>)>,
    /// Labels in source order: name, memory, and the bundle or data word that each stands before.
    pub labels: Vec<(String, Space, u32)>,
    /// `.range`s in source order: the register, and the bits of its least and largest value.
    pub ranges: Vec<(u32, [u32; 2])>,
    /// `.range`s of arrays in data memory, by ascending word.
    pub array_ranges: Vec<ArrayRange>,
    /// Arrays whose words are results when a period ends, by ascending word.
    pub results: Vec<ArrayResult>,
    /// Assumptions about values that operations write: types and ends.
    pub assumptions: Vec<(Type, [u32; 2])>,
    /// `.deadline`s: the output, the last cycle in which it may be written, and whether the demand is on `.period`.
    pub deadlines: Vec<(u32, u32, bool)>,
    /// Source files that locations name.
    pub files: Vec<String>,
}

/// A register of the source.
#[derive(Clone, Debug)]
pub struct PlainRegister {
    /// Name in the source; empty for a constant.
    pub name: String,
    /// Role of the register.
    pub kind: PlainKind,
    /// Type by which debuggers show the bits.
    pub ty: Type,
    /// Address that the source gives the register.
    pub pinned: Option<Register>,
    /// Number that the source gives the output port.
    pub number: Option<u16>,
    /// Bits that the register holds from the start.
    pub preset: Option<u32>,
}

/// The role of a register.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PlainKind {
    /// Register of the program's own.
    Plain,
    /// Register whose value outlives the period.
    State,
    /// Input port, which the host writes.
    Input,
    /// Output port, which the host reads.
    Output,
    /// Parameter: an input port that the host sets between periods.
    Parameter,
}

/// Operations that execute together.
#[derive(Clone, Debug)]
pub struct PlainBundle {
    /// The operations, in the order of the source.
    pub operations: Vec<PlainOperation>,
    /// Products may be fused into sums here.
    pub contract: bool,
}

/// An operation on plain registers.
#[derive(Clone, Debug)]
pub struct PlainOperation {
    /// Instruction of the operation.
    pub op: Op,
    /// Destination: an index into [`PlainProgram::registers`].
    pub dest: Option<u32>,
    /// Registers that the operation reads, as many as the instruction has sources; the rest is zero.
    pub sources: [u32; 3],
    /// Immediate, offset, or index of the target bundle.
    pub constant: u32,
    /// Index into [`PlainProgram::arrays`] of the accessed array.
    pub array: Option<u32>,
    /// The operation is a raw word, given bit by bit, with unknown effect.
    pub raw: bool,
    /// Place in the source.
    pub location: Option<Location>,
}

/// Reads the program that begins with the source at `path`, up to the point where the assembler begins to transform it.
///
/// # Errors
/// Every error found so far.
pub fn plain(path: &str, loader: &dyn Loader, options: &Options) -> Result<PlainProgram, Diagnostics> {
    let mut context = Context::new(options.machine);
    context.reports.sink.levels = options.levels;
    let (mut context, flat) = Expander::new(context, loader).expand(path);
    let ir = resolve::resolve(&mut context, loader, flat);
    let sink = std::mem::take(&mut context.reports.sink);
    if sink.errors > 0 {
        let sources: Sources = std::mem::take(&mut context.reports.sources);
        return Err(sink.finish(Arc::new(sources)));
    }
    Ok(of(&ir, options.contract))
}

fn of(ir: &Ir, contract: Contract) -> PlainProgram {
    let may_contract = |bundle: usize| {
        ir.contracted.get(bundle).copied().flatten().is_some_and(|on| match contract {
            Contract::AsWritten => on,
            Contract::All => true,
            Contract::None => false,
        })
    };
    let numbers: HashMap<usize, u16> = ir.numbers.iter().map(|(number, id)| (id.index(), *number)).collect();
    let registers = ir.registers.iter().enumerate().map(|(id, register)| PlainRegister {
        name: register.name.clone(),
        kind: match register.kind {
            RegisterKind::State => PlainKind::State,
            RegisterKind::Input => PlainKind::Input,
            RegisterKind::Parameter => PlainKind::Parameter,
            RegisterKind::Output => PlainKind::Output,
            RegisterKind::Plain | RegisterKind::Constant(_) | RegisterKind::Zero => PlainKind::Plain,
        },
        ty: register.ty,
        pinned: register.pinned,
        number: numbers.get(&id).copied(),
        preset: match register.kind {
            RegisterKind::Constant(bits) => Some(bits),
            RegisterKind::Zero => Some(0),
            _ => register.preset,
        },
    });
    let bundles = ir.bundles.iter().enumerate().map(|(at, bundle)| PlainBundle {
        operations: bundle.operations.iter().map(|operation| operation_of(ir, operation)).collect(),
        contract: may_contract(at),
    });
    let label = |label: &Label| (label.name.clone(), label.space, label.position);
    PlainProgram {
        machine: ir.machine,
        registers: registers.collect(),
        bundles: bundles.collect(),
        period: ir.period,
        arrays: ir.arrays.iter().map(|array| (array.name.clone(), array.base, array.words)).collect(),
        data: ir.data.clone(),
        latched: ir.latched,
        loop_bounds: ir.loop_bounds.iter().map(|bound| (bound.position, bound.most, bound.total)).collect(),
        labels: ir.labels.iter().filter(|label| !label.name.is_empty()).map(label).collect(),
        ranges: ir.ranges.iter().map(|(id, ends)| (id.index() as u32, *ends)).collect(),
        array_ranges: ir.array_ranges.clone(),
        results: ir.results.clone(),
        assumptions: ir.assumptions.iter().map(|assumed| (assumed.ty, assumed.ends)).collect(),
        deadlines: ir.demands.iter().flat_map(deadlines).collect(),
        files: ir.files.clone(),
    }
}

fn deadlines(demand: &crate::ir::Demand) -> impl Iterator<Item = (u32, u32, bool)> + '_ {
    let cycle = match demand.kind {
        crate::ir::DemandKind::Deadline(cycle) => Some(cycle),
        _ => None,
    };
    let ports = demand.ports.iter();
    ports.filter_map(move |(port, _)| Some((port.index() as u32, cycle?, demand.period)))
}

fn operation_of(ir: &Ir, operation: &Operation) -> PlainOperation {
    PlainOperation {
        op: operation.op,
        dest: operation.dest.map(|dest| dest.index() as u32),
        sources: operation.sources.map(|source| source.index() as u32),
        constant: match operation.constant {
            Constant::None => 0,
            Constant::Value(value) => value,
            Constant::Code(label) => ir.labels[label.0 as usize].position,
            Constant::Raw(_) => 0,
        },
        array: ir.access(operation).map(|access| access.array.0),
        raw: matches!(operation.constant, Constant::Raw(_)),
        location: ir.location(operation),
    }
}
