// SPDX-License-Identifier: MIT OR Apache-2.0
//! Output ports as they are read by number: a port shows the last value that was written to it, or, latched, the last one published.
//!
//! The reference has one port, an arbitrary one, and so stands for all; the memories of `takt_outputs.v` are reduced to this port. Of a
//! latched one each has two words, of which the memories keep an arbitrary one, too: the property speaks of reads of this word, the
//! invariants of times at which it is the one that is shown, or the one that is written.

use super::rules::{Reference, any};
use std::fmt::Write as _;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{Plan, SlotPlan};

/// Net: number of the port that is looked at, below the place of its word.
const WORD: &str = "f_probe_outputs";
/// Module that shows the ports a cycle after their numbers, beside the core's own.
const LATER: &str = "f_later";

/// Adds the port, its properties and the invariants to a reference.
pub(super) fn add(plan: &Plan, latched: bool, of: &mut Reference) {
    let last = plan.port_bits - 1;
    let _ = writeln!(
        of.text,
        "
    // An output port, an arbitrary one, with the place of its word if it is latched.
    wire [{}:0] {WORD};
    wire [{last}:0] f_probe_output = {WORD}[{last}:0];
    wire f_hit_output = {};",
        last + u32::from(latched),
        any(plan.slots.iter().map(|slot| hit(plan, slot))),
    );
    later(plan, of);
    for (instance, shown) in [("outputs", net::READ_VALUE.to_string()), (LATER, format!("{LATER}_shown"))] {
        let ports = Outputs { plan, instance, shown };
        if latched { ports.latched(of) } else { ports.direct(of) }
    }
}

/// Condition: a slot writes the port.
fn hit(plan: &Plan, slot: &SlotPlan) -> String {
    let bank = &slot.slot.bank;
    format!("({} & ({} == f_probe_output))", plan.output_write(bank), plan.output_index(bank))
}

/// The module with the other delay: a core has one of both.
fn later(plan: &Plan, of: &mut Reference) {
    let all = |net: &dyn Fn(&SlotPlan) -> String| {
        let list: Vec<String> = plan.slots.iter().rev().map(net).collect();
        format!("{{{}}}", list.join(", "))
    };
    let _ = writeln!(
        of.text,
        "    wire [31:0] {LATER}_shown;
    takt_outputs #(.LATCHED({}), .BANKS({}), .INDEX({}), .READ_DELAY(1)) {LATER} (
        .clk({}), .rst({}), .publish({}), .write({}), .index({}), .value({}), .number({}), .shown({LATER}_shown)
    );",
        net::LATCHED,
        plan.slots.len(),
        plan.port_bits,
        net::CLK,
        net::RST,
        net::PUBLISHED,
        all(&|slot| plan.output_write(&slot.slot.bank).to_string()),
        all(&|slot| plan.output_index(&slot.slot.bank).to_string()),
        all(&|slot| plan.output_value(&slot.slot.bank).to_string()),
        plan.read_output(),
    );
}

/// A takt_outputs, with its own reference.
struct Outputs<'p> {
    plan: &'p Plan,
    instance: &'static str,
    /// Net: the value that is read.
    shown: String,
}

impl Outputs<'_> {
    fn own(&self, what: &str) -> String {
        format!("f_{what}_{}", self.instance)
    }

    /// Value of the port's last write, with those of this cycle; of several the last bank's.
    fn written(&self) -> String {
        self.plan.slots.iter().fold(self.own("written"), |before, slot| {
            format!("{} ? {} : {before}", hit(self.plan, slot), self.plan.output_value(&slot.slot.bank))
        })
    }

    /// Ports that show a value as soon as it is written.
    fn direct(&self, of: &mut Reference) {
        let (clk, rst, written, held) = (net::CLK, net::RST, self.own("written"), self.held(of));
        let _ = writeln!(
            of.text,
            "    reg [31:0] {written};\n    always @(posedge {clk}) {written} <= {rst} ? {held} : {};",
            self.written()
        );
        of.equal("words", &format!("~{rst}"), &held, &written);
        self.shows("an output port shows the last value that was written to it before", "1'b1", &written, of);
    }

    /// Ports that show the value that was published last.
    fn latched(&self, of: &mut Reference) {
        let (clk, rst, publish) = (net::CLK, net::RST, net::PUBLISHED);
        let [written, waits, published, now] =
            ["written", "unpublished", "published", "shown"].map(|what| self.own(what));
        let held = self.held(of);
        let _ = writeln!(
            of.text,
            "    // The port was written since the last publish; the value that is published, and in this cycle.
    reg  {waits};
    reg  [31:0] {written}, {published};
    wire [31:0] {now} = {publish} & {waits} ? {written} : {published};
    always @(posedge {clk}) begin
        {written}   <= {};
        {waits}     <= ~{rst} & (f_hit_output | ({waits} & ~{publish}));
        {published} <= {rst} ? {held} : {now};
    end",
            self.written()
        );
        let mut places = |name: &str| {
            let path = format!("{}.places.g_latched.{name}", self.instance);
            let vector = of.seen(&path, &format!("[{}:0]", (1 << self.plan.port_bits) - 1));
            format!("{vector}[f_probe_output]")
        };
        let (front, changed) = (places("shown"), places("changed"));
        let place = of.seen(&format!("{}.number_place", self.instance), "");
        let at = format!("{WORD}[{}]", self.plan.port_bits);
        of.equal("changed", &format!("~{rst}"), &changed, &waits);
        of.equal("words shown", &format!("~{rst} & ({front} == {at})"), &held, &published);
        of.equal("words to come", &format!("~{rst} & {changed} & ({front} != {at})"), &held, &written);
        let when = format!("({place} == {at})");
        self.shows("a latched output port shows the last value that was published", &when, &now, of);
    }

    /// Property: the port shows a value if its number is on the pins, or has been in the cycle before, under a further condition.
    fn shows(&self, says: &str, when: &str, value: &str, of: &mut Reference) {
        let rst = net::RST;
        let read = format!("({} == f_probe_output) & {when}", self.plan.read_output());
        if self.instance != LATER {
            of.promise(says, &format!("~{rst} & {read}"), &self.shown, value);
            return;
        }
        let _ = writeln!(
            of.text,
            "    reg f_was_read;\n    reg [31:0] f_was_value;\n    always @(posedge {}) begin f_was_read <= ~{rst} & {read}; f_was_value <= {value}; end",
            net::CLK
        );
        let says = format!("{says}, a cycle after its number");
        of.promise(says, &format!("~{rst} & f_was_read"), &self.shown, "f_was_value");
    }

    /// Value that the memories hold for the port: that of the bank that wrote last, as the orders of the banks say.
    fn held(&self, of: &mut Reference) -> String {
        let banks = self.plan.slots.len();
        let mut orders = Vec::new();
        let values: Vec<String> = (0..banks)
            .map(|b| {
                let words = format!("{}.g_bank[{b}].words", self.instance);
                of.word(&words, WORD);
                if banks > 1 {
                    let order = format!("{}.g_several.g_order[{b}].order", self.instance);
                    of.word(&order, WORD);
                    orders.push(of.seen(&format!("{order}.word"), &format!("[{}:0]", banks - 2)));
                }
                of.seen(&format!("{words}.word"), "[31:0]")
            })
            .collect();
        // The earlier one of two banks wrote last if their bits for each other are equal.
        let bit = |b: usize, k: usize| format!("{}[{}]", orders[b], if k < b { k } else { k - 1 });
        let is_last = |b: usize| {
            let others = (0..banks).filter(|&k| k != b).map(|k| {
                let is = if b < k { "==" } else { "!=" };
                format!("({} {is} {})", bit(b, k), bit(k, b))
            });
            format!("({})", others.collect::<Vec<_>>().join(" & "))
        };
        (1..banks).fold(values[0].clone(), |found, b| format!("({} ? {} : {found})", is_last(b), values[b]))
    }
}
