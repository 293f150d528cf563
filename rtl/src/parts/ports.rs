// SPDX-License-Identifier: MIT OR Apache-2.0
//! Declaration of the core's ports.

use crate::plan::names::net;
use crate::plan::{Plan, RESET_CYCLES};
use crate::verilog::{Direction, Port};
use takt_isa::timing::INPUT_DELAY;

/// Ports of the core, in order.
pub(super) fn ports(plan: &Plan) -> Vec<Port> {
    let machine = plan.machine;
    let input = |net| Port::new(Direction::Input, net);
    let output = |net| Port::new(Direction::Output, net);
    let mut ports = vec![
        input(net::CLK),
        input(net::RST).remark(RESET),
        input(net::LOAD).heading(
            "Loader, used in reset. space: 0 program memory (address of the bundle, slot), 1 data memory, 2 registers except inputs.",
        ),
        input(net::LOAD_SPACE),
        input(net::LOAD_SLOT),
        input(net::LOAD_ADDRESS),
        input(net::LOAD_VALUE),
        input(net::INPUT_WRITE).heading(format!(
            "Input ports: a value written in cycle t is read by bundles that issue in t + {INPUT_DELAY} or later; if latched, by those of \
             the period whose tick is high in t + 1 or later."
        )),
        input(plan.input_index()),
        input(net::INPUT_VALUE),
    ];
    for (s, slot) in machine.slots.iter().enumerate() {
        let write = output(plan.output_write(&slot.bank));
        ports.push(match s {
            0 => write.heading(format!(
                "Output ports, the last {} registers of each bank: every write, in the cycle of its writeback, latched or not.",
                machine.outputs_per_bank
            )),
            _ => write,
        });
        ports.push(output(plan.output_index(&slot.bank)));
        ports.push(output(plan.output_value(&slot.bank)));
    }
    let by_number = vec![
        input(plan.read_output()).heading(
            "Output ports by number, whichever bank has them: the visible value, which is the last one published if ports are latched.",
        ),
        output(net::READ_VALUE),
        output(net::ENDED)
            .remark("a `wait` issued two cycles ago: read_value belongs to the period that it ended"),
        output(net::PUBLISHED)
            .remark("a `publish` or a `wait` issued two cycles ago: read_value is what it published"),
    ];
    let rest = [
        input(net::TICK).heading("The tick: high for one cycle, seen in the next one."),
        output(net::WAITING),
        output(net::DEADLINE_MISSED).remark("sticky"),
        output(net::TICK_MISSED).remark("in the cycle in which a tick is seen too early"),
        output(net::TICK_LOST).remark("in the cycle in which a tick is lost"),
        output(net::HALTED),
        output(net::FAULT),
        output(net::FAULT_KIND).remark(
            "1 illegal word, 2 data address, 3 return stack full, 4 return stack empty, 5 loops too deep, 6 loop count, 7 loop nesting",
        ),
        output(net::FAULT_SLOT),
        output(net::FAULT_ADDRESS),
    ];
    let verification = vec![
        output(net::ISSUED).heading(
            "For verification: each bundle and each store, two cycles after issue, and each slot's writeback.",
        ),
        output(net::ISSUED_ADDRESS),
        output(net::STORED),
        output(net::STORED_ADDRESS),
        output(net::STORED_VALUE),
        output(plan.retire()),
        output(plan.retire_address()),
        output(plan.retire_register()),
        output(plan.retire_value()),
        output(plan.retire_flags()).remark("{invalid, divide by zero, overflow}"),
    ];
    ports.extend(by_number.into_iter().chain(rest).chain(verification));
    ports.push(output(net::STATUS).remark("the sticky flags"));
    if plan.ecc {
        ports.push(output(net::CORRECTIONS).heading(
            "Error correction: cycles in which a word was corrected, for a bundle or for good, since reset; at most 255.",
        ));
        ports.push(
            output(net::UPSET).remark("sticky: a word that a bundle takes is wrong, or cannot be repaired"),
        );
    }
    ports
}

const RESET: &str = "synchronous; held for 64 cycles or more";
const _: () = assert!(RESET_CYCLES == 64, "say so in the remark");
