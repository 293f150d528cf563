// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_divroot's fsqrt for all operands, with the digits cut out as in divide.v. The reference is written out here: a root is never
// subnormal and never halfway between two numbers (it would have 25 significant bits, its square 49 or 50), so that it is rounded up
// exactly if its 25th bit is 1. Cases: numbers whose exponent is even, odd; what is no positive number.

module miter (
    input  [31:0] a,
    input  [31:0] b,            // does not matter
    input  [24:0] truncated,    // the root of the normalised radicand, in [1, 2), with 24 bits after the point
    input         whole,        // it has no more bits
    input         above,        // it is a unit or more above s; always if it has no more bits
    input  [26:0] residual,
    output        bad,
    output        assumed,
    output [1:0]  part
);

    wire [31:0] result;
    wire [2:0]  flags;
    wire [24:0] s = truncated - above;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op(1'b1), .a(a), .b(b), .result(result), .flags(flags),
        .s_9(s), .last_9(residual), .\second_low.p (36'd0), .\second_high.p (36'd0)
    );

    wire        nan    = (&a[30:23]) & (|a[22:0]);
    wire        zero   = a[30:0] == 0;
    wire        number = ~a[31] & ~zero & ~&a[30:23];
    wire [4:0]  zeros;
    leading_zeros of_a (.x({|a[30:23], a[22:0]}), .zeros(zeros));
    // The radicand's exponent, and half of it, rounded down, as an exponent field.
    wire signed [10:0] exponent = $signed({3'd0, a[30:24], a[23] | ~|a[30:23]}) - $signed({6'd0, zeros}) - 127;
    wire signed [10:0] field    = (exponent >>> 1) + 127;
    wire [23:0] significand = truncated[24:1] + truncated[0];

    wire [31:0] exact =
        nan | (a[31] & ~zero) ? 32'h7fc00000 : zero | ~number ? a : {1'b0, field[7:0], significand[22:0]};
    wire        invalid = (nan & ~a[22]) | (a[31] & ~zero & ~nan);
    assign bad = (result != exact) | (flags != {invalid, 2'b00});

    // The root is at most the root of 4 - 2^-22. (s + 1)^2 is at most twice the root away from the radicand.
    wire proper = truncated[24] & truncated <= 25'h1fffffe & (~whole | (~truncated[0] & above));
    wire sign   = above ? ~residual[26] & ((residual == 0) == whole) : residual[26];
    assign assumed = ~number | (proper & sign);
    assign part = number ? {1'b0, exponent[0]} : 2'd2;

endmodule
