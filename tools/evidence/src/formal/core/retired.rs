// SPDX-License-Identifier: MIT OR Apache-2.0
//! Addresses of the bundles whose results are written back, as the pins for verification show them.

use super::decoded::Decoded;
use super::invariants::age;
use super::rules::{Reference, booked, places};
use std::fmt::Write as _;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{Plan, SlotPlan, Stage};

/// Bits of an address.
const ADDRESS: u32 = 16;

/// Adds the addresses, their properties and invariants to a reference.
pub(super) fn add(plan: &Plan, of: &mut Reference) {
    for slot in &plan.slots {
        declare(slot, of);
        of.promise(
            format!("`{}`: a writeback is shown with the address of its bundle", slot.name()),
            &format!("f_live & {}", slot.writes()),
            &slot.retire_address().to_string(),
            &address(slot, 0),
        );
        let own =
            of.seen(&format!("{}.addresses", slot.results()), &format!("[{}:0]", ADDRESS * slot.depth - 1));
        for place in 0..slot.depth.min(places(slot)) {
            of.equal(
                "address",
                &format!("f_runs & {}", booked(slot, place)),
                &format!("{own}[{} +: {ADDRESS}]", ADDRESS * place),
                &address(slot, place),
            );
        }
        for late in &slot.late {
            let age = age(slot, late, of);
            for k in 1..=late.beyond {
                of.equal(
                    "address",
                    &format!("f_runs & {age}[{k}]"),
                    &slot.late_address(late).to_string(),
                    &address(slot, late.unit.latency - k),
                );
            }
        }
    }
}

/// Address of the bundle whose result has its writeback in `place` cycles.
fn address(slot: &SlotPlan, place: u32) -> String {
    format!("f_{}_from[{} +: {ADDRESS}]", slot.name(), ADDRESS * place)
}

/// The addresses of a slot, a place for each cycle to the writeback.
fn declare(slot: &SlotPlan, of: &mut Reference) {
    let (name, clk, issue) = (slot.name(), net::CLK, net::I_ADDRESS);
    let result = Decoded { slot, stage: Stage::Issue }.result();
    let _ = writeln!(
        of.text,
        "
    // Slot `{name}`: the address of the bundle of each result in flight.
    reg [{}:0] f_{name}_from;
    always @(posedge {clk}) begin
        f_{name}_from <= f_{name}_from >> {ADDRESS};",
        ADDRESS * places(slot) - 1,
    );
    for (number, latency) in slot.latencies.iter().enumerate() {
        let place = ADDRESS * (latency - 1);
        let _ = writeln!(
            of.text,
            "        if (f_issues & {result}[{number}]) f_{name}_from[{place} +: {ADDRESS}] <= {issue};"
        );
    }
    of.text += "    end\n";
}
