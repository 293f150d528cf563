// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_recurrence's fsqrt for all operands, with the digits cut out. The reference is written out as in root.v. The circuit's digits are
// the root that recurrence_digits.v finds from what the registers hold before the first step, and the rest is 0 if that is all of it.
// Cases: numbers whose exponent is even, odd; what is no positive number.

module miter (
    input         op,
    input  [31:0] a,
    input  [31:0] result,
    input  [2:0]  flags,
    input  [27:1] rest_6,
    input  [25:1] known_6,
    input  [25:0] place_6,
    input  [24:0] digits_6,
    input  [3:0]  wait_digits_6,
    input  [27:1] rest_19,
    input  [24:0] digits_19,    // the root of the normalised radicand, in [1, 2), with 24 bits after the point
    output        bad,
    output        assumed,
    output [1:0]  part
);

    wire        nan    = (&a[30:23]) & (|a[22:0]);
    wire        zero   = a[30:0] == 0;
    wire        number = ~a[31] & ~zero & ~&a[30:23];
    wire [23:0] x      = {|a[30:23], a[22:0]};
    wire [4:0]  zeros;
    leading_zeros of_a (.x(x), .zeros(zeros));
    wire [23:0] x_normal = x << zeros;
    // The radicand's exponent, and half of it, rounded down, as an exponent field.
    wire signed [10:0] exponent = $signed({3'd0, a[30:24], a[23] | ~|a[30:23]}) - $signed({6'd0, zeros}) - 127;
    wire signed [10:0] field    = (exponent >>> 1) + 127;
    wire [23:0] significand = digits_19[24:1] + digits_19[0];

    wire [31:0] exact =
        nan | (a[31] & ~zero) ? 32'h7fc00000 : zero | ~number ? a : {1'b0, field[7:0], significand[22:0]};
    wire        invalid = (nan & ~a[22]) | (a[31] & ~zero & ~nan);

    wire        loaded =
        rest_6 == (exponent[0] ? {2'd0, x_normal, 1'b0} : {3'd0, x_normal}) & known_6 == 0 & (place_6 & 26'h2aaaaaa) == 26'h2000000 &
        digits_6 == 0 & wait_digits_6 == 0;
    assign bad = (result != exact) | (flags != {invalid, 2'b00}) | (number & ~loaded);

    // The root is at most the root of 4 - 2^-22. It is never halfway between two numbers.
    wire proper = digits_19[24] & digits_19 <= 25'h1fffffe & (rest_19 != 0 | ~digits_19[0]);
    assign assumed = op & (~number | proper);
    assign part = number ? {1'b0, exponent[0]} : 2'd2;

endmodule
