// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_divroot: pipelined divider and square root for binary32, correctly rounded, with one operation per cycle.
//
// Contract
//   Operands and op on the inputs in one cycle, with in_valid, give result and flags on the outputs LATENCY - 1 cycles later,
//   with out_valid. One operation per cycle. No reset is needed: LATENCY cycles without in_valid empty the pipeline.
//   flags = {invalid, divide by zero, overflow}. IEEE 754, to nearest even, with subnormals; every NaN
//   result is 7fc00000. The root is that of a; b is ignored.
//
//@ op 1'b0 fdiv
//@ op 1'b1 fsqrt
//@ clears
//
// Method: digit recurrence of very high radix, with two digits. A table gives Y, an approximation of the reciprocal of the divisor b
// (of the reciprocal root of the radicand) that is too small by at most 2^-13. In parentheses, the same for a root. With the operand
// x, the first digit is q1 = x Y, to 14 bits after the point. The residual x - q1 b (x - q1^2) is exact. The second digit is
// q2 = residual Y (residual Y / 2), to 24 bits after the point. The result exceeds s = q1 + q2, by less than 2^-23, which is two
// units of s's last place and one unit of the significand's. So s, the significand with a round bit, decides the rounding unless
// that bit is 0; then the sign of the residual of s + 2^-24 does. The tests prove this, and the widths below
// (rtl/tests/tables.rs).
//
// Range: the dividend is doubled if it is less than the divisor, so that the quotient is in [1, 2). If the quotient is
// subnormal, the dividend is shifted right instead, keeping all its bits, so that the quotient comes out denormalised as the
// format has it. Only then can a quotient be a tie, halfway between two numbers: the last residual is zero.
//
// Pipeline, by the number that ends the names of its registers:
//   1 classified        kinds of the operands; leading zeros shifted out in groups of four
//   2 normalised        and the table read
//   3 table's words     registered, since they come late out of a block RAM; exponents and significands compared
//   4 reciprocal        Y; the dividend aligned
//   5 first digit
//   6 first product     q1 b or q1^2
//   7 first residual
//   8 second digit
//   9 second product    q2 b or q2 (2 q1 + q2); s
//  10 rounded           the outputs

module takt_divroot #(
    parameter LATENCY = 11
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
        if (LATENCY != 11) begin : g_latency
            takt_divroot_has_latency_11 unsupported ();
        end
    endgenerate

    // Shift register of valid bits: bit k - 1 belongs to stage k.
    reg [9:1] valid, root;
    always @(posedge clk) begin
        valid     <= {valid[8:1], in_valid};
        root      <= {root[8:1], op};
        out_valid <= valid[9];
    end

    // ---- 1: kinds, and subnormals partly shifted

    wire [7:0]  a_exponent, b_exponent;
    wire [23:0] a_shifted, b_shifted;
    wire [4:0]  a_zeros, b_zeros;
    wire        a_zero, a_infinite, a_nan, a_signaling;
    wire        b_zero, b_infinite, b_nan, b_signaling;
    takt_unpack unpack_a (
        .clk(clk), .x(a[30:0]), .exponent(a_exponent), .significand(a_shifted), .zeros(a_zeros),
        .zero(a_zero), .infinite(a_infinite), .nan(a_nan), .signaling(a_signaling)
    );
    takt_unpack unpack_b (
        .clk(clk), .x(b[30:0]), .exponent(b_exponent), .significand(b_shifted), .zeros(b_zeros),
        .zero(b_zero), .infinite(b_infinite), .nan(b_nan), .signaling(b_signaling)
    );

    reg       a_sign_1, b_sign_1;
    reg [7:0] a_exponent_1, b_exponent_1;
    always @(posedge clk) begin
        a_sign_1     <= a[31];
        b_sign_1     <= b[31];
        a_exponent_1 <= a_exponent;
        b_exponent_1 <= b_exponent & {8{~op}};
    end

    // ---- 2: the rest of the shift; special results; the table's rows

    // An even exponent field is an odd exponent: then the radicand is in [2, 4).
    wire       doubled = ~(a_exponent_1[0] ^ a_zeros[0]);
    wire       any_nan = a_nan | (~root[1] & b_nan);
    wire       undefined = root[1] ? a_sign_1 & ~a_zero & ~a_nan : (a_zero & b_zero) | (a_infinite & b_infinite);

    reg [23:0] a_2, b_2;
    reg        sign_2, nan_2, infinite_2, zero_2, invalid_2, by_zero_2;
    reg [9:0]  right_2;         // 1 less the exponent field of a quotient in [1, 2), or 1 less twice a root's, but for zeros_2
    reg [5:0]  zeros_2;
    always @(posedge clk) begin
        a_2        <= a_shifted;
        b_2        <= b_shifted;
        sign_2     <= (a_sign_1 ^ (b_sign_1 & ~root[1])) & ~any_nan & ~undefined;
        nan_2      <= any_nan | undefined;
        infinite_2 <= a_infinite | (~root[1] & b_zero);
        zero_2     <= a_zero | (~root[1] & b_infinite);
        invalid_2  <= a_signaling | (~root[1] & b_signaling) | undefined;
        by_zero_2  <= ~root[1] & b_zero & ~a_zero & ~a_infinite & ~a_nan;
        right_2    <= {2'b0, b_exponent_1} - {2'b0, a_exponent_1} - 10'd126;
        zeros_2    <= {1'b0, b_zeros & {5{~root[1]}}} - {1'b0, a_zeros};
    end

    wire [14:0] coarse_2;
    wire [5:0]  fine_2;
    takt_reciprocal_table table_of_reciprocals (
        .clk(clk),
        .coarse_row(root[1] ? {1'b1, doubled, a_shifted[22:14]} : {1'b0, b_shifted[22:13]}),
        .fine_row(root[1] ? {1'b1, doubled, a_shifted[22:19], a_shifted[13:9]} : {1'b0, b_shifted[22:18], b_shifted[12:8]}),
        .coarse(coarse_2),
        .fine(fine_2)
    );

    // ---- 3: the table's words; exponents and significands compared

    reg [14:0] coarse_3;
    reg [5:0]  fine_3;
    reg [23:0] a_3, b_3;
    reg        sign_3, nan_3, infinite_3, zero_3, invalid_3, by_zero_3;
    reg [9:0]  right_3;
    reg        less_3;
    always @(posedge clk) begin
        {coarse_3, fine_3} <= {coarse_2, fine_2};
        {a_3, b_3}         <= {a_2, b_2};
        right_3            <= right_2 - {{4{zeros_2[5]}}, zeros_2};
        less_3             <= a_2 < b_2;
        {sign_3, nan_3, infinite_3, zero_3, invalid_3, by_zero_3} <=
            {sign_2, nan_2, infinite_2, zero_2, invalid_2, by_zero_2};
    end

    // ---- 4: Y; x, the dividend or radicand, with 47 bits after the point

    wire        subnormal = ~root[3] & ~right_3[9];     // also the least exponent of normal quotients
    wire        left = root[3] ? ~right_3[0] : less_3 & ~subnormal;
    wire [4:0]  right = right_3[4:0] & {5{subnormal}};
    wire [48:0] aligned_by_8 = {1'b0, a_3, 24'b0} >> {right[4:3], 3'b0};
    wire [48:0] aligned_by_2 = aligned_by_8 >> {right[2:1], 1'b0};

    reg [15:0] y_4;
    reg [48:0] x_4;
    reg [23:0] b_4;
    reg        sign_4, nan_4, infinite_4, zero_4, invalid_4, by_zero_4;
    reg        subnormal_4, left_4;
    reg [9:0]  exponent_4;      // of a quotient in [1, 2), or twice a root's
    always @(posedge clk) begin
        y_4         <= {1'b1, coarse_3} - {10'b0, fine_3};
        x_4         <= left ? aligned_by_2 << 1 : right[0] ? aligned_by_2 >> 1 : aligned_by_2;
        b_4         <= b_3;
        sign_4      <= sign_3;
        nan_4       <= nan_3;
        infinite_4  <= infinite_3;
        // From a shift of 25 on, the result rounds to 0; from 32 on, the shift is not made.
        zero_4      <= zero_3 | (subnormal & |right_3[8:5]);
        invalid_4   <= invalid_3;
        by_zero_4   <= by_zero_3;
        subnormal_4 <= subnormal;
        left_4      <= left;
        exponent_4  <= 10'd1 - right_3;
    end

    // ---- 5: the first digit; exponent and flags, which are final

    wire [35:0] first_product;
    takt_product first_digit (.clk(clk), .a(x_4[48:31]), .b({2'b0, y_4}), .p(first_product));
    wire [14:0] q1_5 = first_product[32:18];

    wire [9:0]  exponent = root[4] ? {1'b0, exponent_4[9:1]} : exponent_4 - {9'b0, left_4};
    wire        number = ~nan_4 & ~infinite_4 & ~zero_4;
    wire        too_large = number & ~subnormal_4 & (exponent[8] | &exponent[7:0]);
    wire        ones = nan_4 | infinite_4 | too_large;

    // Only the first three and the last of these affect the datapath, which is correct for numbers whose exponent fits.
    reg        fixed_5;         // not a number, infinite or zero: the fraction is nan_5's
    reg        nan_5;
    reg        subnormal_5;     // only if the result is not fixed
    reg [7:0]  exponent_5;      // 0 if subnormal_5: then the significand's leading bit is the exponent
    reg [2:0]  flags_5;
    reg        sign_5;
    reg [36:0] x_5;             // the residual is small: its upper bits are known
    reg [15:0] y_5;
    reg [23:0] b_5;
    always @(posedge clk) begin
        fixed_5     <= ~number | too_large;
        nan_5       <= nan_4;
        subnormal_5 <= subnormal_4 & number;
        exponent_5  <= {8{ones}} | (exponent[7:0] & {8{number & ~subnormal_4}});
        flags_5     <= {invalid_4, by_zero_4, too_large};
        sign_5      <= sign_4;
        x_5         <= x_4[36:0];
        y_5         <= y_4;
        b_5         <= b_4;
    end

    // ---- 6: q1 b, or q1^2 as the upper product alone

    wire [35:0] low_6, high_6;
    takt_product first_low  (.clk(clk), .a({3'b0, q1_5}), .b({9'b0, b_5[8:0] & {9{~root[5]}}}), .p(low_6));
    takt_product first_high (.clk(clk), .a({3'b0, q1_5}), .b({3'b0, root[5] ? q1_5 : b_5[23:9]}), .p(high_6));

    reg [14:0] q1_6;
    reg [36:0] x_6;
    reg [15:0] y_6;
    reg [23:0] b_6;
    reg [14:0] beside_6;
    always @(posedge clk) begin
        q1_6     <= q1_5;
        x_6      <= x_5;
        y_6      <= y_5;
        b_6      <= b_5;
        beside_6 <= {sign_5, fixed_5, nan_5, subnormal_5, exponent_5, flags_5};
    end

    // ---- 7: the residual, 37 bits after the point, in [0, 2^-10)

    reg [26:0] residual_7;
    reg [9:0]  x_7;
    reg [14:0] q1_7;
    reg [15:0] y_7;
    reg [23:0] b_7;
    reg [14:0] beside_7;
    always @(posedge clk) begin
        residual_7 <= x_6[36:10] - low_6[26:0] - {high_6[17:0], 9'b0};
        x_7        <= x_6[9:0];
        q1_7       <= q1_6;
        y_7        <= y_6;
        b_7        <= b_6;
        beside_7   <= beside_6;
    end

    // ---- 8: the second digit; the last residual, modulo 2^27, begins: 47 bits after the point for a quotient, 48 for a root

    wire [35:0] second_product;
    takt_product second_digit (.clk(clk), .a(residual_7[26:9]), .b({2'b0, y_7}), .p(second_product));
    wire [11:0] q2_8 = root[8] ? second_product[32:21] : second_product[31:20];

    // For a root, the known parts of 2 (s + 2^-25) are subtracted, too.
    wire [15:0] root_part = residual_7[15:0] + ~{1'b0, q1_7};
    reg [26:0] last_8;
    reg [14:0] q1_8;
    reg [23:0] b_8;
    reg [14:0] beside_8;
    always @(posedge clk) begin
        last_8   <= root[7] ? {root_part, 11'h7ff} : {residual_7[16:0], x_7};
        q1_8     <= q1_7;
        b_8      <= b_7;
        beside_8 <= beside_7;
    end

    // ---- 9: q2 b or q2 (2 q1 + q2), in two parts; s, the significand and a bit

    wire [35:0] low_9, high_9;
    takt_product second_low  (.clk(clk), .a({6'b0, q2_8}), .b(root[8] ? {6'b0, q2_8} : {7'b0, b_8[10:0]}), .p(low_9));
    takt_product second_high (.clk(clk), .a({6'b0, q2_8}), .b(root[8] ? {3'b0, q1_8} : {5'b0, b_8[23:11]}), .p(high_9));

    reg [26:0] last_9;
    reg [24:0] s_9;
    reg        sign_9, fixed_9, nan_9, subnormal_9;
    reg [7:0]  exponent_9;
    reg [2:0]  flags_9;
    always @(posedge clk) begin
        last_9 <= last_8 - (root[8] ? {14'b0, q2_8, 1'b0} : {3'b0, b_8});
        s_9    <= {q1_8, 10'b0} + {13'b0, q2_8};
        {sign_9, fixed_9, nan_9, subnormal_9, exponent_9, flags_9} <= beside_8;
    end

    // ---- 10: the last residual's sign, and the choice

    // A tie is rounded down if the significand is even: then only a residual above zero rounds up.
    wire        tie_down = subnormal_9 & ~s_9[1];
    wire [26:0] last = last_9 - low_9[26:0] - {high_9[15:0], 10'b0, tie_down};
    wire [23:0] upper = s_9[24:1] + 24'd1;
    wire [23:0] lower = s_9[0] ? upper : s_9[24:1];

    // The residual's sign arrives last; everything else about bits 23 and 22 is computed before.
    wire [1:0]  upper_top = {exponent_9[0] | (subnormal_9 & upper[23]), fixed_9 ? nan_9 : upper[22]};
    wire [1:0]  lower_top = {exponent_9[0] | (subnormal_9 & lower[23]), fixed_9 ? nan_9 : lower[22]};

    always @(posedge clk) begin
        result[31:24] <= {sign_9, exponent_9[7:1]};
        result[23:22] <= last[26] ? lower_top : upper_top;
        result[21:0]  <= last[26] ? lower[21:0] : upper[21:0];
        if (fixed_9) begin
            result[21:0] <= 22'd0;
        end
        flags <= flags_9;
        if (~valid[9]) {result, flags} <= 35'd0;
    end

    wire unused = &{1'b0, root[9], exponent_4[9], exponent[9:8], first_product[35:33], first_product[17:0], low_6[35:27],
                    high_6[35:18], second_product[35:33], second_product[19:0], low_9[35:27], high_9[35:16], last[25:0]};

endmodule
