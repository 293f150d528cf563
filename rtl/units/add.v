// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_add: binary32 sum and difference, rounded to nearest even, subnormals included.
//
// Contract
//   Operands and op on the inputs in one cycle, with in_valid, give result and flags on the outputs LATENCY - 1 cycles later,
//   with out_valid. One operation per cycle. No reset is needed: LATENCY cycles without in_valid empty the pipeline.
//   flags = {invalid, divide by zero, overflow}. Every NaN result is 7fc00000.
//
//@ op 1'b0 fadd
//@ op 1'b1 fsub
//
// Method: a dual-path adder. Each path needs only one long shift, because a difference either cancels or needs rounding, never
// both:
//   far:  align the smaller operand, add or subtract, normalise by at most one place, round;
//   near: subtract operands whose exponents differ by 0 or 1, normalise; the result is exact. This path is taken if the operation
//         subtracts, the exponents are that close, and the difference has lost its leading bit (cancellation).
//
// Notation: L is the operand of larger magnitude, S the other. A significand has 24 bits, the leading one included.
//
// Pipeline
//   1  swapped operands       S and L, difference of their exponents
//   2  aligned operands       far: S aligned; near: the difference
//   3  sum, leading zeros     far: sum, normalised by a place if needed; near: shift count, shifted by multiples of four
//   4  normalised, rounded    the result

module takt_add #(
    parameter LATENCY = 5
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [0:0]  op,
    input  wire [31:0] a,
    input  wire [31:0] b,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 5) begin : g_latency
            takt_add_has_latency_5 unsupported ();
        end
    endgenerate

    reg valid1, valid2, valid3;
    always @(posedge clk) begin
        valid1    <= in_valid;
        valid2    <= valid1;
        valid3    <= valid2;
        out_valid <= valid3;
    end

    // =============================================================== 1: compare and swap

    wire        b_sign    = b[31] ^ op[0];
    wire        subtracts = a[31] ^ b_sign;
    wire        a_small   = a[30:23] == 8'd0;  // zero or subnormal
    wire        b_small   = b[30:23] == 8'd0;
    wire        b_larger  = a[30:0] < b[30:0];

    // Alignment distance: S is shifted right by it. For a difference it is one less, since that is kept one place further to the left
    // than a sum (see 3).
    wire [8:0]  a_above = {1'b0, a[30:23]} - {1'b0, b[30:23]} - {8'd0, subtracts};
    wire [8:0]  b_above = {1'b0, b[30:23]} - {1'b0, a[30:23]} - {8'd0, subtracts};

    wire [22:0] s_fraction = b_larger ? a[22:0] : b[22:0];
    wire [22:0] l_fraction = b_larger ? b[22:0] : a[22:0];

    wire        a_special = &a[30:23];
    wire        b_special = &b[30:23];
    wire        a_nan     = a_special & (|a[22:0]);
    wire        b_nan     = b_special & (|b[22:0]);
    wire        opposed   = a_special & b_special & subtracts;  // infinities, if there is no NaN

    reg  [23:0] s1, l1;
    reg  [7:0]  exponent1;  // of L
    reg  [8:0]  distance1;  // modulo 512; -1 if a difference has equal exponents
    reg         subtracts1, sign1, nan1, infinite1, invalid1;

    always @(posedge clk) begin
        // An exponent field of 0 means the same exponent as 1. Instead of correcting the distance between a subnormal S and a
        // normal L, S is shifted left by one, into the place of its leading bit, which is zero.
        s1         <= (a_small ^ b_small) ? {s_fraction, 1'b0} : {~a_small, s_fraction};
        l1         <= {~(a_small & b_small), l_fraction};
        exponent1  <= b_larger ? b[30:23] : a[30:23];
        distance1  <= a_above[8] ? b_above : a_above;
        subtracts1 <= subtracts;
        sign1      <= b_larger ? b_sign : a[31];
        nan1       <= a_nan | b_nan | opposed;
        infinite1  <= a_special | b_special;
        invalid1   <= (a_nan & ~a[22]) | (b_nan & ~b[22]) | (opposed & ~a_nan & ~b_nan);
    end

    // =============================================================== 2: align; near difference

    // ---- far: S shifted right, with guard, round and sticky bit; the sticky bit is the OR of all bits shifted out

    wire        beyond = |distance1[7:5];
    wire [27:0] shift0 = {1'b0, s1, 3'b000};
    wire [27:0] shift1 = beyond ? 28'd0 : distance1[4] ? {16'd0, shift0[27:16]} : shift0;
    wire [27:0] shift2 = distance1[3] ? {8'd0, shift1[27:8]} : shift1;
    wire [27:0] shift3 = distance1[2] ? {4'd0, shift2[27:4]} : shift2;
    wire [27:0] shift4 = distance1[1] ? {2'd0, shift3[27:2]} : shift3;
    wire [27:0] shift5 = distance1[0] ? {1'd0, shift4[27:1]} : shift4;
    wire        lost =
        (beyond & (|s1)) | (distance1[4] & (|shift0[15:0])) | (distance1[3] & (|shift1[7:0])) |
        (distance1[2] & (|shift2[3:0])) | (distance1[1] & (|shift3[1:0])) | (distance1[0] & shift4[0]);

    // ---- near: exact difference, with one guard bit. A distance of -1 means equal exponents.

    wire [24:0] difference = {l1, 1'b0} - (distance1[0] ? {s1, 1'b0} : {1'b0, s1});
    wire        close      = subtracts1 & ((distance1 == 9'h000) | (distance1 == 9'h1ff));

    // A subnormal result is shifted only until its exponent is 1: a one inserted at that place stops the count of leading zeros.
    // Place 24 holds the leading one.
    wire [24:0] stop;
    genvar i;
    generate
        for (i = 0; i < 25; i = i + 1) begin : g_stop
            assign stop[24 - i] = (exponent1 == i + 1) | ((i == 0) & (exponent1 == 8'd0));
        end
    endgenerate

    reg  [27:0] far_s2, far_l2;
    reg  [24:0] near2, count2;
    reg  [7:0]  exponent2;
    reg  [7:0]  above2, below2;  // far: exponent field less the leading one, if the sum reaches the top place; if not
    reg         near_taken2, subtracts2, sign2, nan2, infinite2, invalid2, top_overflows2;

    wire        normal1 = |exponent1;

    always @(posedge clk) begin
        far_s2         <= {shift5[27:1], shift5[0] | lost} ^ {28{subtracts1}};
        far_l2         <= subtracts1 ? {l1, 4'b0000} : {1'b0, l1, 3'b000};
        near2          <= difference;
        count2         <= difference | stop;
        near_taken2    <= close & ~difference[24];
        exponent2      <= {exponent1[7:1], exponent1[0] | ~normal1};
        above2         <= exponent1 + {8{subtracts1 & normal1}} + {7'd0, ~normal1};
        below2         <= exponent1 + {{7{normal1}}, normal1 & ~subtracts1};
        subtracts2     <= subtracts1;
        sign2          <= sign1;
        nan2           <= nan1;
        infinite2      <= infinite1;
        invalid2       <= invalid1;
        top_overflows2 <= (exponent1 == 8'd254) & ~subtracts1;
    end

    // =============================================================== 3: sum; leading zeros

    // ---- far: the leading one of the sum is in place 27 or 26, and so is that of the difference (which was kept one place to the
    //      left). The sum of two subnormals may have none.

    wire [27:0] sum = far_l2 + far_s2 + {27'd0, subtracts2};
    wire        top = sum[27];
    wire        up  = top ? sum[3] & ((|sum[2:0]) | sum[4]) : sum[2] & ((|sum[1:0]) | sum[3]);

    // ---- near: leading-zero count and coarse shift of 25 places, in groups of four from the top; the last place is alone.

    wire        none0  = ~|count2[24:21];
    wire        none1  = ~|count2[20:17];
    wire        none2  = ~|count2[16:13];
    wire        none3  = ~|count2[12:9];
    wire        none4  = ~|count2[8:5];
    wire        none5  = ~|count2[4:1];
    wire        by16   = none0 & none1 & none2 & none3;
    wire        by8    = none0 & none1 & (by16 ? none4 & none5 : ~(none2 & none3));
    wire        by4    = by16 ? none4 & ~none5 : none0 & (~none1 | (none2 & ~none3));
    wire [24:0] near16 = by16 ? {near2[8:0], 16'd0} : near2;
    wire [24:0] near8  = by8 ? {near16[16:0], 8'd0} : near16;
    wire [24:0] near4  = by4 ? {near8[20:0], 4'd0} : near8;

    // The upper three places of the group with the leading one; if it is in none of them, it is in the fourth.
    wire [2:0] group =
        by16 ? (by8 ? {count2[0], 2'b00} : by4 ? count2[4:2] : count2[8:6]) :
        by8 ? (by4 ? count2[12:10] : count2[16:14]) : (by4 ? count2[20:18] : count2[24:22]);

    reg  [23:0] far3;
    reg  [7:0]  far_exponent3;
    reg         up3;
    reg  [24:0] near3;
    reg  [7:0]  near_exponent3;
    reg  [4:0]  zeros3;
    reg         near_taken3, sign3, nan3, special3, invalid3, overflow3;

    always @(posedge clk) begin
        far3           <= top ? sum[27:4] : sum[26:3];
        far_exponent3  <= top ? above2 : below2;
        up3            <= up;
        near3          <= near4;
        near_exponent3 <= exponent2;
        zeros3         <= {by16, by8, by4, ~(group[2] | group[1]), ~(group[2] | (~group[1] & group[0]))};
        near_taken3    <= near_taken2;
        sign3          <= sign2 & ~(near_taken2 & ~|near2);
        nan3           <= nan2;
        special3       <= nan2 | infinite2 | (top & top_overflows2);
        invalid3       <= invalid2;
        overflow3      <= ~nan2 & ~infinite2 & top & top_overflows2;
    end

    // =============================================================== 4: normalise near, round far

    wire [24:0] near_by2  = zeros3[1] ? {near3[22:0], 2'd0} : near3;
    wire [23:0] near_by1  = zeros3[0] ? near_by2[23:0] : near_by2[24:1];
    wire [7:0]  near_exp  = near_exponent3 - {3'd0, zeros3};
    wire [30:0] near_bits = {near_exp & {8{near_by1[23]}}, near_by1[22:0]};

    // The leading one is added to the exponent field, and so is a carry of the rounding; beyond the largest number, that gives
    // infinity.
    wire [30:0] far_bits = {far_exponent3, far3[22:0]} + {7'd0, far3[23], 22'd0, up3};
    wire        rounds_to_infinity = up3 & (far_exponent3 == 8'd253) & (&far3);

    always @(posedge clk) begin
        result[31] <= sign3 & ~nan3;
        if (special3) begin
            result[30:0] <= {8'hff, nan3, 22'd0};
        end else begin
            result[30:0] <= near_taken3 ? near_bits : far_bits;
        end
        flags <= {invalid3, 1'b0, overflow3 | (rounds_to_infinity & ~near_taken3 & ~special3)};
    end

endmodule
