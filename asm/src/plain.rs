// SPDX-License-Identifier: MIT OR Apache-2.0
//! The plain program: the source's operations in its order, on registers of its own, before any is fused, given a bank, moved
//! or given an address. A checker of all that comes after starts from it (`takt-verify`).

use crate::context::Context;
use crate::expand::Expander;
use crate::ir::{Constant, Ir, Operation, RegisterKind};
use crate::report::diag::Diagnostics;
use crate::report::source::Sources;
use crate::{Contract, Loader, Options, resolve};
use std::sync::Arc;
use takt_isa::program::Location;
use takt_isa::{Machine, Op, Register, Type};

/// A program as its source has it.
#[derive(Clone, Debug)]
pub struct Plain {
    /// The machine that it is for.
    pub machine: &'static Machine,
    /// The registers; the first always reads as zero.
    pub registers: Vec<PlainRegister>,
    /// The bundles, those of `once` first. All operations of a bundle read before any writes.
    pub bundles: Vec<PlainBundle>,
    /// Index of the first bundle of `period`.
    pub period: u32,
    /// The arrays of data memory: name, first word, number of words. An access of an array's element never leaves the array.
    pub arrays: Vec<(String, u32, u32)>,
    /// Data memory.
    pub data: Vec<u32>,
    /// True if inputs are latched together at the tick.
    pub latched: bool,
    /// Bounds of loops: the bundle that heads each, the most iterations each time that it is entered, and of a section.
    pub loop_bounds: Vec<(u32, u32, Option<u32>)>,
    /// `.deadline`: the output, the cycle in which it is written at the latest, and whether it is one of `.period`.
    pub deadlines: Vec<(u32, u32, bool)>,
    /// Source files that locations name.
    pub files: Vec<String>,
}

/// A register of the source.
#[derive(Clone, Debug)]
pub struct PlainRegister {
    /// Its name; empty for a constant.
    pub name: String,
    /// Its role.
    pub kind: PlainKind,
    /// The type as which its bits are shown.
    pub ty: Type,
    /// The address that the source gives it.
    pub pinned: Option<Register>,
    /// The bits that it holds from the start.
    pub preset: Option<u32>,
}

/// The role of a register.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PlainKind {
    /// The program's own.
    Plain,
    /// Its value outlives the period.
    State,
    /// An input port.
    Input,
    /// An output port.
    Output,
}

/// Operations that execute together.
#[derive(Clone, Debug)]
pub struct PlainBundle {
    /// The operations, in the order of the source.
    pub operations: Vec<PlainOperation>,
    /// True if products may be fused into sums here.
    pub contract: bool,
}

/// An operation.
#[derive(Clone, Debug)]
pub struct PlainOperation {
    /// The instruction.
    pub op: Op,
    /// The register that it writes: an index into [`Plain::registers`].
    pub dest: Option<u32>,
    /// The registers that it reads, as many as the instruction has sources; the rest is zero.
    pub sources: [u32; 3],
    /// Immediate, offset, or index of the bundle that it leads to.
    pub constant: u32,
    /// The array that it accesses.
    pub array: Option<u32>,
    /// True if it is a word given bit by bit: what it does is not known.
    pub raw: bool,
    /// Its source line.
    pub location: Option<Location>,
}

/// Reads the program that begins with the source at `path`, up to the point where the assembler begins to change it.
///
/// # Errors
/// Every error found so far.
pub fn plain(path: &str, loader: &dyn Loader, options: &Options) -> Result<Plain, Diagnostics> {
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

fn of(ir: &Ir, contract: Contract) -> Plain {
    let may_contract = |bundle: usize| {
        ir.contracted.get(bundle).copied().flatten().is_some_and(|on| match contract {
            Contract::AsWritten => on,
            Contract::All => true,
            Contract::None => false,
        })
    };
    let registers = ir.registers.iter().map(|register| PlainRegister {
        name: register.name.clone(),
        kind: match register.kind {
            RegisterKind::State => PlainKind::State,
            RegisterKind::Input => PlainKind::Input,
            RegisterKind::Output => PlainKind::Output,
            RegisterKind::Plain | RegisterKind::Constant(_) | RegisterKind::Zero => PlainKind::Plain,
        },
        ty: register.ty,
        pinned: register.pinned,
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
    Plain {
        machine: ir.machine,
        registers: registers.collect(),
        bundles: bundles.collect(),
        period: ir.period,
        arrays: ir.arrays.iter().map(|array| (array.name.clone(), array.base, array.words)).collect(),
        data: ir.data.clone(),
        latched: ir.latched,
        loop_bounds: ir.loop_bounds.iter().map(|bound| (bound.position, bound.most, bound.total)).collect(),
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
