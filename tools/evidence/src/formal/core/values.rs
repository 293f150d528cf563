// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operands: a bundle reads of each register the result with the latest writeback not after its issue, whichever way it takes through
//! the core: a copy of the bank, or the bus of this cycle or of one of the two before.
//!
//! The reference has one register of each bank, an arbitrary one, and so stands for all: `f_probe_*` is its index, `f_word_*` its value
//! after the writes of all cycles before. What a copy of a bank delivers is assumed (`takt_bank.v`): two cycles after a read, the
//! register's value before the read, if it was not written in that very cycle.

use super::decoded::Decoded;
use super::invariants::{has, in_read, inner};
use super::rules::{Reference, any, pending, places};
use std::fmt::Write as _;
use takt_isa::Effect;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{Plan, SlotPlan, Stage};

/// Adds the registers, the properties of operands and their invariants to a reference.
pub(super) fn add(plan: &Plan, of: &mut Reference) {
    for slot in &plan.slots {
        probe(plan, slot, of);
    }
    inputs(plan, of);
    flags(plan, of);
    for (slot, operand) in plan.sources() {
        for bank in &plan.slots {
            from_bank(plan, slot, operand, bank, of);
        }
        from_inputs(plan, slot, operand, of);
        from_word(plan, slot, operand, of);
    }
}

/// The probed register of a bank.
fn probe(plan: &Plan, slot: &SlotPlan, of: &mut Reference) {
    let (name, clk, last) = (slot.name(), net::CLK, plan.index - 1);
    of.constants.push(format!("f_probe_{name}"));
    let _ = writeln!(
        of.text,
        "
    // Bank of slot `{name}`: an arbitrary register.
    wire [{last}:0] f_probe_{name};
    reg  [31:0] f_word_{name};
    reg  f_was_hit_{name};
    wire f_hit_{name} = {} & ({} == f_probe_{name});
    wire [31:0] f_now_{name} = f_hit_{name} ? {} : f_word_{name};
    always @(posedge {clk}) begin f_word_{name} <= f_now_{name}; f_was_hit_{name} <= f_hit_{name}; end",
        slot.writes(),
        slot.in_flight_index().low(plan.index),
        slot.result()
    );
    of.promise(
        "a result of the last cycle",
        &format!("f_live & f_was_hit_{name}"),
        &slot.was_result().to_string(),
        &format!("f_word_{name}"),
    );
}

/// The probed input port. A value is read by bundles that issue two cycles after it has reached the core's first register.
fn inputs(plan: &Plan, of: &mut Reference) {
    let (clk, last) = (net::CLK, plan.index - 1);
    of.constants.push("f_probe_inputs".to_owned());
    let _ = writeln!(
        of.text,
        "
    // Input ports: an arbitrary one.
    wire [{last}:0] f_probe_inputs;
    reg  [31:0] f_word_inputs, f_now_inputs;
    reg  f_was_hit_inputs;
    wire f_hit_inputs = {} & ({} == f_probe_inputs);
    always @(posedge {clk}) begin
        if (f_hit_inputs) f_word_inputs <= {};
        f_now_inputs <= f_word_inputs;
        f_was_hit_inputs <= f_hit_inputs;
    end",
        net::INPUT1,
        plan.input1_index(),
        net::INPUT1_VALUE
    );
    of.equal("the next value", "f_live & f_was_hit_inputs", &net::INPUT2_VALUE.to_string(), "f_word_inputs");
    of.equal("no next value", "f_live & ~f_was_hit_inputs", "f_now_inputs", "f_word_inputs");
}

/// The flags that operations have raised, as of their writebacks.
fn flags(plan: &Plan, of: &mut Reference) {
    let raised =
        any(plan.slots.iter().map(|slot| format!("({{3{{{}}}}} & {})", slot.writes(), slot.flags())));
    let clears =
        any(plan.slots.iter().map(|slot| Decoded { slot, stage: Stage::Issue }.effect(Effect::ClearFlags)));
    let _ = writeln!(
        of.text,
        "
    // The sticky flags. A clearing that issued in the last cycle has no effect if a fault is reported now.
    reg [2:0] f_flags;
    reg f_clears;
    wire [2:0] f_flags_now = (f_flags & ~{{3{{f_clears & ~{fault}}}}}) | {raised};
    always @(posedge {clk}) begin
        f_flags  <= {rst} ? 3'd0 : f_flags_now;
        f_clears <= f_issues & {clears};
    end",
        clk = net::CLK,
        rst = net::RST,
        fault = net::FAULT,
    );
    of.promise(
        "the flags are those of all operations whose writeback was, and that no bundle has cleared",
        &format!("~{}", net::RST),
        &net::STATUS.to_string(),
        "f_flags_now",
    );
    let clearing = net::X_CLEAR_FLAGS.to_string();
    of.equal("x_clear_flags", &format!("~{} & ~{}", net::RST, net::FAULT), &clearing, "f_clears");
    of.equal("sticky", &format!("~{}", net::RST), &net::STICKY.to_string(), "f_flags");
}

/// Nets of a source.
struct Source {
    copy: String,
    index: String,
    /// Value of the operand register at the end of the cycle.
    taken: String,
    past: String,
    fresh: String,
    r_is_next: String,
    i_is_next: String,
    /// Condition: the bundle in read, in issue, counts.
    read: String,
    issue: String,
}

impl Source {
    fn of(plan: &Plan, slot: &SlotPlan, operand: usize, of: &mut Reference) -> Source {
        let (instance, banks) = (slot.source(operand), plan.slots.len() as u32);
        let value = of.seen(&format!("{instance}.value"), "[31:0]");
        let stays = inner(of, &instance, "i_stays");
        let flags = match operand {
            0 => Decoded { slot, stage: Stage::Issue }.effect(Effect::ReadFlags),
            _ => "1'b0".to_owned(),
        };
        let mut wide =
            |name: &str| of.seen(&format!("{instance}.hazard.{name}"), &format!("[{}:0]", banks - 1));
        let (past, fresh) = (wide("r_past"), wide("r_copy"));
        Source {
            copy: of.seen(&format!("{instance}.copy"), &format!("[{}:0]", 32 * banks + 31)),
            index: of.seen(&format!("{instance}.read_index"), &format!("[{}:0]", plan.index - 1)),
            taken: format!("(({stays} & ~{flags}) ? {} : {value})", slot.operand(operand)),
            past,
            fresh,
            r_is_next: inner(of, &instance, "r_is_next"),
            i_is_next: inner(of, &instance, "i_is_next"),
            read: in_read(of),
            issue: format!("f_filled & ~{} & {}", net::FAULT, has(of, Stage::Issue)),
        }
    }

    /// A probed register as this source reads it: what its copy delivers, and the value that a bundle which issues must get.
    fn probed(&self, own: &str, bank: &str, number: u32, issues: &str, of: &mut Reference) {
        let _ = writeln!(
            of.text,
            "    reg {own}_read1, {own}_read2, {own}_reads;
    reg [31:0] {own}_value1, {own}_value2, {own}_wanted;
    always @(posedge {clk}) begin
        {own}_read1  <= ({index} == f_probe_{bank}) & ~f_hit_{bank};
        {own}_value1 <= f_word_{bank};
        {own}_read2  <= {own}_read1;
        {own}_value2 <= {own}_value1;
        {own}_reads  <= f_issues & {issues};
        {own}_wanted <= f_now_{bank};
    end",
            clk = net::CLK,
            index = self.index
        );
        of.assumed.push(format!("(~{own}_read2 | ({}[{} +: 32] == {own}_value2))", self.copy, 32 * number));
    }
}

/// Condition: the bundle in a stage reads the probed register of a bank.
fn reads(at: Decoded<'_>, operand: usize, bank: &str, number: u32) -> String {
    format!("{}[{number}] & ({} == f_probe_{bank})", at.bank(operand), at.index(operand))
}

/// An operand from a slot's bank.
fn from_bank(plan: &Plan, slot: &SlotPlan, operand: usize, bank: &SlotPlan, of: &mut Reference) {
    let (instance, banks) = (slot.source(operand), plan.slots.len() as u32);
    let (name, number) = (bank.name(), bank.number);
    let own = format!("f_{instance}_{name}");
    let source = Source::of(plan, slot, operand, of);
    let probed = |stage| reads(Decoded { slot, stage }, operand, name, number);
    source.probed(&own, name, number, &probed(Stage::Issue), of);
    of.promise(
        format!("`{instance}`: an operand from the bank of `{name}` is the register's last value"),
        &format!("f_live & {own}_reads"),
        &slot.operand(operand).to_string(),
        &format!("{own}_wanted"),
    );
    let when = format!("{} & {}", source.read, probed(Stage::Read));
    let one = 1_u32 << number;
    of.equal("r_past", &when, &source.past, &format!("f_was_hit_{name} ? {banks}'d{one} : {banks}'d0"));
    of.equal("r_copy", &when, &source.fresh, &format!("f_was_hit_{name} ? {banks}'d0 : {banks}'d{one}"));
    of.never(
        "the copy has been read",
        &format!("{when} & ~f_was_hit_{name} & (~{own}_read1 | ({own}_value1 != f_word_{name}))"),
    );
    let waits =
        pending(plan, &Decoded { slot, stage: Stage::Issue }, operand, |slot| (1..places(slot)).collect());
    let when = format!("{} & {} & ~{waits}", source.issue, probed(Stage::Issue));
    of.equal("operand", &when, &source.taken, &format!("f_now_{name}"));
}

/// An operand from the input ports.
fn from_inputs(plan: &Plan, slot: &SlotPlan, operand: usize, of: &mut Reference) {
    let (instance, banks) = (slot.source(operand), plan.slots.len() as u32);
    let own = format!("f_{instance}_inputs");
    let source = Source::of(plan, slot, operand, of);
    let probed = |stage| reads(Decoded { slot, stage }, operand, "inputs", banks);
    source.probed(&own, "inputs", banks, &probed(Stage::Issue), of);
    of.promise(
        format!(
            "`{instance}`: an operand from an input port is the value that the port had two cycles before"
        ),
        &format!("f_live & {own}_reads"),
        &slot.operand(operand).to_string(),
        &format!("{own}_wanted"),
    );
    let when = format!("{} & {}", source.read, probed(Stage::Read));
    of.equal("r_is_next", &when, &source.r_is_next, "f_was_hit_inputs");
    of.never(
        "the copy has been read",
        &format!("{when} & ~f_was_hit_inputs & (~{own}_read1 | ({own}_value1 != f_word_inputs))"),
    );
    let when = format!("{} & {}", source.issue, probed(Stage::Issue));
    of.equal("i_is_next", &when, &source.i_is_next, "f_was_hit_inputs");
    of.equal("operand", &when, &source.taken, "f_now_inputs");
    // Only an operand from an input port has a value that comes next, and only one from a bank has been on a bus.
    let read = Decoded { slot, stage: Stage::Read }.bank(operand);
    let issue = Decoded { slot, stage: Stage::Issue }.bank(operand);
    of.never("r_is_next", &format!("{} & {} & ~{read}[{banks}]", source.read, source.r_is_next));
    of.never("i_is_next", &format!("{} & {} & ~{issue}[{banks}]", source.issue, source.i_is_next));
    of.never(
        "no bank",
        &format!(
            "{} & ({read}[{}:0] == {banks}'d0) & ({} != {banks}'d0 | {} != {banks}'d0)",
            source.read,
            banks - 1,
            source.past,
            source.fresh
        ),
    );
}

/// An operand from no register: an immediate, the flags, or 0.
fn from_word(plan: &Plan, slot: &SlotPlan, operand: usize, of: &mut Reference) {
    let instance = slot.source(operand);
    let source = Source::of(plan, slot, operand, of);
    let at = |stage| Decoded { slot, stage };
    let immediate =
        |stage| format!("({{32{{{}}}}} & {}[31:0])", at(stage).effect(Effect::Immediate), at(stage).word());
    let value = match operand {
        0 => format!(
            "({} | {{27'd0, {{3{{{}}}}} & f_flags_now, 2'd0}})",
            immediate(Stage::Issue),
            at(Stage::Issue).effect(Effect::ReadFlags)
        ),
        _ => "32'd0".to_owned(),
    };
    let none = format!("({} == {}'d0)", at(Stage::Issue).bank(operand), plan.slots.len() + 1);
    let _ = writeln!(
        of.text,
        "    reg f_{instance}_none;
    reg [31:0] f_{instance}_wanted;
    always @(posedge {}) begin f_{instance}_none <= f_issues & {none}; f_{instance}_wanted <= {value}; end",
        net::CLK
    );
    of.promise(
        format!("`{instance}`: an operand from no register is the immediate, the flags or 0"),
        &format!("f_live & f_{instance}_none"),
        &slot.operand(operand).to_string(),
        &format!("f_{instance}_wanted"),
    );
    of.equal("operand", &format!("{} & {none}", source.issue), &source.taken, &value);
    if operand == 0 && slot.has_effect(Effect::Immediate) {
        let matched = format!("f_live & {}", has(of, Stage::Match));
        let is = at(Stage::Match).effect(Effect::Immediate);
        of.equal("immediate", &matched, &slot.immediate(Stage::Match).to_string(), &is);
        of.equal(
            "immediate",
            &source.read,
            &slot.immediate(Stage::Read).to_string(),
            &immediate(Stage::Read),
        );
    }
}
