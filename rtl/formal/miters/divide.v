// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_divroot's fdiv against IEEE 754's quotient, for all operands, with the digits cut out: s, the quotient with one bit more than the
// significand, and the last residual are arbitrary, but for what divide_digits.v and rtl/tests/tables.rs show: the quotient is above s,
// by less than two units of s's last place; the residual of s + 1 unit is negative, zero or positive as the quotient is below, at or
// above that. The reference's quotient and remainder are arbitrary, too. A quotient without remainder has no more significant bits
// than the dividend. Cases: the quotient normal, or its shift to the right if it is subnormal; dividend less than the divisor or not.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [25:0] quotient,     // of the normalised significands, 25 bits after the point
    input  [50:0] remainder,
    input         above,        // the quotient is a unit or more above s; always if it has no remainder
    input  [26:0] residual,
    input  [50:0] unused_quotient,
    output        bad,
    output        assumed,
    output [6:0]  part
);

    wire [31:0] result, exact;
    wire [2:0]  flags;
    wire        invalid, by_zero, overflow;
    wire [24:0] s;
    wire [50:0] cut_a, cut_b, mod_a, mod_b;
    wire        finite;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op(1'b0), .a(a), .b(b), .result(result), .flags(flags),
        .s_9(s), .last_9(residual), .\second_low.p (36'd0), .\second_high.p (36'd0)
    );
    symfpu reference (
        .a(a), .b(b), .o(exact), .NV(invalid), .DZ(by_zero), .OF(overflow), .\cut0.a (cut_a), .\cut0.b (cut_b),
        .\cut0.p (finite ? {25'd0, quotient} : unused_quotient), .\mod0.a (mod_a), .\mod0.b (mod_b), .\mod0.p (remainder)
    );

    wire [23:0] x = {|a[30:23], a[22:0]};
    wire [23:0] y = {|b[30:23], b[22:0]};
    wire [4:0]  x_zeros, y_zeros;
    leading_zeros of_x (.x(x), .zeros(x_zeros));
    leading_zeros of_y (.x(y), .zeros(y_zeros));
    wire [23:0] x_normal = x << x_zeros;
    wire [23:0] y_normal = y << y_zeros;
    assign finite = ~&a[30:23] & ~&b[30:23] & (|x) & (|y);

    // 1 less the exponent field of a quotient in [1, 2).
    wire signed [10:0] right =
        $signed({3'd0, b[30:24], b[23] | ~|b[30:23]}) - $signed({3'd0, a[30:24], a[23] | ~|a[30:23]}) - 126 -
        $signed({6'd0, y_zeros}) + $signed({6'd0, x_zeros});
    wire        subnormal = right >= 0;
    wire        deep      = right >= 32;
    wire        less      = x_normal < y_normal;
    wire [4:0]  shift     = subnormal ? right[4:0] : 5'd0;

    // The quotient in units of s, truncated, and whether that is all of it.
    wire [26:0] wide  = {quotient, 1'b0} << (less & ~subnormal);
    wire [26:0] moved = wide >> 2 >> shift;
    wire        whole = remainder == 0 & (moved << shift << 2) == wide;
    wire [24:0] truncated = moved[24:0];
    assign s = truncated - above;

    // The quotient is at most (2^24 - 1) / 2^23, or 1 - 1/y.
    wire fits = moved[26:25] == 0 & (truncated != 0 | ~above) & (above | ~whole);
    wire proper =
        quotient[25] == ~less & (quotient[25] | quotient[24]) &
        quotient <= (less ? 26'h1fffffd : 26'h3fffffc) & (x_normal != y_normal | (quotient == 26'h2000000 & remainder == 0)) &
        (remainder != 0 | (quotient[25] ? quotient[1:0] == 0 : ~quotient[0]));
    wire sign  = above ? ~residual[26] & ((residual == 0) == whole) & ~residual[25] : residual[26] & residual[25];
    assign assumed = ~finite | (proper & (deep | (fits & sign)));

    wire        nan = (&exact[30:23]) & (|exact[22:0]);
    assign bad =
        (result != (nan ? 32'h7fc00000 : exact)) | (flags != {invalid, by_zero, overflow}) |
        (finite & ((cut_a != {x_normal, 27'd0}) | (cut_b != {y_normal, 2'd0}) | (mod_a != cut_a) | (mod_b != cut_b)));
    assign part = ~finite ? 7'd66 : deep ? 7'd67 : subnormal ? {1'b0, shift, less} : {6'd32, less};

endmodule
