// SPDX-License-Identifier: MIT OR Apache-2.0
//! Faults planted in the circuit, in every unit and in the scoreboard, each of which lockstep must find.
//!
//! A fault replaces one expression. All of a machine's stand in one simulation, which chooses one by `+fault=`; without it,
//! the circuit is as it was.
#![allow(clippy::print_stdout)]

use crate::common::folder;
use takt_cosim::{LockstepError, Model, random};
use takt_isa::spec::units::ADDMUL;
use takt_isa::{Machine, Shape, T1, T3, T4};
use takt_rtl::plan::names::{decode, net};
use takt_rtl::plan::{ControlBit, Plan, Stage};
use takt_rtl::verilator;
use takt_rtl::verilog::{Expr, any, number, repeat};
use takt_rtl::{Design, Library, export};

/// A module, an expression that occurs once in it, and what takes its place.
type Fault = (&'static str, &'static str, &'static str);

/// In what both machines have.
#[rustfmt::skip]
const COMMON: &[Fault] = &[
    ("takt_add", "close & ~difference[24]", "close"),
    ("takt_multiply", "5'd23 - zeros1", "5'd22 - zeros1"),
    ("takt_convert", "x[31] & ~nan", "1'b0"),
    ("takt_alu", "a[31] ^ b[31] ^ minus ^ low_sum[32]", "a[31] ^ b[31] ^ minus"),
    ("takt_sine", "quadrant3[1] ^ (quadrant3[0] & op3)", "quadrant3[1]"),
    // Waiting for operands: too short, in each of the ways in which a result is in flight.
    ("takt_hazard", "r_later | r_on_issue", "r_later"),
    ("takt_hazard", "(|(hit >> MIDDLE)) | (|late_hit)", "|(hit >> MIDDLE)"),
    ("takt_hazard", "|hit[MIDDLE-1:3]", "|hit[MIDDLE-2:3]"),
    ("takt_hazard", "(r_later & ~(|r_at2)) | r_on_issue_late", "r_later & ~(|r_at2)"),
    ("takt_hazard", "<= |(m_on_issue & ~i_early)", "<= 1'b0"),
    // Too long.
    ("takt_hazard", "m_bank[s] & r_writes[s]", "r_writes[s]"),
    ("takt_hazard", "i_later & ~(|i_at2)", "i_later"),
    // Forwarding.
    ("takt_hazard", "advance ? r_bank & {SLOTS{r_at1}} : i_bank & {SLOTS{i_at1}}", "r_bank & {SLOTS{r_at1}}"),
    ("takt_hazard", "advance & r_at0", "1'b0"),
    ("takt_source", "r_past & {SLOTS{~next_input}}", "{SLOTS{1'b0}}"),
    ("takt_source", "advance ? m_index : r_index", "m_index"),
    ("takt_source", "advance ? r_is_next : i_is_next", "r_is_next"),
    ("takt_source", "~advance & ~i_taken & ~i_is_next", "~advance"),
    ("takt_source", "~next_fresh & ~next_input", "1'b0"),
    ("takt_source", "copy[32*k +: 32] & {32{shown[k]}}", "copy[32*k +: 32]"),
    // A bundle at fault.
    ("takt_in_flight", "above[j+1] & ~((above_fresh[j+1] | above_recent[j+1]) & cancel)", "above[j+1]"),
    // The unit's interval.
    ("takt_long_latency", "working & ~age[INTERVAL-1]", "1'b0"),
    // Branches, calls, the tick.
    ("takt_sequencer", "x_operand == 32'd0 ? x_if_zero : x_if_nonzero", "x_if_zero"),
    ("takt_sequencer", "x_if_zero | x_if_nonzero | wait_next", "wait_next"),
    ("takt_sequencer", "x_call & entries[LEVEL]", "1'b0"),
    ("takt_sequencer", "x_return & ~|entries", "1'b0"),
    ("takt_sequencer", "x_address + 16'd1", "x_address + 16'd2"),
    ("takt_sequencer", "x_wait & ~remembered & ~fault", "x_wait & ~fault"),
    ("takt_sequencer", "remembered & ~x_wait", "remembered"),
    ("takt_sequencer", "issue & redirects", "1'b0"),
    ("takt_sequencer", "take & i_ends & (redirects | i_loop)", "take & i_ends & redirects"),
    ("takt_sequencer", "i_loop & i_short", "i_loop"),
    ("takt_sequencer", "x_loop ? x_next : x_target", "x_target"),
    ("takt_sequencer", "x_loop & loops_full", "1'b0"),
    ("takt_sequencer", "(|x_operand[31:16]) | (x_operand == 32'd0)", "x_operand == 32'd0"),
    ("takt_sequencer", "x_loop & loops_cut", "1'b0"),
    // Loops: the counts, the levels as of issue and as of fetch, the refill of a short body. The first is also refuted by the proof in CI.
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
    ("takt_loops", "r_target < r_address + SHORT", "r_target < r_address + SHORT - 16'd1"),
    ("takt_loops", "innermost_last >= x_address", "1'b1"),
    ("takt_loops", "innermost_last < x_target", "innermost_last < x_target - 16'd1"),
    ("takt_loops", "used & ~(used >> 1)", "used"),
    ("takt_issue", "refused <= next_valid & next_illegal & ~block", "refused <= 1'b0"),
    // The data memory.
    ("takt_memory", "above | ~upper", "above"),
    ("takt_memory", "x_store & ~(|fault) & ~cancel", "x_store & ~cancel"),
];

/// In the modules of which t3 is made, and in its own units.
#[rustfmt::skip]
const OF_T3: &[Fault] = &[
    ("takt_divroot", "a_sign_1 & ~a_zero & ~a_nan", "a_sign_1 & ~a_nan"),
    ("takt_arctangent", "sign & ~nan", "1'b0"),
    ("takt_arccosine", "negative_19 ? HALF_TURN - shifted : shifted", "shifted"),
    ("takt_hazard", "(|(hit >> MIDDLE)) | (|late_hit)", "|late_hit"),
    ("takt_hazard", "(|r_at2) | r_on_issue_early", "|r_at2"),
    ("takt_hazard", "m_at2 | (m_on_issue & i_early)", "m_at2"),
    ("takt_program", "{48-LOW{legal}}", "{48-LOW{1'b1}}"),
];

/// Likewise of t1.
#[rustfmt::skip]
const OF_T1: &[Fault] = &[
    ("takt_alu_late", "waiting[36*WAIT-1 -: 36]", "(waiting[36*WAIT-1 -: 36] & ~36'd8)"),
    ("takt_addmul", "sign5 & ~(zero5 & cancels5)", "sign5"),
    ("takt_recurrence", "is_signaling | b_signaling | undefined", "is_signaling | b_signaling"),
    ("takt_recurrence", "a_sign & ~is_zero & ~is_nan", "a_sign & ~is_nan"),
];

/// In the second port of the data memory, which t4 has.
#[rustfmt::skip]
const OF_T4: &[Fault] = &[
    ("takt_memory", "same ? read : second", "second"),
    ("takt_memory", "same ? read : second", "read"),
    ("takt_memory", "x_store & ~(|fault) & ~cancel", "x_store & ~fault[0] & ~cancel"),
    ("takt_sequencer", "address_first ? address_slot : OWN_SLOT", "OWN_SLOT"),
];

/// A fault whose text is made.
type MadeFault = (String, String, String);

/// In what is generated for t3, in the names of its plan.
fn generated_for_t3(plan: &Plan) -> Vec<MadeFault> {
    let (core, mul) = (plan.top(), plan.slot("mul").expect("t3's slot"));
    let writes = Expr::from(plan.writes_at(Stage::Issue)).any_bit();
    let kept = |kept: Expr| (net::STICKY & kept).to_string();
    // The product's write port is taken by the sine.
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
        // Of two operands, what is stray does not reach the decoder: `takt_program`.
        (plan.decoder(mul), decode::is_stray(Shape::Da).to_string(), "1'b0".to_owned()),
    ]
}

/// Likewise for t1: the write port that iterative units take.
fn generated_for_t1(plan: &Plan) -> Vec<MadeFault> {
    let one = plan.slot("one").expect("t1's slot");
    let taken =
        one.bit(Stage::Read, ControlBit::Result(ADDMUL.latency)) & any(one.booked(ADDMUL.latency + 1));
    vec![(plan.top(), format!("({taken})"), "1'b0".to_owned())]
}

/// Likewise for t4 with latched ports.
fn generated_for_latched(plan: &Plan) -> Vec<MadeFault> {
    let direct = Expr::from(&net::LATCHED).is(number(0));
    vec![
        (plan.top(), (direct | net::INPUTS_OPEN | net::RST).to_string(), "1'b1".to_owned()),
        (plan.top(), (net::INPUTS_TAKEN | net::RST).to_string(), net::RST.to_string()),
    ]
}

/// In what takes and publishes latched ports, on t4, whose outputs are written by four slots.
#[rustfmt::skip]
const OF_LATCHED: &[Fault] = &[
    ("takt_double_buffer", "flip ? shown ^ changed : shown", "shown"),
    ("takt_double_buffer", "now[index[BITS-1:0]] ^ ~open", "~now[index[BITS-1:0]]"),
    ("takt_double_buffer", "now[index[BITS-1:0]] ^ ~open", "now[index[BITS-1:0]]"),
    ("takt_double_buffer", "{PORTS{~flip & ~drop}}", "{PORTS{1'b1}}"),
    ("takt_double_buffer", "write[k] & ~open & (index >> BITS) == 0", "write[k] & (index >> BITS) == 0"),
    ("takt_outputs", "of_number == j[OWNER-1:0]", "1'b0"),
    ("takt_sequencer", "x_wait & ~fault", "x_wait & ~remembered & ~fault"),
    ("takt_source", "advance ? m_place : r_place", "1'b0"),
];

/// Random programs that a fault may pass before it counts as not found.
const PROGRAMS: u64 = 1000;

fn faults_are_found(
    machine: &'static Machine,
    latched: u16,
    faults: &[Fault],
    generated: fn(&Plan) -> Vec<MadeFault>,
) {
    let design = export(machine, &Library::builtin()).expect("every machine has a circuit");
    let mut design = Design { latched, ..design };
    let made = generated(&design.plan);
    let made = made.iter().map(|(module, from, to)| (module.as_str(), from.as_str(), to.as_str()));
    let faults: Vec<(&str, &str, &str)> = faults.iter().copied().chain(made).collect();
    verilator::plant(&mut design.files, &design.top, &faults).unwrap_or_else(|error| panic!("{error}"));
    let model = Model::build(&design, &folder(), false).unwrap_or_else(|error| panic!("{error}"));
    let mut survivors = Vec::new();
    for number in 0..=faults.len() {
        let argument = format!("+fault={number}");
        let mut simulation = model.start(&[argument.as_ref()]).unwrap_or_else(|error| panic!("{error}"));
        let mut found = None;
        for seed in 0..if number == 0 { 20 } else { PROGRAMS } {
            match random::run(seed, machine, simulation, &mut random::Coverage::default()) {
                Ok(again) => simulation = again,
                Err(LockstepError::Difference(difference)) => {
                    found = Some((seed, difference));
                    break;
                }
                Err(error) => panic!("{error}"),
            }
        }
        match (number.checked_sub(1).map(|index| faults[index]), found) {
            (None, None) => {}
            (None, Some((seed, difference))) => panic!("without a fault, seed {seed}: {difference}"),
            (Some(fault), None) => survivors.push(format!("{fault:?}")),
            (Some(fault), Some((seed, difference))) => {
                println!(
                    "{}: {} `{}`: program {seed}, cycle {}",
                    machine.name, fault.0, fault.1, difference.cycle
                );
            }
        }
    }
    assert!(survivors.is_empty(), "{}: not found:\n{}", machine.name, survivors.join("\n"));
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
fn planted_faults_in_latched_ports_and_in_the_second_port_are_found() {
    faults_are_found(&T4, T4.inputs.depth, &[OF_LATCHED, OF_T4].concat(), generated_for_latched);
}
