// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_recurrence's fdiv against IEEE 754's quotient, for all operands, with the digits cut out. The reference's quotient and remainder
// are arbitrary. The circuit's digits are the bits of that quotient that recurrence_digits.v finds from the registers' contents before
// the first step, and the rest is 0 if that is all of it. A quotient without remainder has no more significant bits than the
// dividend. Cases: as divide.v.

module miter (
    input         op,
    input  [31:0] a,
    input  [31:0] b,
    input  [31:0] result,
    input  [2:0]  flags,
    input  [27:1] rest_6,
    input  [25:1] known_6,
    input  [25:0] place_6,
    input  [24:0] digits_6,
    input  [3:0]  wait_digits_6,
    input  [27:1] rest_19,
    input  [24:0] digits_19,
    input  [25:0] quotient,     // of the normalised significands, 25 bits after the point
    input  [50:0] remainder,
    input  [50:0] unused_quotient,
    output        bad,
    output        assumed,
    output [6:0]  part
);

    wire [31:0] exact;
    wire        invalid, by_zero, overflow;
    wire [50:0] cut_a, cut_b, mod_a, mod_b;
    wire        finite;
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
    wire        less     = x_normal < y_normal;
    assign finite = ~&a[30:23] & ~&b[30:23] & (|x) & (|y);

    // The circuit's dividend X is the quotient's dividend, or twice as much. The circuit finds 13 digits, less the
    // digits that it waits for. With all 13 digits, X is less than twice the divisor, so that the digits have 25 bits.
    wire        doubled = rest_6 == {2'd0, x_normal, 1'b0};
    wire        loaded  =
        (doubled ? less | wait_digits_6 != 0 : rest_6 == {3'd0, x_normal}) & known_6 == {1'b0, y_normal} & (place_6 & 26'h2aaaaaa) == 0 &
        digits_6 == 0;
    // The digits are X / divisor with 24 bits after the point, less 2 for each digit that the unit waits for.
    wire [5:0]  missing = {1'b0, wait_digits_6, ~doubled};
    wire [25:0] moved   = quotient >> missing;
    wire        whole   = remainder == 0 & moved << missing == quotient;

    wire proper =
        quotient[25] == ~less & (quotient[25] | quotient[24]) &
        quotient <= (less ? 26'h1fffffd : 26'h3fffffc) & (x_normal != y_normal | (quotient == 26'h2000000 & remainder == 0)) &
        (remainder != 0 | (quotient[25] ? quotient[1:0] == 0 : ~quotient[0]));
    assign assumed = ~op & (~finite | (proper & digits_19 == moved[24:0] & (rest_19 == 0) == whole));

    wire        nan = (&exact[30:23]) & (|exact[22:0]);
    assign bad =
        (result != (nan ? 32'h7fc00000 : exact)) | (flags != {invalid, by_zero, overflow}) |
        (finite & (~loaded | (cut_a != {x_normal, 27'd0}) | (cut_b != {y_normal, 2'd0}) | (mod_a != cut_a) | (mod_b != cut_b)));

    // 1 less the exponent field of a quotient in [1, 2).
    wire signed [10:0] right =
        $signed({3'd0, b[30:24], b[23] | ~|b[30:23]}) - $signed({3'd0, a[30:24], a[23] | ~|a[30:23]}) - 126 -
        $signed({6'd0, y_zeros}) + $signed({6'd0, x_zeros});
    assign part = ~finite ? 7'd66 : right >= 32 ? 7'd67 : right >= 0 ? {1'b0, right[4:0], less} : {6'd32, less};

endmodule
