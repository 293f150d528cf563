// SPDX-License-Identifier: MIT OR Apache-2.0
//! Order of bundles: which one comes next, by jumps, branches, calls, returns and counted loops, and which faults there are.
//!
//! The reference executes one bundle after the other. It has the loops under way, and of the return stack one entry, an arbitrary one.
//! The core fetches ahead of issue; invariants say that the bundles in its stages are those which follow if nothing redirects.

use super::decoded::Decoded;
use super::invariants::inner;
use super::rules::{Reference, any};
use std::fmt::Write as _;
use takt_isa::Effect;
use takt_rtl::plan::names::net;
use takt_rtl::plan::{Plan, SlotPlan, Stage};

/// Stages from issue back to fetch, whose bundles follow one another.
const STAGES: [&str; 4] = ["i", "r", "m", "d"];
/// For each of them, a net: the bundle's address is outside of the program memory.
const OUTSIDE: [&str; 4] = ["f_i_outside", "f_r_outside", "f_m_outside", "d_outside"];
/// Instance of takt_loops.
const LOOPS: &str = "sequencer.g_loops.loops";

/// Adds the reference, its properties and invariants.
pub(super) fn add(plan: &Plan, of: &mut Reference) {
    let loops = plan.machine.loop_depth;
    execute(plan, of);
    levels(plan, loops, of);
    next(plan, loops, of);
    stack(plan, of);
    faults(plan, loops, of);
    stages(plan, loops, of);
    if loops > 0 {
        ahead(plan, loops, of);
    }
}

fn control(plan: &Plan) -> Decoded<'_> {
    Decoded { slot: plan.control(), stage: Stage::Issue }
}

/// The bundle in execute.
fn execute(plan: &Plan, of: &mut Reference) {
    let target = format!("{}[15:0]", control(plan).word());
    let _ = writeln!(
        of.text,
        "
    // The bundle in execute.
    reg [15:0] f_x_address, f_x_target;
    always @(posedge {}) begin f_x_address <= {}; f_x_target <= {target}; end",
        net::CLK,
        net::I_ADDRESS
    );
    let (address, to) = (net::X_ADDRESS.to_string(), of.seen("sequencer.x_target", "[15:0]"));
    of.equal("x_address", "f_live", &address, "f_x_address");
    of.equal("x_target", "f_live & f_issued1", &to, "f_x_target");
}

/// Bits of a level.
fn level(vector: &str, k: u32) -> String {
    format!("{vector}[{} +: 16]", 16 * k)
}

/// Value of the level that a one-hot vector chooses.
fn chosen(vector: &str, top: &str, loops: u32) -> String {
    any((0..loops).map(|k| format!("({{16{{{top}[{k}]}}}} & {})", level(vector, k))))
}

/// Loops under way: level 0 is the outermost. `_1`: with the `loop` that is in execute.
fn levels(plan: &Plan, loops: u32, of: &mut Reference) {
    if loops == 0 {
        of.text += "    wire f_ends = 1'b0, f_more = 1'b0;\n    wire [15:0] f_start = 16'd0;\n";
        return;
    }
    let (clk, last, bits, count) = (net::CLK, loops - 1, 16 * loops - 1, plan.control().operand(0));
    let _ = writeln!(
        of.text,
        "
    // Loops under way.
    reg  [{last}:0] f_used;
    reg  [{bits}:0] f_firsts, f_lasts, f_lefts;
    wire [{last}:0] f_top = f_used & ~(f_used >> 1);
    wire [{last}:0] f_new = {{{loops}{{f_x_loop}}}} & ((f_used << 1) | {loops}'d1) & ~f_used;
    wire [{last}:0] f_used_1 = f_used | f_new;
    wire [{last}:0] f_top_1 = f_used_1 & ~(f_used_1 >> 1);
    wire [{bits}:0] f_firsts_1, f_lasts_1, f_lefts_1;"
    );
    for k in 0..loops {
        for (vector, value) in [
            ("f_firsts", "f_x_address + 16'd1".to_owned()),
            ("f_lasts", "f_x_target - 16'd1".to_owned()),
            ("f_lefts", format!("{count}[15:0]")),
        ] {
            let _ = writeln!(
                of.text,
                "    assign {} = f_new[{k}] ? {value} : {};",
                level(&format!("{vector}_1"), k),
                level(vector, k)
            );
        }
    }
    let _ = writeln!(
        of.text,
        "    wire f_ends = f_used_1[0] & ({address} == {});
    wire f_more = {} != 16'd1;
    wire [15:0] f_start = {};
    always @(posedge {clk}) begin
        f_used   <= f_issues & f_ends & ~f_more ? f_used_1 >> 1 : f_used_1;
        f_firsts <= f_firsts_1;
        f_lasts  <= f_lasts_1;
        f_lefts  <= f_lefts_1;",
        chosen("f_lasts_1", "f_top_1", loops),
        chosen("f_lefts_1", "f_top_1", loops),
        chosen("f_firsts_1", "f_top_1", loops),
        address = net::I_ADDRESS,
    );
    for k in 0..loops {
        let _ = writeln!(
            of.text,
            "        if (f_issues & f_ends & f_more & f_top_1[{k}]) {} <= {} - 16'd1;",
            level("f_lefts", k),
            level("f_lefts_1", k)
        );
    }
    let _ = writeln!(of.text, "        if ({}) f_used <= {loops}'d0;\n    end", net::RST);
}

/// Address of the bundle that comes next.
fn next(plan: &Plan, loops: u32, of: &mut Reference) {
    let effect = |effect| control(plan).effect(effect);
    let jumps = any([Effect::Jump, Effect::Call, Effect::Wait].map(effect));
    let _ = writeln!(
        of.text,
        "
    // The next bundle; f_known: its address is, as that of every return but one to the entry that is not looked at.
    reg [15:0] f_next;
    reg f_known;
    wire [15:0] f_target = {word}[15:0];
    always @(posedge {clk}) begin
        if (f_redirected) begin f_next <= f_x_target; f_known <= 1'b1; end
        if (f_x_return) begin f_next <= f_after; f_known <= f_depth == {{1'b0, f_level}} + 1'b1; end
        if (f_issues) begin
            f_next  <= {jumps} ? f_target : f_ends & f_more ? f_start : {address} + 16'd1;
            f_known <= ~{return_};
        end
        if ({rst}) begin f_next <= 16'd0; f_known <= 1'b1; end
    end",
        word = control(plan).word(),
        clk = net::CLK,
        address = net::I_ADDRESS,
        return_ = effect(Effect::Return),
        rst = net::RST,
    );
    of.promise(
        "the bundle that issues is the next one",
        "f_live & f_issues & f_known",
        &net::I_ADDRESS.to_string(),
        "f_next",
    );
    let short = of.seen("sequencer.i_short", "");
    let body =
        format!("({{1'b0, f_target}} < {{1'b0, {}}} + 17'd{})", net::I_ADDRESS, plan.machine.refill + 1);
    if loops > 0 {
        of.promise(
            "a loop is short if its body has fewer bundles than the refill has cycles",
            &format!("f_live & f_issues & {}", effect(Effect::Loop)),
            &short,
            &body,
        );
        let ends = of.seen("sequencer.i_ends", "");
        of.promise(
            "a bundle ends a loop if it is the last one of the innermost",
            "f_live & f_issues & ~f_cuts",
            &ends,
            "f_ends",
        );
    }
}

/// Return stack: an arbitrary entry.
fn stack(plan: &Plan, of: &mut Reference) {
    let (clk, depth, bits) = (net::CLK, plan.machine.stack_depth, plan.machine.stack_depth.trailing_zeros());
    of.constants.push("f_level".to_owned());
    let _ = writeln!(
        of.text,
        "
    // Calls under way, and the bundle after an arbitrary one.
    wire [{last}:0] f_level;
    reg [{bits}:0] f_depth;
    reg [15:0] f_after;
    wire f_stack_full  = f_x_call & (f_depth == {width}'d{depth});
    wire f_stack_empty = f_x_return & (f_depth == {width}'d0);
    always @(posedge {clk}) begin
        if (f_x_call) begin
            f_depth <= f_depth + 1'b1;
            if (f_depth == {{1'b0, f_level}}) f_after <= f_x_address + 16'd1;
        end
        if (f_x_return) f_depth <= f_depth - 1'b1;
        if ({rst}) f_depth <= {width}'d0;
    end",
        last = bits - 1,
        width = bits + 1,
        rst = net::RST
    );
    let entries = of.seen("sequencer.entries", &format!("[{bits}:0]"));
    let top = of.seen("sequencer.top", &format!("[{}:0]", bits - 1));
    of.equal("entries", "f_live", &entries, "f_depth");
    of.equal("top", "f_live", &top, &format!("f_depth[{}:0] - 1'b1", bits - 1));
    of.never("f_depth", &format!("f_live & f_depth > {}'d{depth}", bits + 1));
    let words: Vec<String> =
        (0..depth).rev().map(|entry| of.seen(&format!("sequencer.stack[{entry}]"), "[15:0]")).collect();
    let _ = writeln!(
        of.text,
        "    wire [{}:0] f_stack = {{{}}};\n    wire [15:0] f_entry = f_stack[16*f_level +: 16];",
        16 * depth - 1,
        words.join(", ")
    );
    of.equal("stack", "f_live & ({1'b0, f_level} < f_depth)", "f_entry", "f_after");
}

/// Faults, each reported two cycles after the issue of its bundle.
fn faults(plan: &Plan, loops: u32, of: &mut Reference) {
    let count = plan.control().operand(0);
    let old = if loops > 0 { chosen("f_lasts", "f_top", loops) } else { "16'd0".to_owned() };
    let (used, full) =
        if loops > 0 { ("f_used[0]", format!("f_used[{}]", loops - 1)) } else { ("1'b0", "1'b0".to_owned()) };
    let addresses: Vec<String> = (0..plan.ports()).map(|port| format!("f_x_port{port}_fault")).collect();
    let _ = writeln!(
        of.text,
        "
    // Faults of the bundle in execute.
    reg f_x_refused, f_faults;
    reg [15:0] f_fault_address;
    wire f_loop_full  = f_x_loop & {full};
    wire f_loop_count = f_x_loop & ((|{count}[31:16]) | ({count} == 32'd0));
    wire f_cuts       = f_x_loop & {used} & ({old} >= f_x_address) & ({old} < f_x_target);
    wire f_at_fault   = f_x_refused | f_nested | f_stack_full | f_stack_empty | f_loop_full | f_loop_count | f_cuts | {};
    always @(posedge {clk}) begin
        f_x_refused     <= f_refuses;
        f_faults        <= f_faults | f_at_fault;
        if (~{fault}) f_fault_address <= f_x_address;
        if ({rst}) begin f_x_refused <= 1'b0; f_faults <= 1'b0; end
    end",
        any(addresses),
        clk = net::CLK,
        rst = net::RST,
        fault = net::FAULT
    );
    of.promise(
        "a fault is reported two cycles after its bundle has issued, and no other",
        "f_runs",
        &net::FAULT.to_string(),
        "f_faults",
    );
    of.promise(
        "the address of a fault is that of its bundle",
        &format!("~{} & {}", net::RST, net::FAULT),
        &net::FAULT_ADDRESS.to_string(),
        "f_fault_address",
    );
    kinds(plan, of);
    let refused = inner(of, "sequencer", "x_refused");
    of.equal("x_refused", "f_live", &refused, "f_x_refused");
    for name in ["x_call", "x_return", "x_loop", "nested", "if_zero", "if_nonzero"] {
        let own = format!("f_{name}");
        of.never("only what issues redirects", &format!("~{} & {own} & ~f_issued1", net::RST));
    }
    of.never("one redirection", "f_live & ((f_x_call & (f_x_return | f_x_loop)) | (f_x_return & f_x_loop))");
}

/// Kind and slot of a fault: those of the bundle's first slot at fault.
fn kinds(plan: &Plan, of: &mut Reference) {
    let illegal =
        |slot: &SlotPlan| format!("(~{} | f_i_outside)", Decoded { slot, stage: Stage::Issue }.legal());
    let first = plan
        .slots
        .iter()
        .rev()
        .fold("3'd0".to_owned(), |next, slot| format!("{} ? 3'd{} : {next}", illegal(slot), slot.number));
    let own = "f_nested ? 3'd7 : f_stack_full ? 3'd3 : f_stack_empty ? 3'd4 : f_loop_full ? 3'd5 : f_loop_count ? 3'd6 : 3'd7";
    let at_control = "(f_nested | f_stack_full | f_stack_empty | f_loop_full | f_loop_count | f_cuts)";
    let mut found = "6'd0".to_owned();
    for slot in plan.slots.iter().rev() {
        let number = slot.number;
        if let Some(port) = plan.port_of(slot) {
            found = format!("f_x_port{port}_fault ? {{3'd2, 3'd{number}}} : {found}");
        }
        if number as usize == plan.control_slot {
            found = format!("{at_control} ? {{{own}, 3'd{number}}} : {found}");
        }
    }
    let _ = writeln!(
        of.text,
        "
    // Kind and slot of a fault.
    reg [2:0] f_illegal_slot, f_kind, f_slot;
    always @(posedge {clk}) begin
        f_illegal_slot   <= {first};
        if (~{fault}) {{f_kind, f_slot}} <= f_x_refused ? {{3'd1, f_illegal_slot}} : {found};
    end",
        clk = net::CLK,
        fault = net::FAULT
    );
    let when = format!("~{} & {}", net::RST, net::FAULT);
    of.promise(
        "the kind of a fault is that of its bundle's first slot at fault",
        &when,
        &net::FAULT_KIND.to_string(),
        "f_kind",
    );
    of.promise("the slot of a fault is the first at fault", &when, &net::FAULT_SLOT.to_string(), "f_slot");
    let slot = of.seen("sequencer.x_illegal_slot", "[2:0]");
    of.equal("x_illegal_slot", "f_live & f_x_refused", &slot, "f_illegal_slot");
}

/// Addresses in the stages: each bundle follows the one before it, and the first is the next one.
fn stages(plan: &Plan, loops: u32, of: &mut Reference) {
    let bits = plan.code_bits;
    let mut addresses: Vec<String> = STAGES.iter().map(|stage| address(of, stage)).collect();
    addresses.push(of.seen("sequencer.fetched", "[15:0]"));
    let valid: Vec<String> =
        ["i", "r", "m", "d", "f"].map(|stage| inner(of, "issuing", &format!("{stage}_valid"))).into();
    let is_outside =
        |address: &str| if bits < 16 { format!("(|{address}[15:{bits}])") } else { "1'b0".to_owned() };
    for (place, own) in OUTSIDE.iter().enumerate() {
        of.equal("outside", &format!("f_filled & {}", valid[place]), own, &is_outside(&addresses[place]));
    }
    // The target of a redirection on its way: before the flush in the sequencer's registers, then in fetch, and from stage to stage.
    let refill = plan.machine.refill;
    let target = of.seen("sequencer.target", "[15:0]");
    let way = "f_live & f_squash & f_known";
    let to = of.seen("sequencer.x_target", "[15:0]");
    of.equal(
        "x_target",
        &format!("f_live & f_squash & f_known & f_left == 4'd{refill} & ~f_x_return & ~f_x_loop"),
        &to,
        "f_next",
    );
    of.equal("target", &format!("{way} & f_left == 4'd{}", refill - 1), &target, "f_next");
    for (place, left) in [(4, refill - 2), (3, refill - 3), (2, refill - 4), (1, refill - 5)] {
        of.equal("on its way", &format!("{way} & f_left == 4'd{left}"), &addresses[place], "f_next");
    }
    of.equal("in issue", &format!("f_live & f_filled & {} & f_known", valid[0]), &addresses[0], "f_next");
    of.never("a return", "f_live & ~f_known & ~f_squash");
    let issued = format!("(f_squash & f_left == 4'd{refill})");
    of.never("a return", &format!("f_live & f_x_return & (f_known | ~{issued})"));
    of.never("a call", &format!("f_live & f_x_call & ~{issued}"));
    of.never("a loop", &format!("f_live & f_x_loop & ~({issued} | (~f_squash & f_left == 4'd0))"));
    of.never("f_known", "f_live & f_x_loop & ~f_known");
    of.never(
        "f_redirected",
        "f_live & (f_if_zero | f_if_nonzero) & (~f_known | f_x_return | f_x_loop | f_x_call)",
    );
    of.equal("f_x_loop", "f_live & f_x_loop & ~f_nested", "f_next", "f_x_address + 16'd1");
    let more =
        |stage: usize| if loops > 0 { format!("f_again_{}", STAGES[stage]) } else { "1'b0".to_owned() };
    let start =
        |stage: usize| if loops > 0 { format!("f_first_{}", STAGES[stage]) } else { "16'd0".to_owned() };
    if loops > 0 {
        looked(loops, of);
    }
    for place in 0..4 {
        let older = beyond(&valid, place + 1);
        let follows = format!("{} ? {} : {} + 16'd1", more(place), start(place), addresses[place]);
        of.equal(
            "the bundle after",
            &format!("f_live & f_filled & {} & {} & ~{older}", valid[place], valid[place + 1]),
            &addresses[place + 1],
            &follows,
        );
    }
}

/// Condition: one of the first stages has a bundle from outside of the program memory. Nothing behind it ever issues.
fn beyond(valid: &[String], stages: usize) -> String {
    any(OUTSIDE[..stages].iter().zip(valid).map(|(own, valid)| format!("({own} & {valid})")))
}

/// Address of the bundle in a stage.
fn address(of: &mut Reference, stage: &str) -> String {
    match stage {
        "i" => net::I_ADDRESS.to_string(),
        _ => of.seen(&format!("sequencer.{stage}_address"), "[15:0]"),
    }
}

/// Loops as of each stage: those under way, less those that end before it.
fn looked(loops: u32, of: &mut Reference) {
    let last = loops - 1;
    let mut used = "f_used".to_owned();
    let mut counts = vec!["3'd0".to_owned(); loops as usize];
    for stage in STAGES.into_iter().chain(["f"]) {
        let top = format!("f_top_{stage}");
        let left = counts.iter().enumerate().map(|(k, count)| {
            format!("({{16{{{top}[{k}]}}}} & ({} - {{13'd0, {count}}}))", level("f_lefts", k as u32))
        });
        let _ = writeln!(
            of.text,
            "    wire [{last}:0] f_used_{stage} = {used};
    wire [{last}:0] {top} = f_used_{stage} & ~(f_used_{stage} >> 1);
    wire [15:0] f_last_{stage} = {};
    wire [15:0] f_left_{stage} = {};
    wire [15:0] f_first_{stage} = {};",
            chosen("f_lasts", &top, loops),
            any(left),
            chosen("f_firsts", &top, loops),
        );
        if stage == "f" {
            break;
        }
        let valid = inner(of, "issuing", &format!("{stage}_valid"));
        let [ends, again] = ["ends", "again"].map(|name| inner(of, LOOPS, &format!("{stage}_{name}")));
        let _ = writeln!(
            of.text,
            "    wire f_again_{stage} = {valid} & {again};\n    wire f_pops_{stage} = {valid} & {ends} & ~{again};"
        );
        for (k, count) in counts.iter_mut().enumerate() {
            let next = format!("f_count_{stage}_{k}");
            let _ = writeln!(
                of.text,
                "    wire [2:0] {next} = {count} + {{2'd0, f_again_{stage} & {top}[{k}]}};"
            );
            *count = next;
        }
        used = format!("(f_pops_{stage} ? f_used_{stage} >> 1 : f_used_{stage})");
    }
}

/// The registers of takt_loops.
fn ahead(plan: &Plan, loops: u32, of: &mut Reference) {
    let (bits, last) = (plan.code_bits, loops - 1);
    let used = of.seen(&format!("{LOOPS}.used"), &format!("[{last}:0]"));
    of.equal("used", "f_live", &used, "f_used");
    of.never("levels in use", &format!("f_live & (f_used & ~((f_used << 1) | {loops}'d1)) != {loops}'d0"));
    let innermost = of.seen(&format!("{LOOPS}.innermost_last"), "[15:0]");
    of.equal("innermost_last", "f_live & f_used[0]", &innermost, &chosen("f_lasts", "f_top", loops));
    let valid: Vec<String> =
        STAGES.iter().map(|stage| inner(of, "issuing", &format!("{stage}_valid"))).collect();
    let outside = |stages: usize| beyond(&valid, stages);
    let in_memory =
        |address: &str| if bits < 16 { format!("~|{address}[15:{bits}]") } else { "1'b1".to_owned() };
    for k in 0..loops {
        let at = format!("{LOOPS}.g_level[{k}]");
        let (first, ends, left) = (
            of.seen(&format!("{at}.first"), &format!("[{}:0]", bits - 1)),
            of.seen(&format!("{at}.last"), "[15:0]"),
            of.seen(&format!("{at}.left"), "[15:0]"),
        );
        let (few, begun) = (inner(of, &at, "few"), of.seen(&format!("{at}.begun"), "[2:0]"));
        let when = format!("f_live & f_used[{k}]");
        of.equal("first", &when, &first, &format!("f_firsts[{} +: {bits}]", 16 * k));
        of.equal("last", &when, &ends, &level("f_lasts", k));
        of.equal("left", &when, &left, &level("f_lefts", k));
        of.never("left", &format!("{when} & ({} == 16'd0)", level("f_lefts", k)));
        of.never("few", &format!("{when} & ({few} ? {left} >= 16'd16 : {left} < 16'd15)"));
        let all = format!("f_live & f_filled & ~{}", outside(4));
        of.equal("begun", &format!("{all} & f_used[{k}]"), &begun, &format!("f_count_d_{k} + 3'd1"));
        of.never(
            "begun",
            &format!("{all} & f_used[{k}] & ({} <= {{13'd0, f_count_d_{k}}})", level("f_lefts", k)),
        );
        // A first bundle outside of the memory is the next one, and illegal.
        if bits < 16 {
            let beyond = format!("(|f_firsts[{}:{}])", 16 * k + 15, 16 * k + bits);
            of.never(
                "a first bundle outside",
                &format!("{when} & {beyond} & ~(f_known & f_next == {} & ~f_issued1)", level("f_firsts", k)),
            );
        }
    }
    for (place, stage) in STAGES.iter().enumerate() {
        let (ends, again) =
            (inner(of, LOOPS, &format!("{stage}_ends")), inner(of, LOOPS, &format!("{stage}_again")));
        let address = address(of, stage);
        let when = format!("f_live & f_filled & {} & ~{}", valid[place], outside(place + 1));
        of.equal("ends", &when, &ends, &format!("f_used_{stage}[0] & ({address} == f_last_{stage})"));
        of.equal("again", &when, &again, &format!("{ends} & (f_left_{stage} != 16'd1)"));
    }
    let fetching = inner(of, "issuing", "f_valid");
    let when = format!("f_live & f_filled & {fetching} & ~{}", outside(4));
    let register =
        |of: &mut Reference, name: &str| of.seen(&format!("{LOOPS}.{name}"), &format!("[{}:0]", bits - 1));
    let all = of.seen(&format!("{LOOPS}.ahead"), &format!("[{last}:0]"));
    let (first, end) = (register(of, "ahead_first"), register(of, "ahead_last"));
    let (armed, more) = (inner(of, LOOPS, "armed"), inner(of, LOOPS, "ahead_more"));
    of.equal("ahead", &when, &all, "f_used_f");
    of.equal("armed", &when, &armed, &format!("f_used_f[0] & {}", in_memory("f_last_f")));
    let within = format!("{when} & f_used_f[0]");
    of.equal("ahead_first", &within, &first, &format!("f_first_f[{}:0]", bits - 1));
    of.equal("ahead_last", &within, &end, &format!("f_last_f[{}:0]", bits - 1));
    of.equal("ahead_more", &within, &more, "f_left_f != 16'd1");
    let short = of.seen("sequencer.i_short", "");
    let body =
        format!("({{1'b0, f_target}} < {{1'b0, {}}} + 17'd{})", net::I_ADDRESS, plan.machine.refill + 1);
    of.equal("i_short", &format!("f_live & f_filled & {} & f_i_legal", valid[0]), &short, &body);
    // A long loop in execute: its body reaches beyond what has been fetched.
    of.never(
        "a long loop",
        &format!(
            "f_live & f_x_loop & ~f_squash & ({{1'b0, f_x_target}} < {{1'b0, f_x_address}} + 17'd{})",
            plan.machine.refill + 1
        ),
    );
}
