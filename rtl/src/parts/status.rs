// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the status register with the sticky flags.

use crate::plan::names::net;
use crate::plan::{ControlBit, Plan, Stage};
use crate::verilog::{Module, any, choose, decimal, repeat, set};
use takt_isa::Effect;

pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("the status register");
    m.comment(
        "docs/timing.md, Flags: an operation's flags are set in the cycle of its writeback. An operation that clears flags drains first \
         (rule 5), and does not clear those that its own bundle raises.",
    );
    m.blank();
    let bit = ControlBit::Effect(Effect::ClearFlags);
    let clears = plan.slots.iter().filter(|slot| slot.has(bit)).map(|slot| slot.bit(Stage::Issue, bit));
    m.regs([net::X_CLEAR_FLAGS]);
    let mut kept = net::STICKY & repeat(3, !net::X_CLEAR_FLAGS | net::FAULT);
    if plan.clears_beside_faults() {
        m.comment(
            "The bundle that clears may be at fault, with an operation of another slot, which is known a cycle later: the flags come back.",
        );
        m.regs([net::CLEARED]);
        m.clocked(vec![set(net::CLEARED, net::STICKY & repeat(3, net::X_CLEAR_FLAGS & !net::FAULT))]);
        kept = kept | (net::CLEARED & repeat(3, net::FAULT));
    }
    m.assign(net::STICKY_NOW, kept | net::NEW_FLAGS);
    m.assign(net::STATUS, net::STICKY_NOW);
    m.clocked(vec![
        set(net::X_CLEAR_FLAGS, net::ISSUE & !net::FAULT & any(clears)),
        set(net::STICKY, choose(net::RST, decimal(3, 0_u32), net::STICKY_NOW)),
    ]);
}
