// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bank assignment: chooses the home bank of each register that operations of several slots write.
//!
//! A slot writes its own bank only. A value that is live after its straight run, or that an output port shows, must reach the home
//! bank of its register. If another slot computes it, it is transferred in the cheapest of three ways: a constant that is live
//! from the start is loaded with the program, a later constant is rematerialised (Briggs, Cooper, Torczon, PLDI 1992) by an operation
//! of the right slot, and any other value is copied ([`copies`](crate::banks::copies)).

pub(crate) mod copies;
pub(crate) mod slots;
pub(crate) mod webs;

use crate::context::bits_text;
use crate::ir::flow::{self, Flow};
use crate::ir::runs::{self, Run};
use crate::ir::{Constant, Ir, Operation, RegisterId, RegisterKind, VirtualRegister};
use foldhash::HashSet;
use takt_diagnostics::source::Span;
use takt_isa::fp::Host;
use takt_isa::program::Location;
use takt_isa::{BundleAddress, Effect, Machine, Op, ROWS, Register, Row, SlotIndex, Slots, Type, compute};

/// A transfer of a value to the home bank of its register.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adjustment {
    /// Name of the register in the source.
    pub register: String,
    /// Home bank of the register.
    pub bank: &'static str,
    /// Mnemonic of the operation whose slot cannot write this bank.
    pub mnemonic: &'static str,
    /// The operation's source line.
    pub location: Option<Location>,
    /// Transfer of the value to the bank.
    pub transfer: Transfer,
}

/// Transfer of a value to a bank that the slot of its operation does not write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// The loader sets the register to these bits; the operation is gone.
    Preset(u32),
    /// An operation of the right slot, by name, computes the same bits again.
    Rematerialised(&'static str),
    /// The value is copied.
    Copy {
        /// The bundle that copies.
        address: BundleAddress,
        /// The copy issues in a bundle of its own.
        alone: bool,
        /// Cycles that the copy adds to its straight run of bundles; `None` if the run is scheduled.
        cycles: Option<u32>,
    },
}

impl std::fmt::Display for Transfer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Transfer::Preset(bits) => write!(f, "loaded with the program, {}", bits_text(*bits)),
            Transfer::Rematerialised(mnemonic) => write!(f, "becomes `{mnemonic}`"),
            Transfer::Copy { address, alone, cycles } => {
                match alone {
                    true => write!(f, "copied in a bundle of its own, {address}")?,
                    false => write!(f, "copied in a free slot of bundle {address}")?,
                }
                match cycles {
                    Some(0) => write!(f, ": no cycle"),
                    Some(1) => write!(f, ": 1 cycle"),
                    Some(cycles) => write!(f, ": {cycles} cycles"),
                    None => Ok(()),
                }
            }
        }
    }
}

/// The home bank of a register.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HomeBank {
    /// The slot that writes the bank.
    pub(crate) slot: SlotIndex,
    /// The operation of the slot that copies bits, if there is one.
    pub(crate) copier: Option<Op>,
}

/// A register without a bank that all its writes can reach, and advice.
#[derive(Clone, Debug)]
pub(crate) struct BankConflict {
    pub(crate) register: RegisterId,
    pub(crate) help: String,
    /// The cause and its place.
    pub(crate) because: Option<(Span, String)>,
}

/// The assignment of a program's registers to banks.
#[derive(Default)]
pub(crate) struct BankAssignment {
    /// Home bank of each register that several slots write, by register index.
    pub(crate) of: Vec<Option<HomeBank>>,
    /// Liveness of registers with a home bank: by run, whether the register is live after it.
    pub(crate) live: Vec<(RegisterId, Vec<bool>)>,
    pub(crate) conflicts: Vec<BankConflict>,
    /// Registers that the source writes in `.once`, even if it overwrites them before any read.
    pub(crate) set_once: HashSet<RegisterId>,
    /// Registers made for values: not reported if nothing reads them.
    pub(crate) quiet: HashSet<RegisterId>,
    pub(crate) adjustments: Vec<Adjustment>,
    /// For each copied value the index of its adjustment, and its register.
    pub(crate) copied: Vec<(usize, RegisterId)>,
}

impl BankAssignment {
    pub(crate) fn get(&self, register: RegisterId) -> Option<HomeBank> {
        self.of.get(register.index()).copied().flatten()
    }

    /// The conflict of a register without a home bank.
    pub(crate) fn conflict(&self, register: RegisterId) -> Option<&BankConflict> {
        self.conflicts.iter().find(|conflict| conflict.register == register)
    }

    /// A register is live after a run: its value may be read, or a port shows it.
    pub(crate) fn is_live(&self, register: RegisterId, run: usize) -> bool {
        let found = self.live.binary_search_by_key(&register, |(register, _)| *register);
        found.map_or(true, |index| self.live[index].1[run])
    }
}

/// A write of a register: every write of an output port, the last write of each run for others.
struct Write {
    bundle: usize,
    number: usize,
    slot: SlotIndex,
    /// The value must reach the home bank: a port shows it, or it is live after the run.
    live: bool,
    /// The bits written, if they are known.
    constant: Option<u32>,
    /// The loader can set the bits.
    initial: bool,
    /// The value can be copied after the write.
    copied: bool,
}

/// Cost of a transfer by rematerialisation, and by a copy.
const OPERATION: u64 = 1;
const COPY: u64 = 4;

/// Assigns home banks. Constants are transferred here; values that need a copy still write the register.
pub(crate) fn assign(ir: &mut Ir) -> BankAssignment {
    let contested = webs::contested(ir);
    let mut assignment = BankAssignment { of: vec![None; ir.registers.len()], ..BankAssignment::default() };
    if !contested.contains(&true) {
        return assignment;
    }
    let runs = runs::runs(ir);
    let flow = Flow::new(ir, &runs);
    for index in (0..contested.len()).filter(|index| contested[*index]) {
        let id = RegisterId::new(index);
        // A register that the source names by its address stays there.
        if ir.register(id).name.is_empty() {
            continue;
        }
        let mut once = ir.bundles[..ir.period as usize].iter().flat_map(|bundle| &bundle.operations);
        if once.any(|operation| operation.dest == Some(id)) {
            assignment.set_once.insert(id);
        }
        let live = if ir.register(id).kind == RegisterKind::Output {
            vec![true; runs.len()]
        } else {
            let (reads, writes) = flow::uses(ir, &runs, id);
            flow.live_after(&reads, &writes)
        };
        let writes = bank_writes(ir, &runs, &flow, id, &live);
        match best_bank(ir, &flow, &writes, ir.register(id).pinned) {
            Some(slot) => {
                let home = HomeBank { slot, copier: copier(ir.machine, slot) };
                assignment.of[index] = Some(home);
                assignment.live.push((id, live));
                for write in writes.iter().filter(|write| write.live && write.slot != slot) {
                    assignment.adjustments.extend(transfer_constant(ir, id, slot, write));
                }
            }
            None => {
                assignment.conflicts.push(conflict(ir, &flow, id, &writes));
            }
        }
    }
    assignment
}

/// The writes of a register whose values may have to reach its home bank.
fn bank_writes(ir: &Ir, runs: &[Run], flow: &Flow, id: RegisterId, live: &[bool]) -> Vec<Write> {
    let output = ir.register(id).kind == RegisterKind::Output;
    let fixed = runs::jumps_to_numbers(ir);
    let mut writes = Vec::new();
    // An earlier operation has used the register.
    let mut used = false;
    for (run, live) in runs.iter().zip(live) {
        let first = writes.len();
        for at in run.start..run.end {
            let operations = &ir.bundles[at].operations;
            let reads = operations.iter().any(|operation| operation.reads().contains(&id));
            for (number, operation) in operations.iter().enumerate() {
                let (Some(slot), true) = (operation.slot, operation.dest == Some(id)) else { continue };
                let constant = constant(ir, operation);
                let initial = !used && !reads && is_initial(ir, flow, at, operation);
                let copied = !fixed && branch_that_reads(ir, at).is_none();
                writes.push(Write { bundle: at, number, slot, live: *live, constant, initial, copied });
            }
            used |= reads || operations.iter().any(|operation| operation.dest == Some(id));
        }
        if !output {
            let last = writes.len().saturating_sub(1).max(first);
            writes.drain(first..last);
        }
    }
    writes
}

/// The loader can set the register that an operation writes, provided that nothing uses the register before.
pub(crate) fn is_initial(ir: &Ir, flow: &Flow, at: usize, operation: &Operation) -> bool {
    let output = operation.dest.is_some_and(|dest| ir.register(dest).kind == RegisterKind::Output);
    !output && at < flow.once && constant(ir, operation).is_some()
}

/// A redirection that reads a register written by its own bundle: it cannot be issued after the rest.
fn branch_that_reads(ir: &Ir, at: usize) -> Option<&Operation> {
    let operations = &ir.bundles[at].operations;
    let writes = |register: &RegisterId| operations.iter().any(|operation| operation.dest == Some(*register));
    operations.iter().find(|operation| operation.redirects() && operation.reads().iter().any(writes))
}

/// The slot whose bank is the cheapest home. A `pinned` register has its bank already.
fn best_bank(ir: &Ir, flow: &Flow, writes: &[Write], pinned: Option<Register>) -> Option<SlotIndex> {
    let machine = ir.machine;
    // Ties go to the bank of the first write.
    let live = || writes.iter().filter(|write| write.live);
    let favourite = live().next().or(writes.first()).map(|write| write.slot);
    let is_possible = |slot: &takt_isa::Slot| pinned.is_none_or(|address| slot.bank.contains(address));
    let candidates = machine.numbered_slots().filter(|(_, slot)| is_possible(slot));
    let cost = |slot: SlotIndex| {
        let copier = copier(machine, slot);
        live().filter(|write| write.slot != slot).try_fold(0u64, |sum, write| {
            let weight = flow.weights[write.bundle];
            let cost = match write.constant {
                Some(_) if write.initial => 0,
                Some(bits) if is_free(ir, write, slot) && materialise(machine, slot, bits).is_some() => {
                    OPERATION * weight
                }
                _ if write.copied && copier.is_some() => COPY * weight,
                _ => return None,
            };
            Some(sum.saturating_add(cost))
        })
    };
    candidates
        .filter_map(|(slot, _)| Some((cost(slot)?, Some(slot) != favourite, slot)))
        .min()
        .map(|(_, _, slot)| slot)
}

/// No operation of the write's bundle needs the slot.
fn is_free(ir: &Ir, write: &Write, slot: SlotIndex) -> bool {
    ir.bundles[write.bundle].operations.iter().all(|operation| operation.slot != Some(slot))
}

/// Transfers a constant to the home bank.
fn transfer_constant(ir: &mut Ir, id: RegisterId, slot: SlotIndex, write: &Write) -> Option<Adjustment> {
    let bits = write.constant?;
    let old = ir.bundles[write.bundle].operations[write.number];
    let transfer = if write.initial {
        ir.registers[id.index()].preset = Some(bits);
        // Taken out of its bundle later: indices of operations still count it.
        ir.bundles[write.bundle].operations[write.number] = Operation { made: true, ..old.idle() };
        Transfer::Preset(bits)
    } else if is_free(ir, write, slot) {
        let (op, sources) = materialise(ir.machine, slot, bits)?;
        let slots = able(ir, id, op);
        let mut new = Operation { op, slots, slot: Some(slot), dest: Some(id), made: true, ..old.idle() };
        (new.attribution, new.expansion) = (old.attribution, old.expansion);
        match op.row().effect {
            Effect::Immediate => new.constant = Constant::Value(bits),
            _ => {
                for (source, bits) in new.sources.iter_mut().zip(sources) {
                    *source = constant_register(ir, bits, old.span);
                }
            }
        }
        ir.bundles[write.bundle].operations[write.number] = new;
        Transfer::Rematerialised(op.row().mnemonic)
    } else {
        return None;
    };
    Some(adjustment(ir, id, slot, &old, transfer))
}

pub(crate) fn adjustment(
    ir: &Ir,
    id: RegisterId,
    slot: SlotIndex,
    from: &Operation,
    transfer: Transfer,
) -> Adjustment {
    Adjustment {
        register: ir.register(id).name.clone(),
        bank: ir.machine.slot(slot).bank.name,
        mnemonic: from.row().mnemonic,
        location: ir.location(from),
        transfer,
    }
}

/// The operation with the least latency that copies bits to the bank of a slot.
fn copier(machine: &Machine, slot: SlotIndex) -> Option<Op> {
    rows(machine, slot)
        .filter(|(_, row)| row.copies())
        .min_by_key(|(latency, _)| *latency)
        .map(|(_, row)| row.op)
}

/// The slots that may execute an operation made to write a register.
pub(crate) fn able(ir: &Ir, id: RegisterId, op: Op) -> Slots {
    let hosts = ir.machine.hosts(op.row().function);
    ir.register(id).pinned.map_or(hosts, |place| hosts.and(ir.machine.writers(place)))
}

/// The instructions that a slot executes, with their latencies.
fn rows(machine: &Machine, slot: SlotIndex) -> impl Iterator<Item = (u32, &'static Row)> + '_ {
    ROWS.iter().filter_map(move |row| Some((machine.unit(slot, row.function)?.latency, row)))
}

/// The bits that an operation writes, if they are known and it raises no flag.
fn constant(ir: &Ir, operation: &Operation) -> Option<u32> {
    let row = operation.row();
    match (row.effect, operation.constant) {
        (Effect::Immediate, Constant::Value(bits)) => Some(bits),
        (Effect::Compute, _) => {
            let mut bits = [0; 3];
            for (bits, source) in bits.iter_mut().zip(operation.reads()) {
                *bits = match ir.register(*source).kind {
                    RegisterKind::Zero => 0,
                    RegisterKind::Constant(bits) => bits,
                    _ => return None,
                };
            }
            let value = compute::<Host>(operation.op, bits[0], bits[1], bits[2]);
            value.flags.is_empty().then_some(value.bits)
        }
        _ => None,
    }
}

/// Rematerialises a constant: the operation of a slot with the least latency that gives these bits and raises no flag, and the bits
/// of its sources.
fn materialise(machine: &Machine, slot: SlotIndex, bits: u32) -> Option<(Op, [u32; 2])> {
    let palette = [0, bits, (-0.0f32).to_bits(), 1.0f32.to_bits()];
    let sources = |row: &Row| {
        let pairs = || palette.iter().flat_map(|&a| palette.iter().map(move |&b| [a, b]));
        let gives = |&[a, b]: &[u32; 2]| {
            let value = compute::<Host>(row.op, a, b, 0);
            value.bits == bits && value.flags.is_empty()
        };
        match (row.effect, row.shape.sources()) {
            (Effect::Immediate, _) => Some([0; 2]),
            (Effect::Compute, 1 | 2) => pairs().find(gives),
            _ => None,
        }
    };
    rows(machine, slot)
        .filter_map(|(latency, row)| Some((latency, row.op, sources(row)?)))
        .min_by_key(|(latency, ..)| *latency)
        .map(|(_, op, sources)| (op, sources))
}

/// The register that holds these bits, new if necessary.
fn constant_register(ir: &mut Ir, bits: u32, span: Span) -> RegisterId {
    let holds = |register: &VirtualRegister| match register.kind {
        RegisterKind::Zero => bits == 0,
        RegisterKind::Constant(other) => other == bits,
        _ => false,
    };
    let found = ir.registers.iter().position(holds);
    let index = found.unwrap_or_else(|| {
        let kind = RegisterKind::Constant(bits);
        ir.registers.push(VirtualRegister {
            name: String::new(),
            kind,
            ty: Type::B,
            pinned: None,
            preset: None,
            span,
        });
        ir.registers.len() - 1
    });
    RegisterId::new(index)
}

/// The reason why a register has no home bank, and advice.
fn conflict(ir: &Ir, flow: &Flow, register: RegisterId, writes: &[Write]) -> BankConflict {
    let found = ir.register(register);
    let because_of = |help: String, because| BankConflict { register, help, because };
    if found.pinned.is_some()
        && let Some(slot) = best_bank(ir, flow, writes, None)
    {
        let bank = ir.machine.slot(slot).bank.name;
        let help = format!("leave its place to the assembler, or place it in bank {bank}");
        return because_of(help, Some((found.span, "placed here".to_owned())));
    }
    if let Some(jump) = ir.operations().find(|operation| operation.target_number().is_some()) {
        let help = "jump to labels, so that the assembler can add an operation that copies";
        let because = "this depends on every bundle's address".to_owned();
        return because_of(help.to_owned(), Some((jump.span, because)));
    }
    match writes.iter().find_map(|write| branch_that_reads(ir, write.bundle)) {
        Some(branch) => {
            let name = branch.row().mnemonic;
            let because = format!("`{name}` reads what its own bundle writes: no copy can come between");
            because_of(format!("write `{name}` as a bundle of its own"), Some((branch.span, because)))
        }
        None => because_of("use two registers".to_owned(), None),
    }
}
