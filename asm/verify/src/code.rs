// SPDX-License-Identifier: MIT OR Apache-2.0
//! Common form of both programs: the plain program of a source, and an image's words decoded by the specification's rows.

use crate::Difference;
use crate::fields::{Bound, Layout};
use foldhash::{HashMap, HashMapExt as _, HashSet};
use takt_asm::Contraction;
use takt_asm::plain::{PlainKind, PlainProgram};
use takt_isa::program::Location;
use takt_isa::{BundleAddress, Effect, Function, Op, Program, Register, SlotIndex, fusions};

/// An operation of either program.
#[derive(Clone, Debug)]
pub(crate) struct Operation {
    pub(crate) op: Op,
    pub(crate) dest: Option<usize>,
    pub(crate) sources: [usize; 3],
    pub(crate) constant: u32,
    /// Array that the source names for the access.
    pub(crate) array: Option<usize>,
    pub(crate) location: Option<Location>,
    /// Role in a fused multiply-add.
    pub(crate) fused: ContractionRole,
    /// Unit and latency; `None` in the source.
    pub(crate) timing: Option<Timing>,
}

/// Unit of an operation, by slot and index within the slot, with its latency and interval.
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

/// Role of an operation in a contraction.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ContractionRole {
    /// No part of a contraction.
    No,
    /// Product of the contraction with this number.
    Product(usize),
    /// Sum that adds the product as its operand `source`; the fused instruction is `op`.
    Sum { product: usize, source: usize, op: Op },
}

/// A program, of source or image, with its ports and loop bounds.
#[derive(Clone, Debug)]
pub(crate) struct Code {
    pub(crate) bundles: Vec<Vec<Operation>>,
    /// Initial value of each register, if any.
    pub(crate) initial: Vec<Option<u32>>,
    /// Output port of each register, by number of the source's declaration.
    pub(crate) outputs: Vec<Option<usize>>,
    /// Registers of the inputs, then of the parameters, in order of declaration.
    pub(crate) inputs: Vec<usize>,
    /// Labels before each bundle: numbers of the first and the last.
    pub(crate) labels: HashMap<u32, (u32, u32)>,
    /// Bounds on iterations, by first bundle of the loop.
    pub(crate) bounds: HashMap<u32, Bound>,
    /// The bundle has a label or a bound.
    pub(crate) marked: Vec<bool>,
    /// Targets of jumps and branches.
    targets: HashSet<u32>,
    /// First bundle of `period`.
    pub(crate) period: u32,
}

impl Code {
    fn new(
        bundles: Vec<Vec<Operation>>,
        initial: Vec<Option<u32>>,
        (inputs, outputs): (Vec<usize>, Vec<Option<usize>>),
        labels: HashMap<u32, (u32, u32)>,
        bounds: HashMap<u32, Bound>,
        period: u32,
    ) -> Code {
        let mut marked = vec![false; bundles.len()];
        for at in labels.keys().chain(bounds.keys()) {
            if let Some(marked) = marked.get_mut(*at as usize) {
                *marked = true;
            }
        }
        let leads = |operation: &&Operation| {
            let effect = operation.op.row().effect;
            effect == Effect::Jump || effect.is_conditional()
        };
        let leading = bundles.iter().flatten().filter(leads);
        let targets = leading.map(|operation| operation.constant).collect();
        Code { bundles, initial, outputs, inputs, labels, bounds, marked, targets, period }
    }

    /// The sequencer counts the iterations of the loop with this first bundle.
    pub(crate) fn is_counted(&self, head: u32) -> bool {
        let before = head.checked_sub(1).and_then(|entry| self.bundles.get(entry as usize));
        before.is_some_and(|bundle| bundle.iter().any(|operation| operation.op.row().effect == Effect::Loop))
    }

    /// Some jump or branch targets the bundle.
    pub(crate) fn is_led_to(&self, head: u32) -> bool {
        self.targets.contains(&head)
    }

    /// Source line of a bundle.
    pub(crate) fn location(&self, at: u32) -> Option<Location> {
        self.bundles.get(at as usize)?.iter().find_map(|operation| operation.location)
    }
}

pub(crate) fn refuse(what: String) -> Difference {
    Difference { place: None, what, source: None, image: None }
}

/// Registers of a source of one kind, in order of declaration: index and name.
pub(crate) fn named(plain: &PlainProgram, kind: PlainKind) -> impl Iterator<Item = (usize, &str)> {
    let registers = plain.registers.iter().enumerate();
    registers
        .filter(move |(_, register)| register.kind == kind)
        .map(|(id, register)| (id, register.name.as_str()))
}

/// Indices of inputs, then of parameters: registers that the host writes.
pub(crate) fn inputs_of(plain: &PlainProgram) -> impl Iterator<Item = usize> {
    let of = |kind| named(plain, kind).map(|(id, _)| id);
    of(PlainKind::Input).chain(of(PlainKind::Parameter))
}

/// Converts the source. `contractions` names the fused products; each is accepted only where the source permits it.
pub(crate) fn of_source(
    plain: &PlainProgram,
    layout: &Layout,
    contractions: &[Contraction],
) -> Result<Code, Difference> {
    let mut roles: HashMap<(u32, u32), ContractionRole> = HashMap::new();
    for (number, contraction) in contractions.iter().enumerate() {
        let [product, sum] = contraction.at;
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
        roles.insert(product, ContractionRole::Product(number));
        roles.insert(sum, ContractionRole::Sum { product: number, source: row.source, op: row.fused });
    }
    let mut bundles = Vec::with_capacity(plain.bundles.len());
    for (bundle, at) in plain.bundles.iter().zip(0..) {
        let mut operations = Vec::with_capacity(bundle.operations.len());
        for (operation, number) in bundle.operations.iter().zip(0..) {
            if operation.raw {
                let what = "a word given bit by bit cannot be checked".to_owned();
                return Err(Difference { place: operation.location, ..refuse(what) });
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
                fused: roles.get(&(at, number)).copied().unwrap_or(ContractionRole::No),
                timing: None,
            });
        }
        bundles.push(operations);
    }
    let mut outputs = vec![None; plain.registers.len()];
    for (number, (id, _)) in named(plain, PlainKind::Output).enumerate() {
        outputs[id] = Some(number);
    }
    let initial = plain.registers.iter().map(|register| register.preset).collect();
    let inputs = inputs_of(plain).collect();
    let mut bounds: HashMap<u32, Bound> = HashMap::new();
    for &(head, most, total) in &plain.loop_bounds {
        let bound = Bound { most, total };
        bounds.entry(head).and_modify(|of| *of = of.merged(bound)).or_insert(bound);
    }
    Ok(Code::new(bundles, initial, (inputs, outputs), layout.labels.source.clone(), bounds, plain.period))
}

/// Converts a bundle of an image; an error is the reason why it cannot run.
pub(crate) fn of_bundle(program: &Program, address: BundleAddress) -> Result<Vec<Operation>, String> {
    let bundle = program.bundle(address).unwrap_or(Ok(Vec::new()));
    let bundle = bundle.map_err(|(_, reason)| reason.to_string())?;
    let operations = SlotIndex::all().zip(bundle).filter_map(|(slot, instruction)| {
        let row = instruction.op.row();
        (row.function != Function::Idle).then(|| Operation {
            op: instruction.op,
            dest: instruction.writes(program.machine.slot(slot)).map(Register::index),
            sources: instruction.sources.map(Register::index),
            constant: instruction.constant,
            array: None,
            location: program.operation_location(address, slot),
            fused: ContractionRole::No,
            timing: program.machine.slot(slot).unit_index(row.function).map(|unit| {
                let times = program.machine.slot(slot).units[unit];
                let (latency, interval) = (times.latency.into(), times.interval.into());
                Timing { slot: slot.index(), unit, latency, interval }
            }),
        })
    });
    Ok(operations.collect())
}

/// Converts the image, with the locations of the source's declarations.
pub(crate) fn of_image(program: &Program, layout: &Layout) -> Result<Code, Difference> {
    let mut bundles: Vec<Vec<Operation>> = Vec::new();
    for address in program.addresses() {
        bundles.push(of_bundle(program, address).map_err(|reason| Difference {
            place: program.location(address),
            ..refuse(format!("bundle {address} cannot run: {reason}"))
        })?);
    }
    let mut initial = vec![None; Register::COUNT];
    initial[Register::ZERO.index()] = Some(0);
    for &(register, bits) in &program.constants {
        initial[register.index()] = Some(bits);
    }
    let mut outputs = vec![None; Register::COUNT];
    for (number, register) in layout.outputs.iter().enumerate() {
        outputs[register.index()] = Some(number);
    }
    let inputs = layout.inputs.iter().map(|register| register.index()).collect();
    let labels = layout.labels.image.clone();
    Ok(Code::new(bundles, initial, (inputs, outputs), labels, layout.bounds.clone(), layout.period))
}
