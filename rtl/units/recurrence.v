// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_recurrence: iterative divider and square root for binary32, correctly rounded, by one restoring digit recurrence: small,
// without a multiplier.
//
// Contract
//   Operands and op on the inputs in one cycle, with in_valid, give result and flags on the outputs LATENCY - 1 cycles later,
//   with out_valid. An iterative unit: the next operation may follow INTERVAL cycles later, no sooner. No reset is needed:
//   LATENCY cycles without in_valid empty the unit.
//   flags = {invalid, divide by zero, overflow}. IEEE 754, to nearest even, with subnormals; every NaN
//   result is 7fc00000. The root is that of a; b is ignored. The root of -0 is -0.
//
//@ op 1'b0 fdiv
//@ op 1'b1 fsqrt
//@ clears
//
// Method: restoring recurrence, two bits per cycle. The next bit of a quotient is 1 if the divisor d is not more than twice the
// remainder; d is then subtracted. The next bit of a root is found in the same way, with 2 q + m instead of d, q being the root so
// far and m the weight of the next bit. So one set of subtractors serves both: `known` is d or 2 q, and the bit `place`, which is
// the weight m of the first of the two bits, moves down only for a root.
//   The dividend is doubled if it is less than the divisor, so that the quotient is in [1, 2); the radicand is in [1, 4), the
// root in [1, 2). Thirteen digits give the bits of weight 2, which is 0, to 2^-24, which is the round bit. The final remainder
// is the sticky bit: it tells if the quotient is exact. A root is never a tie (it would have 25 bits, its square 49 or 50). A
// subnormal quotient begins with zeros: the dividend is held back for that many cycles, and so loses no bits.
//
// Schedule: at[k] = 1 in stage k of an operation; its operands are on the inputs in stage 0.
//   0-2    operands unpacked, b first
//   3      compared; the exponent
//   4      aligned
//   5      loaded into the registers of the recurrence, which are 0
//   6-18   digits
//   19     rounded into the outputs
// One operation at a time uses the registers of stages 5 to 19: the next is 15 cycles later.

module takt_recurrence #(
    parameter LATENCY  = 21,
    parameter INTERVAL = 15
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire        op,
    input  wire [31:0] a,
    input  wire [31:0] b,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 21 || INTERVAL < 15) begin : g_latency
            takt_recurrence_has_latency_21_and_interval_15 unsupported ();
        end
    endgenerate

    reg [19:1] at;
    always @(posedge clk) begin
        at        <= {at[18:1], in_valid};
        out_valid <= at[19];
    end

    // ---- 0-2: operands, one after the other; from stage 2 on `unpack` shows a

    reg        root_1, a_sign, b_sign;
    reg [30:0] a_1;
    always @(posedge clk) begin
        if (in_valid) begin
            root_1 <= op;
            a_sign <= a[31];
            b_sign <= b[31];
            a_1    <= a[30:0];
        end
    end

    wire [7:0]  field;
    wire [23:0] significand;
    wire [4:0]  zeros;
    wire        is_zero, is_infinite, is_nan, is_signaling;
    takt_unpack unpack (
        .clk(clk), .x(in_valid ? b[30:0] : a_1), .exponent(field), .significand(significand), .zeros(zeros),
        .zero(is_zero), .infinite(is_infinite), .nan(is_nan), .signaling(is_signaling)
    );

    reg [7:0]  field_1;
    reg [9:0]  right_2, right_3;
    reg [23:0] a_3, b_2;
    reg [4:0]  zeros_3;
    reg        b_zero, b_infinite, b_nan, b_signaling;
    always @(posedge clk) begin
        field_1 <= field;
        if (in_valid & op) field_1 <= 8'd0;
        if (at[1]) begin
            b_2         <= significand;
            b_zero      <= is_zero & ~root_1;
            b_infinite  <= is_infinite & ~root_1;
            b_nan       <= is_nan & ~root_1;
            b_signaling <= is_signaling & ~root_1;
        end
        a_3     <= significand;
        zeros_3 <= zeros;
        right_2 <= {2'd0, field_1} - {5'd0, zeros & {5{~root_1}}};
        right_3 <= right_2 - {1'b0, field_1[7], ~field_1[7], field_1[6:0]};     // less 128 and the field
    end

    // ---- 3: kinds; the exponent field of a quotient in [1, 2), or twice a root's, negative

    wire       undefined = root_1 ? a_sign & ~is_zero & ~is_nan : (is_zero & b_zero) | (is_infinite & b_infinite);

    reg        root_4, less_4, nan_4, infinite_4, zero_4, sign_4, invalid_4, by_zero_4;
    reg [9:0]  minus_field_4;
    wire [10:0] sum_3 = {right_3, 1'b1} + {5'd0, zeros_3, 1'b1};
    always @(posedge clk) begin
        if (at[3]) begin
            root_4        <= root_1;
            less_4        <= a_3 < b_2;
            minus_field_4 <= sum_3[10:1];
            nan_4         <= is_nan | b_nan | undefined;
            infinite_4    <= is_infinite | b_zero;
            zero_4        <= is_zero | b_infinite;
            sign_4        <= (a_sign ^ (b_sign & ~root_1)) & ~is_nan & ~b_nan & ~undefined;
            invalid_4     <= is_signaling | b_signaling | undefined;
            by_zero_4     <= b_zero & ~is_zero & ~is_infinite & ~is_nan;
        end
    end

    // ---- 4: dividend or radicand, or twice it; for a subnormal quotient also the wait

    wire        subnormal = ~root_4 & (~minus_field_4[9] | (&minus_field_4));   // also the least exponent of normal quotients
    // A digit is two bits: the first one's lower bit is the first of the result.
    wire        double    = root_4 ? minus_field_4[0] : subnormal ? ~minus_field_4[0] : less_4;
    wire [8:0]  waits     = minus_field_4[9:1] + 9'd1;

    reg [25:1]  start_5;        // these two 0 but in stage 5
    reg [24:1]  divisor_5;
    reg [3:0]   waits_5;
    always @(posedge clk) begin
        start_5   <= double ? {a_3, 1'b0} : {1'b0, a_3};
        divisor_5 <= b_2;
        waits_5   <= |waits[8:4] ? 4'd15 : waits[3:0];
        if (~at[4]) start_5 <= 25'd0;
        if (~at[4] | root_4) divisor_5 <= 24'd0;
        if (~subnormal) waits_5 <= 4'd0;
    end

    // ---- 5-18: a digit. Bit i of these has the weight 2^(i - 24); `place`, of odd i only, has bit 25 first

    reg [27:1] rest;            // what remains, for the next digit
    reg [25:1] known;
    reg [25:0] place;           // even bits 0
    reg [24:0] digits;          // significand and a bit
    reg [3:0]  wait_digits;

    // Subtrahends: of the first bit, and of the second one after a 0 and after a 1 (which arrives late).
    wire [25:0] second_place = {1'b0, place[25:1]};
    wire [25:0] first_taken  = {known, 1'b0} | place;
    wire [25:0] second_taken = {known, 1'b0} | second_place;
    wire [25:0] third_taken  = {known, 1'b0} | second_place | {place[24:0], 1'b0};
    wire [28:0] less_first   = {1'b0, rest, 1'b0} - {2'b0, first_taken, 1'b0};
    wire [28:0] less_second  = {1'b0, rest, 1'b0} - {3'b0, second_taken};
    wire [28:0] less_both    = less_first - {3'b0, third_taken};
    wire        high = ~less_first[28];
    wire        low  = high ? ~less_both[28] : ~less_second[28];
    wire [25:0] next_high = less_both[28] ? less_first[25:0] : less_both[25:0];
    wire [25:0] next_low  = less_second[28] ? {rest[25:1], 1'b0} : less_second[25:0];

    always @(posedge clk) begin
        place <= {at[5] & root_4, 1'b0, place[25:2]};
        // The remainder stays 0 until the operation starts: 0 minus a divisor is restored to 0, and 0 minus 0 is 0.
        if (at[4]) begin
            rest  <= 27'd0;
            known <= 25'd0;
        end else begin
            known <= known | {1'b0, divisor_5} | (place[25:1] & {25{low}}) | ({place[24:1], 1'b0} & {25{high}});
            if (at[5] | ~|wait_digits) begin
                rest <= {high ? next_high : next_low, 1'b0} | {2'd0, start_5};
            end
        end
        if (at[5]) begin
            wait_digits <= waits_5;
            digits      <= 25'd0;
        end else if (|wait_digits) begin
            wait_digits <= wait_digits - 4'd1;
        end else begin
            digits <= {digits[22:0], high, low};
        end
    end

    // ---- 5, 6: the exponent. The registers of stage 4 hold until the next operation is in stage 4; these two must hold longer

    reg [8:0] exponent;
    reg       sign, nan, infinite, zero, invalid, by_zero, is_subnormal, overflow, fixed;
    reg [7:0] exponent_field;   // 0 if subnormal: then the significand's leading bit is the exponent
    wire      too_large = ~is_subnormal & (exponent[8] | (&exponent[7:0]));
    always @(posedge clk) begin
        exponent       <= (root_4 ? ~minus_field_4[9:1] : ~minus_field_4[8:0]) + {8'd0, root_4 ? ~minus_field_4[0] : ~less_4};
        is_subnormal   <= subnormal;
        {sign, nan, infinite, zero, invalid, by_zero} <= {sign_4, nan_4, infinite_4, zero_4, invalid_4, by_zero_4};
        overflow       <= ~nan & ~infinite & ~zero & too_large;
        fixed          <= nan | infinite | zero | too_large;
        exponent_field <= {8{nan | infinite}} | (({8{exponent[8]}} | exponent[7:0]) & {8{~zero & ~is_subnormal}});
    end

    // ---- 19: rounded; only a subnormal quotient can be a tie, or carry into the exponent

    wire        up      = digits[0] & (digits[1] | (|rest));
    wire [23:0] rounded = digits[24:1] + {23'd0, up};
    always @(posedge clk) begin
        result[31]    <= sign;
        result[30:23] <= {exponent_field[7:1], exponent_field[0] | (is_subnormal & rounded[23] & ~fixed)};
        result[22:0]  <= rounded[22:0];
        if (fixed) result[22:0] <= {nan, 22'd0};
        flags <= {invalid, by_zero, overflow};
        if (~at[19]) {result, flags} <= 35'd0;
    end

    wire unused = &{1'b0, sum_3[0], less_first[27:26], less_second[27:26], less_both[27:26]};

endmodule
