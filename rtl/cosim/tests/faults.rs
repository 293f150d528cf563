// SPDX-License-Identifier: MIT OR Apache-2.0
//! Faults planted in the circuit, in every unit and in the scoreboard; lockstep must find each.
//!
//! A fault replaces one expression. One simulation holds all faults of a machine and selects one by `+fault=`; without it, the circuit is
//! unchanged. A third of the faults is simulated, all of them with `TAKT_FULL=1`.
#![allow(clippy::print_stdout)]

use crate::common::folder;
use std::collections::BTreeMap;
use std::sync::OnceLock;
use takt_cosim::corners::corners;
use takt_cosim::{Difference, LockstepError, Model, Simulation, random};
use takt_isa::spec::units::*;
use takt_isa::{Bank, Machine, Shape, Slot, T1, T3, T4};
use takt_rtl::plan::names::{decode, net};
use takt_rtl::plan::{ControlBit, Plan, Stage};
use takt_rtl::verilator;
use takt_rtl::verilog::{Expr, any, number, repeat};
use takt_rtl::{Design, Library, export};

/// Fault: module, an expression that occurs once in it, and its replacement.
type Fault = (&'static str, &'static str, &'static str);

/// Faults in modules that both machines have.
#[rustfmt::skip]
const COMMON: &[Fault] = &[
    ("takt_add", "close & ~difference[24]", "close"),
    ("takt_add", "(distance1[4] & (|shift0[15:0]))", "1'b0"),
    ("takt_multiply", "5'd23 - zeros1", "5'd22 - zeros1"),
    ("takt_convert", "x[31] & ~nan", "1'b0"),
    ("takt_alu", "a[31] ^ b[31] ^ minus ^ low_sum[32]", "a[31] ^ b[31] ^ minus"),
    ("takt_sine", "quadrant3[1] ^ (quadrant3[0] & op3)", "quadrant3[1]"),
    // Waits for operands that are too short, in each of the ways in which a result is in flight.
    ("takt_hazard", "r_later | r_on_issue", "r_later"),
    ("takt_hazard", "(|(hit >> MIDDLE)) | (|late_hit)", "|(hit >> MIDDLE)"),
    ("takt_hazard", "|hit[MIDDLE-1:3]", "|hit[MIDDLE-2:3]"),
    ("takt_hazard", "(r_later & ~(|r_at2)) | r_on_issue_late", "r_later & ~(|r_at2)"),
    ("takt_hazard", "<= |(m_on_issue & ~i_early)", "<= 1'b0"),
    // Waits for operands that are too long.
    ("takt_hazard", "m_bank[s] & r_writes[s]", "r_writes[s]"),
    ("takt_hazard", "i_later & ~(|i_at2)", "i_later"),
    // Forwarding of results.
    ("takt_hazard", "advance ? r_bank & {SLOTS{r_at1}} : i_bank & {SLOTS{i_at1}}", "r_bank & {SLOTS{r_at1}}"),
    ("takt_hazard", "advance & r_at0", "1'b0"),
    ("takt_source", "r_past & {SLOTS{~next_input}}", "{SLOTS{1'b0}}"),
    ("takt_source", "advance ? m_index : r_index", "m_index"),
    ("takt_source", "advance ? r_is_next : i_is_next", "r_is_next"),
    ("takt_source", "~advance & ~i_taken & ~i_is_next", "~advance"),
    ("takt_source", "~next_fresh & ~next_input", "1'b0"),
    ("takt_source", "copy[32*k +: 32] & {32{shown[k]}}", "copy[32*k +: 32]"),
    // Results of bundles after a fault.
    ("takt_in_flight", "above[j+1] & ~((above_fresh[j+1] | above_recent[j+1]) & cancel)", "above[j+1]"),
    // Interval of an iterative unit.
    ("takt_long_latency", "working & ~age[INTERVAL-1]", "1'b0"),
    // Branches, calls, the tick.
    ("takt_sequencer", "x_operand == 32'd0 ? x_if_zero : x_if_nonzero", "x_if_zero"),
    ("takt_sequencer", "x_if_zero | x_if_nonzero | wait_next", "wait_next"),
    ("takt_sequencer", "x_call & entries[LEVEL]", "1'b0"),
    ("takt_sequencer", "x_return & ~|entries", "1'b0"),
    // The return stack overflows early: two entries share a word, on writing and on reading.
    ("takt_sequencer", "entries[LEVEL-1:0]", "{1'b0, entries[LEVEL-2:0]}"),
    ("takt_sequencer", "stack[top]", "stack[{1'b0, top[LEVEL-2:0]}]"),
    ("takt_sequencer", "x_address + 16'd1", "x_address + 16'd2"),
    ("takt_sequencer", "x_wait & ~remembered & ~fault", "x_wait & ~fault"),
    ("takt_sequencer", "remembered & ~x_wait", "remembered"),
    ("takt_sequencer", "issue & redirects", "1'b0"),
    ("takt_sequencer", "take & i_ends & (redirects | i_loop | i_publish)", "take & i_ends & (redirects | i_publish)"),
    ("takt_sequencer", "(was_wait | was_publish) & ~fault", "was_wait & ~fault"),
    ("takt_sequencer", "i_loop & i_short", "i_loop"),
    ("takt_sequencer", "x_loop ? x_next : x_target", "x_target"),
    ("takt_sequencer", "x_loop & loops_full", "1'b0"),
    ("takt_sequencer", "(|x_operand[31:16]) | (x_operand == 32'd0)", "x_operand == 32'd0"),
    ("takt_sequencer", "x_loop & loops_cut", "1'b0"),
    // Addresses: of the next bundle, of a return, beyond the program memory, of a fault.
    ("takt_sequencer", "fetched + 16'd1", "{fetched[15:8], fetched[7:0] + 8'd1}"),
    ("takt_sequencer", "x_address + 16'd1", "{x_address[15:8], x_address[7:0] + 8'd1}"),
    ("takt_sequencer", "|(fetched >> PROGRAM)", "fetched[PROGRAM]"),
    ("takt_sequencer", "fault_address <= x_address", "fault_address <= {8'd0, x_address[7:0]}"),
    ("takt_program", "words[read_address]", "words[{1'b0, read_address[ADDRESS-2:0]}]"),
    // A bit of a register's index, in each comparison and in the banks; of a data word's address, and its sum; of an output port's number.
    ("takt_hazard", "in_flight_index[(s*DEPTH+j)*INDEX +: INDEX] == m_index", "in_flight_index[(s*DEPTH+j)*INDEX +: INDEX-1] == m_index[INDEX-2:0]"),
    ("takt_hazard", "r_dest[s*INDEX +: INDEX] == m_index", "(r_dest[s*INDEX +: INDEX] | 32) == (m_index | 32)"),
    ("takt_hazard", "late_index[(s*LATE+j)*INDEX +: INDEX] == m_index", "late_index[(s*LATE+j)*INDEX +: INDEX-1] == m_index[INDEX-2:0]"),
    ("takt_hazard", "index2 == i_index", "(index2 | 64) == (i_index | 64)"),
    ("takt_source", "in_flight_index[s*DEPTH*INDEX +: INDEX]", "{1'b0, in_flight_index[s*DEPTH*INDEX +: INDEX-1]}"),
    ("takt_bank", "words[read_index]", "words[{1'b0, read_index[INDEX-2:0]}]"),
    ("takt_memory", "sum[ADDRESS-1:0]", "{1'b0, sum[ADDRESS-2:0]}"),
    ("takt_memory", "sum[15:0] >> ADDRESS", "sum[15:0] >> (ADDRESS+1)"),
    ("takt_outputs", "words[read_at[ADDRESS-1:0]]", "words[{1'b0, read_at[ADDRESS-2:0]}]"),
    ("takt_outputs", "order[read_at[ADDRESS-1:0]]", "order[{1'b0, read_at[ADDRESS-2:0]}]"),
    // A unit and the data memory that drive their slot's bus in other cycles, too.
    ("takt_sine", "~valid[12]", "1'b0"),
    ("takt_memory", "read & {32{delivers[p]}}", "read"),
    // Loops: the counts, the levels as of issue and as of fetch, the refill after a short body. The proof in CI refutes the first fault,
    // too.
    ("takt_loops", "x_count != 16'd1", "1'b1"),
    ("takt_loops", "flush) begun <= 3'd1", "flush) begun <= begun"),
    ("takt_loops", "ahead       <= used", "ahead       <= ahead"),
    ("takt_loops", "armed       <= used[0]", "armed       <= armed"),
    ("takt_loops", "ahead_first <= first_issued", "ahead_first <= ahead_first"),
    ("takt_loops", "ahead_first <= first_around", "ahead_first <= ahead_first"),
    ("takt_loops", "|(top & more)", "1'b1"),
    ("takt_loops", "(ahead_top >> 1) & more", "ahead_top & more"),
    ("takt_loops", "ahead_top & more_then", "ahead_top & more"),
    ("takt_loops", "advance & again & ahead_top[k]", "again & ahead_top[k]"),
    ("takt_loops", "left[3:0] != 4'd1", "left[3:0] != 4'd0"),
    ("takt_loops", "take & i_again & top[k]", "i_again & top[k]"),
    ("takt_loops", "take & i_ends & ~i_again", "take & i_ends"),
    ("takt_loops", "advance & ends & ~again", "1'b0"),
    ("takt_loops", "few <= ~|left[15:4]", "few <= few"),
    // Carries and comparisons cut at 8 bits; loops that end beyond the memory, by themselves and around others.
    ("takt_loops", "left <= left - 16'd1", "left <= {left[15:8], left[7:0] - 8'd1}"),
    ("takt_loops", "x_target - 16'd1", "{x_target[15:8], x_target[7:0] - 8'd1}"),
    ("takt_loops", "r_target < r_address + SHORT", "r_target < {r_address[15:8], r_address[7:0] + SHORT[7:0]}"),
    ("takt_loops", "~|(x_last >> PROGRAM)", "1'b1"),
    ("takt_loops", "~|(innermost_last >> PROGRAM)", "1'b1"),
    ("takt_loops", "~|(ahead_around >> PROGRAM)", "1'b1"),
    ("takt_loops", "r_target < r_address + SHORT", "r_target < r_address + SHORT - 16'd1"),
    ("takt_loops", "innermost_last >= x_address", "innermost_last[7:0] >= x_address[7:0]"),
    ("takt_loops", "innermost_last < x_target", "innermost_last[7:0] < x_target[7:0]"),
    ("takt_loops", "innermost_last >= x_address", "1'b1"),
    ("takt_loops", "innermost_last < x_target", "innermost_last < x_target - 16'd1"),
    ("takt_loops", "used & ~(used >> 1)", "used"),
    ("takt_issue", "refused <= next_valid & next_illegal & ~block", "refused <= 1'b0"),
    ("takt_issue", "next_valid & next_illegal & ~block", "next_valid & next_illegal"),
    // What issues right behind a bundle at fault, or ends a loop; of several illegal words, the slot.
    ("takt_sequencer", "x_halt & ~fault", "x_halt"),
    ("takt_sequencer", "take & i_halt & ~i_ends", "take & i_halt"),
    ("takt_sequencer", "x_illegal_slot <= s[2:0]", "x_illegal_slot <= 3'd0"),
    // Addresses and stores of the data memory.
    ("takt_memory", "above | ~upper", "above"),
    ("takt_memory", "x_store & ~(|fault) & ~cancel", "x_store & ~cancel"),
];

/// Faults in modules that only t3 has, and in its own units.
#[rustfmt::skip]
const OF_T3: &[Fault] = &[
    ("takt_divroot", "a_sign_1 & ~a_zero & ~a_nan", "a_sign_1 & ~a_nan"),
    ("takt_arctangent", "sign & ~nan", "1'b0"),
    ("takt_arccosine", "negative_19 ? HALF_TURN - shifted : shifted", "shifted"),
    ("takt_hazard", "(|(hit >> MIDDLE)) | (|late_hit)", "|late_hit"),
    ("takt_hazard", "(|r_at2) | r_on_issue_early", "|r_at2"),
    ("takt_in_flight", "(above_fresh[j+1] | above_recent[j+1])", "above_fresh[j+1]"),
    ("takt_long_latency", "age[2] & ~cancel", "age[2]"),
    ("takt_hazard", "m_at2 | (m_on_issue & i_early)", "m_at2"),
    ("takt_program", "{48-LOW{legal}}", "{48-LOW{1'b1}}"),
];

/// Faults in units that only t1 has.
#[rustfmt::skip]
const OF_T1: &[Fault] = &[
    ("takt_alu_late", "waiting[36*WAIT-1 -: 36]", "(waiting[36*WAIT-1 -: 36] & ~36'd8)"),
    ("takt_addmul", "sign5 & ~(zero5 & cancels5)", "sign5"),
    ("takt_recurrence", "is_signaling | b_signaling | undefined", "is_signaling | b_signaling"),
    ("takt_recurrence", "a_sign & ~is_zero & ~is_nan", "a_sign & ~is_nan"),
    ("takt_long_latency", "in_flight & ~age[LATENCY-DEPTH]", "in_flight & ~age[LATENCY-DEPTH-1]"),
    ("takt_long_latency", "insert | busy", "insert"),
    ("takt_in_flight", "above_index[(j+1)*INDEX +: INDEX]", "(above_index[(j+1)*INDEX +: INDEX] & ~(j == DEPTH-1 ? 128 : 0))"),
    ("takt_memory", "sum[ADDRESS-1:0]", "(sum[ADDRESS-1:0] & ~{{ADDRESS-1{1'b0}}, a[31]})"),
];

/// Faults in the second port of the data memory, which only t4 has, and where results of latency 2 are beside it.
#[rustfmt::skip]
const OF_T4: &[Fault] = &[
    ("takt_in_flight", "valid[0] & ~(recent[0] & cancel)", "valid[0]"),
    ("takt_sequencer", "x_address_fault & EARLIER", "{SLOTS{1'b0}}"),
    ("takt_sequencer", "t[2:0]", "3'd2"),
    ("takt_sequencer", "(was_wait | was_publish) & ~fault", "was_wait | was_publish"),
    ("takt_sequencer", "x_halt & ~fault & ~any_address", "x_halt & ~fault"),
    ("takt_memory", "same  <= other == address", "same  <= (other | 512) == (address | 512)"),
    ("takt_memory", "word[ADDRESS +: ADDRESS]", "{word[ADDRESS+1 +: ADDRESS-1], 1'b0}"),
    ("takt_onehot_mux", "choices[2*i] | choices[2*i+1]", "choices[2*i]"),
    ("takt_hazard", "|hit[MIDDLE-1:3]", "|hit[MIDDLE-1:4]"),
    ("takt_outputs", "told[k*BANKS+b] ^ (k < b)", "k < b"),
    ("takt_outputs", "write[b] & ~|yields[b*BANKS +: BANKS]", "write[b]"),
    ("takt_memory", "same ? read : second", "second"),
    ("takt_memory", "same ? read : second", "read"),
    ("takt_memory", "x_store & ~(|fault) & ~cancel", "x_store & ~fault[0] & ~cancel"),
    ("takt_sequencer", "address_first ? address_slot : OWN_SLOT", "OWN_SLOT"),
];

/// Fault with computed texts.
type ComputedFault = (String, String, String);

/// Faults in the generated part of t3, expressed with the names of its plan.
fn generated_for_t3(plan: &Plan) -> Vec<ComputedFault> {
    let (core, mul) = (plan.top(), plan.slot("mul").expect("t3's slot"));
    let writes = Expr::from(plan.writes_at(Stage::Issue)).any_bit();
    let kept = |kept: Expr| (net::STICKY & kept).to_string();
    // The sine may book the product's write port.
    let product = mul.bit(Stage::Read, ControlBit::Result(5)) & any(mul.booked(6));
    vec![
        (core.clone(), (net::PENDING | writes).to_string(), net::PENDING.to_string()),
        (core.clone(), kept(repeat(3, !net::X_CLEAR_FLAGS | net::FAULT)), net::STICKY.to_string()),
        (core.clone(), format!("({product})"), "1'b0".to_owned()),
        (
            core,
            (mul.illegal(Stage::Decode) | net::D_OUTSIDE).to_string(),
            mul.illegal(Stage::Decode).to_string(),
        ),
        // In words of two operands, `takt_program` already removes the stray bits.
        (plan.decoder(mul), decode::is_stray(Shape::Da).to_string(), "1'b0".to_owned()),
    ]
}

/// Fault in the generated part of t1: the write port that iterative units book.
fn generated_for_t1(plan: &Plan) -> Vec<ComputedFault> {
    let one = plan.slot("one").expect("t1's slot");
    let taken =
        one.bit(Stage::Read, ControlBit::Result(ADDMUL.latency)) & any(one.booked(ADDMUL.latency + 1));
    vec![(plan.top(), format!("({taken})"), "1'b0".to_owned())]
}

/// Faults in the generated part of t4 with latched ports.
fn generated_for_latched(plan: &Plan) -> Vec<ComputedFault> {
    let direct = Expr::from(&net::LATCHED).is(number(0));
    vec![
        (plan.top(), (direct | net::INPUTS_OPEN | net::RST).to_string(), "1'b1".to_owned()),
        (plan.top(), (net::INPUTS_TAKEN | net::RST).to_string(), net::RST.to_string()),
    ]
}

/// Faults in the modules for latched ports, on t4, whose outputs are written by four slots.
#[rustfmt::skip]
const OF_LATCHED: &[Fault] = &[
    ("takt_double_buffer", "flip ? shown ^ changed : shown", "shown"),
    ("takt_double_buffer", "now[index[BITS-1:0]] ^ ~open", "~now[index[BITS-1:0]]"),
    ("takt_double_buffer", "now[index[BITS-1:0]] ^ ~open", "now[index[BITS-1:0]]"),
    ("takt_double_buffer", "{PORTS{~flip & ~drop}}", "{PORTS{1'b1}}"),
    ("takt_double_buffer", "{PORTS{~flip & ~drop}}", "{PORTS{~drop}}"),
    ("takt_double_buffer", "shown ^ changed", "~shown"),
    ("takt_double_buffer", "write[k] & ~open & (index >> BITS) == 0", "write[k] & (index >> BITS) == 0"),
    ("takt_outputs", "of_number[j]", "1'b0"),
    ("takt_sequencer", "x_wait & ~fault", "x_wait & ~remembered & ~fault"),
    ("takt_source", "advance ? m_place : r_place", "1'b0"),
];

/// In the order of faults where the data memory is behind the sequencer's slot.
#[rustfmt::skip]
const OF_MEMORY_BEHIND: &[Fault] = &[
    ("takt_sequencer", "x_address_fault & EARLIER", "x_address_fault"),
    ("takt_sequencer", "any_address & ~own_fault", "any_address"),
];

/// A machine whose data memory is behind the sequencer's slot, as that of no row of the table is.
fn machine_with_late_memory() -> &'static Machine {
    static MACHINE: OnceLock<Machine> = OnceLock::new();
    let slot = |name, bank, base, units| Slot { name, bank: Bank { name: bank, base, depth: 64 }, units };
    MACHINE.get_or_init(|| Machine {
        name: "behind",
        slots: Vec::leak(vec![
            slot("first", "r", 0, &[ALU, SEQUENCER]),
            slot("second", "q", 128, &[ALU, MEMORY]),
        ]),
        inputs: Bank { name: "i", base: 896, depth: 128 },
        outputs_per_bank: 16,
        code_depth: 256,
        data_depth: 128,
        ..T1
    })
}

/// Changes of t3 that are no faults, each with its reason. Directed programs show none of them.
#[rustfmt::skip]
const NONE_ON_T3: &[Fault] = &[
    // A load at fault would drive its slot's bus. It has booked the bank's write port for that cycle, so that no result of an earlier bundle
    // is on the bus, those of later ones are cancelled, and its own is cancelled in takt_in_flight.
    ("takt_memory", "x_load & ~fault", "x_load"),
    // A result of latency 2 is in place 0 when its bundle's fault is known. On t3 only `aux` has such results, and all faults of bundles that
    // issue, so that the operation at fault is the slot's own, and has no result.
    ("takt_in_flight", "valid[0] & ~(recent[0] & cancel)", "valid[0]"),
    // No access of t3 comes from a slot before the sequencer's. Likewise on t1.
    ("takt_sequencer", "x_address_fault & EARLIER", "{SLOTS{1'b0}}"),
    // `cancel` stays high: what is not dropped in its second cycle is dropped in its third.
    ("takt_long_latency", "age[1] & ~cancel", "age[1]"),
    // An access in the sequencer's slot is no fault of the sequencer: of one slot there is one.
    ("takt_sequencer", "any_address & ~own_fault", "any_address"),
];

/// Random programs that a fault may survive before it counts as not found.
const PROGRAMS: u64 = 1000;
/// Random programs that a circuit without a fault runs.
const FEW: u64 = 20;

/// The first program on which a circuit differs from the emulator, and how: of so many random ones, then of the directed ones.
pub(crate) fn search(
    machine: &'static Machine,
    mut simulation: Simulation,
    programs: u64,
) -> Option<(String, Box<Difference>)> {
    let coverage = &mut random::Coverage::default();
    let random = (0..programs).map(|seed| (format!("program {seed}"), None));
    let directed = corners(machine).into_iter().map(|corner| (corner.name.clone(), Some(corner)));
    for (seed, (name, corner)) in (0..).zip(random.chain(directed)) {
        let done = match corner {
            None => random::run(seed, machine, simulation, coverage),
            Some(corner) => random::run_corner(&corner, simulation, coverage),
        };
        match done {
            Ok(again) => simulation = again,
            Err(LockstepError::Difference(difference)) => return Some((name, difference)),
            Err(error) => panic!("{error}"),
        }
    }
    None
}

/// One fault in so many is simulated unless `TAKT_FULL=1`; the others are planted, and stay unused.
const SHARE: usize = 3;

/// The same of faults that may show in no program, which takes all programs to tell.
const FRESH_SHARE: usize = 15;

/// A machine's circuit with faults, compiled.
fn planted(machine: &'static Machine, latched: u16, faults: &[(&str, &str, &str)]) -> Model {
    let design = export(machine, &Library::builtin()).expect("every machine has a circuit");
    let mut design = Design { latched, ..design };
    verilator::plant(&mut design.files, &design.top, faults).unwrap_or_else(|error| panic!("{error}"));
    // A fault may have other widths.
    design.files.iter_mut().for_each(|file| file.text.insert_str(0, "/* verilator lint_off WIDTH */ "));
    Model::build(&design, &folder(), false).unwrap_or_else(|error| panic!("{error}"))
}

/// A simulation with one of the faults, from 1; with 0 without.
fn start(model: &Model, fault: usize) -> Simulation {
    model.start(&[format!("+fault={fault}").as_ref()]).unwrap_or_else(|error| panic!("{error}"))
}

fn faults_are_found(
    machine: &'static Machine,
    latched: u16,
    faults: &[Fault],
    generated: fn(&Plan) -> Vec<ComputedFault>,
) {
    let made = generated(&export(machine, &Library::builtin()).expect("every machine has a circuit").plan);
    let made = made.iter().map(|(module, from, to)| (module.as_str(), from.as_str(), to.as_str()));
    let faults: Vec<(&str, &str, &str)> = faults.iter().copied().chain(made).collect();
    let model = planted(machine, latched, &faults);
    if let Some((name, difference)) = search(machine, start(&model, 0), FEW) {
        panic!("without a fault, {name}: {difference}");
    }
    let share = if is_full() { 1 } else { SHARE };
    let survivors = unseen(machine, &model, &faults, share);
    assert!(survivors.is_empty(), "{}: not found:\n{}", machine.name, survivors.join("\n"));
}

fn is_full() -> bool {
    std::env::var_os("TAKT_FULL").is_some()
}

/// Planted faults, one in `share`, that no program shows.
fn unseen(
    machine: &'static Machine,
    model: &Model,
    faults: &[(&str, &str, &str)],
    share: usize,
) -> Vec<String> {
    let mut survivors = Vec::new();
    for (number, fault) in (1..).zip(faults).step_by(share) {
        match search(machine, start(model, number), PROGRAMS) {
            None => survivors.push(format!("{fault:?}")),
            Some((name, difference)) => {
                println!("{}: {} `{}`: {name}, cycle {}", machine.name, fault.0, fault.1, difference.cycle);
            }
        }
    }
    survivors
}

#[test]
fn planted_faults_are_found_on_t3() {
    faults_are_found(&T3, 0, &[COMMON, OF_T3].concat(), generated_for_t3);
}

/// Faults in modules that t3 does not have.
#[test]
fn planted_faults_are_found_on_t1() {
    faults_are_found(&T1, 0, OF_T1, generated_for_t1);
}

#[test]
fn planted_faults_of_a_memory_behind_the_sequencer_are_found() {
    faults_are_found(machine_with_late_memory(), 0, OF_MEMORY_BEHIND, |_| Vec::new());
}

/// A change that has a reason to be none, and that a program shows, has lost its reason.
#[test]
fn equivalent_changes_have_no_effect() {
    let model = planted(&T3, 0, NONE_ON_T3);
    for (number, change) in (1..).zip(NONE_ON_T3) {
        if let Some((name, difference)) = search(&T3, start(&model, number), FEW) {
            panic!("{change:?} shows in {name}: {difference}");
        }
    }
}

#[test]
fn planted_faults_in_latched_ports_and_in_the_second_port_are_found() {
    faults_are_found(&T4, T4.inputs.depth, &[OF_LATCHED, OF_T4].concat(), generated_for_latched);
}

/// Faults chosen by somebody who had seen neither properties nor other faults: most show in programs, where circuit and emulator differ.
/// The proof of the core refutes each.
#[test]
fn fresh_faults_show_in_programs() {
    let lists: BTreeMap<String, Vec<[String; 4]>> =
        serde_json::from_str(include_str!("../../formal/fresh.json")).expect("lists of faults");
    for machine in [&T1, &T4] {
        let faults = lists[machine.name].iter().map(|[module, from, to, _]| (&**module, &**from, &**to));
        let faults: Vec<_> = faults.collect();
        let share = if is_full() { 1 } else { FRESH_SHARE };
        let unseen = unseen(machine, &planted(machine, 0, &faults), &faults, share);
        let count = faults.len().div_ceil(share);
        println!("{}: {} of {count} show in no program:\n{}", machine.name, unseen.len(), unseen.join("\n"));
        assert!(unseen.len() * 2 < count, "{}: {unseen:#?}", machine.name);
    }
}
