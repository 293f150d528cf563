// SPDX-License-Identifier: MIT OR Apache-2.0
//! The rules of issue (`docs/timing.md`) as a circuit beside the core: a bundle issues in the cycle that they give, and in no other.
//!
//! The reference is generated from the tables alone. It sees the words that move through the core's pipeline, the operand of a branch,
//! the tick, and two decisions of the loops (`takt_loops`): that a bundle is the last one of a loop, and that a loop is short. For each
//! slot it has the results in flight in the order of their writebacks, for each unit the cycles until it accepts an operation, and the
//! cycles until the front end delivers a bundle.

use super::decoded::{Decoded, module};
use std::fmt::Write as _;
use takt_isa::Effect;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{LateUnit, Plan, SlotPlan, Stage};

/// Stages whose words the reference follows.
pub(super) const STAGES: [Stage; 3] = [Stage::Match, Stage::Read, Stage::Issue];

/// Texts that are added to a core.
#[derive(Default)]
pub(super) struct Reference {
    /// Modules beside the core.
    pub(super) modules: String,
    /// Text within the core's module.
    pub(super) text: String,
    /// Nets of the text that stand for nets within the core's parts.
    pub(super) inner: Vec<(String, String)>,
    /// Nets of the text that are arbitrary, and the same in all cycles.
    pub(super) constants: Vec<String>,
    /// Memories of which one word is kept, each with the net of its address.
    pub(super) words: Vec<(String, String)>,
    /// Conditions that are assumed in every cycle.
    pub(super) assumed: Vec<String>,
    /// Conditions that must never hold, each with a name: violations of properties and of invariants.
    pub(super) bad: Vec<(String, String)>,
    /// Number of properties among them.
    pub(super) properties: usize,
}

impl Reference {
    /// Declares a net that stands for one within the core's parts, and returns its name.
    pub(super) fn seen(&mut self, path: &str, range: &str) -> String {
        let name = format!("f_at_{}", path.replace(['.', '[', ']'], "_"));
        if self.inner.iter().all(|(known, _)| *known != name) {
            let _ = writeln!(self.text, "    wire {range} {name};");
            self.inner.push((name.clone(), path.to_owned()));
        }
        name
    }

    /// Reduces a memory of the circuit to one word, `MEMORY.word`, at an arbitrary address that the text declares as a net.
    pub(super) fn word(&mut self, memory: &str, address: &str) {
        self.words.push((memory.to_owned(), address.to_owned()));
        if self.constants.iter().all(|known| known != address) {
            self.constants.push(address.to_owned());
        }
    }

    /// Property: two values are equal where a condition holds.
    pub(super) fn promise(&mut self, says: impl Into<String>, when: &str, left: &str, right: &str) {
        self.properties += 1;
        self.equal(says, when, left, right);
    }

    /// Invariant: two values are equal where a condition holds.
    pub(super) fn equal(&mut self, says: impl Into<String>, when: &str, left: &str, right: &str) {
        self.bad.push((format!("({when}) & (({left}) != ({right}))"), says.into()));
    }

    /// Text within the core's module, with the conditions as the bits of `f_bad`, the first lowest. `rtl/formal/core.py` finds its first line.
    pub(super) fn within(&self) -> String {
        let bad: Vec<&str> = self.bad.iter().rev().map(|(text, _)| text.as_str()).collect();
        format!(
            "\n    // ---- reference, properties and invariants, added by `cargo evidence formal`\n\n{}\n    wire f_assumed = {};\n    wire [{}:0] f_bad = {{\n        {}\n    }};\n",
            self.text,
            self.assumed.join("\n        & "),
            bad.len() - 1,
            bad.join(",\n        ")
        )
    }

    /// Invariant: a condition never holds.
    pub(super) fn never(&mut self, says: impl Into<String>, when: &str) {
        self.bad.push((when.to_owned(), says.into()));
    }
}

/// Results in flight of a slot: the places of the reference, one for each cycle to the writeback.
pub(super) fn places(slot: &SlotPlan) -> u32 {
    slot.latencies.last().copied().unwrap_or(1)
}

/// Bit of the reference: a result has its writeback in `place` cycles.
pub(super) fn booked(slot: &SlotPlan, place: u32) -> String {
    if place < places(slot) { format!("f_{}_booked[{place}]", slot.name()) } else { "1'b0".to_owned() }
}

/// Register of that result.
pub(super) fn register(plan: &Plan, slot: &SlotPlan, place: u32) -> String {
    format!("f_{}_register[{} +: {}]", slot.name(), place * plan.index, plan.index)
}

/// Register of a result that no fault cancels any more.
pub(super) fn sure_register(plan: &Plan, slot: &SlotPlan, place: u32) -> String {
    format!("f_{}_sure_register[{} +: {}]", slot.name(), place * plan.index, plan.index)
}

/// Counter of the reference: cycles until the unit accepts an operation.
pub(super) fn busy(slot: &SlotPlan, late: &LateUnit) -> String {
    format!("f_{}_{}_busy", slot.name(), late.unit.name)
}

/// Disjunction of conditions.
pub(super) fn any(conditions: impl IntoIterator<Item = String>) -> String {
    let list: Vec<String> = conditions.into_iter().collect();
    if list.is_empty() { "1'b0".to_owned() } else { format!("({})", list.join(" | ")) }
}

/// Condition: a register that a source of the bundle in a stage reads has a result in flight, in `from` cycles or later.
pub(super) fn pending(
    plan: &Plan,
    reader: &Decoded<'_>,
    operand: usize,
    places_of: impl Fn(&SlotPlan) -> Vec<u32>,
) -> String {
    any(plan.slots.iter().flat_map(|slot| {
        places_of(slot).into_iter().map(move |place| {
            format!(
                "({}[{}] & {} & ({} == {}))",
                reader.bank(operand),
                slot.number,
                booked(slot, place),
                register(plan, slot, place),
                reader.index(operand)
            )
        })
    }))
}

/// Condition: the register that the bundle in a stage writes has a result in flight.
pub(super) fn taken(plan: &Plan, writer: &Decoded<'_>, places: impl IntoIterator<Item = u32>) -> String {
    let slot = writer.slot;
    any(places.into_iter().map(|place| {
        format!(
            "({} & {} & ({} == {}))",
            writer.writes(),
            booked(slot, place),
            register(plan, slot, place),
            writer.dest()
        )
    }))
}

/// Cycles in which every result of a machine has been written and every unit accepts an operation, counted from the last issue: no
/// bundle waits longer for rules 2 to 6.
pub(super) fn longest(plan: &Plan) -> u32 {
    let units = plan.slots.iter().flat_map(|slot| slot.late.iter().map(|late| late.unit.interval));
    plan.slots.iter().map(places).chain(units).max().unwrap_or(1) - 1
}

/// The reference, and the properties that a user relies on.
pub(super) fn reference(plan: &Plan) -> Reference {
    let mut of = Reference::default();
    for slot in &plan.slots {
        of.modules += &module(plan, slot);
    }
    pipeline(plan, &mut of);
    front_end(plan, &mut of);
    for slot in &plan.slots {
        scoreboard(plan, slot, &mut of);
    }
    decision(plan, &mut of);
    properties(plan, &mut of);
    of
}

/// Words of the bundles in each stage, decoded by the tables.
fn pipeline(plan: &Plan, of: &mut Reference) {
    let (clk, advance) = (net::CLK, net::ADVANCE);
    for slot in &plan.slots {
        for stage in STAGES {
            let decoded = Decoded { slot, stage };
            of.text += &decoded.declared(plan);
        }
        let word = |stage| Decoded { slot, stage }.word();
        let _ = writeln!(
            of.text,
            "    always @(posedge {clk}) if ({advance}) begin {} <= {}; {} <= {}; {} <= {}; end",
            word(Stage::Match),
            slot.word(),
            word(Stage::Read),
            word(Stage::Match),
            word(Stage::Issue),
            word(Stage::Read)
        );
    }
    let _ = writeln!(
        of.text,
        "    reg f_m_outside, f_r_outside, f_i_outside;
    always @(posedge {clk}) if ({advance}) begin f_m_outside <= {}; f_r_outside <= f_m_outside; f_i_outside <= f_r_outside; end",
        net::D_OUTSIDE
    );
    for stage in STAGES {
        let legal = plan.slots.iter().map(|slot| Decoded { slot, stage }.legal());
        let _ = writeln!(
            of.text,
            "    wire f_{stage}_legal = {} & ~f_{stage}_outside;",
            legal.collect::<Vec<_>>().join(" & ")
        );
    }
}

/// Rule 1: branches, the tick, halts.
fn front_end(plan: &Plan, of: &mut Reference) {
    let (clk, rst) = (net::CLK, net::RST);
    let (refill, resolve) = (plan.machine.refill, plan.machine.resolve);
    let control = Decoded { slot: plan.control(), stage: Stage::Issue };
    let effect = |effect| control.effect(effect);
    let ends = of.seen("sequencer.i_ends", "");
    let short = of.seen("sequencer.i_short", "");
    let fault = net::FAULT;
    let always = any([
        effect(Effect::Jump),
        effect(Effect::Call),
        effect(Effect::Return),
        effect(Effect::Wait),
        format!("({} & {short})", effect(Effect::Loop)),
    ]);
    let branches = any([effect(Effect::BranchZero), effect(Effect::BranchNonzero)]);
    let tested = plan.control().operand(0);
    let _ = writeln!(
        of.text,
        "
    // Rule 1. f_left: cycles until the front end delivers a bundle; f_squash: it fetches anew. f_over: a fault has been reported.
    reg [3:0] f_left;
    reg f_squash, f_waiting, f_remembered, f_halted, f_over, f_refused, f_if_zero, f_if_nonzero;
    wire f_issues, f_refuses;
    wire f_runs = ~{rst} & ~f_over;
    wire f_live  = f_runs & ~{fault};
    wire f_delivered = (f_left == 4'd0) & ~f_waiting & ~f_halted & ~f_refused;
    wire f_redirected = (f_if_zero & ({tested} == 32'd0)) | (f_if_nonzero & ({tested} != 32'd0));
    wire f_ticked = f_remembered | ({ticks} & ~f_waiting);
    always @(posedge {clk}) begin
        f_left <= f_left == 4'd0 ? 4'd0 : f_left - 4'd1;
        if (f_redirected) begin f_left <= 4'd{after}; f_squash <= 1'b1; end
        f_if_zero    <= f_issues & {zero};
        f_if_nonzero <= f_issues & {nonzero};
        if (f_issues) f_squash <= 1'b0;
        if (f_issues & {always}) begin f_left <= 4'd{refill}; f_squash <= 1'b1; end
        if (f_issues & {branches}) f_left <= 4'd{resolve};
        f_remembered <= f_ticked;
        f_waiting    <= f_waiting & ~{ticks};
        // In the last bundle of a loop, both are at fault, and a halt keeps the next bundle for a cycle.
        if (f_issues & {wait} & ~{ends}) begin f_waiting <= ~f_ticked; f_remembered <= 1'b0; end
        if (f_issues & {halt} & ~{ends}) f_halted <= 1'b1;
        if (f_issues & {halt} & {ends}) f_left <= 4'd1;
        if (f_refuses) f_refused <= 1'b1;
        if ({fault}) f_over <= 1'b1;
        if ({rst}) begin
            f_left <= 4'd{refill};
            f_squash <= 1'b1;
            {{f_waiting, f_remembered, f_halted, f_over, f_refused, f_if_zero, f_if_nonzero}} <= 7'd0;
        end
    end",
        ticks = net::TICKS,
        after = refill - 1,
        zero = effect(Effect::BranchZero),
        nonzero = effect(Effect::BranchNonzero),
        wait = effect(Effect::Wait),
        halt = effect(Effect::Halt),
    );
}

/// Results in flight of a slot, and its units.
fn scoreboard(plan: &Plan, slot: &SlotPlan, of: &mut Reference) {
    let (name, clk, rst, width, most) = (slot.name(), net::CLK, net::RST, plan.index, places(slot));
    let issued = Decoded { slot, stage: Stage::Issue };
    let _ = writeln!(
        of.text,
        "
    // Slot `{name}`: place j has the result whose writeback is in j cycles.
    reg [{last}:0] f_{name}_booked;
    reg [{bits}:0] f_{name}_register;
    always @(posedge {clk}) begin
        f_{name}_booked   <= f_{name}_booked >> 1;
        f_{name}_register <= f_{name}_register >> {width};",
        last = most - 1,
        bits = most * width - 1,
    );
    for (number, latency) in slot.latencies.iter().enumerate() {
        let place = latency - 1;
        let _ = writeln!(
            of.text,
            "        if (f_issues & {}[{number}]) begin f_{name}_booked[{place}] <= 1'b1; f_{name}_register[{} +: {width}] <= {}; end",
            issued.result(),
            place * width,
            issued.dest()
        );
    }
    let _ = writeln!(of.text, "        if ({rst}) f_{name}_booked <= {most}'d0;\n    end");
    sure(plan, slot, of);
    for late in &slot.late {
        let u = busy(slot, late);
        let _ = writeln!(
            of.text,
            "    reg [5:0] {u};
    always @(posedge {clk}) {u} <= {rst} ? 6'd0 : f_issues & {} ? 6'd{} : {u} - {{5'd0, |{u}}};",
            issued.uses(late.unit),
            late.unit.interval - 1
        );
    }
}

/// Results that no fault cancels any more: a fault, reported two cycles after the bundle at fault has issued, cancels those of this bundle
/// and of the next.
fn sure(plan: &Plan, slot: &SlotPlan, of: &mut Reference) {
    let (name, clk, rst, width, most) = (slot.name(), net::CLK, net::RST, plan.index, places(slot));
    let issued = Decoded { slot, stage: Stage::Issue };
    let count = slot.latencies.len().max(1);
    let _ = writeln!(
        of.text,
        "    reg [{kinds}:0] f_{name}_new1, f_{name}_new2;
    reg [{index}:0] f_{name}_dest1, f_{name}_dest2;
    reg [{last}:0] f_{name}_sure, f_{name}_sure_now;
    reg [{bits}:0] f_{name}_sure_register, f_{name}_sure_register_now;
    always @* begin
        f_{name}_sure_now = f_{name}_sure;
        f_{name}_sure_register_now = f_{name}_sure_register;",
        kinds = count - 1,
        index = width - 1,
        last = most - 1,
        bits = most * width - 1,
    );
    for (number, latency) in slot.latencies.iter().enumerate() {
        let place = latency - 2;
        let _ = writeln!(
            of.text,
            "        if (f_{name}_new2[{number}] & ~{}) begin f_{name}_sure_now[{place}] = 1'b1; f_{name}_sure_register_now[{} +: {width}] = f_{name}_dest2; end",
            net::FAULT,
            place * width,
        );
    }
    let _ = writeln!(
        of.text,
        "    end
    always @(posedge {clk}) begin
        f_{name}_new1 <= {{{count}{{f_issues}}}} & {};
        f_{name}_dest1 <= {};
        f_{name}_new2 <= f_{name}_new1;
        f_{name}_dest2 <= f_{name}_dest1;
        f_{name}_sure <= f_{name}_sure_now >> 1;
        f_{name}_sure_register <= f_{name}_sure_register_now >> {width};
        if ({rst}) begin f_{name}_new1 <= {count}'d0; f_{name}_new2 <= {count}'d0; f_{name}_sure <= {most}'d0; end
    end",
        issued.result(),
        issued.dest()
    );
}

/// Rules 2 to 6, and the decision.
fn decision(plan: &Plan, of: &mut Reference) {
    let at = |slot| Decoded { slot, stage: Stage::Issue };
    let beyond = |slot: &SlotPlan| (1..places(slot)).collect::<Vec<_>>();
    let operands = plan.sources().map(|(slot, operand)| pending(plan, &at(slot), operand, beyond));
    let destinations = plan.slots.iter().map(|slot| taken(plan, &at(slot), beyond(slot)));
    let units = plan.slots.iter().flat_map(|slot| {
        slot.late
            .iter()
            .map(move |late| format!("({} & ({} != 6'd0))", at(slot).uses(late.unit), busy(slot, late)))
    });
    let undrained = any(plan
        .slots
        .iter()
        .flat_map(|slot| beyond(slot).into_iter().map(move |place| booked(slot, place))));
    let drains = any(plan.slots.iter().map(|slot| at(slot).drains()));
    let ports = plan.slots.iter().flat_map(|slot| {
        slot.latencies.iter().enumerate().map(move |(number, &latency)| {
            format!("({}[{number}] & {})", at(slot).result(), booked(slot, latency))
        })
    });
    let _ = writeln!(
        of.text,
        "
    wire f_rule2 = ~{};
    wire f_rule3 = ~{};
    wire f_rule4 = ~{};
    wire f_rule5 = ~({drains} & {undrained});
    wire f_rule6 = ~{};
    assign f_issues  = f_runs & f_delivered & f_i_legal & f_rule2 & f_rule3 & f_rule4 & f_rule5 & f_rule6;
    assign f_refuses = f_runs & f_delivered & ~f_i_legal;

    // Cycles since the last issue, and those of them in which a legal bundle was there and did not issue.
    reg [5:0] f_quiet, f_waits;
    always @(posedge {clk}) begin
        f_quiet <= f_issues ? 6'd0 : f_quiet + {{5'd0, f_quiet != 6'd63}};
        f_waits <= f_issues | ~f_delivered | ~f_i_legal ? 6'd0 : f_waits + 6'd1;
        if ({rst}) begin f_quiet <= 6'd0; f_waits <= 6'd0; end
    end",
        any(operands),
        any(destinations),
        any(units),
        any(ports),
        clk = net::CLK,
        rst = net::RST
    );
}

/// Properties that a user relies on.
fn properties(plan: &Plan, of: &mut Reference) {
    pins(plan, of);
    of.promise(
        "a bundle issues in the cycle that the rules give, and in no other",
        "f_runs",
        &net::ISSUE.to_string(),
        "f_issues",
    );
    of.promise(
        "an illegal bundle is refused when it is delivered, and no other",
        "f_runs",
        &net::REFUSED.to_string(),
        "f_refuses",
    );
    for slot in &plan.slots {
        let (writes, index) = (slot.writes(), slot.in_flight_index().low(plan.index));
        of.promise(
            format!("`{}`: a result is written in the cycle of its writeback, and in no other", slot.name()),
            "f_live",
            &writes.to_string(),
            &booked(slot, 0),
        );
        of.promise(
            format!("`{}`: a result is written to its register", slot.name()),
            &format!("f_live & {writes}"),
            &index.to_string(),
            &register(plan, slot, 0),
        );
    }
    for slot in &plan.slots {
        of.promise(
            format!(
                "`{}`: after a fault, results of bundles before it are written, and no others",
                slot.name()
            ),
            &format!("~{} & {}", net::RST, net::FAULT),
            &slot.writes().to_string(),
            &format!("f_{}_sure[0]", slot.name()),
        );
    }
    let early = format!("{} & ~f_waiting & ~f_remembered", net::TICKS);
    of.promise(
        "a tick that comes too early is reported, and no other",
        "f_live",
        &net::TICK_MISSED.to_string(),
        &early,
    );
    of.promise(
        "a tick that is lost is reported, and no other",
        "f_live",
        &net::TICK_LOST.to_string(),
        &format!("{} & ~f_waiting & f_remembered", net::TICKS),
    );
    let _ = writeln!(
        of.text,
        "    reg f_deadline;
    always @(posedge {}) f_deadline <= ~{} & (f_deadline | (f_live & {early}));",
        net::CLK,
        net::RST
    );
    of.promise(
        "the pin of missed deadlines is high after the first tick that comes too early, until reset",
        "f_live",
        &net::DEADLINE_MISSED.to_string(),
        "f_deadline",
    );
    let most = longest(plan);
    of.promise(
        format!("a legal bundle waits for rules 2 to 6 for {most} cycles at most"),
        "f_live",
        &format!("f_waits > 6'd{most}"),
        "1'b0",
    );
}

/// Pins that the core takes into a register first: the tick, and input ports.
fn pins(plan: &Plan, of: &mut Reference) {
    let (clk, rst, last) = (net::CLK, net::RST, plan.index - 1);
    let base = (1 << plan.index) - (1_u32 << plan.input_bits);
    let _ = writeln!(
        of.text,
        "
    // Pins in the cycle before.
    reg f_pin_tick, f_pin_write;
    reg [{last}:0] f_pin_index;
    reg [31:0] f_pin_value;
    always @(posedge {clk}) begin
        f_pin_tick  <= {} & ~{rst};
        f_pin_write <= {};
        f_pin_index <= {}'d{base} + {};
        f_pin_value <= {};
    end",
        net::TICK,
        net::INPUT_WRITE,
        plan.index,
        plan.input_index(),
        net::INPUT_VALUE
    );
    let always = "1'b1";
    of.promise(
        "a tick is seen in the cycle after that on its pin",
        always,
        &net::TICKS.to_string(),
        "f_pin_tick",
    );
    of.promise(
        "an input port is written in the cycle after that on its pins",
        always,
        &net::INPUT1.to_string(),
        "f_pin_write",
    );
    let written = net::INPUT1.to_string();
    of.promise("a value goes to its input port", &written, &plan.input1_index().to_string(), "f_pin_index");
    of.promise(
        "an input port has the value on its pins",
        &written,
        &net::INPUT1_VALUE.to_string(),
        "f_pin_value",
    );
}
