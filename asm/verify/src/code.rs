// SPDX-License-Identifier: MIT OR Apache-2.0
//! The two programs in one form: the plain program of a source, and an image's words as decoded by the specification's rows.

use crate::{Difference, Hint};
use foldhash::{HashMap, HashMapExt as _};
use takt_asm::plain::{Plain, PlainKind};
use takt_isa::program::Location;
use takt_isa::{Effect, Function, Op, Program, Register, SlotIndex, fusions};

/// An operation.
#[derive(Clone, Debug)]
pub(crate) struct Operation {
    pub(crate) op: Op,
    pub(crate) dest: Option<usize>,
    pub(crate) sources: [usize; 3],
    pub(crate) constant: u32,
    /// The array that the source says it accesses.
    pub(crate) array: Option<usize>,
    pub(crate) location: Option<Location>,
    /// The part that it has in a fused product.
    pub(crate) fused: Fused,
    /// Its slot, unit and latency; of the image only.
    pub(crate) timing: Option<Timing>,
}

/// The unit of an operation, by slot and number in it, and its times.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timing {
    pub(crate) slot: usize,
    pub(crate) unit: usize,
    pub(crate) latency: u64,
    pub(crate) interval: u64,
}

impl Operation {
    pub(crate) fn reads(&self) -> &[usize] {
        &self.sources[..self.op.row().shape.sources()]
    }
}

/// The part of an operation in a product that is fused into a sum.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Fused {
    /// None.
    No,
    /// The product, by its number.
    Product(usize),
    /// The sum with the product of a number, which is this source of it; as this instruction.
    Sum { product: usize, source: usize, op: Op },
}

/// A program.
#[derive(Clone, Debug)]
pub(crate) struct Code {
    pub(crate) bundles: Vec<Vec<Operation>>,
    /// The value that each register holds at the start, if any.
    pub(crate) initial: Vec<Option<u32>>,
    /// For each register the output port that it is, by number of the source's declaration.
    pub(crate) outputs: Vec<Option<usize>>,
    /// The registers of the inputs, in the order of the declaration.
    pub(crate) inputs: Vec<usize>,
    /// Bounds of the iterations of loops, by first bundle.
    pub(crate) bounds: HashMap<u32, u32>,
}

fn refuse(what: String) -> Difference {
    Difference { place: None, what, source: None, image: None }
}

/// Input ports, output ports and states of a source, in the order of their declaration.
pub(crate) fn named(plain: &Plain, kind: PlainKind) -> impl Iterator<Item = (usize, &str)> {
    let registers = plain.registers.iter().enumerate();
    registers
        .filter(move |(_, register)| register.kind == kind)
        .map(|(id, register)| (id, register.name.as_str()))
}

/// The source's program. `hints` say which products the assembler fused; each is accepted only where the source permits it.
pub(crate) fn of_source(plain: &Plain, hints: &[Hint]) -> Result<Code, Difference> {
    let mut roles: HashMap<(u32, u32), Fused> = HashMap::new();
    for (number, hint) in hints.iter().enumerate() {
        let &Hint::Fused { product, sum } = hint else { continue };
        let found = |(bundle, at): (u32, u32)| {
            let bundle = plain.bundles.get(bundle as usize)?;
            Some((bundle.contract, bundle.operations.get(at as usize)?))
        };
        let (Some((true, first)), Some((true, second))) = (found(product), found(sum)) else {
            return Err(refuse("a product is fused where the source does not say `.contract on`".to_owned()));
        };
        let row = fusions().iter().find(|fusion| {
            fusion.product == first.op
                && fusion.sum == second.op
                && second.sources.get(fusion.source).copied() == first.dest
        });
        let Some(row) = row else {
            return Err(refuse("a product is fused that the sum does not read".to_owned()));
        };
        roles.insert(product, Fused::Product(number));
        roles.insert(sum, Fused::Sum { product: number, source: row.source, op: row.fused });
    }
    let mut bundles = Vec::with_capacity(plain.bundles.len());
    for (bundle, at) in plain.bundles.iter().zip(0..) {
        let mut operations = Vec::with_capacity(bundle.operations.len());
        for (operation, number) in bundle.operations.iter().zip(0..) {
            if operation.raw {
                return Err(Difference {
                    place: operation.location,
                    what: "a word given bit by bit cannot be checked".to_owned(),
                    source: None,
                    image: None,
                });
            }
            if operation.op.row().function == Function::Idle {
                continue;
            }
            operations.push(Operation {
                op: operation.op,
                dest: operation.dest.map(|dest| dest as usize),
                sources: operation.sources.map(|source| source as usize),
                constant: operation.constant,
                array: operation.array.map(|array| array as usize),
                location: operation.location,
                fused: roles.get(&(at, number)).copied().unwrap_or(Fused::No),
                timing: None,
            });
        }
        bundles.push(operations);
    }
    let mut outputs = vec![None; plain.registers.len()];
    for (number, (id, _)) in named(plain, PlainKind::Output).enumerate() {
        outputs[id] = Some(number);
    }
    Ok(Code {
        bundles,
        initial: plain.registers.iter().map(|register| register.preset).collect(),
        outputs,
        inputs: named(plain, PlainKind::Input).map(|(id, _)| id).collect(),
        bounds: plain.loop_bounds.iter().map(|&(head, most, _)| (head, most)).collect(),
    })
}

/// The image's program, with the ports and states that the source declares.
pub(crate) fn of_image(program: &Program, plain: &Plain) -> Result<Code, Difference> {
    if program.machine != plain.machine {
        let (image, source) = (program.machine.name, plain.machine.name);
        return Err(refuse(format!("the image is for {image}, the source for {source}")));
    }
    let word = |data: &[u32], at: usize| data.get(at).copied().unwrap_or(0);
    let length = program.data.len().max(plain.data.len());
    if let Some(at) = (0..length).find(|at| word(&program.data, *at) != word(&plain.data, *at)) {
        let name = program.data_text(at as u32);
        let text = |data: &[u32]| format!("{:?} (0x{:08x})", f32::from_bits(word(data, at)), word(data, at));
        return Err(Difference {
            source: Some(text(&plain.data)),
            image: Some(text(&program.data)),
            ..refuse(format!("{name} is not the source's"))
        });
    }
    if program.latched != plain.latched {
        return Err(refuse("image and source differ in whether ports are latched".to_owned()));
    }
    let mut bundles: Vec<Vec<Operation>> = Vec::new();
    for address in program.addresses() {
        let location = program.location(address);
        let bundle = program.bundle(address).unwrap_or(Ok(Vec::new())).map_err(|(_, reason)| Difference {
            place: location,
            what: format!("bundle {address} cannot run: {reason}"),
            source: None,
            image: None,
        })?;
        let operations = SlotIndex::all().zip(bundle).filter_map(|(slot, instruction)| {
            let row = instruction.op.row();
            (row.function != Function::Idle).then(|| Operation {
                op: instruction.op,
                dest: instruction.writes(program.machine.slot(slot)).map(Register::index),
                sources: instruction.sources.map(Register::index),
                constant: instruction.constant,
                array: None,
                location: program.operation_location(address, slot),
                fused: Fused::No,
                timing: program.machine.slot(slot).unit_index(row.function).map(|unit| {
                    let times = program.machine.slot(slot).units[unit];
                    let (latency, interval) = (times.latency.into(), times.interval.into());
                    Timing { slot: slot.index(), unit, latency, interval }
                }),
            })
        });
        bundles.push(operations.collect());
    }
    let mut bounds: HashMap<u32, u32> = HashMap::new();
    for bound in &program.loop_bounds {
        let head = bound.address.get();
        let counts = |operations: &Vec<Operation>| {
            operations.iter().any(|operation| operation.op.row().effect == Effect::Loop)
        };
        // The bound of a loop that the sequencer counts is checked where the count is known. The place of another is not checked, but
        // it is one of the source's.
        let is_counted =
            head.checked_sub(1).and_then(|entry| bundles.get(entry as usize)).is_some_and(counts);
        if !is_counted
            && plain.loop_bounds.iter().all(|known| (known.1, known.2) != (bound.most, bound.total))
        {
            return Err(refuse("the image has a loop bound that the source does not".to_owned()));
        }
        bounds.insert(head, bound.most);
    }
    let mut initial = vec![None; Register::COUNT];
    initial[Register::ZERO.index()] = Some(0);
    for &(register, bits) in &program.constants {
        initial[register.index()] = Some(bits);
    }
    let port = |ports: &[takt_isa::program::Port], name: &str| {
        ports.iter().find(|port| port.name == name).map(|port| port.register.index())
    };
    let mut outputs = vec![None; Register::COUNT];
    for (number, (id, name)) in named(plain, PlainKind::Output).enumerate() {
        let declared = program.outputs.iter().find(|port| port.name == name);
        let Some(declared) = declared else { continue };
        if declared.ty != plain.registers[id].ty {
            return Err(refuse(format!("output `{name}` has another type in the image")));
        }
        if program.machine.output_number(declared.register).is_none() {
            return Err(refuse(format!("output `{name}` is no output port in the image")));
        }
        if plain.registers[id].pinned.is_some_and(|pinned| pinned != declared.register) {
            return Err(refuse(format!("output `{name}` is another port in the image")));
        }
        outputs[declared.register.index()] = Some(number);
    }
    let mut inputs = Vec::new();
    for (id, name) in named(plain, PlainKind::Input) {
        // An input that nothing reads has no place; register `zero` is never written, so that nothing is lost there.
        let place = port(&program.inputs, name).unwrap_or(usize::MAX);
        let pinned = plain.registers[id].pinned.map(Register::index);
        let is_input = program.inputs.iter().all(|port| program.machine.is_input(port.register));
        if !is_input || pinned.is_some_and(|pinned| place != usize::MAX && pinned != place) {
            return Err(refuse(format!("input `{name}` is another port in the image")));
        }
        inputs.push(place);
    }
    Ok(Code { bundles, initial, outputs, inputs, bounds })
}
