// SPDX-License-Identifier: MIT OR Apache-2.0
//! Faults planted in the circuits, which the units' test must find: each is an edit of a single place in a unit's file, or in a file that
//! the unit shares with others.
//!
//! A run without variables plants the first fault of each unit, and the faults that only directed operands find; `TAKT_FULL=1` plants all
//! faults, and `TAKT_FAULTS=fused` all faults of a single unit.

use crate::harness::{Simulation, circuit, full, library};
use takt_isa::{UNITS, Unit};
use takt_rtl::{Circuit, Library};

/// A unit, the text that is replaced, which occurs once in the unit's files, and the text that takes its place.
type Fault = (&'static str, &'static str, &'static str);

#[rustfmt::skip]
const FAULTS: &[Fault] = &[
    // Faults in the sum's sticky bit, tie to even, subnormals, infinities, flags.
    ("add", "shift5[0] | lost}", "shift5[0]}"),
    ("add", "sum[3] & ((|sum[2:0]) | sum[4])", "sum[3] & ((|sum[2:0]) | 1'b1)"),
    ("add", "(distance1[2] & (|shift2[3:0]))", "(distance1[2] & (|shift2[3:1]))"),
    ("add", "(a_small ^ b_small) ?", "1'b0 ?"),
    ("add", "count2         <= difference | stop", "count2         <= difference"),
    ("add", "((i == 0) & (exponent1 == 8'd0))", "1'b0"),
    ("add", "sign2 & ~(near_taken2 & ~|near2)", "sign2"),
    ("add", "close & ~difference[24]", "close"),
    ("add", "(top & top_overflows2);", "1'b0;"),
    ("add", "up3 & (far_exponent3 == 8'd253) & (&far3)", "1'b0"),
    ("add", "(opposed & ~a_nan & ~b_nan)", "opposed"),
    ("add", "valid3    <= valid2", "valid3    <= valid1"),
    ("add", "sign1      <= b_larger ? b_sign : a[31]", "sign1      <= b_larger ? b[31] : a[31]"),
    // Faults in alignment, lost bits, either shift's ends, conversions, the place where the shift to the left stops, zero, infinities,
    // flags.
    ("addmul", "{converts, b[30:0]}", "{1'b0, b[30:0]}"),
    ("addmul", "from_integer ? a[23] : ~a_small", "~a_small"),
    ("addmul", "if (multiplies | converts) l1 <= 24'd0;", "if (multiplies) l1 <= 24'd0;"),
    ("addmul", "if (~from_integer) above1 <= 8'd0;", ""),
    ("addmul", "-10'd157", "-10'd158"),
    ("addmul", "multiplies1 | converts1 | distance1[9]", "multiplies1 | distance1[9]"),
    ("addmul", "(b_sign & ~converts)", "b_sign"),
    ("addmul", "(improper & ~a_nan & ~b_nan)", "improper"),
    ("addmul", "(b_special & a_small & a_empty)", "1'b0"),
    ("addmul", "if (~multiplies1) {s2[7:0], below2} <= 23'd0;", ""),
    ("addmul", "distance[9] ? to_integer1 : ~integers1 & (|distance[8:5])", "~integers1 & (|distance[8:5])"),
    ("addmul", "distance[9] ? to_integer1 : ~integers1 & (|distance[8:5])", "distance[9] & to_integer1"),
    ("addmul", "exponent2 <= 8'd157;", "exponent2 <= 8'd158;"),
    ("addmul", "too_large ? high1 : subtracts1", "subtracts1"),
    ("addmul", "~a[31] | a_nan", "~a[31]"),
    ("addmul", "& ~(sign1 & empty1 & (distance == 10'h3ff))", ""),
    ("addmul", "(right2[2] & (|by8[3:0]))", "(right2[2] & (|by8[3:1]))"),
    ("addmul", "{above2[36:33], by8[32:4]}", "{4'd0, by8[32:4]}"),
    ("addmul", "(right2[0] & by2[0])", "1'b0"),
    ("addmul", "& {9{distance2[9]}}", ""),
    ("addmul", "half & (lost3 | odd)", "half & lost3"),
    ("addmul", "subtracts3 & ~lost3", "subtracts3"),
    ("addmul", "(~bytes2 & (|below4[6:0]))", "1'b0"),
    ("addmul", "(|exponent3[8:5]) | (&exponent3[4:3])", "|exponent3[8:5]"),
    ("addmul", "none3 & none2 & allowed4[2]", "none3 & none2"),
    ("addmul", "(~bytes1 & (|below4[14:7]))", "1'b0"),
    ("addmul", "sum4[32] ^ saturates4", "sum4[32]"),
    ("addmul", "(exponent5[2:0] >= i)", "(exponent5[2:0] > i)"),
    ("addmul", "~moved5[30] & at_least[3]", "~moved5[30] & at_least[1]"),
    ("addmul", "moved2[32]) & ~to_integer5", "moved2[32])"),
    ("addmul", "(moved2[7] & ~left1)", "1'b0"),
    ("addmul", "left6     <= 3'd0;", ""),
    ("addmul", "sign5 & ~(zero5 & cancels5)", "sign5"),
    ("addmul", "(lost6 | number6[9]) & ~to_integer6", "(lost6 | number6[9])"),
    ("addmul", "(is_254 & ~|left6)", "is_254"),
    ("addmul", "overflows | (&rounded[31:24])", "overflows"),
    ("addmul", "{valid, in_valid}", "{valid[5:1], in_valid, in_valid}"),
    ("addmul", "{ones1, 5'd0}", "{ones1, 5'd1}"),
    // Faults in products of integers: signs, shift, places of the result, specials.
    ("addmul", "({8{integers & b[23]}} & a[7:0])", "8'd0"),
    ("addmul", "l1[16:9] - excess1", "l1[16:9]"),
    ("addmul", "integers ? a[23] : ~a_small", "~a_small"),
    ("addmul", "of_floats & (a_special | b_special)", "~converts & (a_special | b_special)"),
    ("addmul", "~distance[9] & ~integers1", "~distance[9]"),
    ("addmul", "~integers1 & (|distance[8:5])", "(|distance[8:5])"),
    ("addmul", "| {2{integers4}}", ""),
    ("addmul", "integers4 ? {1'b0, sum4[15:8]} :", ""),
    ("addmul", "to_integer4 | integers4", "to_integer4"),
    ("addmul", "integers4 ? sum4[16] : sign4", "sign4"),
    // Faults in rounding in either place, the shift's ends, the exponent's limits, a partial product.
    ("multiply", "(shift2[5] & (|shift0[53:22]))", "(shift2[5] & (|shift0[53:24]))"),
    ("multiply", "shifted3[22] & (lost3 | shifted3[23])", "shifted3[22]"),
    ("multiply", "|deep[9:6] ? 6'd63 : deep[5:0]", "deep[5:0]"),
    ("multiply", "5'd23 - zeros1", "5'd23"),
    ("multiply", "a[23] | a_small}", "a[23]}"),
    ("multiply", "infinite2 | (field2 >= 9'd254)", "infinite2"),
    ("multiply", "up & (&kept) & (top ? field_252 : field_253 & shifted3[46])", "1'b0"),
    ("multiply", "{1'd0, x & {5{y[4]}}, 4'd0}", "{1'd0, x & {5{y[4]}}, 4'd1}"),
    ("multiply", "{1'd0, a[23] & b[23], y", "{1'd0, 1'b1, y"),
    ("multiply", "(a_special & b_zero) | (a_zero & b_special)", "a_special & b_zero"),
    ("multiply", "zero2     <= zero1", "zero2     <= 1'b0"),
    ("multiply", "~top & shifted3[46]", "~top"),
    ("multiply", "op ? a[23] : ~a_small", "~a_small"),
    ("multiply", "integer1 ? 6'd0 : ~subnormal", "~subnormal"),
    ("multiply", "product2[31:24] - excess2", "product2[31:24]"),
    ("multiply", "({8{b[23]}} & a[7:0])", "({8{b[23]}} & b[7:0])"),
    ("multiply", "& {3{~integer3}}", ""),
    // Faults in the fused unit: C's sticky bit, the window's ends, the sum's direction, limits of the count, rounding, signs, flags, a
    // product or sum alone.
    ("fused", "(at_48 & (|by4[10:0]))", "(at_48 & (|by4[10:1]))"),
    ("fused", "(at_64 & (|by4[26:0]))", "1'b0"),
    ("fused", "(beyond & (|c1))", "1'b0"),
    ("fused", "distance[9] | a_zero | y_zero", "distance[9] | a_zero"),
    ("fused", "distance[9] | a_zero | y_zero", "distance[9] | y_zero"),
    ("fused", "- 10'd100;", "- 10'd99;"),
    ("fused", "z_exponent - 8'd1", "z_exponent"),
    ("fused", "y[23] | y_small}", "y[23]}"),
    ("fused", "minus2 & ~lost2}", "minus2}"),
    ("fused", "minus2 & ~plain[76]", "1'b0"),
    ("fused", "swap ? ~plain[75:0] : sum", "swap ? ~sum : sum"),
    ("fused", "swap ? z_sign2 : p_sign2", "p_sign2"),
    ("fused", "above2[8:2] == i;", "above2[7:2] == i;"),
    ("fused", "(|sum3[75 - 4*i -: 4]) | stop3[i]", "(|sum3[75 - 4*i -: 4])"),
    ("fused", "{1'b0, stop3[18:16]}", "4'd0"),
    ("fused", "{after[19], after[18], after[17], after[16]}", "4'd0"),
    ("fused", "lost3 | group_after[nibble]", "group_after[nibble]"),
    ("fused", "sign3 & ~(minus3 & ~infinite3 & ~|some)", "sign3 & ~(minus3 & ~|some)"),
    ("fused", "sign3 & ~(minus3 & ~infinite3 & ~|some)", "sign3"),
    ("fused", "limited4 & (above4[1:0] == 2'd1)", "1'b0"),
    ("fused", "|shifted4[4:0]}", "|shifted4[4:1]}"),
    ("fused", "kept[0] & (rest | lost4 | kept[1])", "kept[0] & (rest | lost4)"),
    ("fused", "field[8] | (field[7:0] >= 8'd254)", "field[8]"),
    ("fused", "(field == 9'd253) & up & (&kept[24:1])", "1'b0"),
    ("fused", "too_large & ~zero4)", "too_large)"),
    ("fused", "infinite1 & ~p_infinite1 ? z_sign1 : p_sign1", "p_sign1"),
    ("fused", "signaling | improper", "signaling | (improper & ~any_nan)"),
    ("fused", "(opposed & ~any_nan)", "opposed"),
    ("fused", "op[2] ? p_sign :", "1'b0 ? p_sign :"),
    ("fused", "op[3] ? 32'h3f800000 : b", "b"),
    ("fused", "a[31] ^ y[31] ^ op[1]", "a[31] ^ y[31]"),
    ("fused", "{6'd0, high_low[23:0]}", "{6'd0, high_low[22:0], 1'b0}"),
    ("fused", "valid4    <= valid3", "valid4    <= valid2"),
    ("fused", "integers ? a[23] : ~a_small", "~a_small"),
    ("fused", "integers ? 9'd41 : distance[8:0]", "distance[8:0]"),
    ("fused", "~integers & (distance[9]", "(distance[9]"),
    ("fused", "minus | integers;", "minus;"),
    ("fused", "& ~integers2;", ";"),
    ("fused", "product4  <= sum3[33:2]", "product4  <= sum3[34:3]"),
    ("fused", "~zero4 & ~integers4 &", "~zero4 &"),
    // Faults in ties, -2^31, values below one half, the direction of saturation.
    ("convert", "half2 & (lost2 | (addend2[0] ^ sign2))", "half2 & (lost2 | addend2[0])"),
    ("convert", "(shift1[0] & by2[0])", "1'b0"),
    ("convert", "& (x != 32'hcf000000)", ""),
    ("convert", "exponent < 8'd126", "exponent < 8'd125"),
    ("convert", "x[31] & ~nan", "x[31]"),
    ("convert", "none & ~x[31]", "1'b0"),
    ("convert", "up ^ sign2}", "up}"),
    ("convert", "op0    <= op[0]", "op0    <= to_integer ^ op[0]"),
    // Faults in the order of zeros, shifts, NaN, the last step of a shift, comparison of negative numbers.
    ("alu", "unlike ? b[31] : ~a[31]", "unlike ? a[31] : ~a[31]"),
    ("alu", "is_shift & op[1] & a[31]", "is_shift & op[1]"),
    ("alu", "b[4] ^ (left & (|b[3:0]))", "b[4] ^ (left & (|b[3:1]))"),
    ("alu", "b[4:0] <= 31 - i", "b[4:0] < 31 - i"),
    ("alu", "is_sel & a[31]", "1'b0"),
    ("alu", "(is_float & a_zero)", "1'b0"),
    ("alu", "is_float & a[31];", "1'b0;"),
    ("alu", "(ordered & any_nan)", "(ordered & any_snan)"),
    ("alu", "(b_nan & ~is_sign)", "b_nan"),
    ("alu", "~(is_float & any_nan)", "1'b1"),
    ("alu", "^ minus ^ low_sum[32]", "^ minus"),
    ("alu", "1'b1} + {1'b0, b[30:0]", "1'b0} + {1'b0, b[30:0]"),
    ("alu", "op[1] ? b[31] : a[31], b[30:0]}", "b[31], b[30:0]}"),
    ("alu_late", "localparam WAIT = LATENCY - 2", "localparam WAIT = LATENCY - 3"),
    // Faults in ties of subnormal quotients, bits that the alignment shifts low, digits, the table, operations that mix, flags.
    ("divroot", "subnormal_9 & ~s_9[1]", "1'b0"),
    ("divroot", "{residual_7[16:0], x_7}", "{residual_7[16:0], 10'd0}"),
    ("divroot", "{root_part, 11'h7ff}", "{root_part, 11'h000}"),
    ("divroot", "{1'b1, coarse_3} - {10'b0, fine_3}", "{1'b1, coarse_3}"),
    ("divroot", "less_3 & ~subnormal", "less_3"),
    ("divroot", "(subnormal & |right_3[8:5])", "1'b0"),
    ("divroot", "(~root[1] & b_signaling)", "b_signaling"),
    ("divroot", "& ~a_infinite & ~a_nan;", "& ~a_nan;"),
    ("divroot", "(exponent[8] | &exponent[7:0])", "exponent[8]"),
    ("divroot", "root[8] ? {14'b0, q2_8, 1'b0}", "root[9] ? {14'b0, q2_8, 1'b0}"),
    ("divroot", "b_zeros & {5{~root[1]}}", "b_zeros"),
    ("divroot", "s_9[0] ? upper : s_9[24:1]", "s_9[24:1]"),
    ("divroot", "~(a_exponent_1[0] ^ a_zeros[0])", "~a_exponent_1[0]"),
    ("divroot", "a_sign_1 & ~a_zero & ~a_nan", "a_sign_1 & ~a_nan"),
    ("divroot", "subnormal_9 & lower[23]", "1'b0"),
    ("divroot", "{residual_7[16:0], x_7}", "{residual_7[16:0], x_7 & 10'h3fe}"),
    ("divroot", "out_valid <= valid[9]", "out_valid <= valid[8]"),
    // Faults in stickiness, the alignment of subnormal quotients, digits, parity, exponents, flags, the least interval.
    ("recurrence", "digits[0] & (digits[1] | (|rest))", "digits[0]"),
    ("recurrence", "digits[0] & (digits[1] | (|rest))", "digits[0] & (digits[1] | (|rest[27:4]))"),
    ("recurrence", "{23'd0, up}", "24'd0"),
    ("recurrence", "subnormal ? ~minus_field_4[0] : less_4", "less_4"),
    ("recurrence", "root_4 ? minus_field_4[0] :", "root_4 ? ~minus_field_4[0] :"),
    ("recurrence", "|waits[8:4] ? 4'd15 : waits[3:0]", "waits[3:0]"),
    ("recurrence", "(&minus_field_4)", "1'b0"),
    ("recurrence", "high ? ~less_both[28] : ~less_second[28]", "~less_second[28]"),
    ("recurrence", "second_place | {place[24:0], 1'b0}", "second_place"),
    ("recurrence", "(place[25:1] & {25{low}})", "25'd0"),
    ("recurrence", "({place[24:1], 1'b0} & {25{high}})", "25'd0"),
    ("recurrence", "{at[5] & root_4, 1'b0, place[25:2]}", "{at[5], 1'b0, place[25:2]}"),
    ("recurrence", "if (~at[4] | root_4) divisor_5", "if (~at[4]) divisor_5"),
    ("recurrence", "root_4 ? ~minus_field_4[0] : ~less_4", "~less_4"),
    ("recurrence", "root_4 ? ~minus_field_4[0] : ~less_4", "~minus_field_4[0]"),
    ("recurrence", "if (in_valid & op) field_1 <= 8'd0;", ""),
    ("recurrence", "zeros & {5{~root_1}}", "zeros"),
    ("recurrence", "{5'd0, zeros_3, 1'b1}", "{5'd0, zeros_3, 1'b0}"),
    ("recurrence", "is_subnormal & rounded[23] & ~fixed", "is_subnormal & rounded[23]"),
    ("recurrence", "is_subnormal & rounded[23] & ~fixed", "1'b0"),
    ("recurrence", "~is_subnormal & (exponent[8] | (&exponent[7:0]))", "~is_subnormal & exponent[8]"),
    ("recurrence", "a_sign & ~is_zero & ~is_nan", "a_sign & ~is_nan"),
    ("recurrence", "b_zero & ~is_zero & ~is_infinite & ~is_nan", "b_zero & ~is_zero & ~is_nan"),
    ("recurrence", "is_nan & ~root_1", "is_nan"),
    ("recurrence", "(b_sign & ~root_1)", "b_sign"),
    ("recurrence", "if (at[4]) begin", "if (at[3]) begin"),
    ("recurrence", "if (at[3]) begin", "if (at[2] | at[3]) begin"),
    // Faults in quadrants, the multiple, cancellation, limits, the products of low parts, tiny operands.
    ("sine", "quadrant3[1] ^ (quadrant3[0] & op3)", "quadrant3[1]"),
    ("sine", "+ 23'd8192", "+ 23'd4096"),
    ("sine", "{6'd0, by_3}", "23'd0"),
    ("sine", "{a[27] ^ a[26], a[26], ~a[25:23]}", "{a[27], a[26], ~a[25:23]}"),
    ("sine", "{56{minus}}", "{56{1'b0}}"),
    ("sine", "wire        zeros16 = ~|n0[55:40]", "wire        zeros16 = 1'b0"),
    ("sine", "tiny2 | (k == 9'd0)", "(k == 9'd0)"),
    ("sine", "& {18{~tiny5}}", ""),
    ("sine", "& {28{~tiny6}}", ""),
    ("sine", "31'h43c90fda", "31'h43c90fdb"),
    ("sine", "8'd115", "8'd116"),
    ("sine", "one ? result12[12] : result12[11]", "result12[11]"),
    ("sine", "h[16:11] ^ {6{h[17]}}", "h[16:11]"),
    ("sine", "{11'd0, n[9:3]}", "{12'd0, n[8:3]}"),
    ("sine", "& {17{~cosine11}}", ""),
    ("sine", "sign1    <= a[31] & ~op", "sign1    <= a[31]"),
    // Faults in the octant, the number of leading digits, the row, the divisor, special operands, subnormal results.
    ("arctangent", "5'd3:     {first, place} = {5'b10000, 2'd3}", "5'd3:     {first, place} = {5'b01000, 2'd3}"),
    ("arctangent", "5'd12:    {first, place} = {5'b00010, 2'd3}", "5'd12:    {first, place} = {5'b00001, 2'd0}"),
    ("arctangent", "quotient[0] | ~|place", "quotient[0]"),
    ("arctangent", "(step & {29{digit_2[0]}})", "(step & {29{digit_1[0]}})"),
    ("arctangent", "if (change) divisor <= next_grown", "if (change) divisor <= grown"),
    ("arctangent", "first[4:1] | first[3:0]", "first[4:1]"),
    ("arctangent", "|e[8:4] ? 29'd0", "1'b0 ? 29'd0"),
    ("arctangent", "a[30:0] > b[30:0]", "a[30:0] >= b[30:0]"),
    ("arctangent", "a_zero | (b_infinite & ~a_infinite)", "a_zero | b_infinite"),
    ("arctangent", "b_zero | (a_infinite & ~b_infinite)", "b_zero"),
    ("arctangent", "9'd126);", "9'd127);"),
    ("arctangent", "none | (|places[8:5])", "none"),
    ("arctangent", "sign & ~nan", "left & ~nan"),
    ("arctangent", "{2'd0, quotient, 2'd2}", "{2'd0, quotient, 2'd0}"),
    ("arctangent", "{31'd0, back}", "32'd0"),
    ("arctangent", "zeros_2   <= steep_1 ? {1'b0, b_zeros} - {1'b0, a_zeros} : {1'b0, a_zeros} - {1'b0, b_zeros}", "zeros_2   <= 6'd0"),
    ("arctangent", "a_nan | b_nan", "a_nan"),
    // Faults in the place in the segment, the last segment, normalisation, the root's digits and their delay, both ends.
    ("arccosine", "at[4] & ~place[13]", "1'b0"),
    ("arccosine", "| {24{t_2[30]}}", ""),
    ("arccosine", "a[30:23] < 8'd96 ? 31'd0 : by1", "by1"),
    ("arccosine", "wire        eight_2 = ~|t_2[30:15]", "wire        eight_2 = 1'b0"),
    ("arccosine", "- {1'b0, q, 4'd4} - {2'd0, q, 3'd5}", "- {1'b0, q, 4'd4} - {2'd0, q, 3'd1}"),
    ("arccosine", "{addend & {31{digits[15]}}, 1'b0}", "{addend & {31{digits[13]}}, 1'b0}"),
    ("arccosine", "if (at[18]) begin", "if (at[19]) begin"),
    ("arccosine", "& {4{negative_19}}", ""),
    ("arccosine", "{31{negative_19 | ~zero_19}}", "{31{1'b1}}"),
    ("arccosine", "31'h3f800000", "31'h3f800001"),
];

/// Faults that hardly any random operands meet: the sticky bit of sums at distances of 16 to 31. Runs without variables try these faults,
/// too.
#[rustfmt::skip]
const RARE: &[Fault] = &[
    ("add", "(distance1[4] & (|shift0[15:0]))", "1'b0"),
    ("addmul", "(right2[4] & (|s2[15:0]))", "1'b0"),
];

/// All planted faults, rare faults last.
fn faults() -> impl Iterator<Item = Fault> {
    FAULTS.iter().chain(RARE).copied()
}

/// Runs the units' test, at its usual size, on a circuit.
fn passes(unit: &Unit, library: &Library) -> Result<(), String> {
    let mut simulation = Simulation::new(library, &circuit(library, unit)?)?;
    let outcome = simulation.check_all(100_000);
    simulation.remove();
    outcome.map(|_| ())
}

/// The row of the fault's unit, and the files with the fault in them.
fn planted((unit, from, to): Fault) -> (&'static Unit, Library) {
    let row = UNITS.iter().find(|row| row.name == unit).expect("a unit of the table");
    let mut library = library();
    let files = circuit(&library, row).expect("the unit has a circuit").files;
    let places = |name: &String| library.text(name).map_or(0, |text| text.matches(from).count());
    let found: Vec<_> = files.iter().filter(|name| places(name) > 0).collect();
    assert!(
        matches!(found[..], [name] if places(name) == 1),
        "`{from}` must occur once in the files of `{unit}`; it is in {found:?}"
    );
    let text = library.text(found[0]).unwrap_or_default().replace(from, to);
    library.put(found[0], text);
    (row, library)
}

/// Each fault still fits the text of its unit: most faults are planted only on demand, and by the proofs.
#[test]
fn every_fault_has_its_place() {
    faults().for_each(|fault| _ = planted(fault));
}

/// Each unit has a planted fault: a test that finds nothing would otherwise pass unnoticed.
#[test]
fn every_unit_has_planted_faults() {
    for unit in UNITS.iter().filter(|unit| Circuit::rows(unit).next().is_some() && unit.name != "memory") {
        assert!(
            FAULTS.iter().any(|(name, _, _)| *name == unit.name),
            "no fault is planted in rtl/units/{0}.v: add one to FAULTS in rtl/tests/faults.rs, (\"{0}\", what to replace, by what)",
            unit.name
        );
    }
}

#[test]
fn planted_faults_are_found() {
    let mut survivors = Vec::new();
    let mut last = "";
    let only = std::env::var("TAKT_FAULTS").ok();
    let known = |name: &String| faults().any(|(unit, _, _)| unit == name);
    assert!(only.as_ref().is_none_or(known), "TAKT_FAULTS: no unit with planted faults is called {only:?}");
    for fault @ (unit, from, to) in faults() {
        let skipped = match &only {
            Some(only) => unit != only,
            None => !full() && unit == last && !RARE.contains(&fault),
        };
        if skipped {
            continue;
        }
        last = unit;
        let (row, library) = planted(fault);
        let error = match passes(row, &library) {
            Ok(()) => {
                survivors.push(format!("{unit}: `{from}` -> `{to}`"));
                continue;
            }
            Err(error) => error,
        };
        // The operation must fail, not the build.
        assert!(
            error.contains("the specification") || error.contains("out_valid"),
            "{unit}: `{from}` -> `{to}` is no circuit: {error}"
        );
    }
    assert!(survivors.is_empty(), "faults that no test finds:\n{}", survivors.join("\n"));
}
