// SPDX-License-Identifier: MIT OR Apache-2.0
//! Core behind its AXI4-Lite slave: the Wishbone slave's jobs, partial words, simultaneous accesses, and faults planted in the slave.

use crate::bus::{AXI, Bus, Fault, Job, counts_and_faults, is_same, register, restart, survivors, tracking};
use std::fmt::Write as _;
use takt_isa::T1;

/// Writes to parts of a word, which are rejected and change nothing, and simultaneous writes and reads: the side that was not served last
/// is served first.
fn parts_and_orders() -> Job {
    let mut bus = Bus::default();
    let period = register("period");
    bus.put(1, period, 0x1234_5670);
    // The register's address with one bit changed.
    (3..16).for_each(|bit| bus.put(1, period ^ 1 << bit, 7));
    bus.read(period, 0x1234_5670);
    for strobes in 0..15 {
        bus.put(6, period, 0xffff_fff0 | strobes);
        writeln!(bus.expected, "{period:04x} answered 2").expect("a string takes it");
        bus.read(period, 0x1234_5670);
    }
    // The side that was served last, and the value.
    let mut value = 0x1234_5670;
    for round in 0..12_u32 {
        let is_read_last = round % 3 != 1;
        if is_read_last {
            bus.put(4, period, 0);
        }
        let new = 0x0101_0101 * (round + 1);
        bus.put(7, period, new);
        let (order, seen) = if is_read_last { ("wr", new) } else { ("rw", value) };
        writeln!(bus.expected, "{period:04x} {order} {seen:08x}").expect("a string takes it");
        if round % 3 == 0 {
            // The write is served last.
            bus.write("period", new);
        }
        value = new;
    }
    bus.read(period, value);
    bus.job("parts".to_owned(), &T1, String::new(), is_same)
}

fn jobs() -> [Job; 4] {
    [parts_and_orders(), counts_and_faults(&T1), restart(&T1, false, true), tracking(&T1)]
}

#[test]
fn axi_slave_agrees_with_the_wishbone_slave() {
    for job in jobs() {
        job.run(AXI, None).unwrap_or_else(|text| panic!("{text}"));
    }
}

#[rustfmt::skip]
const FAULTS: &[Fault] = &[
    // Arbitration: an address without its data, one side forever, both sides at once, a request while a response is pending.
    ("s_axi_awvalid & s_axi_wvalid & ~s_axi_bvalid", "s_axi_awvalid & ~s_axi_bvalid"),
    ("s_axi_awvalid & s_axi_wvalid & ~s_axi_bvalid", "s_axi_wvalid & ~s_axi_bvalid"),
    ("~(to_read & wrote)", "1'b1"),
    ("~(to_read & wrote)", "~to_read"),
    ("idle & to_read & ~write", "idle & to_read"),
    ("~access & ~s_axi_awready & ~s_axi_arready", "~s_axi_awready & ~s_axi_arready"),
    ("wrote   <= write", "wrote   <= 1'b0"),
    // Parts of words.
    ("begins | &s_axi_wstrb", "1'b1"),
    ("write & ~&s_axi_wstrb", "write & ~|s_axi_wstrb"),
    ("<= 3'b110", "<= 3'b100"),
    ("<= 3'b110", "<= 3'b010"),
    // Responses that are withdrawn early, or never.
    ("if (s_axi_bready) s_axi_bvalid <= 1'b0;", "s_axi_bvalid <= 1'b0;"),
    ("if (s_axi_rready) s_axi_rvalid <= 1'b0;", "s_axi_rvalid <= 1'b0;"),
    ("if (s_axi_rready) s_axi_rvalid <= 1'b0;", ""),
    ("s_axi_rdata} <= {1'b1, read}", "s_axi_rdata} <= {1'b1, 1'b0, read[30:0]}"),
    // Address: of the wrong side, without its upper bits, shifted.
    ("write ? s_axi_awaddr[17:2] : s_axi_araddr[17:2]", "s_axi_awaddr[17:2]"),
    ("write ? s_axi_awaddr[17:2]", "write ? {1'b0, s_axi_awaddr[16:2]}"),
    ("s_axi_araddr[17:2]", "s_axi_araddr[15:0]"),
    ("we      <= write", "we      <= 1'b1"),
    ("value   <= s_axi_wdata", "value   <= {s_axi_wdata[31:1], 1'b0}"),
];

#[test]
fn faults_in_the_slave_are_found() {
    let survivors = survivors(AXI, &jobs(), FAULTS);
    assert!(survivors.is_empty(), "not found:\n{}", survivors.join("\n"));
}
