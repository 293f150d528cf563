// SPDX-License-Identifier: MIT OR Apache-2.0
//! Execution of an issued bundle, driven by the effects of its operations and `takt_isa::compute`; no instruction is named.

use crate::code::{DecodedBundle, Operation};
use crate::event::Retire;
use crate::fault::FaultKind;
use crate::machine::{PendingResult, State};
use takt_isa::fp::{Flags, Host, Value};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Effect, Flow, Machine, SlotIndex, compute};

/// Effective address of a load or store, in words: the sum of an unsigned offset and a signed base. The memory is far smaller than 2^31
/// words, so the sum modulo 2^32 lies in it exactly if the true sum does.
#[inline(always)]
pub(crate) fn data_address(offset: u32, base: u32) -> usize {
    offset.wrapping_add(base) as usize
}

/// First fault, in slot order, that a bundle would raise if it issued now.
pub(crate) fn check(
    decoded: &DecodedBundle,
    state: &State,
    machine: &Machine,
    address: BundleAddress,
) -> Option<(SlotIndex, FaultKind)> {
    decoded.operations.iter().find_map(|operation| {
        let kind = check_operation(operation, decoded, state, machine, address)?;
        Some((operation.slot, kind))
    })
}

fn check_operation(
    operation: &Operation,
    decoded: &DecodedBundle,
    state: &State,
    machine: &Machine,
    address: BundleAddress,
) -> Option<FaultKind> {
    let unwritten = operation.reads().iter().find(|&&register| !state.written.contains(register));
    if let Some(&register) = unwritten {
        return Some(FaultKind::UnwrittenRegister { register });
    }
    match operation.effect {
        Effect::Load | Effect::Store => {
            let base = state.get(operation.sources[0]);
            let (depth, store) = (state.memory.len() as u32, operation.effect == Effect::Store);
            let address = i64::from(operation.constant) + i64::from(base.cast_signed());
            let outside = data_address(operation.constant, base) >= state.memory.len();
            outside.then_some(FaultKind::DataAddress { address, depth, store })
        }
        // A bundle has at most one operation with control flow, so the bundle's flow is this operation's.
        Effect::Call
        | Effect::Return
        | Effect::Loop
        | Effect::Jump
        | Effect::BranchZero
        | Effect::BranchNonzero
        | Effect::Publish
        | Effect::Wait
        | Effect::Halt => flow_fault(decoded.flow, decoded.ends_loop, state, machine, address),
        Effect::Compute | Effect::Immediate | Effect::ReadFlags | Effect::ClearFlags => None,
        Effect::Nothing => None,
    }
}

/// Fault that a bundle's flow would raise on the return stack or on the active loops.
#[inline]
pub(crate) fn flow_fault(
    flow: Flow,
    ends_loop: bool,
    state: &State,
    machine: &Machine,
    address: BundleAddress,
) -> Option<FaultKind> {
    let around = state.loops.last();
    if ends_loop && flow != Flow::LoopEnd && around.is_some_and(|around| around.end == address.next()) {
        return Some(FaultKind::LoopNesting { last: address });
    }
    match flow {
        Flow::Call(_) => {
            let depth = machine.stack_depth;
            (state.stack.len() >= depth as usize).then_some(FaultKind::StackOverflow { depth })
        }
        Flow::Return => state.stack.is_empty().then_some(FaultKind::StackUnderflow),
        Flow::Loop { count, end } => {
            let (depth, count) = (machine.loop_depth, state.get(count));
            if state.loops.len() >= depth as usize {
                return Some(FaultKind::LoopOverflow { depth });
            }
            if count == 0 || count > u32::from(u16::MAX) {
                return Some(FaultKind::LoopCount { count: count.cast_signed() });
            }
            let cut = around.filter(|around| around.end > address && around.end <= end)?;
            Some(FaultKind::LoopNesting { last: cut.end.previous() })
        }
        Flow::Next
        | Flow::LoopEnd
        | Flow::Jump(_)
        | Flow::Branch { .. }
        | Flow::Publish
        | Flow::Wait(_)
        | Flow::Halt => None,
    }
}

/// Issues the operations of a bundle that [`check`] has passed; [`Emulator::follow`](crate::Emulator) handles its control flow. Results
/// are added to `state.pending`; operations that write no register complete at once and are passed to `retired`, in slot order.
pub(crate) fn issue(
    decoded: &DecodedBundle,
    state: &mut State,
    address: BundleAddress,
    cycle: Cycle,
    mut retired: impl FnMut(Retire),
) {
    // Results are written back later, so operations can be executed one after another and still all read the old values. For the same
    // reason, flags are cleared only after the last operation.
    let mut flags = state.flags;
    for operation in &decoded.operations {
        let [a, b, c] = operation.sources.map(|register| state.get(register));
        let mut memory = None;
        let value = match operation.effect {
            Effect::Compute => compute::<Host>(operation.op, a, b, c),
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
                flags = Flags::NONE;
                Value::exact(0)
            }
            // Control flow is handled for the whole bundle.
            Effect::Jump | Effect::BranchZero | Effect::BranchNonzero => Value::exact(0),
            Effect::Call | Effect::Return | Effect::Loop => Value::exact(0),
            Effect::Publish | Effect::Wait | Effect::Halt | Effect::Nothing => Value::exact(0),
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
                let Operation { output, float, watched, .. } = *operation;
                state.pending.push(PendingResult { retire, register, output, float, watched });
            }
            None => retired(retire),
        }
    }
    state.flags = flags;
}
