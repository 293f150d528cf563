// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operands: a bundle reads of each register the result with the latest writeback not after its issue, whichever way it takes through
//! the core: a copy of the bank, or the bus of this cycle or of one of the two before.
//!
//! The reference has one register of each bank, an arbitrary one, and so stands for all: `f_probe_*` is its index, `f_word_*` its value
//! after the writes of all cycles before. In the place of a bank's copies stands their contract (`bank.v`): two cycles after a read, the
//! register's value before the read, if it was not written in that very cycle.

use super::decoded::Decoded;
use super::invariants::{has, in_read, inner};
use super::rules::{Reference, any, pending, places};
use std::fmt::Write as _;
use takt_isa::Effect;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{Plan, SlotPlan, Stage};

/// Adds the registers, the properties of operands and their invariants to a reference.
pub(super) fn add(plan: &Plan, latched: bool, of: &mut Reference) {
    for slot in &plan.slots {
        probe(plan, slot, of);
    }
    let port = Port { latched, bits: plan.input_bits };
    port.add(plan, of);
    flags(plan, of);
    for (number, (slot, operand)) in plan.sources().enumerate() {
        for bank in &plan.slots {
            from_bank(plan, slot, operand, bank, of);
        }
        from_inputs(plan, slot, operand, port, of);
        if latched {
            place(slot, operand, number, port, plan, of);
        }
        from_word(plan, slot, operand, of);
    }
}

/// The probed register of a bank.
fn probe(plan: &Plan, slot: &SlotPlan, of: &mut Reference) {
    let (name, clk, last) = (slot.name(), net::CLK, plan.index - 1);
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

/// The probed input port. A latched one has two words, of which the reference has an arbitrary one; what is read in cycles in which the
/// front is the other one, the same proof says with the other one.
#[derive(Clone, Copy)]
struct Port {
    latched: bool,
    /// Bits of a port's number.
    bits: u32,
}

impl Port {
    /// Bits of an index by which ports differ, where the bank of the inputs has no others.
    fn own(self, index: &str) -> String {
        if self.latched { format!("{index}[{}:0]", self.bits - 1) } else { index.to_owned() }
    }

    /// Condition: an index is that of the port.
    fn is(self, index: &str) -> String {
        format!("({} == {})", self.own(index), self.own("f_probe_inputs"))
    }

    /// The word's place, of a latched port.
    fn place(self) -> String {
        format!("f_probe_inputs[{}]", self.bits)
    }

    /// The place of a latched port that bundles read.
    fn front(self, of: &mut Reference) -> String {
        let shown = of.seen("inputs.g_latched.shown", &format!("[{}:0]", (1 << self.bits) - 1));
        format!("{shown}[{}]", self.own("f_probe_inputs"))
    }

    /// Condition: the bundle in a stage reads the port.
    fn reads(self, at: Decoded<'_>, operand: usize, plan: &Plan) -> String {
        format!("{}[{}] & {}", at.bank(operand), plan.slots.len(), self.is(&at.index(operand)))
    }

    /// Condition: the reference has the word that bundles read.
    fn is_front(self, of: &mut Reference) -> String {
        if self.latched { format!("({} == {})", self.front(of), self.place()) } else { "1'b1".to_owned() }
    }

    /// Adds the port. `f_word_inputs` is the word, `f_port` what bundles read that issue two cycles later.
    fn add(self, plan: &Plan, of: &mut Reference) {
        let (clk, rst) = (net::CLK, net::RST);
        let last = if self.latched { self.bits } else { plan.index - 1 };
        let hit = self.is(&plan.input1_index().to_string());
        let _ = writeln!(
            of.text,
            "
    // Input ports: an arbitrary one, with the place of its word if it is latched.
    wire [{last}:0] f_probe_inputs;
    wire f_hits_input = {} & {hit};
    reg  [31:0] f_word_inputs, f_now_inputs;
    reg  f_was_hit_inputs;",
            net::INPUT1,
        );
        if self.latched {
            self.periods(of);
            if plan.index > self.bits {
                let (low, width) = (self.bits, plan.index - self.bits);
                let base = (u32::from(plan.machine.inputs.base) & ((1 << plan.index) - 1)) >> low;
                let upper = format!("{}[{low} +: {width}]", plan.input1_index());
                of.equal("input1_index", "1'b1", &upper, &format!("{width}'d{base}"));
            }
        } else {
            of.text += "    wire f_hit_inputs = f_hits_input, f_opens = 1'b1;\n    wire [31:0] f_port = f_word_inputs;\n";
        }
        let _ = writeln!(
            of.text,
            "    always @(posedge {clk}) begin
        if (f_hit_inputs) f_word_inputs <= {};
        f_now_inputs <= f_port;
        f_was_hit_inputs <= f_hit_inputs & (f_opens | {rst});
    end",
            net::INPUT1_VALUE
        );
        let when = if self.latched {
            format!("f_filled & ~{} & {}", net::FAULT, self.is_front(of))
        } else {
            "f_live".to_owned()
        };
        of.equal(
            "the next value",
            &format!("{when} & f_was_hit_inputs"),
            &net::INPUT2_VALUE.to_string(),
            "f_word_inputs",
        );
        of.equal("no next value", &format!("{when} & ~f_was_hit_inputs"), "f_now_inputs", "f_word_inputs");
    }

    /// What the host has set until a period begins is taken, and what comes later is for the next one.
    fn periods(self, of: &mut Reference) {
        let (clk, rst, value) = (net::CLK, net::RST, net::INPUT1_VALUE);
        let _ = writeln!(
            of.text,
            "    // f_port: what bundles read; f_next_port: what the host has set since, if f_changed_port.
    wire f_opens = {open}, f_takes = {taken};
    wire f_hit_inputs = f_hits_input & ({place} == {at});
    reg  f_changed_port;
    reg  [31:0] f_port, f_next_port;
    always @(posedge {clk}) begin
        if (f_takes & f_changed_port) f_port <= f_next_port;
        f_changed_port <= f_changed_port & ~f_takes;
        if (f_hits_input & f_opens) f_port <= {value};
        if (f_hits_input & ~f_opens) begin f_next_port <= {value}; f_changed_port <= 1'b1; end
        if ({rst}) begin f_changed_port <= 1'b0; f_port <= f_hit_inputs ? {value} : f_word_inputs; end
    end",
            open = net::INPUTS_OPEN,
            taken = net::INPUTS_TAKEN,
            place = net::INPUT1_PLACE,
            at = self.place(),
        );
        let (opens, takes) = (net::INPUTS_OPEN.to_string(), net::INPUTS_TAKEN.to_string());
        of.promise(
            "inputs are for the next bundle while the program waits, until the tick is seen",
            "f_live",
            &opens,
            &format!("f_waiting & ~{}", net::TICKS),
        );
        of.promise(
            "inputs are taken in the cycle after a `wait`, and in no other",
            "f_live",
            &takes,
            "f_ended1",
        );
        let changed = of.seen("inputs.g_latched.changed", &format!("[{}:0]", (1 << self.bits) - 1));
        let changed = format!("{changed}[{}]", self.own("f_probe_inputs"));
        let front = self.is_front(of);
        of.equal("changed", &format!("~{rst}"), &changed, "f_changed_port");
        of.equal("words read", &format!("~{rst} & {front}"), "f_word_inputs", "f_port");
        of.equal(
            "words to come",
            &format!("~{rst} & f_changed_port & ~{front}"),
            "f_word_inputs",
            "f_next_port",
        );
    }
}

/// Place from which a source reads a latched input port: the front.
fn place(slot: &SlotPlan, operand: usize, number: usize, port: Port, plan: &Plan, of: &mut Reference) {
    let front = port.front(of);
    let read = inner(of, &slot.source(operand), "g_latched_inputs.r_place");
    let matched = format!("{}[{number}]", plan.place(Stage::Match));
    for (stage, place, when) in [
        (Stage::Match, matched, format!("f_filled & {}", has(of, Stage::Match))),
        (Stage::Read, read, in_read(of)),
    ] {
        let reads = port.reads(Decoded { slot, stage }, operand, plan);
        of.equal("place", &format!("{when} & {reads}"), &place, &front);
    }
}

/// The flags that operations have raised, as of their writebacks.
fn flags(plan: &Plan, of: &mut Reference) {
    let (rst, fault) = (net::RST, net::FAULT);
    let raised =
        any(plan.slots.iter().map(|slot| format!("({{3{{{}}}}} & {})", slot.writes(), slot.flags())));
    let clears =
        any(plan.slots.iter().map(|slot| Decoded { slot, stage: Stage::Issue }.effect(Effect::ClearFlags)));
    let _ = writeln!(
        of.text,
        "
    // The sticky flags. If a fault is reported, the bundle at fault, which issued two cycles ago, and the next one have cleared nothing.
    reg [2:0] f_flags, f_cleared;
    reg f_clears;
    wire [2:0] f_flags_now = (f_flags & ~{{3{{f_clears & ~{fault}}}}}) | (f_cleared & {{3{{{fault}}}}}) | {raised};
    always @(posedge {clk}) begin
        f_flags   <= {rst} ? 3'd0 : f_flags_now;
        f_clears  <= f_issues & {clears};
        f_cleared <= f_flags & {{3{{f_clears & ~{fault}}}}};
    end",
        clk = net::CLK,
    );
    of.promise(
        "the flags are those of all operations whose writeback was, and that no bundle has cleared",
        &format!("~{rst}"),
        &net::STATUS.to_string(),
        "f_flags_now",
    );
    let clearing = net::X_CLEAR_FLAGS.to_string();
    of.equal("x_clear_flags", &format!("~{rst} & ~{fault}"), &clearing, "f_clears");
    of.equal("sticky", &format!("~{rst}"), &net::STICKY.to_string(), "f_flags");
    if !plan.clears_beside_faults() {
        of.never("a clearing by itself", "f_live & f_clears & f_at_fault");
        of.never("a clearing by itself", &format!("~{rst} & {fault} & (f_cleared != 3'd0)"));
    }
}

/// Nets of a source.
struct Source {
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
            taken: format!("(({stays} & ~{flags}) ? {} : {value})", slot.operand(operand)),
            past,
            fresh,
            r_is_next: inner(of, &instance, "r_is_next"),
            i_is_next: inner(of, &instance, "i_is_next"),
            read: in_read(of),
            issue: format!("f_filled & ~{} & {}", net::FAULT, has(of, Stage::Issue)),
        }
    }

    /// A probed register as this source reads it: the word of the source's copy, and the value that a bundle which issues must get.
    fn probed(
        &self,
        own: &str,
        copy: &str,
        [bank, address]: [&str; 2],
        issues: &str,
        of: &mut Reference,
    ) -> Copied {
        let _ = writeln!(
            of.text,
            "    reg {own}_reads;
    reg [31:0] {own}_wanted;
    always @(posedge {clk}) begin
        {own}_reads  <= f_issues & {issues};
        {own}_wanted <= f_now_{bank};
    end",
            clk = net::CLK,
        );
        of.word(copy, address);
        let mut word = |name: &str| of.seen(&format!("{copy}.{name}"), "[31:0]");
        let (word, value) = (word("word"), word("value1"));
        let known = inner(of, copy, "known1");
        // In reset all copies have what the loader has written.
        of.assumed.push(format!("(~{} | ({word} == f_word_{bank}))", net::RST));
        of.equal("word", &format!("~{}", net::RST), &word, &format!("f_word_{bank}"));
        Copied { known, value }
    }
}

/// Nets of a source's copy of a bank, in the cycle after a read.
struct Copied {
    known: String,
    value: String,
}

/// Condition: the bundle in a stage reads the probed register of a bank.
fn reads(at: Decoded<'_>, operand: usize, bank: &SlotPlan) -> String {
    format!("{}[{}] & ({} == f_probe_{})", at.bank(operand), bank.number, at.index(operand), bank.name())
}

/// An operand from a slot's bank.
fn from_bank(plan: &Plan, slot: &SlotPlan, operand: usize, bank: &SlotPlan, of: &mut Reference) {
    let (instance, banks) = (slot.source(operand), plan.slots.len() as u32);
    let (name, number) = (bank.name(), bank.number);
    let own = format!("f_{instance}_{name}");
    let source = Source::of(plan, slot, operand, of);
    let probed = |stage| reads(Decoded { slot, stage }, operand, bank);
    let probe = format!("f_probe_{name}");
    let copy = format!("{instance}.g_slot[{number}].bank");
    let copy = source.probed(&own, &copy, [name, &probe], &probed(Stage::Issue), of);
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
        &format!("{when} & ~f_was_hit_{name} & (~{} | ({} != f_word_{name}))", copy.known, copy.value),
    );
    let waits =
        pending(plan, &Decoded { slot, stage: Stage::Issue }, operand, |slot| (1..places(slot)).collect());
    let when = format!("{} & {} & ~{waits}", source.issue, probed(Stage::Issue));
    of.equal("operand", &when, &source.taken, &format!("f_now_{name}"));
}

/// An operand from the input ports.
fn from_inputs(plan: &Plan, slot: &SlotPlan, operand: usize, port: Port, of: &mut Reference) {
    let (instance, banks) = (slot.source(operand), plan.slots.len() as u32);
    let own = format!("f_{instance}_inputs");
    let source = Source::of(plan, slot, operand, of);
    let front = port.is_front(of);
    let probed = |stage| format!("{} & {front}", port.reads(Decoded { slot, stage }, operand, plan));
    let copy = format!("{instance}.{}.inputs", if port.latched { "g_latched_inputs" } else { "g_inputs" });
    let copy = source.probed(&own, &copy, ["inputs", "f_probe_inputs"], &probed(Stage::Issue), of);
    let value = if port.latched { "as it was taken for the period" } else { "of two cycles before" };
    of.promise(
        format!("`{instance}`: an operand from an input port is the port's value {value}"),
        &format!("f_live & {own}_reads"),
        &slot.operand(operand).to_string(),
        &format!("{own}_wanted"),
    );
    let when = format!("{} & {}", source.read, probed(Stage::Read));
    of.equal("r_is_next", &when, &source.r_is_next, "f_was_hit_inputs");
    of.never(
        "the copy has been read",
        &format!("{when} & ~f_was_hit_inputs & (~{} | ({} != f_word_inputs))", copy.known, copy.value),
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
