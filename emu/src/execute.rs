//! What a bundle does when it issues: by the effects of its operations and `takt_isa::compute`, naming no instruction.

use crate::code::{Decoded, Operation};
use crate::event::Retire;
use crate::fault::FaultKind;
use crate::machine::{Pending, State};
use takt_isa::fp::{Host, Value};
use takt_isa::timing::{Address, Cycle};
use takt_isa::{Effect, Machine, Program, compute};

/// Where execution continues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    /// At the next bundle; nothing in the bundle could redirect.
    Sequential,
    /// At the next bundle, a conditional branch not having been taken.
    NotTaken,
    /// At the target of a jump or of a branch that is taken.
    Jump(Address),
    /// At the target of a call, or where a return leads.
    Redirect(Address),
    /// At the target, on the tick.
    Wait(Address),
    /// Nowhere.
    Halt,
}

/// The data word that a load or store addresses: its unsigned offset and the signed base added. The memory is far
/// smaller than 2^31 words, so that a sum modulo 2^32 lies in it exactly if the true sum does.
#[inline(always)]
pub(crate) fn data_address(offset: u32, base: u32) -> usize {
    offset.wrapping_add(base) as usize
}

/// The first fault, in slot order, that a bundle would raise if it issued now.
pub(crate) fn check(
    decoded: &Decoded,
    state: &State,
    machine: &Machine,
    program: &Program,
) -> Option<(u8, FaultKind)> {
    decoded.operations.iter().find_map(|operation| {
        let kind = check_operation(operation, state, machine, program)?;
        Some((operation.slot, kind))
    })
}

fn check_operation(
    operation: &Operation,
    state: &State,
    machine: &Machine,
    program: &Program,
) -> Option<FaultKind> {
    let unwritten = operation.reads().iter().find(|&&register| !state.written.contains(register));
    if let Some(&register) = unwritten {
        return Some(FaultKind::UnwrittenRegister { register, name: program.register_text(register) });
    }
    match operation.effect {
        Effect::Load | Effect::Store => {
            let base = state.get(operation.sources[0]);
            let (depth, store) = (state.memory.len() as u32, operation.effect == Effect::Store);
            let address = i64::from(operation.constant) + i64::from(base.cast_signed());
            let outside = data_address(operation.constant, base) >= state.memory.len();
            outside.then_some(FaultKind::DataAddress { address, depth, store })
        }
        Effect::Call => {
            let depth = machine.stack_depth;
            (state.stack.len() >= depth as usize).then_some(FaultKind::StackOverflow { depth })
        }
        Effect::Return => state.stack.is_empty().then_some(FaultKind::StackUnderflow),
        _ => None,
    }
}

/// Issues a bundle that [`check`] has passed. Results join `state.pending`; operations that write no register are
/// complete at once and are handed to `retired`, in slot order.
pub(crate) fn issue(
    decoded: &Decoded,
    state: &mut State,
    address: Address,
    cycle: Cycle,
    mut retired: impl FnMut(Retire),
) -> Flow {
    let mut flow = Flow::Sequential;
    // Results are written back later, so that reading and executing one operation after another reads old values only.
    for operation in &decoded.operations {
        let [a, b, c] = operation.sources.map(|register| state.get(register));
        let mut memory = None;
        let target = operation.constant;
        let value = match operation.effect {
            Effect::Compute => compute::<Host>(operation.op, a, b, c),
            Effect::Nothing => Value::exact(0),
            Effect::Immediate => Value::exact(operation.constant),
            Effect::Load => {
                let word = data_address(operation.constant, a);
                memory = Some(word as u32);
                Value::exact(state.memory.get(word).copied().unwrap_or(0))
            }
            Effect::Store => {
                let word = data_address(operation.constant, a);
                memory = Some(word as u32);
                if let Some(place) = state.memory.get_mut(word) {
                    *place = b;
                }
                Value::exact(b)
            }
            Effect::ReadFlags => Value::exact(state.flags.bits().into()),
            Effect::ClearFlags => {
                state.flags = takt_isa::fp::Flags::NONE;
                Value::exact(0)
            }
            Effect::Jump => {
                flow = Flow::Jump(target);
                Value::exact(0)
            }
            Effect::BranchZero | Effect::BranchNonzero => {
                let taken = (a == 0) == (operation.effect == Effect::BranchZero);
                flow = if taken { Flow::Jump(target) } else { Flow::NotTaken };
                Value::exact(0)
            }
            Effect::Call => {
                state.stack.push(address + 1);
                flow = Flow::Redirect(target);
                Value::exact(0)
            }
            Effect::Return => {
                flow = state.stack.pop().map_or(Flow::Sequential, Flow::Redirect);
                Value::exact(0)
            }
            Effect::Wait => {
                flow = Flow::Wait(target);
                Value::exact(0)
            }
            Effect::Halt => {
                flow = Flow::Halt;
                Value::exact(0)
            }
        };
        let latency = if operation.dest.is_some() { operation.latency } else { 0 };
        let retire = Retire {
            cycle: cycle + Cycle::from(latency),
            issued: cycle,
            address,
            slot: operation.slot,
            op: operation.op,
            register: operation.dest,
            value: value.bits,
            flags: value.flags,
            memory,
        };
        match operation.dest {
            Some(register) => {
                let (output, float) = (operation.output, operation.float);
                state.pending.push(Pending { retire, register, output, float });
            }
            None => retired(retire),
        }
    }
    flow
}
