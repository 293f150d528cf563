// SPDX-License-Identifier: MIT OR Apache-2.0
//! Program prepared for execution: every word decoded and checked once.

use crate::fault::LoadError;
use crate::machine::RegisterSet;
use takt_isa::program::{IllegalWord, LoopBound};
use takt_isa::spec::check::MAX_SLOTS;
use takt_isa::timing::Bundle;
use takt_isa::{BundleAddress, Effect, Flow, Machine, Op, Program, Register, SlotIndex, Type, Unit};

/// Decoded operation in its slot, with the properties of its unit and its operands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Operation {
    pub(crate) slot: SlotIndex,
    pub(crate) op: Op,
    pub(crate) effect: Effect,
    pub(crate) sources: [Register; 3],
    pub(crate) source_count: u8,
    pub(crate) dest: Option<Register>,
    pub(crate) latency: u32,
    pub(crate) constant: u32,
    /// The destination is an output port.
    pub(crate) output: bool,
    /// The destination is a port that carries binary32: report NaNs.
    pub(crate) float: bool,
    /// Writes of the destination are recorded ([`crate::Emulator::set_watched`]).
    pub(crate) watched: bool,
}

impl Operation {
    pub(crate) fn reads(&self) -> &[Register] {
        &self.sources[..self.source_count.into()]
    }
}

/// Legal bundle. Operations without effect are left out.
#[derive(Clone, Debug)]
pub(crate) struct DecodedBundle {
    pub(crate) operations: Box<[Operation]>,
    pub(crate) flow: Flow,
    /// A loop may end with this bundle.
    pub(crate) ends_loop: bool,
    pub(crate) timing: Bundle,
    /// Writes an acting port, after which runs pause again ([`crate::Emulator::set_acting`]).
    pub(crate) acts: bool,
    /// Cycles from the issue for which the bundle can stall others: its longest latency or interval.
    pub(crate) reach: u32,
}

impl DecodedBundle {
    /// An operation of the bundle writes this register.
    pub(crate) fn writes(&self, register: Register) -> bool {
        self.operations.iter().any(|operation| operation.dest == Some(register))
    }
}

/// Decoded bundles of a program. An illegal bundle has a slot and a reason instead.
#[derive(Clone)]
pub(crate) struct Code {
    pub(crate) machine: &'static Machine,
    /// Input ports of the machine.
    pub(crate) inputs: RegisterSet,
    /// Acting output ports: after a write to one of them, runs pause again.
    pub(crate) acting: RegisterSet,
    bundles: Vec<Result<DecodedBundle, (SlotIndex, IllegalWord)>>,
    /// Loops with a bound, whose iterations (turns) are counted, by ascending address of their heads.
    pub(crate) loops: Vec<LoopBound>,
}

impl Code {
    pub(crate) fn new(program: &Program) -> Result<Code, LoadError> {
        let machine = program.machine;
        check(program)?;
        let ends = program.loop_ends();
        let bundles = program.addresses().map_while(|address| Some((address, program.bundle(address)?)));
        let bundles = bundles.map(|(address, bundle)| {
            let instructions = bundle?;
            let ends_loop = ends.binary_search(&address).is_ok();
            let mut reach = 0;
            let mut operations = Vec::with_capacity(instructions.len());
            for (instruction, (s, slot)) in instructions.iter().zip(machine.numbered_slots()) {
                let row = instruction.op.row();
                let Some(&Unit { latency, interval, .. }) = slot.unit(row.function) else { continue };
                let dest = instruction.writes(slot);
                reach = reach.max(interval).max(if dest.is_some() { latency } else { 0 });
                let output = dest.is_some_and(|register| machine.is_output(register));
                let ty = program.outputs.iter().find(|port| Some(port.register) == dest).map(|port| port.ty);
                operations.push(Operation {
                    slot: s,
                    op: instruction.op,
                    effect: row.effect,
                    sources: instruction.sources,
                    source_count: row.shape.sources() as u8,
                    dest,
                    latency,
                    constant: instruction.constant,
                    output,
                    float: output && ty.unwrap_or(row.result_type()) == Type::F,
                    watched: false,
                });
            }
            let (flow, timing) = (Flow::of(&instructions), Bundle::new(machine, &instructions));
            let flow = if ends_loop { flow.at_loop_end() } else { flow };
            Ok(DecodedBundle { operations: operations.into(), flow, ends_loop, timing, acts: false, reach })
        });
        let mut inputs = RegisterSet::default();
        Register::all().filter(|&register| machine.is_input(register)).for_each(|port| inputs.insert(port));
        let (bundles, loops) = (bundles.collect(), program.loop_bounds.clone());
        Ok(Code { machine, inputs, acting: RegisterSet::default(), bundles, loops })
    }

    /// Sets the acting ports, and marks the bundles that write them.
    pub(crate) fn pause_after(&mut self, ports: RegisterSet) {
        for bundle in self.bundles.iter_mut().flatten() {
            bundle.acts = bundle.operations.iter().filter_map(|o| o.dest).any(|dest| ports.contains(dest));
        }
        self.acting = ports;
    }

    /// Sets the watched ports: marks the operations that write them.
    pub(crate) fn watch(&mut self, registers: &RegisterSet) {
        let operations = self.bundles.iter_mut().flatten().flat_map(|bundle| bundle.operations.iter_mut());
        for operation in operations {
            operation.watched =
                operation.output && operation.dest.is_some_and(|register| registers.contains(register));
        }
    }

    /// Number of bundles in the program.
    pub(crate) fn len(&self) -> usize {
        self.bundles.len()
    }

    /// Bundle at an address; `None` past the end.
    pub(crate) fn get(
        &self,
        address: BundleAddress,
    ) -> Option<&Result<DecodedBundle, (SlotIndex, IllegalWord)>> {
        self.bundles.get(address.index())
    }

    /// Index of the counted loop whose head is the bundle at an address.
    #[inline]
    pub(crate) fn head(&self, address: BundleAddress) -> Option<usize> {
        if self.loops.is_empty() {
            return None;
        }
        self.loops.binary_search_by_key(&address, |bound| bound.address).ok()
    }

    /// Bundle at an address, if it is legal.
    pub(crate) fn legal(&self, address: BundleAddress) -> Option<&DecodedBundle> {
        self.get(address)?.as_ref().ok()
    }
}

/// Checks that the machine's memories can hold the program. Illegal words are not an error here: executing one is a fault.
fn check(program: &Program) -> Result<(), LoadError> {
    let machine = program.machine;
    let (name, slots) = (machine.name, machine.slots.len());
    if slots == 0 || slots > MAX_SLOTS {
        return Err(LoadError::Slots { machine: name, slots, most: MAX_SLOTS });
    }
    let words = program.code.len();
    if !words.is_multiple_of(slots) {
        return Err(LoadError::Bundle { words, slots });
    }
    if words / slots > machine.most_bundles() as usize {
        return Err(LoadError::Code { bundles: words / slots, machine: name, depth: machine.most_bundles() });
    }
    if program.data.len() > machine.data_depth as usize {
        return Err(LoadError::Data { words: program.data.len(), machine: name, depth: machine.data_depth });
    }
    for &(register, _) in &program.constants {
        if register == Register::ZERO || !machine.has_register(register) {
            return Err(LoadError::Constant { register, machine: name });
        }
    }
    let inputs = program.inputs.iter().map(|port| (port, "input", machine.is_input(port.register)));
    let outputs = program.outputs.iter().map(|port| (port, "output", machine.is_output(port.register)));
    let parameters = program.parameters.iter().map(|port| (port, "input", machine.is_input(port.register)));
    for (port, kind, exists) in inputs.chain(outputs).chain(parameters) {
        if !exists {
            let (name, register) = (port.name.clone(), port.register);
            return Err(LoadError::Port { name, register, machine: machine.name, kind });
        }
    }
    Ok(())
}
