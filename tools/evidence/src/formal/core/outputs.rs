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

/// Adds the port, its property and the invariants to a reference.
pub(super) fn add(plan: &Plan, latched: bool, of: &mut Reference) {
    let (clk, rst, last) = (net::CLK, net::RST, plan.port_bits - 1);
    let hit = |slot: &SlotPlan| {
        let bank = &slot.slot.bank;
        format!("({} & ({} == f_probe_output))", plan.output_write(bank), plan.output_index(bank))
    };
    let written = plan.slots.iter().fold("f_written".to_owned(), |before, slot| {
        format!("{} ? {} : {before}", hit(slot), plan.output_value(&slot.slot.bank))
    });
    let _ = writeln!(
        of.text,
        "
    // An output port, an arbitrary one, with the place of its word: the value that was written last.
    wire [{top}:0] f_probe_outputs;
    wire [{last}:0] f_probe_output = f_probe_outputs[{last}:0];
    wire f_hit_output = {};
    reg  [31:0] f_written;",
        any(plan.slots.iter().map(hit)),
        top = last + u32::from(latched),
    );
    let held = held(plan, of);
    let read = format!("({} == f_probe_output)", plan.read_output());
    if !latched {
        let _ = writeln!(of.text, "    always @(posedge {clk}) f_written <= {rst} ? {held} : {written};");
        of.equal("words", &format!("~{rst}"), &held, "f_written");
        of.promise(
            "an output port shows the last value that was written to it before",
            &format!("~{rst} & {read}"),
            &net::READ_VALUE.to_string(),
            "f_written",
        );
        return;
    }
    let published = net::PUBLISHED;
    let _ = writeln!(
        of.text,
        "    // It was written since the last publish; the value that is shown, and in this cycle.
    reg  f_unpublished;
    reg  [31:0] f_published;
    wire [31:0] f_shown = {published} & f_unpublished ? f_written : f_published;
    always @(posedge {clk}) begin
        f_written     <= {written};
        f_unpublished <= ~{rst} & (f_hit_output | (f_unpublished & ~{published}));
        f_published   <= {rst} ? {held} : f_shown;
    end"
    );
    let mut places = |name: &str| {
        let vector = of
            .seen(&format!("outputs.places.g_latched.{name}"), &format!("[{}:0]", (1 << plan.port_bits) - 1));
        format!("{vector}[f_probe_output]")
    };
    let at = format!("f_probe_outputs[{}]", plan.port_bits);
    let (front, changed) = (places("shown"), places("changed"));
    let place = of.seen("outputs.number_place", "");
    of.equal("changed", &format!("~{rst}"), &changed, "f_unpublished");
    of.equal("words shown", &format!("~{rst} & ({front} == {at})"), &held, "f_published");
    of.equal("words to come", &format!("~{rst} & {changed} & ({front} != {at})"), &held, "f_written");
    of.promise(
        "a latched output port shows the last value that was published",
        &format!("~{rst} & {read} & ({place} == {at})"),
        &net::READ_VALUE.to_string(),
        "f_shown",
    );
}

/// Value that the memories hold for the port: that of the bank that wrote last, as the orders of the banks say.
fn held(plan: &Plan, of: &mut Reference) -> String {
    let address = "f_probe_outputs";
    let banks = plan.slots.len();
    let mut orders = Vec::new();
    let values: Vec<String> = (0..banks)
        .map(|b| {
            let words = format!("outputs.g_bank[{b}].words");
            of.word(&words, address);
            if banks > 1 {
                let order = format!("outputs.g_several.g_order[{b}].order");
                of.word(&order, address);
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
