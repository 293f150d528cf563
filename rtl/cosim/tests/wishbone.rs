// SPDX-License-Identifier: MIT OR Apache-2.0
//! Core behind its Wishbone slave: loaded, run, read and restarted over the bus, and faults planted in the slave.

use crate::bus::{Fault, Job, WISHBONE, counts_and_faults, restart, survivors, tracking};
use takt_isa::{T1, T3};

fn passes(jobs: impl IntoIterator<Item = Job>) {
    for job in jobs {
        job.run(WISHBONE, None).unwrap_or_else(|text| panic!("{text}"));
    }
}

#[test]
fn a_program_starts_again_on_t3() {
    passes([(false, true), (true, true), (false, false), (true, false)].map(|(l, r)| restart(&T3, l, r)));
}

#[test]
fn a_program_starts_again_on_t1() {
    passes([(false, true), (true, true), (false, false), (true, false)].map(|(l, r)| restart(&T1, l, r)));
}

#[test]
fn tracking_over_the_bus_on_t3() {
    passes([tracking(&T3)]);
}

#[test]
fn tracking_over_the_bus_on_t1() {
    passes([tracking(&T1)]);
}

#[test]
fn slave_ticks_and_reports_faults() {
    passes([counts_and_faults(&T1), counts_and_faults(&T3)]);
}

/// Faults in the slave of t1. Omitted are faults that show only if an access meets a word that is being restored, in one cycle of a reset
/// (`held`), and faults that the core never sees: the port that is `zero`, words that were never loaded.
#[rustfmt::skip]
const FAULTS: &[Fault] = &[
    // The period: too long, counted before the first `wait`, or from an earlier run.
    ("elapsed >= last", "elapsed > last"),
    ("period - 32'd1", "period"),
    ("due | ~waited ? 32'd0", "due ? 32'd0"),
    ("~rst & (waited | waiting)", "waited | waiting"),
    ("(access & at_tick) | due", "due"),
    // An access that is performed twice.
    ("cyc_i & stb_i & ~ack_o", "cyc_i & stb_i"),
    // The loader: the place, the upper bits.
    ("place + 16'd1", "place + {15'd0, ~&place[4:0]}"),
    ("{slot, space, place} <= dat_i[20:0]", "{slot, space, place} <= {dat_i[20:8], 3'd0, dat_i[4:0]}"),
    ("{high, low}", "{16'd0, low}"),
    // Reads: an output port too early, the status, the registers.
    ("{reading[1:0], 1'b1}", "3'd7"),
    ("fault_slot, fault_kind", "fault_kind, fault_slot"),
    ("{31'd0, run}", "32'd0"),
    ("at_period ? period", "at_period ? last"),
    // Page of addresses.
    ("== 11'd256", "== 11'd0"),
    // Reset that is too short, in cycles or in restored words.
    ("run & settled", "run"),
    ("quiet & restored", "quiet"),
    ("{settled, done, in_reset} <= 9'd0;\n            end", "{settled, done} <= 2'd0;\n            end"),
    // Kept words: saved although the program runs, the wrong value, at the wrong place; inputs not saved.
    ("rst & (keeps_data | keeps_register | writes_input)", "keeps_data | keeps_register | writes_input"),
    ("writes_input ? value : low", "low"),
    ("kept[{~keeps_data, keeps_at}]", "kept[{1'b1, keeps_at}]"),
    ("{replays_register, ~replays_register}", "2'd1"),
    ("writes_input | (replays & replays_input)", "writes_input"),
];

#[test]
fn faults_in_the_slave_are_found() {
    let jobs = [counts_and_faults(&T1), restart(&T1, false, true), tracking(&T1)];
    let survivors = survivors(WISHBONE, &jobs, FAULTS);
    assert!(survivors.is_empty(), "not found:\n{}", survivors.join("\n"));
}
